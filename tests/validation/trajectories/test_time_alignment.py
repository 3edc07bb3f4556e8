"""Common times, and what is fitted before a comparison."""

from dataclasses import replace

import numpy as np
import pytest
from moving_robot import drive, in_space, seen
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError
from validation.poses.trajectory import Trajectory
from validation.trajectories.alignment import align, align_in_time, moved, parts_of, umeyama
from validation.trajectories.association import associate


def transformed(one, turn, shift, scale=1.0, mount=(0.0, 0.0), mount_turn=0.0):
    """What a source in another frame and at another place of the robot gives; planar."""
    c, s = np.cos(turn), np.sin(turn)
    theta = one.poses[:, 2]
    arm = np.column_stack(
        [
            np.cos(theta) * mount[0] - np.sin(theta) * mount[1],
            np.sin(theta) * mount[0] + np.cos(theta) * mount[1],
        ]
    )
    xy = (one.positions + arm) @ np.array([[c, -s], [s, c]]).T / scale + shift
    return replace(one, poses=np.column_stack([xy, theta + turn + mount_turn]))


def test_the_denser_one_is_evaluated_at_the_times_of_the_sparser():
    path = drive()
    reference, source = seen(path, 48.0), seen(path, 7.0, start=3.0)
    pairs = associate(reference, source)
    assert pairs.coverage.at == "source"
    assert pairs.coverage.paired == pairs.coverage.asked == len(source)
    np.testing.assert_array_equal(pairs.source.poses, source.poses)
    assert np.abs(pairs.reference.positions - source.positions).max() < 1e-3
    swapped = associate(source, reference)
    assert swapped.coverage.at == "reference"
    assert associate(reference, source, "reference").coverage.asked == len(reference)


def test_what_has_no_support_is_counted():
    path = drive(100.0)
    source = seen(path, 10.0)
    t = source.times
    holed = source.select((t < 30) | (t > 50))
    found = associate(seen(path, 50.0, start=0.0), holed).coverage
    assert found.paired == found.asked == len(holed)
    [hole] = [one for one in found.holes if one[1] - one[0] > 10]
    assert hole == pytest.approx([30, 50], abs=0.2)
    assert found.share == pytest.approx((96 - 20) / 100, abs=0.02)
    lone = source.select((t < 30) | (np.abs(t - 40) < 0.01) | (t > 50))
    # At the reference's times nothing is made up around a lone pose.
    paired = associate(seen(path, 50.0), lone, "reference")
    assert not np.any(
        (paired.times > 31) & (paired.times < 49) & (np.abs(paired.times - 40) > 0.01)
    )


def test_epochs_are_honoured_and_no_common_time_is_an_error():
    path = drive()
    reference, source = seen(path), seen(path, 5.0, system="cam")
    later = replace(source, times=source.times - 1000, epoch=1000)
    pairs = associate(reference, later)
    np.testing.assert_allclose(pairs.times, source.times, atol=1e-9)
    with pytest.raises(GtvalError, match="no time in common"):
        associate(reference, replace(source, epoch=3600))


def test_different_kinds_are_compared_in_what_they_share():
    path = drive()
    planar, spatial = seen(path, 20.0, system="floor"), in_space(seen(path, 5.0, system="air"))
    pairs = associate(planar, spatial)
    assert pairs.source.kind == pairs.reference.kind == "plane"
    assert "'air' is seen from above" in pairs.shared
    points = Trajectory("station", planar.times, planar.positions, "points_plane")
    pairs = associate(points, spatial)
    assert pairs.source.kind == "points_plane"
    assert "'station' has positions only" in pairs.shared


@pytest.mark.parametrize("parts", ["frame", "frame+scale", "frame+mount", "frame+scale+mount"])
def test_what_was_done_to_a_source_is_found_and_undone(parts):
    path = drive()
    reference = seen(path, 10.0, system="reference")
    mount = {"mount": (0.3, -0.1), "mount_turn": 0.2} if "mount" in parts else {}
    scale = 1.02 if "scale" in parts else 1.0
    source = transformed(reference, 0.7, [3.0, -2.0], scale, **mount)
    pairs = associate(reference, source)
    found = align(pairs, parts_of(parts))
    back = moved(found, pairs.source)
    assert np.abs(back.positions - pairs.reference.positions).max() < 1e-9
    turn = np.exp(1j * (back.poses[:, 2] - pairs.reference.poses[:, 2]))
    assert np.abs(turn - 1).max() < 1e-9
    assert found.freedoms == 3 + ("scale" in parts) + 3 * ("mount" in parts)
    assert set(found.sigmas) == set(found.numbers)
    if "scale" in parts:
        assert found.scale == pytest.approx(1.02)


