"""The files of report/, made from a run."""

from validation.report.document import build_document
from validation.report.html import html_report
from validation.report.latex import latex_report
from validation.report.markdown import markdown_report
from validation.run import RunResult

REPORT = "report.html"


def report_files(run: RunResult) -> dict[str, str | bytes]:
    """report.html, tables.md and tables.tex, by their names relative to report/."""
    document = build_document(run)
    return {
        REPORT: html_report(document),
        "tables.md": markdown_report(document),
        "tables.tex": latex_report(document),
    }
