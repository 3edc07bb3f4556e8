"""Knots, odometry between them, and a first trajectory from running medians."""

import numpy as np
from scipy.spatial.transform import Rotation

from validation.poses.angles import Array
from validation.poses.trajectory import Kind, Trajectory
from validation.trajectories.interpolation import interpolate
from validation.trajectories.smoothing.chain import CHUNK
from validation.trajectories.smoothing.geometry import axes, difference, lengths
from validation.trajectories.smoothing.problem import Mask, Problem, Rows, Steps

NEAR = 0.1
"""Share of the shortest usual interval of a source; frames that are nearer share a knot. The rates
carry them over; what acceleration adds in half of it is 1/100 of what it adds half-way between two
frames."""
FILL = 0.05
"""Seconds; where odometry is known, knots are no farther apart. At 1 m/s and 1 rad/s the chord of a
step differs from its arc by 5 micrometres, and the prior adds nothing."""
ATTACH = 0.0125
"""Seconds; a frame so near to a sample of the odometry shares its knot. An acceleration of 1 m/s^2
adds 0.08 mm. Samples in between two others share the errors of both, so that odometry taken at the
frames' own times looks better than it is: at 50 Hz its noise came out 1.3 to 1.7 times too small,
and squared errors of the fused poses 1.6 times as large as their covariances said."""
TURN_LENGTH = 0.3
"""Metres that a wheel of a usual robot moves when it turns by a radian."""
WINDOW = 9
"""Frames of the running median. Where 1 in 40 headings is off by half a turn, five of nine are once
in a million windows; three of five are once in 6,000, which is once a drive."""
ROUGH = 8.0
"""Robust standard deviations from the median beyond which a frame is left out at first; the
median lags where a robot turns, so that this is wide. Later passes take every frame anew."""


def knots_of(times: Array, near: float) -> tuple[Array, Rows]:
    """Knots of sorted times (f,), and the knot of each: the middle of those nearer than `near`."""
    if len(times) < 2 or np.diff(times).min() >= near:
        return times.copy(), np.arange(len(times))
    firsts, start = [], 0
    while start < len(times):
        firsts.append(start)
        start = int(np.searchsorted(times, times[start] + near, side="right"))
    lasts = np.append(firsts[1:], len(times)) - 1
    knots = (times[firsts] + times[lasts]) / 2
    return knots, np.repeat(np.arange(len(firsts)), lasts - np.array(firsts) + 1)


def knots_with_odometry(times: Array, near: float, odometry: Trajectory) -> tuple[Array, Rows]:
    """Knots of sorted times (f,) and the knot of each, at samples of the odometry where it can be.

    Samples in between are knots too, at most `FILL` apart.
    """
    samples = odometry.times
    after = np.clip(np.searchsorted(samples, times), 1, len(samples) - 1)
    nearest = np.where(times - samples[after - 1] < samples[after] - times, after - 1, after)
    attached = np.abs(samples[nearest] - times) <= ATTACH
    alone, own = knots_of(times[~attached], near)
    stride = max(1, round(FILL / float(np.median(np.diff(samples)))))
    within = np.flatnonzero((samples >= times[0]) & (samples <= times[-1]))
    used = np.union1d(nearest[attached], within[::stride])
    knots = np.concatenate([samples[used], alone])
    order = np.argsort(knots, kind="stable")
    place = np.empty(len(knots), dtype=int)
    place[order] = np.arange(len(knots))
    knot = np.empty(len(times), dtype=int)
    knot[attached] = place[np.searchsorted(used, nearest[attached])]
    knot[~attached] = place[len(used) + own]
    return knots[order], knot


def odometry_steps(knots: Array, odometry: Trajectory) -> Steps:
    """Motions of the odometry between knots (n,), in the moving frame."""
    kind = odometry.kind
    at = interpolate(odometry, knots)
    known = at.supported[1:] & at.supported[:-1]
    poses = np.zeros((len(knots), odometry.poses.shape[1]))
    poses[:, -1] = 1.0
    poses[at.supported] = at.trajectory.poses
    moved = difference(kind, poses[1:], poses[:-1])
    motions = np.einsum("nji,nj->ni", axes(kind, poses[:-1]), moved)
    motions[~known] = 0.0
    d = lengths(kind)
    distance = np.hypot(
        np.linalg.norm(motions[:, :d], axis=1),
        TURN_LENGTH * np.linalg.norm(motions[:, d:], axis=1),
    )
    return Steps(motions, np.asarray(known), distance)


