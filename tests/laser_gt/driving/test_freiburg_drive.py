"""The log of a real building, a part of it, end to end."""

import numpy as np
import pytest
from laser_rooms import FR079

from laser_gt.driving.drive import solve_log
from laser_gt.driving.log import DriveInputs
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.logs.carmen import read_carmen
from laser_gt.logs.motion import MirrorTiming
from laser_gt.scans.planar import between, wrapped

MOUNT = np.array([-0.04, 0.0, 0.0])


@pytest.mark.skipif(not FR079.is_dir(), reason=f"no real scans at {FR079}; set GTVAL_REAL_DATA")
@pytest.mark.parametrize(
    "part", [slice(782, 882), pytest.param(slice(None), marks=pytest.mark.full)], ids=str
)
def test_the_relations_of_freiburg_are_met_by_the_trajectory(part):
    """All of them; or a hundred scans, that 13 are between."""
    records = read_carmen(FR079 / "fr079.log.gz")[part]
    times = np.array([record.scan.time for record in records])
    odometry = np.array([record.odometry for record in records])
    inputs = DriveInputs(
        {"front": [record.scan for record in records]},
        {"front": Sensor(MOUNT, MirrorTiming(1 / 75, 2))},
        np.array([0.002, 0.002, 0.002]),
        Odometer(times, odometry),
    )
    found = solve_log(inputs, 1, lambda _what, _share: None)
    assert found.matched.mean() >= 0.95
    rows = np.loadtxt(FR079 / "fr079.relations")
    near = np.abs(times - rows[:, :2, None]).argmin(-1)
    both = (np.abs(times[near] - rows[:, :2]) < 1e-4).all(-1)
    first, second = near[both].T
    poses = found.trajectory.poses
    off = wrapped(between(poses[first], poses[second]) - rows[both][:, [2, 3, 7]])
    assert np.median(np.hypot(*off[:, :2].T)) < 0.030
