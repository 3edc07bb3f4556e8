"""What a survey and a measured mount alone do to a drive, with a scanner that makes no errors."""

import numpy as np

from data_samples.motion.laser import MOUNT_SIGMAS, LaserDrive
from laser_gt.scans.planar import (
    compose,
    compose_jacobians,
    inverse,
    inverse_jacobian,
    wrapped,
)
from validation.poses.angles import Array

STEPS = 5
"""Of Gauss-Newton, from the truth: errors of millimetres need two."""


def survey_alone(drive: LaserDrive, true: Array) -> Array:
    """(n,) squared errors, in their standard deviations, at true poses of the robot, (n, 3).

    Unknown are where the map lies in the frame of the survey, and the mount; known are the surveyed
    stops and the mount as measured. The map has no errors. What a drive has beyond this is of its
    scans; what it has like this is of chance, six numbers a drive.
    """
    place = {name: row for row, name in enumerate(drive.true_stops.ids)}
    stops = drive.true_stops.poses[[place[name] for name in drive.survey.ids]]
    mount = np.array(drive.scanner.mount, dtype=float)
    weights = np.linalg.inv(drive.survey.covariances)
    measured = np.diag(np.array(MOUNT_SIGMAS) ** -2.0)
    frame, found = np.zeros(3), mount.copy()
    covariance = np.zeros((6, 6))
    for _ in range(STEPS):
        poses, slopes = _moved(frame, found, compose(stops, mount))
        off = wrapped(poses - drive.survey.poses)
        information = np.einsum("nki,nkl,nlj->ij", slopes, weights, slopes)
        gradient = np.einsum("nki,nkl,nl->i", slopes, weights, off)
        information[3:, 3:] += measured
        gradient[3:] += measured @ (found - drive.stated_mount)
        covariance = np.linalg.inv(information)
        step = -covariance @ gradient
        frame, found = frame + step[:3], found + step[3:]
    poses, slopes = _moved(frame, found, compose(true, mount))
    off = wrapped(poses - true)
    spread = slopes @ covariance @ np.swapaxes(slopes, 1, 2)
    return np.asarray((off * np.linalg.solve(spread, off[..., None])[..., 0]).sum(1))


def _moved(frame: Array, mount: Array, laser: Array) -> tuple[Array, Array]:
    """(n, 3) robot poses of a map that is moved, and (n, 3, 6) derivatives by frame and mount."""
    there, back = compose(frame, laser), inverse(mount)
    by_frame, _ = compose_jacobians(np.broadcast_to(frame, laser.shape), laser)
    by_there, by_back = compose_jacobians(there, np.broadcast_to(back, laser.shape))
    slopes = np.concatenate([by_there @ by_frame, by_back @ inverse_jacobian(mount)], axis=2)
    return compose(there, back), slopes
