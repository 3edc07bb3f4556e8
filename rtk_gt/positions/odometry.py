"""Odometry laid over the positions of a receiver, as AD2.3 does."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.alignment import umeyama
from validation.trajectories.clock.estimate import estimate_clock
from validation.trajectories.clock.result import ClockEstimate, on_reference_clock
from validation.trajectories.formats.reading import read_trajectory

FEWEST = 10
"""Positions by which odometry is laid over: a judgement."""


@dataclass(frozen=True)
class Overlay:
    """Odometry in the local frame.

    Parameters
    ----------
    times : (m,) array
        Seconds since 1970, on the receiver's clock.
    places : (m, 2) array
        East and north, metres.
    clock : ClockEstimate
        Of the odometry against the positions.
    rms : float
        Of the level distances from the RTK-fixed positions, metres.
    matched : int
        Positions that were compared.
    lengths : (2,) array
        Of the way between these, by the receiver and by the odometry, metres.
    """

    times: Array
    places: Array
    clock: ClockEstimate
    rms: float
    matched: int
    lengths: Array


def odometry_overlay(path: Path, fixed: Trajectory) -> Overlay:
    """Odometry turned and moved onto the RTK-fixed positions, by least squares of all of them.

    Parameters
    ----------
    path : Path
        A trajectory of any format.
    fixed : Trajectory
        The RTK-fixed positions in time.

    Raises
    ------
    GtvalError
        If the file is bad, or the two have too few times in common.

    Notes
    -----
    Its clock is set right first, where the motion tells it. Where the odometer is on the vehicle,
    and how it drifts, is not known here: both are in the distances.
    """
    odometry = read_trajectory(path, system="odometry")
    clock = estimate_clock(fixed, odometry)
    moved = on_reference_clock(odometry, clock) if clock.verdict == "determined" else odometry
    flat = moved.planar()
    times = flat.times_since(fixed.epoch)
    after = np.clip(np.searchsorted(times, fixed.times), 1, len(times) - 1)
    near = (fixed.times >= times[0]) & (fixed.times <= times[-1])
    near &= times[after] - times[after - 1] <= flat.gap
    if near.sum() < FEWEST:
        raise GtvalError(
            f"{path}: {int(near.sum())} RTK-fixed positions lie within its time; at least {FEWEST} "
            "are needed to lay it over them. Are both of one drive and clock?"
        )
    own = flat.positions
    at = np.column_stack([np.interp(fixed.times[near], times, column) for column in own.T])
    there = fixed.poses[near, :2]
    rotation, shift, _ = umeyama(there, at)
    left = np.linalg.norm(at @ rotation.T + shift - there, axis=1)
    joined = np.diff(np.flatnonzero(near)) == 1
    lengths = [np.linalg.norm(np.diff(way, axis=0), axis=1)[joined].sum() for way in (there, at)]
    return Overlay(
        times + fixed.epoch, own @ rotation.T + shift, clock,
        float(np.sqrt(np.mean(left**2))), int(near.sum()), np.array(lengths),
    )  # fmt: skip
