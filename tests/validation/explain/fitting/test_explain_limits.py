"""What a set of poses cannot tell is said, and bad input is never scored."""

import numpy as np
import pytest
from explain_campaigns import simulate, table
from four_sources import Case, campaign
from scipy import stats

from validation.errors import GtvalError
from validation.explain.analysis import explain
from validation.explain.fitting.pairs import make_pairs
from validation.explain.fitting.selection import select, smallest_shown
from validation.explain.telling.words import findings


def texts(explanation):
    return {finding.code: finding.text for finding in findings(explanation)}


def few(seed, shift):
    """Five poses on a straight line at one heading, two sources."""
    rng = np.random.default_rng(seed)
    stops = np.column_stack([np.linspace(0, 4, 5), np.ones(5), np.full(5, 0.3)])
    noisy = [stops + 0.003 * rng.normal(size=stops.shape) for _ in range(2)]
    return table("survey", noisy[0]), table("rig", noisy[1] + np.array([shift, 0, 0]))


@pytest.mark.parametrize("seed", range(5))
def test_a_shift_over_five_poses_at_one_heading_has_no_one_name(seed):
    survey, rig = few(seed, 0.05)
    told = texts(explain(survey, [rig]))
    cause = told["systematic_error"]
    assert "a wrong frame" in cause
    assert "a wrong mount" in cause
    assert "these poses cannot tell which" in cause
    assert "At a single heading, a wrong mount and a wrong frame" in told["rivals"]
    assert "'frame_mount': frame_x, frame_y, mount_x, mount_y" in told["not_observable"]
    assert "nothing tells which" in told["two_sources"]
    assert "three sources that share no sensor" in told["no_three_cornered_hat"]


@pytest.mark.parametrize("seed", range(5))
def test_five_clean_poses_say_how_large_an_error_they_would_miss(seed):
    told = texts(explain(*_as_arguments(few(seed, 0.0))))
    assert "only errors of the frame from" in (told["no_systematic_error"])


@pytest.mark.parametrize("stated", [True, False])
def test_an_error_of_the_size_said_is_shown_in_19_of_20(stated):
    survey, rig = simulate("none", 0, stated=stated)
    first = select(make_pairs(survey, rig))
    shift, _ = smallest_shown(first.candidate("frame").fit, first.threshold)
    shown, seeds = 0, 40
    for seed in range(seeds):
        survey, rig = simulate("none", seed, stated=stated)
        off = table("rig", rig.poses + np.array([shift, 0, 0]))
        off = type(off)("rig", off.ids, off.poses, rig.covariances)
        shown += select(make_pairs(survey, off)).chosen.name != "none"
    assert shown >= stats.binom.ppf(0.001, seeds, 0.9)


def test_on_a_straight_path_a_turned_mount_is_told_from_a_turned_frame():
    # Both scan-matching turns are 10 mrad; a frame alone would leave 5 cm at the ends of the path.
    case = Case("straight", path="straight", stated=True)
    names = []
    for seed in range(6):
        survey, systems, _ = campaign(case, [3, seed])
        names.append(explain(survey, systems).system("scanmatch").name)
    assert names.count("frame_turn") + names.count("frame_mount") >= 5


def test_covariances_that_are_too_small_are_noticed():
    survey, rig = simulate("none", 1)
    told = texts(
        explain(
            type(survey)("survey", survey.ids, survey.poses, survey.covariances / 16),
            [type(rig)("rig", rig.ids, rig.poses, rig.covariances / 16)],
        )
    )
    assert "times as large as the stated covariances say" in told["covariance_too_small"]


def test_covariances_that_fit_are_left_in_peace():
    told = [texts(explain(*_as_arguments(simulate("none", seed)))) for seed in range(20)]
    wrong = sum("covariance_too_small" in one or "covariance_too_large" in one for one in told)
    # Two 99 % intervals each.
    assert wrong <= stats.binom.ppf(0.999, 20, 0.02)


def _as_arguments(tables):
    survey, rig = tables
    return survey, [rig]


@pytest.mark.parametrize("value", [0.0, -1e-4, np.nan, np.inf])
def test_a_covariance_that_is_none_is_an_error_and_no_score(value):
    survey, rig = simulate("none", 1)
    covariances = rig.covariances.copy()
    covariances[3, 0, 0] = value
    with pytest.raises((GtvalError, ValueError)):
        explain(survey, [type(rig)("rig", rig.ids, rig.poses, covariances)])


def test_a_singular_covariance_is_an_error():
    survey, rig = simulate("none", 1)
    covariances = rig.covariances.copy()
    covariances[3, :2, :2] = covariances[3, 0, 0]
    with pytest.raises((GtvalError, ValueError)):
        explain(survey, [type(rig)("rig", rig.ids, rig.poses, covariances)])


def test_small_angles_in_degrees_are_noticed_against_the_other_table():
    survey, rig = simulate("none", 1)
    poses = rig.poses * np.array([1, 1, np.degrees(1.0)])
    with pytest.raises(GtvalError, match="look like degrees"):
        explain(survey, [type(rig)("rig", rig.ids, poses)])


def test_no_stop_in_common_is_an_error():
    survey, rig = simulate("none", 1)
    other = type(rig)("rig", tuple(f"x{name}" for name in rig.ids), rig.poses)
    with pytest.raises(GtvalError, match="no pose id in common"):
        explain(survey, [other])
