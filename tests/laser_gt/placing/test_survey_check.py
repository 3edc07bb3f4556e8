"""Surveyed poses that contradict the scans: what is wrong is named, and chance is not."""

import numpy as np
import pytest
from scipy.stats import chi2

from laser_gt.placing.survey_check import Shape, doubt_sizes, doubt_text, survey_doubt, with_mount
from laser_gt.scans.planar import compose, inverse
from validation.poses.factored import Factored

SURVEY, SCANS, MOUNT = (0.004, 0.004, 0.003), (0.002, 0.002, 0.0005), (0.001, 0.001, 0.001)

STATED = np.array([0.2, 0.1, 0.3])


def alone(sigmas, stops):
    """Covariance of stops that are independent of each other."""
    return Factored.alone(np.tile(np.diag(sigmas) ** 2, (stops, 1, 1)))


def doubt_of(rng, stops, fault):
    """The doubt of stops surveyed and scanned with noise, in frames of their own; the true size."""
    true = np.column_stack([rng.uniform(0, 8, (stops, 2)), rng.uniform(-3, 3, stops)])
    surveyed = true + rng.standard_normal(true.shape) * SURVEY
    mount = rng.standard_normal(3) * MOUNT
    if fault == "mount":
        mount += [0.04, 0.02, 0.02]
    if fault == "stop":
        surveyed[1] += [0.06, -0.06, 0.0]
    if fault == "exchanged":
        surveyed[[0, 2]] = surveyed[[2, 0]]
    laser = compose(true, STATED + mount)
    seen = compose(laser, inverse(STATED)) + rng.standard_normal(true.shape) * SCANS
    seen = compose(np.array([3.0, 1.0, 0.7]), seen)
    shape = Shape(seen, alone(SCANS, stops), STATED, np.diag(MOUNT) ** 2)
    names = [str(row) for row in range(stops)]
    doubt = survey_doubt(names, shape, surveyed, alone(SURVEY, stops))
    return doubt, -mount if fault == "mount" else np.array([0.06, -0.06, 0.0])


@pytest.mark.parametrize("stops", [2, 3, 10])
def test_chance_is_accused_of_nothing(stops):
    rng = np.random.default_rng(stops)
    assert [doubt_of(rng, stops, "")[0] for _ in range(200)] == 200 * [None]


@pytest.mark.parametrize(
    ("fault", "named"), [("stop", ("1",)), ("exchanged", ("0", "2")), ("mount", ())]
)
@pytest.mark.parametrize("stops", [5, pytest.param(10, marks=pytest.mark.full)])
def test_one_cause_is_named_with_its_size(stops, fault, named):
    rng = np.random.default_rng(stops)
    found = [doubt_of(rng, stops, fault) for _ in range(40)]
    right = [(one, size) for one, size in found if (one.kind, one.stops) == (fault, named)]
    # 15 standard deviations: what is asked of all causes is 95 %.
    assert len(right) >= 38
    assert all(one.explained for one, _ in right)
    if fault != "exchanged":
        off = np.array([(one.size - true) / one.sigmas for one, true in right])
        # Three numbers each; 99.9 % of right covariances are within.
        low, high = chi2.ppf([5e-4, 1 - 5e-4], off.size) / off.size
        assert low < np.square(off).mean() < high


def test_two_stops_do_not_say_which():
    doubt, _ = doubt_of(np.random.default_rng(1), 2, "stop")
    assert doubt.kind == "open"
    assert {kind for kind, _ in doubt.likely} >= {"stop", "mount"}
    assert "these stops do not say" in doubt_text(doubt, "to the stops")
    assert len(doubt_sizes(doubt)) == 1


def test_a_bent_shape_makes_the_mount_one_of_the_causes():
    doubt = with_mount(doubt_of(np.random.default_rng(1), 5, "stop")[0])
    assert doubt.kind == "open"
    assert doubt.likely == (("mount", ()), ("stop", ("1",)))


def test_a_mount_that_is_far_off_is_told_with_its_size_and_the_slip():
    rng = np.random.default_rng(4)
    true = np.column_stack([rng.uniform(0, 8, (6, 2)), rng.uniform(-3, 3, 6)])
    right = STATED * [1, 1, -1]  # the angle has the wrong sign: 0.6 rad
    seen = compose(compose(true, right), inverse(STATED)) + rng.standard_normal((6, 3)) * SCANS
    shape = Shape(seen, alone(SCANS, 6), STATED, np.diag(MOUNT) ** 2)
    doubt = survey_doubt(list("abcdef"), shape, true, alone(SURVEY, 6))
    assert doubt.kind == "mount"
    # stated less found, as everywhere
    assert (np.abs(doubt.size - (STATED - right)) < 4 * doubt.sigmas).all()
    assert "angle has the wrong sign" in doubt_text(doubt, "to the stops")
