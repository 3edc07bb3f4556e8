"""Poses at stops, out of a trajectory: where the robot stands, and for how long."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable
from validation.poses.trajectory import Trajectory
from validation.text_files.csv_tables import Column, read_csv
from validation.trajectories.memory import inflation_of

SHORTEST_STANDSTILL = 2.0
"""Seconds. A judgement: people leave a robot standing for longer while they measure; a robot that
turns on its way may be slow for a second."""
STILL_WINDOW = 1.0
"""Seconds over which a robot that stands must not have moved: at 10 Hz ten poses, whose mean is
three times as sure as one."""
STILL_SIGMAS = 4.0
"""Standard deviations of the difference of two half windows that noise may reach: noise alone
breaks a standstill of a minute (600 differences, of which 60 are independent) once in 250."""
SLOWEST = 0.005
"""Metres, and radians, that a standing robot may move within a window: what a floor and
a mount give way. A robot that creeps at 5 mm/s is taken as standing."""
DRIVES = 0.05
"""Metres that a robot may move within a stop; beyond, it has no pose there. A judgement: rigs that
settle and arms that swing move by less, and who errs by a second at walking speed by more."""
LONE_POSES = 5
"""Poses of the running median: two wrong ones in a row do not end a standstill."""
MARGIN = 0.3
"""Seconds taken off both ends of a standstill that was found: a robot still rocks, and the window
sees the end late by half of its length."""
OUTLIER_SIGMAS = 5.0
"""Robust standard deviations from the median beyond which a single pose of a stop is left out:
normal noise loses one of 1.7 million poses."""
FEWEST = 3
"""Poses within a stop; fewer have no scatter to speak of."""
MOST_HIDDEN = 0.8
"""Of the variance of an error that lasts as long as a stop, which a stop's own scatter lacks."""
POOLED_POSES = 8
"""Independent poses that the scatter of all stops counts for in that of one: a stop of eight
correlation times has a scatter that is a third off by itself. A judgement."""


@dataclass(frozen=True)
class Stop:
    """A name and an interval of time in which the robot stands.

    Parameters
    ----------
    name : str
        Of the pose.
    start, end : float
        Seconds, on the clock of the trajectory, epoch included.
    """

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class StopPoses:
    """Poses of the stops, and what became of those without.

    Parameters
    ----------
    table : PoseTable
        One pose a stop that the trajectory saw.
    counts : mapping of str to int
        Poses of the trajectory that each stop's pose is the mean of.
    left_out : mapping of str to int
        Poses left out of a stop as outliers.
    missing : mapping of str to str
        Stops without a pose, and why.
    inflation : (k,) array
        How many times the variance of a stop's mean is larger than that of as many independent
        poses; NaN where too few poses tell it.
    moved : mapping of str to float
        Stops within which the trajectory moves by more than noise allows, and how far, in metres.
    """

    table: PoseTable
    counts: dict[str, int]
    left_out: dict[str, int]
    missing: dict[str, str]
    inflation: Array
    moved: dict[str, float]


