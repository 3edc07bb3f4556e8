"""The measurements of all sources in one time, as a problem along a chain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.stamps import frame_line
from validation.trajectories.smoothing.geometry import half_turn
from validation.trajectories.smoothing.problem import Frames, Mask, Problem, Rows
from validation.trajectories.smoothing.source import Source
from validation.trajectories.smoothing.start import (
    NEAR,
    knots_of,
    knots_with_odometry,
    odometry_steps,
)

ODOMETRY_ERRORS = (("length", 0.05), ("turn", 0.05), ("bias", 0.01))
"""Standard deviations of the errors of scale of odometry, and of a constant turn, rad/s, before
anything is seen: a wheel is measured to a few percent, a gyroscope turns by half a degree
a second."""
LEAST_JITTER = 0.002
"""Share of the period; stamps of less jitter are used as they are."""


@dataclass(frozen=True)
class Stamped:
    """Times of one source in the common time.

    Parameters
    ----------
    times : (n,) array
        Used for its frames, seconds since the common epoch; in order.
    rows : (n,) array of int
        Row of the trajectory of each.
    since : (n,) array
        Seconds since its delay holds.
    taken : (n,) array
        Seconds of jitter that were taken off the stamps, zero where they are used as they are.
    gap : float
        Longest interval that is no gap.
    """

    times: Array
    rows: Rows
    since: Array
    taken: Array
    gap: float


def stamped(source: Source, epoch: int, smooth: bool) -> Stamped:
    """Stamps of a source in the common time.

    Parameters
    ----------
    smooth : bool
        Whether the jitter of a source with a rate is taken off.
    """
    own = source.trajectory
    stamps = own.times
    taken = np.zeros(len(stamps))
    if smooth and own.clock.stamps != "capture":
        grid = frame_line(stamps)
        if grid is not None and grid.jitter > LEAST_JITTER * grid.period:
            taken, stamps = stamps - grid.times, grid.times
    middle = float(own.times[0] + own.times[-1]) / 2 if source.at_s is None else source.at_s
    since = stamps - middle
    times = stamps + (own.epoch - epoch) + source.delay_s + source.drift_ppm * 1e-6 * since
    order = np.argsort(times, kind="stable")
    return Stamped(times[order], order, since[order], taken[order], own.gap)


def check(sources: Sequence[Source], odometry: Trajectory | None) -> None:
    """Raise where these cannot be fused.

    Raises
    ------
    GtvalError
        Without a source, for sources of different kinds, for fewer than three poses, for odometry
        beside positions without orientation.
    """
    if not sources:
        raise GtvalError("nothing to fuse: give at least one source")
    first = sources[0].trajectory
    for source in sources:
        own = source.trajectory
        if own.kind != first.kind:
            raise GtvalError(
                f"'{own.system}' has {_words(own)}, '{first.system}' has {_words(first)}; "
                "give all sources as poses in the plane, or all in space"
            )
        if len(own) < 3:
            raise GtvalError(f"'{own.system}' has {len(own)} poses; at least three are needed")
    if odometry is not None and odometry.kind != first.kind:
        raise GtvalError(
            f"the odometry '{odometry.system}' has {_words(odometry)}, '{first.system}' has "
            f"{_words(first)}; odometry needs the same kind of poses"
        )
    if odometry is not None and not odometry.has_orientation:
        raise GtvalError("odometry without orientation tells no motion of the robot's own")


def _words(trajectory: Trajectory) -> str:
    return {
        "plane": "poses in the plane",
        "space": "poses in space",
        "points_plane": "positions in the plane",
        "points_space": "positions in space",
    }[trajectory.kind]


def gathered(
    sources: Sequence[Source], stamps: Sequence[Stamped], odometry: Trajectory | None
) -> Problem:
    """All measurements along one chain of knots."""
    first = sources[0].trajectory
    times = np.concatenate([one.times for one in stamps])
    order = np.argsort(times, kind="stable")
    near = NEAR * min(float(np.median(np.diff(one.times))) for one in stamps)
    times = times[order]
    if odometry is None:
        knots, knot = knots_of(times, near)
    else:
        shift = odometry.epoch - first.epoch
        odometry = replace(odometry, times=odometry.times + shift, epoch=first.epoch)
        knots, knot = knots_with_odometry(times, near, odometry)
        # Frames that share a sample stay in its order.
        by_knot = np.argsort(knot, kind="stable")
        order, times, knot = order[by_knot], times[by_knot], knot[by_knot]
    frames = Frames(
        knot,
        times - knots[knot],
        np.repeat(np.arange(len(sources)), [len(one.times) for one in stamps])[order],
        np.concatenate([one.rows for one in stamps])[order],
        np.concatenate(
            [s.trajectory.poses[one.rows] for s, one in zip(sources, stamps, strict=True)]
        )[order],
        _stated(sources, stamps, order),
        np.concatenate([one.since for one in stamps])[order],
    )
    steps = None if odometry is None else odometry_steps(knots, odometry)
    if steps is not None and not steps.known.any():
        raise GtvalError("the odometry and the sources have no time in common")
    shared = [
        (name, number, sigma * unit)
        for number, source in enumerate(sources)
        for name, sigma, unit in (
            ("delay", source.delay_sigma_s, 1.0),
            ("drift", source.drift_sigma_ppm, 1e-6),
        )
        if sigma > 0
    ]
    if steps is not None:
        shared += [(name, 0, sigma) for name, sigma in ODOMETRY_ERRORS]
    return Problem(
        first.kind,
        knots,
        np.ones(len(knots) - 1, dtype=bool),
        frames,
        steps,
        len(sources),
        np.array([sigma for *_, sigma in shared]),
        tuple((name, number) for name, number, _ in shared),
    )


def _stated(sources: Sequence[Source], stamps: Sequence[Stamped], order: Rows) -> Array | None:
    """Covariances as stated, unit matrices where a source states none for all of its poses."""
    if not any(source.trajectory.has_covariance.any() for source in sources):
        return None
    parts = []
    for source, one in zip(sources, stamps, strict=True):
        own = source.trajectory
        m = own.covariances.shape[1]
        if source.noise is None and states_all(own):
            parts.append(own.covariances[one.rows])
        else:
            parts.append(np.broadcast_to(np.eye(m), (len(own), m, m)))
    return np.asarray(np.concatenate(parts)[order])


def states_all(trajectory: Trajectory) -> bool:
    """Whether all poses have a covariance that can be inverted."""
    known = trajectory.has_covariance
    return bool(known.all() and (np.linalg.eigvalsh(trajectory.covariances)[:, 0] > 0).all())


def unflipped(problem: Problem, flips: Mask) -> Problem:
    """The problem with some frames turned by half a turn."""
    frames = problem.frames
    poses = frames.poses.copy()
    poses[flips] = half_turn(problem.kind, poses[flips])
    return replace(problem, frames=replace(frames, poses=poses))