def _windows(count: int) -> Rows:
    """(f, w) rows about each row, shifted at the two ends."""
    width = min(WINDOW, count)
    starts = np.clip(np.arange(count) - width // 2, 0, count - width)
    return np.asarray(starts[:, None] + np.arange(width))


def running_medians(kind: Kind, poses: Array) -> Array:
    """(f, k) medians of positions, and the orientation among neighbours that agrees best."""
    rows, found = _windows(len(poses)), poses.copy()
    for start in range(0, len(poses), CHUNK):
        some = slice(start, start + CHUNK)
        found[some] = _medians(kind, poses, rows[some])
    if kind == "plane":
        found[:, 2] = np.unwrap(found[:, 2])
    return found


def _medians(kind: Kind, poses: Array, rows: Rows) -> Array:
    """(c, k) for windows (c, w) of rows."""
    d = lengths(kind)
    found = np.empty((len(rows), poses.shape[1]))
    for place in range(d):
        found[:, place] = np.median(poses[rows, place], axis=1)
    if kind == "plane":
        around = poses[rows, 2]
        agreed = np.cos(around[:, :, None] - around[:, None, :]).sum(2)
        found[:, 2] = around[np.arange(len(rows)), agreed.argmax(1)]
    elif kind == "space":
        around = poses[rows, 3:]
        agreed = (np.einsum("fik,fjk->fij", around, around) ** 2).sum(2)
        found[:, 3:] = around[np.arange(len(rows)), agreed.argmax(1)]
    return found


def between(kind: Kind, times: Array, poses: Array, knots: Array) -> Array:
    """(n, k) poses at knots, on lines between poses (f, k) at sorted times (f,)."""
    found = np.empty((len(knots), poses.shape[1]))
    for place in range(poses.shape[1]):
        found[:, place] = np.interp(knots, times, poses[:, place])
    if kind == "space":
        nearest = np.clip(np.searchsorted(times, knots), 0, len(times) - 1)
        found[:, 3:] = Rotation.from_quat(poses[nearest, 3:]).as_quat()
    return found


def first_poses(problem: Problem, times: Array, poses: Array) -> Array:
    """(n, k) poses at the knots from poses (f, k) at sorted times (f,).

    Where odometry is known the orientation follows it, so that the long way through a gap starts
    from a shape that is nearly right.
    """
    kind, knots = problem.kind, problem.times
    found = between(kind, times, poses, knots)
    if problem.steps is None:
        return found
    turns = problem.steps.motions[:, lengths(kind) :]
    if kind == "plane":
        ahead = np.concatenate([[0.0], np.cumsum(turns[:, 0])])
        off = np.unwrap(poses[:, 2] - np.interp(times, knots, ahead))
        found[:, 2] = ahead + np.interp(knots, times, off)
        return found
    nearest = np.clip(np.searchsorted(times, knots), 0, len(times) - 1)
    known = problem.steps.known
    for k in range(1, len(knots)):
        if known[k - 1] and nearest[k] == nearest[k - 1]:
            turn = Rotation.from_quat(found[k - 1, 3:]) * Rotation.from_rotvec(turns[k - 1])
            found[k, 3:] = turn.as_quat()
    return found


def rough_sigmas(kind: Kind, poses: Array, source: Rows, count: int) -> Array:
    """(2, q) first noise of positions and angles of each source, from second differences.

    Parameters
    ----------
    poses : (f, k) array
        Frames in the order of time.
    """
    d = lengths(kind)
    sigmas = np.full((2, count), 0.01)
    for number in range(count):
        own = poses[source == number]
        ahead, back = difference(kind, own[2:], own[1:-1]), difference(kind, own[:-2], own[1:-1])
        second = (ahead + back) / np.sqrt(6)
        for part, some in enumerate((second[:, :d], second[:, d:])):
            if some.size:
                sigmas[part, number] = max(float(np.median(np.abs(some))) / 0.6745, 1e-5)
    return sigmas


def rough_trust(kind: Kind, off: Array, source: Rows, sigmas: Array) -> Array:
    """(f,) first trust: zero for frames far off their running median.

    Parameters
    ----------
    off : (f, m) array
        Frames less their running median.
    sigmas : (2, q) array
        See `rough_sigmas`.
    """
    d = lengths(kind)
    far = np.zeros(len(off), dtype=bool)
    for part, some in enumerate((off[:, :d], off[:, d:])):
        far |= np.linalg.norm(some, axis=1) > ROUGH * sigmas[part, source]
    return np.where(far, 0.0, 1.0)


def both_sides(times: Array, good: list[Array], gaps: list[float]) -> Mask:
    """(n,) whether good frames stand on both sides of times (n,), and no gap in between.

    Parameters
    ----------
    good : list of (f,) arrays
        Sorted times of the frames of each source that are no outliers.
    gaps : list of float
        Seconds; the longest interval of each source that is no gap.
    """
    found = np.zeros(len(times), dtype=bool)
    together = np.sort(np.concatenate(good)) if good else np.empty(0)
    for own, gap in [*zip(good, gaps, strict=True), (together, min(gaps))]:
        if len(own) < 2:
            continue
        right = np.clip(np.searchsorted(own, times, side="left"), 1, len(own) - 1)
        left, after = own[right - 1], own[right]
        slack = 1e-9 * np.maximum(np.abs(times), 1.0)
        inside = (times >= left - slack) & (times <= after + slack)
        found |= inside & (
            (after - left <= gap) | (np.minimum(times - left, after - times) <= slack)
        )
    return found