def read_stops(path: Path) -> list[Stop]:
    """Stops from a CSV file with the columns pose, from and to, in seconds.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    cells = read_csv(
        path,
        [Column("pose"), Column("from", "number", unit="s"), Column("to", "number", unit="s")],
    )
    cells.flag_duplicates(["pose"])
    start, end = cells.numbers["from"], cells.numbers["to"]
    for row in np.flatnonzero(np.asarray(end, dtype=float) <= np.asarray(start, dtype=float)):
        cells.flag(int(row), "to", "a stop must end after its start")
    if not len(cells):
        cells.problems.append(Problem(path, "the file has a header but no stop", 1))
    cells.raise_problems()
    return [
        Stop(name, float(a), float(b))
        for name, a, b in zip(cells.text["pose"], start, end, strict=True)
    ]


def find_standstills(trajectory: Trajectory, shortest: float = SHORTEST_STANDSTILL) -> Array:
    """Intervals in which the robot stands.

    Parameters
    ----------
    trajectory : Trajectory
        With n poses or positions.
    shortest : float
        Seconds that a standstill lasts at least.

    Returns
    -------
    (m, 2) array
        Start and end of each, seconds since the trajectory's epoch. None reaches over a gap.

    Notes
    -----
    A pose belongs to a standstill where the mean of half a window after it differs from that of
    half a window before it by less than `STILL_SIGMAS` of what noise allows. The noise is that of
    second differences, in which a steady motion leaves no trace.
    """
    times, n = trajectory.times, len(trajectory)
    if n < 2 * FEWEST:
        return np.empty((0, 2))
    numbers = _numbers(trajectory)
    half = STILL_WINDOW / 2
    sums = np.vstack([np.zeros(numbers.shape[1]), np.cumsum(numbers - numbers.mean(0), axis=0)])
    low = np.searchsorted(times, times - half)
    high = np.searchsorted(times, times + half, side="right")
    at = np.arange(n)
    before, after = at + 1 - low, high - at
    enough = (before >= FEWEST) & (after >= FEWEST)
    difference = (sums[high] - sums[at]) / np.maximum(after, 1)[:, None] - (
        sums[at + 1] - sums[low]
    ) / np.maximum(before, 1)[:, None]
    noise = _noise(numbers) * np.sqrt(1 / before + 1 / after)[:, None]
    still = enough & (np.abs(difference) < np.maximum(STILL_SIGMAS * noise, SLOWEST)).all(1)
    runs = _runs(times, still, trajectory.gap)
    near = np.maximum(STILL_SIGMAS * _noise(numbers) / np.sqrt(FEWEST), SLOWEST)
    return _joined(times, numbers, runs, near, shortest)


def _runs(times: Array, still: npt.NDArray[np.bool_], gap: float) -> list[tuple[int, int]]:
    """First and last row of each run of still poses."""
    breaks = np.flatnonzero((np.diff(still.astype(int)) != 0) | (np.diff(times) > gap)) + 1
    edges = np.concatenate([[0], breaks, [len(times)]])
    return [(int(a), int(b) - 1) for a, b in itertools.pairwise(edges) if still[a]]


def _joined(
    times: Array, numbers: Array, runs: list[tuple[int, int]], near: Array, shortest: float
) -> Array:
    """(m, 2) times of the runs that last, margins taken off.

    Runs at one place that noise has parted for less than a window are one.
    """
    joined: list[tuple[int, int]] = []
    for start, end in runs:
        if joined and times[start] - times[joined[-1][1]] < STILL_WINDOW:
            first, last = joined[-1]
            apart = np.abs(numbers[first : last + 1].mean(0) - numbers[start : end + 1].mean(0))
            if (apart < near).all():
                joined[-1] = (first, end)
                continue
        joined.append((start, end))
    found = [
        (times[a] + MARGIN, times[b] - MARGIN)
        for a, b in joined
        if times[b] - times[a] >= max(shortest, 3 * MARGIN)
    ]
    return np.array(found).reshape(-1, 2)


def _numbers(trajectory: Trajectory) -> Array:
    """(n, m) positions, and cosine and sine of the heading where there is one.

    A running median of `LONE_POSES` takes out single poses that are wrong, as heading flips are.
    """
    numbers = trajectory.positions
    if trajectory.has_orientation:
        headings = trajectory.headings
        numbers = np.column_stack([numbers, np.cos(headings), np.sin(headings)])
    return np.asarray(median_filter(numbers, size=(LONE_POSES, 1), mode="nearest"))


def _noise(numbers: Array) -> Array:
    """(m,) robust standard deviation of one pose's noise, by second differences.

    Taken `LONE_POSES` apart, where a running median has left the noise independent.
    """
    k = LONE_POSES
    second = numbers[2 * k :] - 2 * numbers[k:-k] + numbers[: -2 * k]
    if not len(second):
        return np.zeros(numbers.shape[1])
    return np.asarray(1.4826 * np.median(np.abs(second), axis=0) / np.sqrt(6.0))


def poses_at_stops(trajectory: Trajectory, stops: Sequence[Stop]) -> StopPoses:
    """One pose a stop: the mean of the poses within, with its covariance.

    Parameters
    ----------
    trajectory : Trajectory
        Poses, or positions.
    stops : sequence of Stop
        On the trajectory's clock.

    Raises
    ------
    GtvalError
        If the trajectory saw none of them.

    Notes
    -----
    The scatter S of n poses within a stop gives their mean the covariance ``f S / n``; f counts
    that neighbours are correlated, and is found from all stops together, because one stop alone
    is too short to tell it. Where the trajectory states covariances C, what the scatter does not
    show of them, the positive part of ``C - S``, is taken as an error that all poses of a stop
    share, and added: no mean makes it smaller.
    """
    inside: dict[str, Array] = {}
    kept, missing, left_out, ways = {}, {}, {}, {}
    seconds = trajectory.times + trajectory.epoch
    for stop in stops:
        rows = np.flatnonzero((seconds >= stop.start) & (seconds <= stop.end))
        if len(rows) < FEWEST:
            missing[stop.name] = _why_missing(stop, seconds, len(rows))
            continue
        deviations = _deviations(trajectory, rows)
        path, noise = _movement(deviations)
        # Neighbours are correlated: a robot that drives moves by many times the noise.
        if path > max(DRIVES, 20.0 * noise):
            missing[stop.name] = f"the robot moves by {path:.2f} m in it"
            continue
        ways[stop.name] = path, noise
        spread = 1.4826 * np.median(np.abs(deviations), axis=0)
        usual = (np.abs(deviations) <= OUTLIER_SIGMAS * np.maximum(spread, 1e-9)).all(1)
        if usual.sum() < FEWEST:
            missing[stop.name] = "its poses do not agree with each other"
            continue
        kept[stop.name], left_out[stop.name] = rows[usual], int((~usual).sum())
        inside[stop.name] = deviations[usual]
    if not kept:
        first = f"; {next(iter(missing))}: {next(iter(missing.values()))}" if missing else ""
        raise GtvalError(f"'{trajectory.system}' saw none of the {len(stops)} stops{first}")
    steady = [inside[name] for name in kept if ways[name][0] < max(5 * ways[name][1], SLOWEST)]
    inflation = inflation_of(steady or list(inside.values()))
    slow = float(np.sqrt(np.nanmax([1.0, *inflation[:2]])))
    moved = {
        name: path
        for name, (path, noise) in ways.items()
        if name in kept and path > max(STILL_SIGMAS * slow * noise, SLOWEST)
    }
    table = _table(trajectory, kept, inside, inflation, moved)
    counts = {name: len(rows) for name, rows in kept.items()}
    return StopPoses(
        table, counts, {k: v for k, v in left_out.items() if v}, missing, inflation, moved
    )


def _why_missing(stop: Stop, seconds: Array, count: int) -> str:
    """Why a stop has no pose."""
    if stop.end < seconds[0] or stop.start > seconds[-1]:
        where = "before the first" if stop.end < seconds[0] else "after the last"
        return f"{stop.start:.3f} to {stop.end:.3f} s is {where} pose of the trajectory"
    return f"{count or 'no'} poses in {stop.start:.3f} to {stop.end:.3f} s; {FEWEST} are needed"


def _deviations(trajectory: Trajectory, rows: npt.NDArray[np.intp]) -> Array:
    """(n, m) differences of poses from their median pose, rotations about the fixed axes."""
    poses, d = trajectory.poses[rows], trajectory.dimensions
    flat = poses[:, :d] - np.median(poses[:, :d], axis=0)
    if trajectory.kind == "plane":
        turned = wrap(poses[:, 2] - _central_heading(poses[:, 2]))
        return np.column_stack([flat, turned])
    if trajectory.kind == "space":
        rotations = Rotation.from_quat(poses[:, d:])
        return np.column_stack([flat, (rotations * rotations.mean().inv()).as_rotvec()])
    return flat


def _central_heading(headings: Array) -> float:
    """Median on the circle; half a turn in some poses does not move it."""
    near = wrap(headings[:, None] - headings[:: max(1, len(headings) // 50)])
    centre = headings[:: max(1, len(headings) // 50)][int(np.abs(near).sum(0).argmin())]
    return float(centre + np.median(wrap(headings - centre)))


def _movement(deviations: Array) -> tuple[float, float]:
    """Metres between the medians of the first and last quarter, and the noise of independent poses.

    The noise is the standard deviation of the difference in each axis.
    """
    quarter = max(len(deviations) // 4, 1)
    parts = deviations[:quarter, :2], deviations[-quarter:, :2]
    middles = [np.median(part, axis=0) for part in parts]
    spread = max(
        float((1.4826 * np.median(np.abs(part - middle), axis=0)).max())
        for part, middle in zip(parts, middles, strict=True)
    )
    return float(np.linalg.norm(middles[0] - middles[1])), 1.25 * spread * np.sqrt(2 / quarter)


def _table(
    trajectory: Trajectory,
    kept: dict[str, npt.NDArray[np.intp]],
    inside: dict[str, Array],
    inflation: Array,
    moved: dict[str, float],
) -> PoseTable:
    """The means of the stops, with their covariances.

    A robot that moves a little within a stop was anywhere along that way when it was surveyed.
    """
    poses, covariances = [], []
    grown = np.sqrt(np.where(np.isfinite(inflation), inflation, 1.0))
    # A system that repeats its numbers to the last digit has no scatter: one nanometre.
    nothing = 1e-18 * np.eye(len(grown))
    scatters = {name: np.cov(inside[name], rowvar=False) + nothing for name in kept}
    usual = np.diag(np.median([np.diagonal(one) for one in scatters.values()], axis=0))
    for name, rows in kept.items():
        chosen = trajectory.select(rows)
        own = len(rows) / max(grown) ** 2
        scatter = (own * scatters[name] + POOLED_POSES * usual) / (own + POOLED_POSES)
        # Errors that last as long as the stop do not scatter in it: the share that hides is added.
        hidden = 1 / np.sqrt(1 - np.minimum(grown**2 / len(rows), MOST_HIDDEN))
        covariance = (grown * hidden)[:, None] * scatter * (grown * hidden) / len(rows)
        stated = chosen.covariances[chosen.has_covariance]
        if len(stated) == len(rows):
            covariance = covariance + _positive_part(stated.mean(0) - scatter)
        covariance[:2, :2] += np.eye(2) * moved.get(name, 0.0) ** 2 / 12
        pose, jacobian = _mean_pose(chosen)
        poses.append(pose)
        covariances.append(jacobian @ covariance @ jacobian.T)
    return PoseTable(
        system=trajectory.system,
        ids=tuple(kept),
        poses=np.array(poses),
        covariances=np.array(covariances),
        components=trajectory.components,
        sources=tuple(f"mean of {len(rows)} poses" for rows in kept.values()),
        provenance=trajectory.provenance,
    )


def _positive_part(matrix: Array) -> Array:
    """The nearest matrix without negative eigenvalues, in units in which the diagonal is one."""
    scale = np.sqrt(np.maximum(np.abs(np.diagonal(matrix)), 1e-30))
    values, vectors = np.linalg.eigh(matrix / scale[:, None] / scale)
    rest = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(scale[:, None] * rest * scale)


def _mean_pose(chosen: Trajectory) -> tuple[Array, Array]:
    """The mean of poses as a table has it, and its Jacobian by rotations about the fixed axes."""
    position = chosen.positions.mean(0)
    if chosen.kind == "plane":
        centre = _central_heading(chosen.headings)
        heading = wrap(centre + wrap(chosen.headings - centre).mean())
        return np.append(position, heading), np.eye(3)
    if chosen.kind == "space":
        yaw, pitch, roll = chosen.rotations.mean().as_euler("ZYX")
        # Rates of yaw, pitch and roll from a rotation about the fixed axes X, Y, Z.
        c, s, t = np.cos(yaw), np.sin(yaw), np.tan(pitch)
        jacobian = np.eye(6)
        jacobian[3:, 3:] = [
            [c * t, s * t, 1.0],
            [-s, c, 0.0],
            [c / np.cos(pitch), s / np.cos(pitch), 0.0],
        ]
        return np.append(position, [yaw, pitch, roll]), jacobian
    return position, np.eye(len(position))


def check_stops(stops: Sequence[Stop], path: Path) -> None:
    """Raise where two stops overlap: the robot cannot stand at two places at once.

    Raises
    ------
    InputError
        Naming both stops.
    """
    ordered = sorted(stops, key=lambda stop: stop.start)
    problems = [
        Problem(path, f"overlaps the stop '{before.name}'", field="pose", value=after.name)
        for before, after in itertools.pairwise(ordered)
        if after.start < before.end
    ]
    if problems:
        raise InputError(problems)
