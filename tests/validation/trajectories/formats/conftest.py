"""A robot that turns, climbs and stops, as a trajectory."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.poses.trajectory import Trajectory


def driven(kind="space", n=60, *, epoch=1_403_636_579, seed=1, covariance=True) -> Trajectory:
    """Poses of one kind at about 20 Hz with nanoseconds, and covariances of all shapes."""
    rng = np.random.default_rng(seed)
    times = np.round(np.arange(n) * 0.05 + rng.uniform(0, 0.01, n) + 0.763555527, 9)
    positions = np.cumsum(rng.normal(0, 0.02, (n, 3)), axis=0)
    yaw = np.cumsum(rng.normal(0, 0.3, n))
    quaternions = Rotation.from_euler(
        "ZYX", np.column_stack([yaw, rng.normal(0, 0.1, (n, 2))])
    ).as_quat()
    poses = {
        "plane": np.column_stack([positions[:, :2], yaw]),
        "space": np.column_stack([positions, quaternions]),
        "points_plane": positions[:, :2],
        "points_space": positions,
    }[kind]
    size = {"plane": 3, "space": 6, "points_plane": 2, "points_space": 3}[kind]
    roots = rng.normal(0, 1e-3, (n, size, size))
    covariances = roots @ roots.transpose(0, 2, 1) + 1e-8 * np.eye(size)
    covariances = (covariances + covariances.transpose(0, 2, 1)) / 2
    return Trajectory(
        "robot",
        times,
        poses,
        kind,
        covariances if covariance else np.empty(0),
        epoch=epoch,
    )


@pytest.fixture
def drive():
    """Makes the trajectory of `driven`."""
    return driven


def same_poses(a: Trajectory, b: Trajectory, *, atol=0.0, seconds=0.0):
    """Two trajectories hold the same poses at the same times."""
    assert a.kind == b.kind
    np.testing.assert_allclose(a.times_since(b.epoch), b.times, rtol=0, atol=seconds)
    np.testing.assert_allclose(a.positions, b.positions, rtol=0, atol=atol)
    if a.has_orientation:
        turned = (a.rotations.inv() * b.rotations).magnitude()
        np.testing.assert_allclose(turned, 0, atol=max(atol, 1e-12))


@pytest.fixture
def same():
    """Holds two trajectories side by side."""
    return same_poses


@pytest.fixture
def written(tmp_path):
    """Writes a file of a name and a content."""

    def write(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
