"""Errors in time, beside evo on the same pairs, and what is said of them."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evo.core import geometry, metrics, trajectory
from moving_robot import drive, in_space, seen

from validation.errors import GtvalError
from validation.poses.trajectory import Trajectory
from validation.results import Figure
from validation.trajectories.breakdown import breakdown
from validation.trajectories.comparison import compare_in_time
from validation.trajectories.findings import findings_in_time
from validation.trajectories.formats import read_trajectory
from validation.trajectories.relative import errors_of_motions, motions, relative_errors
from validation.trajectories.telling import comparison_json, section_in_time, tables_in_time

REAL = Path(
    os.environ.get("GTVAL_REAL_DATA", Path(__file__).resolve().parents[4] / "shared" / "real")
)
BICOCCA = REAL / "trajectories" / "bicocca_25a"
real_data = pytest.mark.skipif(
    not BICOCCA.is_dir(), reason=f"no trajectories in {REAL} (set GTVAL_REAL_DATA)"
)


@pytest.fixture(scope="module")
def spatial():
    """A source in space with noise and a delay."""
    path = drive()
    reference = in_space(seen(path, 20.0, system="reference"))
    source = in_space(seen(path, 10.0, 0.01, start=3.0))
    return reference, source.shifted(0.05)


def of_evo(one):
    wxyz = one.poses[:, [6, 3, 4, 5]]
    return trajectory.PoseTrajectory3D(one.positions, wxyz, one.times)


def ape(pairs, relation):
    metric = metrics.APE(relation)
    metric.process_data((of_evo(pairs.reference), of_evo(pairs.source)))
    return metric.error


def test_absolute_errors_are_those_of_evo(spatial):
    for parts in ([], ["frame"]):
        found = compare_in_time(*spatial, parts)
        expected = ape(found.pairs, metrics.PoseRelation.translation_part)
        np.testing.assert_allclose(found.distances, expected, rtol=0, atol=1e-9)
        expected = ape(found.pairs, metrics.PoseRelation.rotation_angle_rad)
        # The angle of evo comes from a matrix logarithm.
        np.testing.assert_allclose(found.rotation_angles, expected, rtol=0, atol=1e-9)
        metric = metrics.APE(metrics.PoseRelation.translation_part)
        metric.process_data((of_evo(found.pairs.reference), of_evo(found.pairs.source)))
        rms = metric.get_statistic(metrics.StatisticsType.rmse)
        assert found.rms_position.rms == pytest.approx(rms, abs=1e-9)


@pytest.mark.parametrize("scale", [False, True])
def test_the_frame_is_that_of_evo(spatial, scale):
    bare = compare_in_time(*spatial).pairs
    parts = ["frame", "scale"] if scale else ["frame"]
    found = compare_in_time(*spatial, parts).alignment
    rotation, translation, factor = geometry.umeyama_alignment(
        bare.source.positions.T, bare.reference.positions.T, scale
    )
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(found.translation, translation, atol=1e-9)
    assert found.scale == pytest.approx(factor, abs=1e-9)


@pytest.mark.parametrize("every", [False, True])
def test_relative_errors_are_those_of_evo(spatial, every):
    pairs = compare_in_time(*spatial).pairs
    for relation, name in (
        (metrics.PoseRelation.translation_part, "translations"),
        (metrics.PoseRelation.rotation_angle_rad, "rotations"),
    ):
        metric = metrics.RPE(relation, 10, metrics.Unit.frames, all_pairs=every)
        metric.process_data((of_evo(pairs.reference), of_evo(pairs.source)))
        found = relative_errors(pairs, 10, "poses", every=every)
        np.testing.assert_allclose(getattr(found, name), metric.error, rtol=0, atol=1e-9)
    # The pairs that evo takes for a length, where it takes those of the reference's path.
    rows = np.array(
        metrics.id_pairs_from_delta(
            of_evo(pairs.reference).poses_se3, 1.0, metrics.Unit.meters, all_pairs=every
        )
    )
    metric = metrics.RPE(
        metrics.PoseRelation.translation_part, 1.0, metrics.Unit.meters, all_pairs=every,
        pairs_from_reference=True,
    )  # fmt: skip
    metric.process_data((of_evo(pairs.reference), of_evo(pairs.source)))
    found = errors_of_motions(pairs, rows[:, 0], rows[:, 1], 1.0, "m")
    np.testing.assert_allclose(found.translations, metric.error, rtol=0, atol=1e-9)


def test_motions_are_as_long_as_asked_and_cross_no_gap():
    source = seen(drive(100.0), 10.0)
    source = source.select((source.times < 30) | (source.times > 40))
    pairs = compare_in_time(seen(drive(100.0), 10.0), source).pairs
    for delta, unit in ((5.0, "s"), (2.0, "m")):
        for every in (True, False):
            start, end = motions(pairs, delta, unit, every=every)
            t = pairs.times
            assert not np.any((t[start] < 35) & (t[end] > 35))
            if unit == "s":
                np.testing.assert_allclose(t[end] - t[start], 5.0, atol=1e-9)
            if not every:
                assert (start[1:] >= end[:-1]).all()
    with pytest.raises(GtvalError, match="no motion"):
        relative_errors(pairs, 1000.0)
    with pytest.raises(GtvalError, match="not positive"):
        relative_errors(pairs, 0.0)


def test_drift_of_odometry_grows_and_a_frame_changes_nothing_of_it():
    path = drive(200.0)
    reference, source = seen(path, 20.0), seen(path, 20.0)
    poses = source.poses.copy()
    poses[:, :2] *= 1.01
    pairs = compare_in_time(reference, replace(source, poses=poses)).pairs
    for length in (1.0, 10.0):
        found = relative_errors(pairs, length)
        # One per cent of the chord, which is no longer than the path.
        assert 0.002 * length < found.rms.rms <= 0.0105 * length
    aligned = compare_in_time(reference, replace(source, poses=poses), ["frame"]).pairs
    assert relative_errors(aligned, 10.0).rms.rms == pytest.approx(found.rms.rms, rel=1e-9)


def test_errors_are_reference_minus_source_and_wrapped():
    t = np.arange(40.0)
    reference = Trajectory("r", t, np.column_stack([t, 0 * t, 0 * t + 3.1]))
    source = Trajectory("s", t, np.column_stack([t - 0.2, 0 * t + 0.1, 0 * t - 3.1]))
    found = compare_in_time(reference, source)
    np.testing.assert_allclose(found.errors, np.tile([0.2, -0.1, 6.2 - 2 * np.pi], (40, 1)))
    along, across = found.along_across
    np.testing.assert_allclose(along, 0.2)
    np.testing.assert_allclose(across, -0.1)  # to the left is positive
    np.testing.assert_allclose(found.motion.speed, 1.0)
    assert found.motion.travelled[-1] == pytest.approx(39.0)
    assert "the same number" in found.statistics()[0].mean.reason


def test_a_source_that_is_late_has_errors_along_the_motion_that_grow_with_the_speed():
    path = drive(300.0)
    reference = seen(path, 50.0, 0.002, system="reference")
    late = seen(path, 10.0, 0.002, seed=5, start=3.0).shifted(0.1)
    found = compare_in_time(reference, late)
    delay, spread = found.delay_by_speed
    assert delay == pytest.approx(-0.1, abs=0.01)
    assert spread.low <= -0.1 <= spread.high
    told = {one.code: one.text for one in findings_in_time(found, 0.05)}
    assert "100 ms late" in told["delay_suspected"] or "9" in told["delay_suspected"]
    parts = breakdown(found, "speed")
    assert parts[-1].along.mean > 3 * parts[0].along.mean
    right = compare_in_time(reference, late.shifted(-0.1))
    assert "delay_suspected" not in {one.code for one in findings_in_time(right, 0.05)}


def test_wrong_poses_tell_nothing_of_the_clock():
    path = drive(300.0)
    reference = seen(path, 50.0, 0.002, system="reference")
    late = seen(path, 10.0, 0.002, seed=5, start=3.0).shifted(0.1)
    poses = np.array(late.poses)
    rng = np.random.default_rng(3)
    wrong = rng.random(len(poses)) < 0.05
    poses[wrong, :2] += rng.normal(0, 5, (wrong.sum(), 2))
    delay, spread = compare_in_time(reference, replace(late, poses=poses)).delay_by_speed
    assert delay == pytest.approx(-0.1, abs=0.01)
    assert spread.low <= -0.1 <= spread.high


def test_stated_covariances_are_tested_together():
    path = drive(300.0)
    reference = seen(path, 10.0, 0.004, system="reference", stated=True)
    source = seen(path, 10.0, 0.003, seed=7, stated=True)
    found = compare_in_time(reference, source)
    assert found.nees_test.mean == pytest.approx(3, abs=0.2)
    assert found.nees_test.verdict == "inside"
    boast = replace(source, covariances=np.asarray(source.covariances) / 9)
    low = replace(reference, covariances=np.asarray(reference.covariances) / 9)
    assert compare_in_time(low, boast).nees_test.verdict == "above"
    none = compare_in_time(reference, replace(source, covariances=np.empty(0)))
    assert none.nees_test is None
    assert "states no covariance" in none.unavailable


def test_a_covariance_that_is_none_gives_no_nees():
    path = drive(60.0)
    reference = seen(path, 10.0, 0.004, stated=True)
    broken = np.array(reference.covariances)
    broken[3] = [[1e-6, 2e-6, 0], [2e-6, 1e-6, 0], [0, 0, 1e-6]]
    zero = replace(reference, covariances=np.zeros_like(broken))
    found = compare_in_time(replace(reference, covariances=broken), zero)
    assert np.isnan(found.nees[3])
    assert np.isfinite(found.nees).sum() == len(found) - 1
    assert "not positive definite" in found.unavailable


def test_the_worst_stretch_is_where_it_was_put():
    path = drive(100.0)
    source = seen(path, 10.0, 0.002)
    poses = source.poses.copy()
    rows = (source.times > 60) & (source.times < 64)
    poses[rows, 0] += 0.2
    found = compare_in_time(seen(path, 10.0), replace(source, poses=poses))
    first, *others = found.worst_stretches()
    assert 59 <= first.start_s <= 60.2
    assert 64 <= first.end_s <= 65.1
    assert first.max_m == pytest.approx(0.2, abs=0.01)
    assert all(one.rms_m < 0.01 for one in others)
    told = {one.code for one in findings_in_time(found, 0.05)}
    assert "worst_stretches" in told


def test_the_limit_is_answered_by_the_whole_interval():
    path = drive(200.0)
    found = compare_in_time(seen(path, 10.0), seen(path, 10.0, 0.01))
    rms = found.rms_position
    assert rms.low < 0.01 * np.sqrt(2) < rms.high
    assert found.answer(0.02).verdict == "yes"
    assert found.answer(0.01).verdict == "no"
    assert found.answer(rms.rms).verdict == "cannot_tell"
    assert found.answer(0.1).share == 1
    short = found.pairs.source.select(slice(0, 10))
    assert compare_in_time(seen(path, 10.0), short).answer(0.02).verdict == "cannot_tell"


def test_numbers_fitted_widen_the_interval_of_the_rms():
    path = drive(60.0)
    reference, source = seen(path, 10.0), seen(path, 10.0, 0.01)
    bare, fitted = compare_in_time(reference, source), compare_in_time(reference, source, ["frame"])
    assert fitted.rms_position.rms < bare.rms_position.rms
    ratio = fitted.rms_position.high / fitted.rms_position.rms
    n = 2 * fitted.rms_position.n_effective
    from validation.statistics.dependence import rms_of_series

    plain = rms_of_series(fitted.distances)
    assert ratio == pytest.approx(plain.high / plain.rms * np.sqrt(n / (n - 3)))


@pytest.mark.parametrize("kind", ["plane", "space", "points_plane", "points_space"])
def test_every_kind_has_tables_figures_and_json(kind, spatial):
    reference, source = spatial
    if kind.startswith("points"):
        d = 2 if kind == "points_plane" else 3
        reference, source = (
            Trajectory(one.system, one.times, one.positions[:, :d], kind)
            for one in (reference, source)
        )
    elif kind == "plane":
        reference, source = reference.planar(), source.planar()
    found = compare_in_time(reference, source, ["frame"])
    told = comparison_json(found, 0.05)
    assert told["rms_position_m"] == pytest.approx(np.sqrt(np.square(found.distances).mean()))
    assert told["n"] == len(found)
    assert tables_in_time(found, 0.05)
    section = section_in_time(found, 0.05)
    figures = [block for block in section.blocks if isinstance(block, Figure)]
    assert len(figures) == 4
    for figure in figures:
        assert figure.draw().axes


def test_breakdowns_hold_every_pose_once(spatial):
    found = compare_in_time(*spatial)
    for by in ("time", "speed", "turn_rate", "distance"):
        assert sum(part.rms.n for part in breakdown(found, by)) == len(found)
    with pytest.raises(GtvalError, match="'colour'"):
        breakdown(found, "colour")


@real_data
def test_the_ground_truth_of_bicocca_and_the_one_aligned_by_hand():
    reference, source = (
        read_trajectory(BICOCCA / name) for name in ("GROUNDTRUTH.csv.gz", "GT-extended.csv.gz")
    )
    found = compare_in_time(reference, source, ["frame"])
    assert found.rms_position.rms == pytest.approx(0.0314, abs=0.0001)
    assert found.coverage.paired == 102
    assert len(found.coverage.holes) == 2
    assert found.alignment.numbers["frame_theta_rad"] == pytest.approx(-0.2720, abs=0.0005)
    assert found.answer(0.05).verdict == "cannot_tell"
    assert found.answer(0.05).share == pytest.approx(0.92, abs=0.01)
