"""Boards in many images of which some say that another board was stated than there is."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from vision_gt.images.charuco import not_at
from vision_gt.images.jobs import BOARD_IS, BoardJob, Found
from vision_gt.images.kept import KeptDetections, detect_new
from vision_gt.images.other_boards import named_for_all, stated_wrongly

_FIRST = 4
"""Images of each board that are looked at before the others. A judgement: a search for anything
takes some seconds an image."""
_ENOUGH = 2
"""Of these, that say the same, none showing the stated board: a judgement."""


def boards_in(
    jobs: Sequence[BoardJob],
    kept: KeptDetections,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> list[Found]:
    """What images show, in the order of the jobs; a board stated wrongly has one name for all.

    Where the first images of a board agree that it is another one, that one alone is looked for in
    the others.

    Parameters
    ----------
    jobs, kept, workers, progress
        As for `detect_new`.
    """
    alike: dict[object, list[int]] = defaultdict(list)
    for number, job in enumerate(jobs):
        alike[tuple(job.boards)].append(number)
    first = [i for some in alike.values() for i in some[:_FIRST]]
    found = dict(zip(first, detect_new([jobs[i] for i in first], kept, workers), strict=True))
    hinted = list(jobs)
    for some in alike.values():
        name = _agreed([found[i] for i in some if i in found])
        for i in some if name else ():
            hinted[i] = replace(jobs[i], perhaps=name)
            if i in found and not found[i].note and not found[i].boards:
                del found[i]  # it is looked at again, for that board
    rest = [i for i in range(len(jobs)) if i not in found]
    found |= zip(rest, detect_new([hinted[i] for i in rest], kept, workers, progress), strict=True)
    for some in alike.values():
        for i, one in _renamed([(i, found[i]) for i in some]):
            found[i] = one
        for i, one in _with_other_ids(jobs[some[0]], [(i, found[i]) for i in some]):
            found[i] = one
    return [found[i] for i in range(len(jobs))]


def _wrong(found: Sequence[Found]) -> list[str]:
    """What images say that the board is which was stated wrongly."""
    names = [one.note.removeprefix(BOARD_IS) for one in found if one.note.startswith(BOARD_IS)]
    return [name for name in names if stated_wrongly(name)]


def _agreed(found: Sequence[Found]) -> str:
    """What the first images agree on; '' where one shows the stated board."""
    names = _wrong(found)
    name = named_for_all(names)
    kind = name.partition("_")[0]
    same = [one for one in names if one.partition("_")[0] == kind]
    shown = any(one.boards for one in found)
    return "" if shown or len(same) < _ENOUGH else name


def _renamed(found: Sequence[tuple[int, Found]]) -> Iterator[tuple[int, Found]]:
    """Images of one board, by one name where several are names of families with the same codes."""
    name = named_for_all(_wrong([one for _, one in found]))
    kind = name.partition("_")[0]
    for number, one in found:
        if name and one.note.startswith(f"{BOARD_IS}{kind}_"):
            yield number, replace(one, note=f"{BOARD_IS}{name}")


def _with_other_ids(
    job: BoardJob, found: Sequence[tuple[int, Found]]
) -> Iterator[tuple[int, Found]]:
    """Images of a board whose ids begin elsewhere, which some show too little of to tell it."""
    for part, board in job.boards:
        said = [one.note for _, one in found if f"{not_at(board)};" in one.note]
        if len(said) < _ENOUGH:
            continue
        note = max(said, key=said.count)
        for number, one in found:
            others = tuple(view for view in one.boards if view.part != part)
            if len(others) < len(one.boards) or one.note in said:
                yield number, replace(one, boards=others, note=note)
