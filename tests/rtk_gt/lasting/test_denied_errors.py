"""The distances of the antennas deny a false fix that the motion seems to show, and no true one."""

from dataclasses import replace

import numpy as np
import pytest
from trials.lasting_errors import Errors, made_drive

from rtk_gt.lasting.jumps_back import by_drive_and_motion
from rtk_gt.lasting.lasting_error import LastingError, denied_level, together
from rtk_gt.offsets.estimate import estimate_offsets

LEVEL, UP = np.array([0.045, -0.066, 0.0]), np.array([0.0, 0.0, 0.15])
FROM, SECONDS = 150.0, 20.0


def false_fix(made, size):
    """Of one receiver, for some seconds, as motion tells it: to a centimetre."""
    start = made.steps.times[0] + FROM
    return LastingError(
        (1,), start, start + SECONDS, size, 1e-4 * np.eye(3), 90.0, 100, 0.2, told_by_motion=True
    )


def is_denied(made, error):
    offsets = estimate_offsets(made.steps, bent="never")
    placed = made.steps.corrected(offsets.offsets)
    told = by_drive_and_motion(placed.times, placed.positions, offsets, error)
    return denied_level(error, replace(error, size=told[0], covariance=told[1]))


@pytest.mark.parametrize("errors", [Errors(0.004), Errors(0.003, 0.010, 30.0)])
@pytest.mark.parametrize("seed", range(6))
def test_only_a_level_false_fix_that_was_none_is_denied(errors, seed):
    made = made_drive(seed, errors, seconds=400.0)
    times = made.steps.times - made.steps.times[0]
    rows = np.flatnonzero((times >= FROM) & (times < FROM + SECONDS))
    if not errors.slow:
        assert is_denied(made, false_fix(made, LEVEL))
    for size in (LEVEL, UP):
        assert not is_denied(made.jumped([1], rows, size), false_fix(made, size))
    # What is up changes the distances too little to tell.
    assert not is_denied(made, false_fix(made, UP))


def test_errors_last_together_where_both_go_again():
    made = made_drive(1, Errors(0.004), seconds=30.0)
    one = false_fix(made, LEVEL)
    assert together(one, replace(one, start=one.start + 5, end=one.end + 5))
    assert not together(one, replace(one, start=one.end, end=one.end + 5))
    assert not together(one, replace(one, end=np.inf))
