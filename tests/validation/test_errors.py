"""Errors that a person can act on."""

import pytest

from validation.errors import MAX_SHOWN_PROBLEMS, InputError, Problem


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
