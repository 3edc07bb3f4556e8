"""Parts of the report made one by one: a broken one leaves a sentence behind, a figure is kept."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from importlib.metadata import version

from validation.pieces.store import FOLDER, KeptPieces, key_of
from validation.report.cells import rows_of_text
from validation.report.svg import DrawnFigure, drawn_svg
from validation.results import Figure, Section, SystemResult, Table, Text
from validation.run import RunResult
from validation.solving import unexpected
from validation.step_keys import keys_of_steps

Failures = list[SystemResult]
MOST_ROWS = 3000
"""Rows of a table of a report. A judgement: a hall of 2,000 stops has all its poses there, nobody
reads more, and each thousand rows take a quarter of a megabyte."""


def section_or_sentence(title: str, make: Callable[[], Section], failures: Failures) -> Section:
    """A section with all its parts made, figures drawn; what fails is said in its place.

    Parameters
    ----------
    title : str
        Of the section, also where it cannot be made.
    make : callable
        Returns the section.
    failures : list of SystemResult
        What stands in for each failure is added.
    """
    try:
        section = make()
        blocks = [_checked(section.title, block, failures) for block in section.blocks]
        return replace(section, blocks=blocks)
    except Exception as error:  # noqa: BLE001  (one section must not take the report)
        return Section(title, [_failed(f"report: {title}", error, failures)])


def checked_sections(sections: Iterable[Section], failures: Failures) -> list[Section]:
    """Sections of systems, each with what fails said in its place."""
    return [section_or_sentence(one.title, partial(replace, one), failures) for one in sections]


def _checked(title: str, block: Table | Figure | Text, failures: Failures) -> Table | Figure | Text:
    """The block, drawn if it is a figure, or the sentence that it failed."""
    name = getattr(block, "name", None) or getattr(block, "title", "text")
    try:
        if isinstance(block, Figure):
            return DrawnFigure(**vars(block), svg=svg_of(title, block))
        if not isinstance(block, Text):
            block = _shortened(block)
            rows_of_text(block)
    except Exception as error:  # noqa: BLE001  (one figure must not take the report)
        return _failed(f"report: {title}: {name}", error, failures)
    return block


def _shortened(table: Table) -> Table:
    """The table with the first of its rows, where there are too many for a page."""
    if len(table.rows) <= MOST_ROWS:
        return table
    left = f"The first {MOST_ROWS} of {len(table.rows)} rows; all are in the files under results/."
    return replace(table, rows=table.rows[:MOST_ROWS], note=f"{table.note} {left}".strip())


def _failed(part: str, error: Exception, failures: Failures) -> Text:
    """The sentence that stands in for a part."""
    failures.append(unexpected(part, error))
    return Text(f"This part of the report could not be made: {failures[-1].findings[0].text}")


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
        self._of: dict[int, str] = {}
        for solved in run.systems:
            with suppress(TypeError, AttributeError):  # a plug-in's own fault, told where it shows
                for section in solved.result.sections:
                    own = keys.get(solved.name, self._whole)
                    self._of |= {id(block): own for block in section.blocks}
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
