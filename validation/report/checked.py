"""Parts of the report that may fail, tried one by one: a broken part leaves a sentence behind."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

from validation.report.cells import rows_of_text
from validation.report.kept_figures import svg_of
from validation.report.svg import DrawnFigure
from validation.results import Figure, Section, SystemResult, Table, Text
from validation.solving import unexpected

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
