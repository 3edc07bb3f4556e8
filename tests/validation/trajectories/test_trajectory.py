import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError
from validation.poses.angles import wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.interpolation import interpolate

TIMES = np.arange(0.0, 10.0, 0.1)


def circle(kind="plane", sigma=0.001):
    angle = TIMES / 2
    plane = np.column_stack([np.cos(angle), np.sin(angle), wrap(angle + np.pi / 2)])
    if kind == "plane":
        return Trajectory("c", TIMES, plane, "plane", np.tile(np.eye(3) * sigma**2, (100, 1, 1)))
    turned = Rotation.from_rotvec(plane[:, 2:] * [0, 0, 1.0]).as_quat()
    poses = np.column_stack([plane[:, :2], np.zeros(100), turned])
    return Trajectory("c", TIMES, poses, "space", np.tile(np.eye(6) * sigma**2, (100, 1, 1)))


@pytest.mark.parametrize("kind", ["plane", "space"])
def test_the_stated_uncertainty_of_being_in_between_covers_the_sagitta(kind):
    there = interpolate(circle(kind, 1e-9), TIMES[:-1] + 0.05).trajectory
    angle = (TIMES[:-1] + 0.05) / 2
    error = there.positions[:, :2] - np.column_stack([np.cos(angle), np.sin(angle)])
    sagitta = (0.05 / 2) ** 2 / 2  # half of the chord's angle squared, radius 1 m
    assert np.abs(np.linalg.norm(error, axis=1) - sagitta).max() < 1e-6
    stated = np.sqrt(there.covariances[:, 0, 0] + there.covariances[:, 1, 1])
    inner = slice(2, -2)
    assert (np.linalg.norm(error, axis=1)[inner] < 1.3 * stated[inner]).all()
    assert np.abs(wrap(there.headings - angle - np.pi / 2)).max() < 1e-9


def test_the_plane_and_space_agree_on_a_flat_path():
    flat = interpolate(circle(), TIMES[:-1] + 0.03).trajectory
    seen = interpolate(circle("space"), TIMES[:-1] + 0.03).trajectory.planar()
    np.testing.assert_allclose(flat.positions, seen.positions, atol=1e-12)
    np.testing.assert_allclose(wrap(flat.headings - seen.headings), 0.0, atol=1e-12)
    np.testing.assert_allclose(flat.covariances, seen.covariances, rtol=1e-9)


def test_nothing_is_given_over_a_gap_nor_beyond_the_ends():
    with_gap = circle().select((TIMES < 3) | (TIMES > 6))
    asked = np.array([-0.01, 0.0, 2.85, 3.5, 5.0, 6.15, 9.9, 9.95])
    found = interpolate(with_gap, asked)
    assert found.supported.tolist() == [False, True, True, False, False, True, True, False]
    assert with_gap.gaps.shape == (1, 2)


def test_a_lone_pose_in_a_gap_supports_its_own_time_only():
    rows = np.r_[0:20, 50, 80:100]
    lone = circle().select(rows)
    found = interpolate(lone, [TIMES[50] - 0.01, TIMES[50], TIMES[50] + 0.01])
    assert found.supported.tolist() == [False, True, False]


@given(st.integers(0, 98), st.floats(0.01, 0.99))
def test_independent_errors_are_mixed_by_the_square_of_their_shares(row, share):
    straight = Trajectory(
        "s", TIMES, np.column_stack([TIMES, 0 * TIMES, 0 * TIMES]),
        covariances=np.tile(np.eye(3), (100, 1, 1)),
    )  # fmt: skip
    there = interpolate(straight, [TIMES[row] + share * 0.1]).trajectory
    expected = share**2 + (1 - share) ** 2
    assert there.covariances[0, 1, 1] == pytest.approx(expected, rel=1e-6)


def test_nanoseconds_survive_beside_the_epoch():
    stamp = 1_400_000_000_123_456_789
    one = Trajectory("e", [stamp % 10**9 / 1e9], [[0.0, 0.0, 0.0]], epoch=stamp // 10**9)
    assert round(one.times_since(1_400_000_000)[0] * 1e9) == 123_456_789


@pytest.mark.parametrize(
    ("times", "poses", "said"),
    [
        ([0.0, 0.0], np.zeros((2, 3)), "do not increase"),
        ([0.0, np.nan], np.zeros((2, 3)), "not finite"),
        ([0.0], np.zeros((1, 4)), "expected 1 poses of 3 numbers"),
    ],
)
def test_what_is_no_trajectory_is_refused(times, poses, said):
    with pytest.raises(GtvalError, match=said):
        Trajectory("bad", times, poses)
