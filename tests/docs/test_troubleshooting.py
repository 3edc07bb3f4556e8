"""Every code of a finding is explained, and no code is explained that no finding has."""

import re

import pytest
from blocks import REPOSITORY
from finding_codes import UnreadableCodeError, _codes_of, finding_codes

PAGE = REPOSITORY / "docs" / "troubleshooting.md"


def explained() -> list[str]:
    """Codes in the headings of the page."""
    headings = re.findall(r"^### (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return [code for heading in headings for code in re.findall(r"`([^`]+)`", heading)]


def test_every_code_is_explained_once():
    assert sorted(explained()) == sorted(finding_codes(REPOSITORY))


@pytest.mark.parametrize(
    ("source", "codes"),
    [
        ('Finding("note", "t", "s", "one")', {"one"}),
        ('Finding("note", "t", code="one" if a else "two")', {"one", "two"}),
        (
            'def f(code):\n    Finding("note", "t", "s", code)\nf("one")\nf(code="two")',
            {"one", "two"},
        ),
        ('def f():\n    a, code = "good", "one"\n    Finding(a, "t", "s", code)', {"one"}),
        ('Finding("note", "t", "s", {"a": "one"}.get(b, "two"))', {"one", "two"}),
        ('Finding("note", "t")', set()),
    ],
)
def test_codes_are_found_however_they_are_written(source, codes):
    import ast

    assert set(_codes_of(ast.parse(source), "here")) == codes


def test_a_code_that_cannot_be_read_is_refused():
    import ast

    with pytest.raises(UnreadableCodeError):
        list(_codes_of(ast.parse('Finding("note", "t", "s", codes[0])'), "here"))
