"""The report as one HTML file that needs nothing else: no network, no script, no other file."""

from collections.abc import Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from validation.report.cells import is_number_column, rows_of_text
from validation.report.document import SHORT, Document
from validation.report.layout import tied
from validation.report.summary.to_do import FINDINGS
from validation.report.svg import inline_svg
from validation.report.terminal import SEVERITIES
from validation.results import Figure, Finding, Table, Text, sentences

LONG = 8
"""Rows of a table beyond which it is closed until it is opened. A judgement: closed are three
systems with three components each; the first page sums them up."""


def html_report(document: Document) -> str:
    """The report as HTML. All text is escaped; only the figures' SVG goes in as it is."""
    sections = [
        {
            "id": f"section-{number}",
            "title": section.title,
            "first": section is document.overview,
            "folded": section.folded,
            "short": section.title == SHORT,
            "blocks": _blocks(section.blocks, f"s{number}", document.tables_in),
            "tables_in": document.tables_in,
        }
        for number, section in enumerate(document.sections, 1)
    ]
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            document=document,
            sections=sections,
            groups=_groups(document.findings),
            to_do=listed_items(document),
        )
    )


def listed_items(document: Document) -> list[dict[str, str]]:
    """The lines of the list of what to do, each with the place of its evidence in the page."""
    places = {one.title: f"section-{number}" for number, one in enumerate(document.sections, 1)}
    places[FINDINGS] = "findings"
    return [
        {
            "subject": one.subject,
            "text": one.text,
            "to": places.get(one.evidence, "findings"),
            "name": one.evidence if one.evidence in places else FINDINGS,
        }
        for one in document.to_do
    ]


def html_blocks(blocks: Sequence[Table | Figure | Text], name: str) -> str:
    """Tables, figures and paragraphs as the report sets them, for another page.

    Parameters
    ----------
    blocks : sequence of Table, Figure or Text
        In their order.
    name : str
        Begins the ids of this page's elements.
    """
    template = _environment().get_template("blocks.html.j2")
    return str(template.module.set_blocks(_blocks(blocks, name)))  # type: ignore[attr-defined]


def _environment() -> Environment:
    """Where the templates are, and that all text is escaped."""
    environment = Environment(
        loader=PackageLoader("validation.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["tied"] = tied
    environment.filters["sentences"] = sentences
    return environment


def _blocks(
    blocks: Sequence[Table | Figure | Text], name: str, tables_in: str = "tables.md"
) -> list[dict[str, Any]]:
    """What the templates need of several blocks."""
    return [
        {**_block(block, f"{name}b{place}"), "tables_in": tables_in}
        for place, block in enumerate(blocks)
    ]


def _groups(findings: Sequence[Finding]) -> dict[str, Any]:
    """The findings that ask for action, and the others to be unfolded."""
    by_severity = {
        severity: [finding for finding in findings if finding.severity == severity]
        for severity in SEVERITIES
    }
    folded = [("Notes", by_severity["note"]), ("As it should be", by_severity["good"])]
    return {
        "urgent": by_severity["error"] + by_severity["warning"],
        "folded": [(name, some) for name, some in folded if some],
    }


def _block(block: Table | Figure | Text, identifier: str) -> dict[str, Any]:
    """What the template needs of a block."""
    if isinstance(block, Text):
        return {"kind": "text", "text": block.text}
    if isinstance(block, Figure):
        # The SVG is made by us from escaped text; everything else is escaped by the template.
        svg = Markup(inline_svg(block, identifier))  # noqa: S704
        return {
            "kind": "figure",
            "id": identifier,
            "caption": block.caption,
            "svg": svg,
            "folded": block.folded,
        }
    return {
        "kind": "table",
        "id": identifier,
        "table": block,
        "folded": block.folded or len(block.rows) > LONG,
        "rows": rows_of_text(block),
        "right": _right(block),
    }


def _right(table: Table) -> Sequence[bool]:
    """Which columns hold numbers."""
    return [is_number_column(table.rows, column) for column in range(len(table.columns))]
