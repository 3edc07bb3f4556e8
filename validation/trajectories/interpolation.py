"""The pose in between two poses, with the uncertainty of not having been seen there."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from validation.poses.angles import Array, wrap
from validation.poses.trajectory import Trajectory


@dataclass(frozen=True)
class Interpolated:
    """A trajectory at times asked for.

    Parameters
    ----------
    trajectory : Trajectory
        At those of the times that have support, in their order.
    supported : (m,) array of bool
        For every time asked for: whether poses stand on both sides and no gap in between.
    """

    trajectory: Trajectory
    supported: npt.NDArray[np.bool_]


def interpolate(trajectory: Trajectory, times: npt.ArrayLike) -> Interpolated:
    """Poses at other times, on straight lines at constant turn rate between neighbours.

    Parameters
    ----------
    trajectory : Trajectory
        With n poses.
    times : (m,) array_like
        Strictly increasing seconds since the trajectory's epoch.

    Returns
    -------
    Interpolated
        Nothing is given across a gap, before the first pose or after the last. A time that is a
        pose's own has support in any case.

    Notes
    -----
    At the share u of an interval T the covariance is ``(1-u)^2 C0 + u^2 C1``, as if the errors of
    neighbours were independent, and the error of the straight line under the acceleration a,
    ``a u (1-u) T^2 / 2``, added as a variance. The acceleration is the second difference of the
    poses at the two ends; noise in them makes it larger, never smaller.
    """
    times = np.asarray(times, dtype=float)
    left, share, supported = _places(trajectory, times)
    left, share = left[supported], share[supported]
    if not share.any():  # every time is a pose's own
        found = replace(trajectory.select(left), times=times[supported])
        return Interpolated(found, supported)
    right = np.minimum(left + 1, len(trajectory) - 1)
    poses = _mixed_poses(trajectory, left, right, share)
    if not trajectory.has_covariance.any():
        # There is nothing to mix, and in a long trajectory that would take most of the time.
        found = replace(
            trajectory,
            times=times[supported],
            poses=poses,
            covariances=np.empty(0),
            longest_interval=trajectory.gap,
        )
        return Interpolated(found, supported)
    covariances = np.asarray(trajectory.covariances)
    mixed = (1 - share)[:, None, None] ** 2 * covariances[left]
    mixed = mixed + np.where(share > 0, share**2, 0.0)[:, None, None] * covariances[right]
    # A pose at its own time is as certain as it is, whatever its neighbours are.
    mixed = np.where((share == 0)[:, None, None], covariances[left], mixed)
    sag = in_between_sigmas(trajectory)
    widths = trajectory.times[right] - trajectory.times[left]
    height = (share * (1 - share) * widths**2 / 2)[:, None] * np.maximum(sag[left], sag[right])
    mixed = mixed + np.einsum("ij,jk->ijk", height**2, np.eye(height.shape[1]))
    found = replace(
        trajectory,
        times=times[supported],
        poses=poses,
        covariances=mixed,
        longest_interval=trajectory.gap,
    )
    return Interpolated(found, supported)


def _places(
    trajectory: Trajectory, times: Array
) -> tuple[npt.NDArray[np.intp], Array, npt.NDArray[np.bool_]]:
    """The pose before each time, the share of its interval, and whether it has support."""
    own = trajectory.times
    left = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 1)
    right = np.minimum(left + 1, len(own) - 1)
    width = own[right] - own[left]
    share = np.where(width > 0, (times - own[left]) / np.where(width > 0, width, 1.0), 0.0)
    at_pose = times == own[left]
    inside = (times >= own[0]) & (times <= own[-1])
    return left, share, np.asarray(inside & (at_pose | (width <= trajectory.gap)))


def _mixed_poses(
    trajectory: Trajectory,
    left: npt.NDArray[np.intp],
    right: npt.NDArray[np.intp],
    share: Array,
) -> Array:
    """(m, k) poses at a share of the way from left to right."""
    poses, d = trajectory.poses, trajectory.dimensions
    mixed = poses[left] + share[:, None] * (poses[right] - poses[left])
    if trajectory.kind == "plane":
        turn = wrap(poses[right, 2] - poses[left, 2])
        mixed[:, 2] = wrap(poses[left, 2] + share * turn)
    elif trajectory.kind == "space" and len(left):
        start, end = Rotation.from_quat(poses[left, d:]), Rotation.from_quat(poses[right, d:])
        turn = (end * start.inv()).as_rotvec()
        mixed[:, d:] = (Rotation.from_rotvec(share[:, None] * turn) * start).as_quat()
    return np.asarray(mixed)


def in_between_sigmas(trajectory: Trajectory) -> Array:
    """(n, m) acceleration at each pose, m/s^2 and rad/s^2, by second differences.

    Zero at the ends, at gaps' edges and in a trajectory of fewer than three poses: the line from a
    gap's edge takes the acceleration of its other end.
    """
    times, poses, d = trajectory.times, trajectory.poses, trajectory.dimensions
    freedoms = trajectory.covariances.shape[1]
    accelerations = np.zeros((len(times), freedoms))
    if len(times) < 3:
        return accelerations
    steps = np.diff(times)
    rates = np.empty((len(steps), freedoms))
    rates[:, :d] = np.diff(poses[:, :d], axis=0) / steps[:, None]
    if trajectory.kind == "plane":
        rates[:, 2] = wrap(np.diff(poses[:, 2])) / steps
    elif trajectory.kind == "space":
        turned = Rotation.from_quat(poses[1:, 3:]) * Rotation.from_quat(poses[:-1, 3:]).inv()
        rates[:, 3:] = turned.as_rotvec() / steps[:, None]
    middle = (steps[1:] + steps[:-1]) / 2
    accelerations[1:-1] = np.abs(np.diff(rates, axis=0)) / middle[:, None]
    wide = steps > trajectory.gap
    accelerations[1:-1][wide[1:] | wide[:-1]] = 0.0
    return accelerations
