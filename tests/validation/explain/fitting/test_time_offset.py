"""Intervals of a time offset hold the truth where the way between poses is not known."""

import numpy as np
from explain_campaigns import table
from scipy.interpolate import CubicSpline

from validation.explain.analysis import Question, explain
from validation.poses.angles import wrap

N, SIGMA, DRIVES = 20, np.array([0.01, 0.01, 0.005]), 16


def drive(rng):
    """A random smooth curve, and its poses as a function of time from 0 to N - 1."""
    knots = np.linspace(-2, N + 1, 10)
    curve = CubicSpline(knots, rng.uniform(0, 1, (10, 2)) * [6, 9])

    def poses(t):
        ahead = curve(t, 1)
        return np.column_stack([curve(t), np.arctan2(ahead[:, 1], ahead[:, 0])])

    return poses


def test_intervals_of_a_late_system_hold_its_delay_along_curves():
    held = named = 0
    for seed in range(DRIVES):
        rng = np.random.default_rng(seed)
        poses, late = drive(rng), 0.15
        t = np.arange(N, dtype=float)
        survey, rig = (poses(at) + rng.normal(size=(N, 3)) * SIGMA for at in (t, t - late))
        for one in (survey, rig):
            one[:, 2] = wrap(one[:, 2])
        given = [table(name, one, SIGMA) for name, one in (("survey", survey), ("rig", rig))]
        times = dict(zip(given[0].ids, t.tolist(), strict=True))
        system = explain(given[0], given[1:], Question(times=times)).systems[0]
        named += system.name == "time"
        (offset,) = [p for p in system.settled.parameters() if p.name == "time"] or [None]
        held += offset is not None and offset.low <= late <= offset.high
    assert named >= 0.9 * DRIVES
    # Of 16 intervals of 95 %, 13 hold the truth with a chance of 99.3 %.
    assert held >= 13
