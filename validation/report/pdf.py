"""The report as PDF, printed from its HTML by WeasyPrint (extra ``pdf``)."""

from validation.errors import GtvalError


def pdf_report(html: str) -> bytes:
    """The pages of a report that is self-contained HTML.

    Parameters
    ----------
    html : str
        As `validation.report.html.html_report` gives it.

    Raises
    ------
    GtvalError
        If WeasyPrint, or a library that it needs, is not installed.
    """
    try:
        from weasyprint import HTML  # noqa: PLC0415  (an optional extra)
    except (ImportError, OSError) as error:
        raise GtvalError(
            "a PDF needs WeasyPrint: pip install 'gtval[pdf]' (and the Pango library of your "
            f"system); or print report.html from a browser. It said: {error}"
        ) from error
    return bytes(HTML(string=html).write_pdf())
