"""A command that is to end ends, whatever its parts and their libraries make of that."""

import os
import signal

import pytest

from validation.report.checked import section_or_sentence
from validation.results import Section
from validation.solving import unexpected
from validation.stopping import STOPS, ended_as_interrupted, go_on_after


def interrupted_in_a_library(which):
    """Code that meets the interrupt, and ends in an error of its own."""
    try:
        os.kill(os.getpid(), which)
        signal.pause()
    except KeyboardInterrupt:
        raise SystemError("returned a result with an exception set") from None


@pytest.mark.parametrize("which", STOPS)
def test_an_error_that_an_interrupt_became_is_no_failure_of_a_part(which):
    failures = []
    before = [signal.getsignal(one) for one in STOPS]
    with ended_as_interrupted(), pytest.raises(KeyboardInterrupt):
        section_or_sentence("what failed", lambda: interrupted_in_a_library(which), failures)
    assert failures == []
    assert [signal.getsignal(one) for one in STOPS] == before


def test_without_one_a_failure_is_a_finding():
    def fails() -> Section:
        raise SystemError("as before")

    failures = []
    with ended_as_interrupted():
        section_or_sentence("what failed", fails, failures)
        go_on_after(SystemError())
    assert [one.findings[0].code for one in failures] == ["unexpected"]
    assert unexpected("laser", SystemError("as before")).findings[0].severity == "error"
