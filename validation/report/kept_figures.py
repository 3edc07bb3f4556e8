"""Figures of a report, drawn once: what shows the same data is taken over from the last report."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.metadata import version

from validation.pieces.store import FOLDER, KeptPieces, key_of
from validation.report.svg import drawn_svg
from validation.results import Figure
from validation.run import RunResult
from validation.step_keys import keys_of_steps


class Shelf:
    """The figures of a run and of the report before it.

    Parameters
    ----------
    run : RunResult
        What is reported.
    """

    def __init__(self, run: RunResult) -> None:
        keys = keys_of_steps(run)
        self._whole = keys[""]
        self._of = {
            id(block): keys.get(solved.name, self._whole)
            for solved in run.systems
            for section in solved.result.sections
            for block in section.blocks
        }
        path = run.campaign.folder / FOLDER / "report_figures.jsonl"
        self._kept = KeptPieces(path, "figures")
        self._used: list[str] = []

    def svg(self, title: str, figure: Figure) -> str:
        """The figure of a section as `drawn_svg` gives it."""
        told = (version("matplotlib"), self._of.get(id(figure), self._whole), title, figure.name)
        key = key_of(*(one.encode() for one in told))
        known = self._kept.get(key)
        self._used.append(key)
        if known is not None and isinstance(known.get("svg"), str):
            self._kept.count(taken=1)
            return str(known["svg"])
        drawn = drawn_svg(figure)
        self._kept.add(key, {"svg": drawn})
        self._kept.count(done=1)
        return drawn

    def close(self) -> None:
        """Forget the figures that this report does not have."""
        self._kept.forget_others(self._used)


_shelf: ContextVar[Shelf | None] = ContextVar("shelf", default=None)


@contextmanager
def figures_kept(run: RunResult) -> Iterator[None]:
    """Take figures from the last report, and keep new ones, as soon as each is drawn."""
    shelf = Shelf(run)
    token = _shelf.set(shelf)
    try:
        yield
        shelf.close()
    finally:
        _shelf.reset(token)


def svg_of(title: str, figure: Figure) -> str:
    """A figure of a section, kept or drawn."""
    shelf = _shelf.get()
    return drawn_svg(figure) if shelf is None else shelf.svg(title, figure)
