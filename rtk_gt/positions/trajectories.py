"""Positions of one receiver, and headings of two, in time."""

import numpy as np

from rtk_gt.positions.outcome import PositionsOutcome
from validation.poses.trajectory import Clock, Trajectory


def fixed_trajectory(outcome: PositionsOutcome) -> Trajectory:
    """The same as positions in time, for a comparison with what else moves."""
    rows = outcome.fixed
    times = outcome.record.times[rows]
    epoch = int(np.floor(times[0]))
    return Trajectory(
        system="rtk",
        times=times - epoch,
        poses=outcome.positions[rows],
        kind="points_space",
        covariances=outcome.covariances[rows],
        epoch=epoch,
        clock=Clock(stamps="capture"),
        longest_interval=outcome.settings.max_gap,
        frame=str(outcome.frame),
    )


def heading_trajectory(outcome: PositionsOutcome) -> Trajectory:
    """Level positions and headings in time; positions alone where there are no headings."""
    found = outcome.headings
    if found is None:
        return fixed_trajectory(outcome)
    epoch = int(np.floor(found.times[0]))
    kept = [0, 1, 3]
    return Trajectory(
        system="rtk",
        times=found.times - epoch,
        poses=found.poses[:, kept],
        covariances=found.covariances[:, kept][:, :, kept],
        epoch=epoch,
        clock=Clock(stamps="capture"),
        longest_interval=outcome.settings.max_gap,
        frame=str(outcome.frame),
    )
