"""Drives of the samples, as tests of laser GT solve them."""

import numpy as np

from data_samples.motion.laser import TIMING
from laser_gt.driving.log import DriveInputs, SurveyedStop
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.scans.planar import wrapped

MOUNT_SIGMAS = np.array([0.001, 0.001, 0.0005])


def drive_inputs_of(drive):
    by_name = {stop.name: stop for stop in drive.stops}
    epoch = drive.truth.epoch
    stops = [
        SurveyedStop(name, by_name[name].start - epoch, by_name[name].end - epoch, pose, spread)
        for name, pose, spread in zip(
            drive.survey.ids, drive.survey.poses, drive.survey.covariances, strict=True
        )
    ]
    return DriveInputs(
        {"front": drive.scans},
        {"front": Sensor(drive.stated_mount, TIMING)},
        MOUNT_SIGMAS,
        Odometer(drive.odometry.times, drive.odometry.poses),
        own_clock=True,
        stops=stops,
        epoch=epoch,
    )


def errors_of(drive, outcome):
    """(n, 3) poses less the true ones of the same times."""
    truth, times = drive.truth, outcome.trajectory.times
    track = np.column_stack([truth.poses[:, :2], np.unwrap(truth.poses[:, 2])])
    true = np.column_stack([np.interp(times, truth.times, column) for column in track.T])
    return wrapped(outcome.trajectory.poses - true)


def squared(errors, outcome):
    """(n,) squared errors in units of the stated covariances."""
    solved = np.linalg.solve(outcome.trajectory.covariances, errors[..., None])[..., 0]
    return (errors * solved).sum(1)
