"""Tables and findings as text, whatever is in them."""

import io

import pytest
from rich.console import Console

from validation.report.cells import cell_text, is_number_column, rows_of_text
from validation.report.terminal import most_severe_first, print_findings, print_table
from validation.results import Finding, Table


def printed(show, what) -> str:
    stream = io.StringIO()
    show(what, Console(file=stream, width=120, highlight=False))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("value", "number_format", "text"),
    [
        (1.23456, ".4f", "1.2346"),
        (-0.00001, ".4f", "0.0000"),
        (-0.5, ".1f", "-0.5"),
        (-0.0, "", "0.0"),
        (3, "d", "3"),
        (None, ".4f", "–"),
        (float("nan"), ".4f", "–"),
        ("17'", ".4f", "17'"),
        (float("inf"), ".4f", "inf"),
        (-1e-9, ".1e", "-1.0e-09"),
    ],
)
def test_a_cell_is_written_the_same_everywhere(value, number_format, text):
    assert cell_text(value, number_format) == text


def test_columns_of_numbers_are_told_from_columns_of_text():
    rows = [["7", 1.0, None], ["8", None, None]]
    assert [is_number_column(rows, column) for column in range(3)] == [False, True, False]


def test_missing_formats_leave_numbers_as_they_are():
    assert rows_of_text(Table("t", ["a", "b"], [[1.5, 2]])) == [["1.5", "2"]]
    assert rows_of_text(Table("t", ["a", "b"], [[1.5, 2]], [".3f", ""])) == [["1.500", "2"]]


@pytest.mark.parametrize(("rows", "formats"), [([[1.5]], []), ([[1.5, 2]], [".3f"])])
def test_a_table_whose_rows_or_formats_do_not_fit_its_columns_is_a_bug(rows, formats):
    with pytest.raises(ValueError, match="table 't': 2 columns"):
        Table("t", ["a", "b"], rows, formats)


def test_nothing_in_a_table_is_taken_as_markup():
    table = Table("[red]title", ["x [m]"], [["[bold]1[/bold]"]], note="[link=x]note")
    text = printed(print_table, table)
    for piece in ("[red]title", "x [m]", "[bold]1[/bold]", "[link=x]note"):
        assert piece in text


def test_findings_come_the_most_severe_first_and_else_in_their_order():
    findings = [
        Finding("good", "g"),
        Finding("warning", "w1"),
        Finding("error", "e"),
        Finding("warning", "w2"),
    ]
    assert [one.text for one in most_severe_first(findings)] == ["e", "w1", "w2", "g"]
    text = printed(print_findings, [*findings, Finding("note", "[n]", "pose [7]")])
    assert "pose [7]" in text
    assert text.index("error") < text.index("warning") < text.index("note") < text.index("good")


def test_no_finding_prints_nothing():
    assert printed(print_findings, []) == ""
