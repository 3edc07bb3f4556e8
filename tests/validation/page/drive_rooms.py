"""Campaigns of trajectories whose delays are known."""

import numpy as np

from validation.poses.trajectory import Trajectory
from validation.trajectories.formats import trajectory_text

TOML = """
name = "A drive"

[[published]]
system = "rig"
file = "rig.csv"
judged = false

[[published]]
system = "camera"
file = "camera.csv"
judged = false

[[published]]
system = "outside"
file = "../outside.csv"
judged = false

[time]
reference = "rig"
"""
LATE = 0.137
"""Seconds by which the camera stamps late, so that its delay is minus that."""


def poses_at(times):
    """A robot that winds its way, never the same way twice."""
    heading = 1.3 * np.sin(0.43 * times) + 0.8 * np.sin(0.171 * times**1.1) + 0.2 * times
    fine = np.arange(0, times.max() + 0.01, 0.01)
    angle = np.interp(fine, times, heading)
    way = np.cumsum(np.column_stack([np.cos(angle), np.sin(angle)]) * 0.005, axis=0)
    place = [np.interp(times, fine, column) for column in way.T]
    return np.column_stack([*place, heading])


def trajectory(system, times, late=0.0, noise=0.002, seed=0):
    rng = np.random.default_rng([20261129, seed])
    poses = poses_at(times) + rng.normal(size=(len(times), 3)) * noise
    covariances = np.tile(np.eye(3) * noise**2, (len(times), 1, 1))
    return Trajectory(system, times + late, poses, "plane", covariances, epoch=1_700_000_000)


def driven(folder):
    """A drive of 50 seconds with a gap in what the camera saw."""
    folder.mkdir()
    times = np.arange(0, 50, 0.02)
    seen = np.arange(0.03, 50, 0.1)
    seen = seen[(seen < 22) | (seen > 26)]
    for name, one in (
        ("rig", trajectory("rig", times)),
        ("camera", trajectory("camera", seen, LATE, 0.01, 1)),
    ):
        (folder / f"{name}.csv").write_text(str(trajectory_text(one)))
    (folder.parent / "outside.csv").write_text((folder / "rig.csv").read_text())
    (folder / "campaign.toml").write_text(TOML)
    return folder
