"""The files of report/, made from a run."""

from validation.report.document import build_document
from validation.report.html import html_report
from validation.report.latex import latex_report
from validation.report.markdown import markdown_report
from validation.report.pdf import pdf_report
from validation.run import RunResult

REPORT = "report.html"


def report_files(run: RunResult, *, pdf: bool = False) -> dict[str, str | bytes]:
    """report.html, tables.md, tables.tex and report.pdf if wanted, relative to report/.

    Raises
    ------
    GtvalError
        If a PDF is wanted and cannot be made.
    """
    document = build_document(run)
    page = html_report(document)
    files: dict[str, str | bytes] = {
        REPORT: page,
        "tables.md": markdown_report(document),
        "tables.tex": latex_report(document),
    }
    if pdf:
        files["report.pdf"] = pdf_report(page)
    return files
