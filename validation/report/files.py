"""The files of report/, made from a run."""

from validation.pieces.processes import give_back_memory
from validation.report.checked import figures_kept
from validation.report.document import build_document
from validation.report.html import html_report, listed_items
from validation.report.latex import latex_paper, latex_report
from validation.report.markdown import markdown_paper, markdown_report
from validation.report.pdf import pdf_report
from validation.run import RunResult
from validation.text_files.json_text import json_text
from validation.text_files.writing import Content

REPORT, TO_DO = "report.html", "to_do.json"


def report_files(run: RunResult, *, pdf: bool = False) -> tuple[RunResult, dict[str, Content]]:
    """report.html, its list of what to do, tables, and report.pdf if wanted, relative to report/.

    Parameters
    ----------
    run : RunResult
        What is reported.
    pdf : bool
        Whether to make a PDF too.

    Returns
    -------
    run : RunResult
        The run with what stands in for parts of the report that could not be made.
    files : dict of str to str or bytes
        By their names.

    Raises
    ------
    GtvalError
        If a PDF is wanted and cannot be made.
    """
    with figures_kept(run):
        document = build_document(run)
    page = html_report(document)
    give_back_memory()  # figures
    files: dict[str, Content] = {
        REPORT: page,
        "tables.md": markdown_report(document),
        "tables.tex": latex_report(document),
        TO_DO: json_text({"to_do": listed_items(document)}),
    }
    if document.paper:
        files["tables_paper.md"] = markdown_paper(document)
        files["tables_paper.tex"] = latex_paper(document)
    if pdf:
        files["report.pdf"] = pdf_report(page)
    return run.with_failures(document.failures), files
