"""Sources with the clocks that were estimated for them."""

from dataclasses import replace

import numpy as np

from validation.errors import GtvalError
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.jumps import parted
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.smoothing.source import NORMAL_95, Source

FEWEST = 3
"""Poses of a part between two jumps that are fused: fewer tell no motion of their own."""


def clocked(trajectory: Trajectory, clock: ClockEstimate | None) -> list[Source]:
    """A source with its delay; of a clock that jumps one source for each part between jumps.

    Parameters
    ----------
    trajectory : Trajectory
        Its poses, on the clock as it was estimated.
    clock : ClockEstimate, optional
        Without it the stamps are those of the common time.

    Raises
    ------
    GtvalError
        If no delay is known.

    Notes
    -----
    Parts are named after the source and their number. Those of fewer than three poses are left out.
    """
    if clock is None:
        return [Source(trajectory)]
    if not clock.pieces:
        return [_late(trajectory, clock)]
    stamps = trajectory.times_since(clock.epoch)
    between = parted(stamps, [jump.stamp_s for jump in clock.jumps])
    return [
        _late(_named(trajectory.select(rows), number), piece)
        for number, (rows, piece) in enumerate(zip(between, clock.pieces, strict=True), 1)
        if np.count_nonzero(rows) >= FEWEST
    ]


def _named(part: Trajectory, number: int) -> Trajectory:
    return replace(part, system=f"{part.system}, part {number}")


def _late(trajectory: Trajectory, clock: ClockEstimate) -> Source:
    """A source with one delay."""
    if not np.isfinite([clock.delay_s, clock.low_s, clock.high_s]).all():
        why = f": {clock.reason}" if clock.reason else ""
        raise GtvalError(
            f"no delay is known for '{trajectory.system}'{why}; leave it out, or bring its stamps "
            "to the common time first"
        )
    drift = clock.drift_high_ppm - clock.drift_low_ppm
    return Source(
        trajectory,
        clock.delay_s,
        max(clock.high_s - clock.low_s, 0.0) / (2 * NORMAL_95),
        float(np.nan_to_num(clock.drift_ppm)),
        max(float(np.nan_to_num(drift)), 0.0) / (2 * NORMAL_95),
        clock.at_s + clock.epoch - trajectory.epoch if np.isfinite(clock.at_s) else None,
    )
