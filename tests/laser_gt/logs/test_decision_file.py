"""Decisions about pairs, written and read back."""

import numpy as np
import pytest

from laser_gt.logs.decision_file import append_decision, read_decisions
from laser_gt.logs.decisions import Decision
from validation.errors import InputError

STOPS = ("1", "2", "3")


def test_what_is_appended_is_read_back(tmp_path):
    path = tmp_path / "laser" / "decisions.csv"
    guess = np.array([0.5, -0.25, 1.5])
    append_decision(
        path, Decision("1", "2", "guess", guess, "me", 'a "bin", moved\nhere'), STOPS, ""
    )
    append_decision(path, Decision("2", "3", "reject"), STOPS, "2024-03-04T10:00")
    found = read_decisions(path, STOPS)
    assert np.array_equal(found["1", "2"].guess, guess)
    assert (found["1", "2"].by, found["1", "2"].note) == ("me", 'a "bin", moved here')
    assert found["3", "2"].kind == "reject"


def test_a_last_line_without_an_end_is_ended_first(tmp_path):
    path = tmp_path / "decisions.csv"
    path.write_text("time,reference,moving,decision,x,y,theta,by,note\n,1,2,accept,,,,,")
    append_decision(path, Decision("1", "3", "accept"), STOPS, "")
    assert {pair for pair in read_decisions(path, STOPS) if pair[0] == "1"} == {
        ("1", "2"),
        ("1", "3"),
    }


def test_a_pose_beside_another_word_than_guess_is_not_dropped(tmp_path):
    path = tmp_path / "decisions.csv"
    path.write_text("reference,moving,decision,x,y,theta\n1,2,accept,0.5,0.1,0.2\n")
    with pytest.raises(InputError, match=r"line 2, field 'x'.*only a guess has x, y and theta"):
        read_decisions(path, STOPS)
    with pytest.raises(InputError, match="only a guess"):
        append_decision(path, Decision("1", "2", "reject", np.zeros(3)), STOPS, "")
