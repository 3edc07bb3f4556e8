"""Tables and findings as Markdown (the pipe tables of GitHub and pandoc)."""

import re
from collections.abc import Sequence

from validation.report.cells import is_number_column, rows_of_text
from validation.report.document import Document
from validation.results import Finding, Table

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~$])")


def markdown_report(document: Document) -> str:
    """Title, findings and all tables as Markdown."""
    lines = [f"# {escaped(document.title)}", ""]
    if document.alarm:
        lines += [f"**{escaped(document.alarm)}**", ""]
    if document.to_do:
        lines += ["## To do", ""]
        lines += [f"- [ ] {escaped(f'{one.subject}: {one.text}')}" for one in document.to_do]
        lines.append("")
    lines += ["## Findings", ""]
    lines += [_finding(finding) for finding in document.findings] or ["None."]
    tables = [markdown_table(table) for table in document.tables]
    return "\n".join(lines) + "\n\n" + "\n".join(tables)


def markdown_paper(document: Document) -> str:
    """The two narrow tables for a paper."""
    return "\n".join(markdown_table(table) for table in document.paper)


def markdown_table(table: Table) -> str:
    """The table with its title above and its note below."""
    columns = range(len(table.columns))
    right = [is_number_column(table.rows, column) for column in columns]
    lines = [f"**{escaped(table.title)}**", ""]
    lines.append(_row(table.columns))
    lines.append("|" + "|".join("---:" if number else "---" for number in right) + "|")
    lines += [_row(cells) for cells in rows_of_text(table)]
    if table.note:
        lines += ["", escaped(table.note)]
    return "\n".join(lines) + "\n"


def _finding(finding: Finding) -> str:
    text = f"{finding.subject}: {finding.text}" if finding.subject else finding.text
    code = f" `{finding.code}`" if finding.code else ""
    return f"- **{finding.severity}** {escaped(text)}{code}"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(escaped(cell) for cell in cells) + " |"


def escaped(text: str) -> str:
    """The text on one line, with nothing in it taken as Markdown."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))
