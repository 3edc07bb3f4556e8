"""How a trajectory moves: speed, direction of motion, turn rate, distance."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory

LEAST_REACH_S = 0.25
"""Seconds either side of a time over which the motion is taken: positions good to 10 mm then give a
speed to 30 mm/s, and a robot turns by a few degrees at most meanwhile."""
STILL_SPEED = 0.05
"""Metres a second below which there is no direction of motion: it would be that of the noise."""


@dataclass(frozen=True)
class Motion:
    """The motion at n times.

    Parameters
    ----------
    velocity : (n, d) array
        Metres a second.
    speed : (n,) array
        Its length.
    ahead : (n, d) array
        Direction of motion; NaN where it stands still.
    turn_rate : (n,) array
        Radians a second, of the heading; NaN for positions only.
    travelled : (n,) array
        Metres since the first time, by the speed, without what lies in gaps.
    """

    velocity: Array
    speed: Array
    ahead: Array
    turn_rate: Array
    travelled: Array


def motion_at(trajectory: Trajectory, times: Array) -> Motion:
    """The motion of a trajectory at some of its times.

    Parameters
    ----------
    trajectory : Trajectory
        Whose.
    times : (n,) array
        Seconds since its epoch, increasing, within its poses.
    """
    own = trajectory.times
    interval = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
    reach = max(LEAST_REACH_S, interval)
    first, last = _stretch(trajectory, times)
    before, after = np.maximum(times - reach, first), np.minimum(times + reach, last)
    width = after - before
    safe = np.where(width > 0, width, np.inf)
    positions = trajectory.positions
    velocity = np.column_stack(
        [
            (np.interp(after, own, column) - np.interp(before, own, column)) / safe
            for column in positions.T
        ]
    )
    speed = np.linalg.norm(velocity, axis=1)
    moves = speed >= STILL_SPEED
    ahead = np.where(moves[:, None], velocity / np.where(moves, speed, 1.0)[:, None], np.nan)
    turn_rate = np.full(len(times), np.nan)
    if trajectory.has_orientation:
        heading = np.unwrap(trajectory.headings)
        turn_rate = (np.interp(after, own, heading) - np.interp(before, own, heading)) / safe
    steps = np.diff(times)
    steps = np.where(np.diff(first) == 0, steps, 0.0)
    travelled = np.concatenate([[0.0], np.cumsum(steps * (speed[1:] + speed[:-1]) / 2)])
    return Motion(velocity, speed, ahead, turn_rate, travelled[: len(times)])


def _stretch(trajectory: Trajectory, times: Array) -> tuple[Array, Array]:
    """First and last time of the stretch without gap that each time is in."""
    gaps = trajectory.gaps
    starts = np.concatenate([trajectory.times[:1], gaps[:, 1]])
    ends = np.concatenate([gaps[:, 0], trajectory.times[-1:]])
    which = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
    return starts[which], ends[which]


def along_and_across(errors: Array, ahead: Array) -> tuple[Array, Array]:
    """Errors in the direction of motion, and across it.

    Parameters
    ----------
    errors : (n, d) array
        Of the position.
    ahead : (n, d) array
        Unit vectors; NaN where there is none.

    Returns
    -------
    along, across : (n,) array
        Across is positive to the left in the plane; in space it is the length of what is left.
    """
    along = (errors * ahead).sum(1)
    if errors.shape[1] == 2:
        return along, ahead[:, 0] * errors[:, 1] - ahead[:, 1] * errors[:, 0]
    return along, np.linalg.norm(errors - along[:, None] * ahead, axis=1)
