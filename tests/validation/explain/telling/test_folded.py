"""A cause that a system names itself is one line, and nothing else is claimed of its errors."""

import pytest

from validation.explain.telling.folded import folded
from validation.results import SPOILT, Finding, Size

CAUSE = Finding(
    "error", "Squares are 3 % smaller. Measure them.", "bar", "print_size", (Size(SPOILT, 6.0),)
)
BIAS = Finding("warning", "There is a bias in x.", "vision", "bias")
MOUNT = Finding("warning", "Explained by a wrong mount.", "vision", "systematic_error")
DEGREES = Finding("warning", "Headings seem to be degrees.", "vision", "perhaps_degrees")
OTHER = Finding("warning", "There is a bias in x.", "laser", "bias")


def test_what_may_come_of_a_cause_is_one_line():
    told = folded([CAUSE, BIAS, MOUNT, DEGREES, OTHER], {"vision": [CAUSE], "laser": []}, None)
    assert told[:3] == [CAUSE, DEGREES, OTHER]
    [line] = told[3:]
    assert (line.severity, line.subject, line.code) == ("note", "vision", "spoilt_by_cause")
    assert line.text.startswith("2 findings of the comparison")
    assert "Squares are 3 % smaller." in line.text
    assert "bias, systematic_error" in line.text


@pytest.mark.parametrize(
    "cause",
    [
        Finding("warning", CAUSE.text, "bar", "print_size", CAUSE.sizes),
        Finding("error", CAUSE.text, "bar", "print_size"),
    ],
)
def test_without_an_error_that_spoils_poses_all_is_told(cause):
    findings = [cause, BIAS, MOUNT]
    assert folded(findings, {"vision": [cause]}, None) == findings
