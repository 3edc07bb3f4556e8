"""Errors stop by stop: signs, wrapping, coverage, and what is not available."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from small_campaigns import three_stops

from validation.errors import GtvalError, InputError
from validation.poses.pose_table import PLANAR, SPATIAL, PoseTable
from validation.statistics.comparison import compare


def test_the_error_is_validation_minus_gt(ad23_poses):
    # AD2.3, "pose 18": 1.1491 - 1.0245 = 0.1246 (from unrounded numbers), 0.0855, 0.0169.
    comparison = compare(ad23_poses["survey"], ad23_poses["vision"])
    error = comparison.errors[comparison.ids.index("18")]
    assert error == pytest.approx([0.1246, 0.0855, 0.0169], abs=5.1e-5)


def test_the_angle_of_an_error_is_wrapped():
    validation = three_stops("survey")
    turned = validation.poses + np.array([0, 0, 2 * np.pi])
    comparison = compare(validation, three_stops("other", poses=turned))
    assert comparison.errors == pytest.approx(np.zeros((3, 3)), abs=1e-15)


def test_covariances_of_both_are_added():
    comparison = compare(three_stops("survey"), three_stops("other", shift=0.01))
    assert comparison.covariances[0] == pytest.approx(2 * three_stops("x").covariances[0])
    # Errors of 1 cm, 1 cm and 10 mrad against sigmas of 14.1 mm, 14.1 mm and 7.07 mrad.
    assert comparison.normalised[0] == pytest.approx([-(0.5**0.5), -(0.5**0.5), -(2**0.5)])
    assert comparison.nees == pytest.approx([0.5 + 0.5 + 2] * 3)
    assert comparison.unavailable == ""


def test_coverage_names_what_each_lacks(ad23_poses):
    comparison = compare(ad23_poses["survey"], ad23_poses["vision"])
    assert comparison.missing_in_gt == ("3", "9", "14", "15", "17", "25")
    assert comparison.missing_in_validation == ()
    assert len(comparison) == 20
    other = compare(ad23_poses["vision"], ad23_poses["survey"])
    assert other.missing_in_validation == ("3", "9", "14", "15", "17", "25")


def test_the_order_of_the_stops_does_not_matter():
    validation, gt = three_stops("survey"), three_stops("other", shift=0.1)
    swapped = gt.select(["3", "1", "2"])
    assert compare(validation, swapped).errors == pytest.approx(compare(validation, gt).errors)


def test_nothing_in_common_is_an_error():
    with pytest.raises(InputError, match="no pose id in common"):
        compare(three_stops("survey"), three_stops("other", ids=("a", "b", "c")))


def test_poses_in_space_are_seen_from_above_beside_planar_ones():
    survey = three_stops("survey")
    poses = np.zeros((1, 6))
    poses[0, [0, 1, 3]] = survey.select(["1"]).poses[0] - [0.1, 0.2, 0.3]
    found = compare(survey, PoseTable("rig", ("1",), poses, components=SPATIAL))
    assert found.errors[0] == pytest.approx([0.1, 0.2, 0.3])
    assert found.left_out == ()


def test_positions_are_compared_as_far_as_they_go():
    prism = PoseTable("prism", ("1", "2"), np.zeros((2, 3)), components=SPATIAL[:3])
    survey = three_stops("survey")
    for found in (compare(survey, prism), compare(prism, survey)):
        assert [one.name for one in found.components] == ["x", "y"]
        assert set(found.left_out) == {"theta of 'survey'", "z of 'prism'"}


def test_without_a_component_in_common_nothing_is_compared():
    heights = PoseTable("level", ("1",), np.zeros((1, 1)), components=SPATIAL[2:3])
    with pytest.raises(GtvalError, match="only the same components"):
        compare(three_stops("survey"), heights)


def test_spatial_poses_are_compared_by_the_same_rules():
    ours = np.array([[1.0, 2.0, 3.0, 3.1, 0.0, 0.1]])
    theirs = np.array([[0.9, 2.0, 3.0, -3.1, 0.0, 0.0]])
    comparison = compare(
        PoseTable("survey", ("1",), ours, components=SPATIAL),
        PoseTable("rig", ("1",), theirs, components=SPATIAL),
    )
    assert comparison.errors[0] == pytest.approx([0.1, 0, 0, 6.2 - 2 * np.pi, 0, 0.1], abs=1e-12)
    assert comparison.distances == pytest.approx([0.1])


def test_without_covariance_nees_is_not_available_and_the_reason_is_given(ad23_poses):
    comparison = compare(ad23_poses["survey"], ad23_poses["vision"])
    assert np.isnan(comparison.nees).all()
    assert comparison.test is None
    assert comparison.unavailable == (
        "'survey' states no covariance and 'vision' states no covariance"
    )


def test_a_single_stop_without_covariance_is_named_and_left_out_of_the_test():
    covariances = three_stops("x").covariances.copy()
    covariances[1] = np.nan
    comparison = compare(three_stops("survey"), three_stops("other", covariances=covariances))
    assert comparison.unavailable == "'other' states no covariance for pose 2"
    assert np.isnan(comparison.nees).tolist() == [False, True, False]
    assert comparison.test is not None
    assert comparison.test.poses == 2


def test_the_test_of_all_stops_sums_their_scores():
    comparison = compare(three_stops("survey"), three_stops("other", shift=0.01))
    assert comparison.test is not None
    assert comparison.test.mean == pytest.approx(comparison.nees.mean())
    assert comparison.test.method.startswith("sum")


def test_correlated_validation_poses_are_tested_jointly():
    # A common offset of all validation poses, 30 mm, beside 1 mm of their own: three equal
    # errors of 30 mm are what is to be expected, and not three independent 30-sigma events.
    common, own, n = 0.03, 0.001, 3
    joint = np.kron(np.full((n, n), common**2), np.eye(3)) + own**2 * np.eye(3 * n)
    covariances = np.tile((common**2 + own**2) * np.eye(3), (n, 1, 1))
    validation = three_stops("survey", covariances=covariances, joint=joint)
    gt_sigma = np.tile(own**2 * np.eye(3), (n, 1, 1))
    comparison = compare(validation, three_stops("other", shift=0.03, covariances=gt_sigma))
    assert comparison.test is not None
    assert comparison.test.method.startswith("joint")
    # One common error of one sigma a component: 3 in all, nearly.
    assert comparison.test.mean * n == pytest.approx(3, rel=0.01)


def test_the_stated_sigma_of_the_mean_holds_what_all_stops_share():
    common_offset, own = 0.03, 0.001
    joint = np.kron(np.full((3, 3), common_offset**2), np.eye(3)) + own**2 * np.eye(9)
    covariances = np.tile((common_offset**2 + own**2) * np.eye(3), (3, 1, 1))
    gt = three_stops("other", covariances=np.tile(own**2 * np.eye(3), (3, 1, 1)))
    together = compare(three_stops("survey", covariances=covariances, joint=joint), gt)
    assert together.mean_sigmas == pytest.approx(
        np.full(3, np.sqrt(common_offset**2 + 2 * own**2 / 3)), rel=1e-12
    )
    apart = compare(three_stops("survey", covariances=covariances), gt)
    assert apart.mean_sigmas == pytest.approx(
        np.full(3, np.sqrt((common_offset**2 + 2 * own**2) / 3)), rel=1e-12
    )


def many_stops(system, n, shared, rng, poses):
    """A table of n stops that share as many errors as ``shared``, by their factor."""
    factor = rng.normal(0, 1e-3, (3 * n, shared))
    rows = factor.reshape(n, 3, shared)
    own = rng.uniform(1e-6, 3e-6, (n, 3, 1)) * np.eye(3)
    covariances = own + rows @ np.swapaxes(rows, 1, 2)
    ids = tuple(str(i) for i in range(n))
    return PoseTable(system, ids, poses, covariances, factor=factor if shared else None)


@pytest.mark.parametrize("shared", [(5, 3), (5, 0), (0, 4)])
def test_a_factor_says_the_same_as_the_whole_matrix(shared):
    rng = np.random.default_rng(20)
    poses = rng.normal(size=(30, 3))
    tables = [
        many_stops(name, 30, k, rng, poses + rng.normal(0, 2e-3, poses.shape))
        for name, k in zip(("survey", "other"), shared, strict=True)
    ]
    whole = [
        replace(t, factor=None, joint=t.joint_covariance) if t.factor is not None else t
        for t in tables
    ]
    split, dense = compare(*tables), compare(*whole)
    assert split.test.mean == pytest.approx(dense.test.mean, rel=1e-9)
    assert split.mean_sigmas == pytest.approx(dense.mean_sigmas, rel=1e-12)


def test_nothing_of_the_square_of_the_stops_is_allocated():
    rng, n = np.random.default_rng(21), 1000
    poses = rng.normal(size=(n, 3))
    tables = [many_stops(name, n, 20, rng, poses) for name in ("survey", "other")]
    tracemalloc.start()
    compared = compare(*tables)
    assert compared.test is not None
    assert (compared.mean_sigmas > 0).all()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # The whole matrix would have 72 MB; factors of 40 columns have 1 MB.
    assert peak < 10e6


def test_the_stated_sigma_of_the_mean_needs_all_covariances(ad23_poses):
    assert np.isnan(compare(ad23_poses["survey"], ad23_poses["vision"]).mean_sigmas).all()


def test_a_singular_joint_covariance_is_an_error():
    validation = three_stops("survey", joint=np.ones((9, 9)))
    gt = three_stops("other", joint=np.ones((9, 9)))
    with pytest.raises(GtvalError, match="joint covariance"):
        compare(validation, gt)


def test_the_joint_scores_of_simulated_campaigns_are_chi_squared():
    rng, n, trials = np.random.default_rng(11), 5, 1000
    mixing = rng.normal(0, 0.01, (3 * n, 3 * n))
    joint = mixing @ mixing.T + 1e-5 * np.eye(3 * n)
    blocks = np.stack([joint[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])
    own = np.tile(np.diag([1e-5, 1e-5, 1e-6]), (n, 1, 1))
    ids = tuple(str(i) for i in range(n))
    inside = 0
    for _ in range(trials):
        noise = rng.multivariate_normal(np.zeros(3 * n), joint).reshape(n, 3)
        gt_noise = rng.normal(0, np.sqrt([1e-5, 1e-5, 1e-6]), (n, 3))
        comparison = compare(
            PoseTable("survey", ids, noise, blocks, PLANAR, joint=joint),
            PoseTable("other", ids, gt_noise, own, PLANAR),
        )
        assert comparison.test is not None
        inside += comparison.test.verdict == "inside"
    # 95 % of 1000, give or take 5 standard deviations of 6.9.
    assert 915 <= inside <= 985