def test_frame_and_mount_in_space():
    path = drive()
    reference = in_space(seen(path, 10.0, system="reference"))
    frame = Rotation.from_rotvec([0.3, -0.2, 1.0])
    mount = Rotation.from_rotvec([0.1, 0.2, -0.3])
    arm = np.array([0.2, -0.1, 0.4])
    # The source sees a point at the arm of its own robot frame: undo it here.
    turned = frame.inv() * reference.rotations * mount.inv()
    positions = frame.inv().apply(reference.positions - [1, 2, 3]) - turned.apply(arm)
    source = replace(reference, poses=np.column_stack([positions, turned.as_quat()]))
    pairs, found = align_in_time(reference, source, ["frame", "mount"])
    assert np.abs(pairs.source.positions - pairs.reference.positions).max() < 1e-8
    away = pairs.reference.rotations * pairs.source.rotations.inv()
    assert away.magnitude().max() < 1e-8
    np.testing.assert_allclose(found.mount, arm, atol=1e-8)
    np.testing.assert_allclose(found.translation, [1, 2, 3], atol=1e-8)
    assert found.freedoms == 12


def test_covariances_are_carried_along_as_draws_are():
    rng = np.random.default_rng(1)
    pose = np.array([[1.0, 2.0, 0.5]])
    covariance = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.2], [0.5, -0.2, 1.0]]) * 1e-6
    one = Trajectory("a", [0.0], pose, covariances=covariance[None])
    path = drive()
    other = transformed(seen(path), 0.7, [3.0, -2.0], 1.02, (0.3, -0.1), 0.2)
    found = align(associate(seen(path), other), ["frame", "scale", "mount"])
    drawn = pose + rng.multivariate_normal(np.zeros(3), covariance, 20_000)
    cloud = moved(found, Trajectory("a", np.arange(20_000.0), drawn)).poses
    # The variance of 20,000 draws is known to 1 %; four of these.
    expected = np.cov(cloud.T)
    np.testing.assert_allclose(moved(found, one).covariances[0], expected, atol=0.05e-6 * 4)


def test_sigmas_hold_for_errors_that_neighbours_share():
    from dependent_intervals import errors

    path = drive(200.0)
    reference = seen(path, 10.0, system="reference")
    n = len(reference)
    scores = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noise = 0.01 * errors("ar1", n, 1.0, 2, rng).T
        poses = reference.poses.copy()
        poses[:, :2] += noise
        found = align(associate(reference, replace(reference, poses=poses)), ["frame"])
        names = list(found.numbers)
        scores.append([found.numbers[k] / found.sigmas[k] for k in names])
    spread = np.std(scores, axis=0)
    # One, but for eight degrees of freedom (1.15) and 60 seeds (10 % each).
    assert (spread > 0.8).all()
    assert (spread < 1.6).all()


def test_a_delay_is_found_with_the_frame():
    path = drive(200.0)
    reference = seen(path, 50.0, 0.001, system="reference")
    source = transformed(seen(path, 10.0, 0.001, seed=4, start=3.0), 0.4, [1.0, 2.0])
    pairs, found = align_in_time(reference, source.shifted(0.12), ["frame", "time"])
    # A source stamped late has a negative delay.
    assert found.delay_s == pytest.approx(-0.12, abs=0.002)
    assert found.freedoms == 4
    assert found.sigmas["delay_s"] < 0.001
    assert np.abs(pairs.source.positions - pairs.reference.positions).max() < 0.01
    given, other = align_in_time(reference, source, ["time"], delay_of=lambda *_: (0.5, 0.1))
    assert (other.delay_s, other.sigmas["delay_s"]) == (0.5, 0.1)
    assert given.coverage.at == "source"


def test_what_cannot_be_told_is_refused():
    t = np.arange(50.0)
    still = Trajectory("still", t, np.zeros((50, 3)))
    with pytest.raises(GtvalError, match="one point"):
        align(associate(still, still), ["frame"])
    line = np.column_stack([t, 0 * t, 0 * t, 0 * t, 0 * t, 0 * t, 0 * t + 1])
    straight = Trajectory("straight", t, line, "space")
    with pytest.raises(GtvalError, match="on a line"):
        align(associate(straight, straight), ["frame"])
    planar = Trajectory("straight", t, np.column_stack([t, 0 * t, 0 * t]))
    with pytest.raises(GtvalError, match="turns"):
        align(associate(planar, planar), ["frame", "mount"])
    points = Trajectory("points", t, np.column_stack([t, t**2]), "points_plane")
    with pytest.raises(GtvalError, match="orientation"):
        align(associate(points, points), ["mount"])
    with pytest.raises(GtvalError, match="'frames' cannot be aligned"):
        parts_of("frames")
    assert parts_of("time+frame") == ("frame", "time")
    assert parts_of("none") == ()


def test_a_mirror_is_never_taken_for_a_rotation():
    points = np.random.default_rng(0).standard_normal((20, 2))
    rotation, _, _ = umeyama(points * [1, -1], points)
    assert np.linalg.det(rotation) == pytest.approx(1)
