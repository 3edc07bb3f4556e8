import importlib.util
import sys

import pytest

from validation.errors import GtvalError
from validation.report.pdf import pdf_report

PAGE = "<!doctype html><html lang=en><title>t</title><h1>Errors</h1><p>0.0804 m</p></html>"


def test_without_weasyprint_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(GtvalError, match=r"gtval\[pdf\]"):
        pdf_report(PAGE)


@pytest.mark.skipif(
    importlib.util.find_spec("weasyprint") is None, reason="the extra 'pdf' is not installed"
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of WeasyPrint's own dependencies
def test_a_page_becomes_a_pdf():
    try:
        made = pdf_report(PAGE)
    except GtvalError as error:
        pytest.skip(str(error))
    assert made.startswith(b"%PDF-")
    assert made.rstrip().endswith(b"%%EOF")
