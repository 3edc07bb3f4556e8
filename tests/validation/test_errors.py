"""Errors that a person can act on."""

import pytest

from validation.errors import MAX_SHOWN_PROBLEMS, GtvalError, InputError, Problem


@pytest.mark.parametrize(
    ("problem", "text"),
    [
        (Problem("a.csv", "is empty"), "a.csv: is empty"),
        (Problem("a.csv", "bad", 3), "a.csv, line 3: bad"),
        (Problem("a.csv", "bad", 3, "x", "?"), "a.csv, line 3, field 'x': '?' — bad"),
        (Problem("a.csv", "bad", value="\x1b[31m\udce9"), r"a.csv: '\x1b[31m\udce9' — bad"),
        (Problem("a.csv", "bad", value="9" * 100), f"a.csv: '{'9' * 59}…' — bad"),
    ],
)
def test_a_problem_names_file_line_field_and_value(problem, text):
    assert str(problem) == text


def test_an_error_lists_the_first_problems_and_counts_the_rest():
    problems = [Problem("a.csv", f"bad {line}", line) for line in range(1, 101)]
    lines = str(InputError(problems)).splitlines()
    assert len(lines) == MAX_SHOWN_PROBLEMS + 1
    assert lines[-1] == f"… and {100 - MAX_SHOWN_PROBLEMS} more."
    assert InputError(problems).problems == tuple(problems)


def test_one_cause_in_many_lines_is_one_line():
    wrong = [Problem("a.csv", "not in degrees", line, "x", f"{line}") for line in range(1, 101)]
    other = Problem("a.csv", "is empty", 50, "y")
    first, second = str(InputError([*wrong[:60], other, *wrong[60:]])).splitlines()
    assert first.startswith("a.csv, line 1, field 'x': '1' — not in degrees; so in lines 2, 3, ")
    assert first.endswith(", 15 and 85 more")
    assert second == str(other)
    # a few have a line each: they may be typing errors
    assert len(str(InputError(wrong[:5])).splitlines()) == 5


def test_what_a_file_puts_into_an_error_controls_no_terminal():
    lost = Problem("a.nmea", "cut", 3, "sentence", "0091" + "\0" * 4096 + "9")
    assert str(lost) == r"a.nmea, line 3, field 'sentence': '0091\x00…9' — cut"
    said = str(GtvalError("the file \x1b[2J\u202ebad\r\n\tsays ½ m"))
    assert said == "the file \\x1b[2J\\u202ebad\\r\n\tsays ½ m"
    assert str(InputError([Problem("a\x1b.csv", "is empty")])) == r"a\x1b.csv: is empty"
