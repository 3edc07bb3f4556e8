"""Several sources of poses, with delays and odometry, into one trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.results import Finding, Size
from validation.trajectories.smoothing.asked import Weighed, at_times, shared_covariances
from validation.trajectories.smoothing.equations import Solved, solve
from validation.trajectories.smoothing.frames import frame_findings
from validation.trajectories.smoothing.gathering import (
    Stamped,
    check,
    gathered,
    stamped,
    states_all,
    unflipped,
)
from validation.trajectories.smoothing.geometry import difference, strength_groups
from validation.trajectories.smoothing.neighbours import grown_by_neighbours
from validation.trajectories.smoothing.noise import (
    Name,
    Noise,
    estimate_noise,
    frame_covariances,
    odometry_noise,
    seen_covariances,
    strengths,
    weights_of,
)
from validation.trajectories.smoothing.problem import (
    Mask,
    Problem,
    State,
    frame_residuals,
    residuals,
)
from validation.trajectories.smoothing.source import Fused, Source, SourceNoise
from validation.trajectories.smoothing.start import (
    both_sides,
    first_poses,
    rough_sigmas,
    rough_trust,
    running_medians,
)
from validation.trajectories.smoothing.trust import outlier_shares, trust, unflip

STRETCHES, STRETCH = 5, 300
"""Parts of the record, and knots of each, from which noise and strength are estimated: 1,500 knots
tell a standard deviation to 2 % or so, and a solution takes a few hundredths of a second."""
ODOMETRY_STRETCH = 1500
"""The same with odometry, whose noise shows only over the time in which its walk outgrows the noise
of the poses: half a minute at 50 Hz. With 300 it ran to nothing on drives with noise of 15 mm, and
squared errors of the headings were a hundred times their covariances."""
STEP = 1e-3
"""Seconds of jitter of stamps that the first pass assumes."""
GRID_WRONG = 0.5
"""Share of the jitter taken off that the poses ask back: 0 where stamps are late and frames
regular, 1 where the frames come irregularly and are stamped rightly."""
MANY_OUTLIERS = 0.1
"""Share of a source's frames that is worth a word: twice the worst that was simulated."""


@dataclass
class _Work:
    """What changes while a fusion runs."""

    problem: Problem
    state: State
    noise: Noise
    trusted: Array
    flips: Mask
    shares: Array


def fuse(
    sources: Sequence[Source],
    *,
    odometry: Trajectory | None = None,
    times: npt.ArrayLike | None = None,
    common: Sequence[npt.NDArray[np.floating[Any]]] | None = None,
) -> Fused:
    """The trajectory that all sources together tell; with one source its smoothed trajectory.

    Parameters
    ----------
    sources : sequence of Source
        Poses of the robot, all in one frame and of one kind.
    odometry : Trajectory, optional
        Poses of the robot in a frame of their own, which may drift; its stamps are the common
        time. Only its motions from sample to sample count.
    times : (n,) array_like, optional
        Increasing seconds since the epoch of the first source. By default the times of the frames.
    common : sequence of (n, m, u) arrays, optional
        For each source the change of its poses by each of u independent errors of variance one,
        which all poses of all sources share.

    Returns
    -------
    Fused
        With covariances at all times, which grow where nothing is seen.

    Raises
    ------
    GtvalError
        If the sources cannot be fused.

    Notes
    -----
    The prior is white noise on acceleration in continuous time (Barfoot, State Estimation for
    Robotics, chapters 3.4 and 11). Its strength, the noise of every source and that of the
    odometry are those under which stretches of the record are most likely. All data count for
    every pose (fixed interval). Outliers are told by their probability under two normal
    distributions; headings off by half a turn are turned back. Jitter of receipt is taken off the
    stamps of sources with a rate, and what remains counts along the motion. An uncertain delay is
    one more unknown for all frames of a source, and part of every covariance.
    """
    check(sources, odometry)
    epoch = sources[0].trajectory.epoch
    smooth = [True] * len(sources)
    work, stamps = _started(sources, odometry, epoch, smooth)
    names = _estimated(sources, work.problem)
    _learn(work, names)
    _pass(work, marginals=False, hold=True)
    wrong = _grid_wrong(work, stamps)
    if any(wrong):
        smooth = [a and not b for a, b in zip(smooth, wrong, strict=True)]
        work, stamps = _started(sources, odometry, epoch, smooth)
        _learn(work, names)
        _pass(work, marginals=False, hold=True)
    if work.problem.shared_of:
        _pass(work, marginals=False)
    _learn(work, names, rounds=1)
    _pass(work, marginals=True)
    work.noise = grown_by_neighbours(work.problem, work.state, work.noise, work.trusted > 0.5)
    solved, seen = _step(work)
    told = _told(sources, stamps, work, solved, times)
    if common is None:
        return told
    return replace(told, shared=_shared(work.problem, solved, seen, common, told.trajectory.times))


def _shared(
    problem: Problem,
    solved: Solved,
    seen: Weighed,
    common: Sequence[npt.NDArray[np.floating[Any]]],
    times: Array,
) -> Array:
    """What errors that all sources share add to the covariances."""
    frames = problem.frames
    each = np.empty((len(frames.row), *common[0].shape[1:]), dtype=common[0].dtype)
    for number, own in enumerate(common):
        rows = frames.source == number
        each[rows] = own[frames.row[rows]]
    return shared_covariances(problem, solved, seen, each, times)


def _started(
    sources: Sequence[Source], odometry: Trajectory | None, epoch: int, smooth: list[bool]
) -> tuple[_Work, list[Stamped]]:
    """Measurements, a rough trajectory, rough noise."""
    stamps = [stamped(s, epoch, keep) for s, keep in zip(sources, smooth, strict=True)]
    problem = gathered(sources, stamps, odometry)
    frames, kind = problem.frames, problem.kind
    medians = running_medians(kind, frames.poses)
    flips = unflip(kind, frames, medians)
    problem = unflipped(problem, flips)
    off = difference(kind, problem.frames.poses, medians)
    sigmas = rough_sigmas(kind, problem.frames.poses, frames.source, problem.count)
    trusted = rough_trust(kind, off, frames.source, sigmas)
    position, angle = sigmas
    at = problem.times[frames.knot] + frames.offset
    poses = first_poses(problem, at, medians)
    state = State(poses, np.zeros((len(poses), problem.m)), np.zeros(len(problem.shared)))
    for number, source in enumerate(sources):
        if source.noise is not None:
            position[number], angle[number] = source.noise
        elif states_all(source.trajectory):
            position[number] = angle[number] = 1.0
    noise = Noise(
        np.full(len(strength_groups(kind)), 0.1),
        position,
        angle,
        np.full(problem.count, STEP),
        np.array([1e-3, 0.01, 1e-3, 0.01, 1e-3, 0.01]),
    )
    shares = np.full(problem.count, 0.02)
    return _Work(problem, state, noise, trusted, flips, shares), stamps


def _estimated(sources: Sequence[Source], problem: Problem) -> list[Name]:
    """What of the noise is estimated."""
    names = [("strength", g) for g in range(len(strength_groups(problem.kind)))]
    for number, source in enumerate(sources):
        if source.noise is None:
            names.append(("position", number))
            if source.trajectory.has_orientation:
                names.append(("angle", number))
        names.append(("jitter", number))
    return names


def _learn(work: _Work, names: list[Name], rounds: int = 2) -> None:
    """Noise from stretches of the record, where the outliers are told apart at the same time."""
    frames = work.problem.frames
    count = len(work.problem.times)
    stretch = STRETCH if work.problem.steps is None else ODOMETRY_STRETCH
    if count <= STRETCHES * stretch:
        parts = [(0, count)]
    else:
        middles = frames.knot[np.linspace(0, len(frames.knot) - 1, STRETCHES + 2).astype(int)[1:-1]]
        half = stretch // 2
        parts = _apart([(max(0, k - half), min(count, k + half)) for k in middles])
    part, knots, kept = work.problem.stretch(parts)
    state = State(work.state.poses[knots], work.state.rates[knots], work.state.shared)
    inner = _Work(part, state, work.noise, work.trusted[kept], work.flips[kept], work.shares)
    for _ in range(rounds):
        _pass(inner, marginals=False, hold=True, retrust=False)
        good = inner.trusted > 0.5
        clean = replace(inner.problem, frames=inner.problem.frames.select(good))
        inner.noise = odometry_noise(clean, inner.state, inner.noise)
        inner.noise = estimate_noise(clean, inner.state, inner.noise, names)
        _pass(inner, marginals=True, hold=True)
    work.noise, work.shares = inner.noise, inner.shares
    work.state.poses[knots] = inner.state.poses
    work.state.rates[knots] = inner.state.rates
    work.trusted[kept] = inner.trusted


def _apart(parts: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stretches that overlap become one."""
    joined: list[tuple[int, int]] = []
    for a, b in parts:
        if joined and a <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(b, joined[-1][1]))
        else:
            joined.append((a, b))
    return joined


def _pass(work: _Work, *, marginals: bool, hold: bool = False, retrust: bool = True) -> None:
    """One step of Gauss and Newton, after which every frame is judged anew.

    Parameters
    ----------
    marginals : bool
        Whether the trajectory's own uncertainty counts when a frame is judged.
    hold : bool
        Whether the shared unknowns stay.
    retrust : bool
        Whether frames are judged.
    """
    solved = _step(work, hold)[0]
    if retrust:
        _judge(work, solved if marginals else None)


def _step(work: _Work, hold: bool = False) -> tuple[Solved, Weighed]:
    """One step of Gauss and Newton, and the frames as it took them."""
    problem = work.problem
    found = residuals(problem, work.state)
    weights = weights_of(problem, found, work.noise, work.trusted)
    solved = solve(problem, found, weights, work.state.shared, hold)
    work.state = work.state.moved(problem.kind, solved.changes, solved.shared)
    return solved, Weighed(weights.frames, found.offset, found.along)


def _judge(work: _Work, solved: Solved | None) -> None:
    """Flips and trust of every frame from its residual."""
    problem = work.problem
    again = unflip(problem.kind, problem.frames, work.state.poses[problem.frames.knot])
    if again.any():
        work.problem = problem = unflipped(problem, again)
        work.flips = work.flips ^ again
    seen, offset, along = frame_residuals(problem, work.state)
    spread = frame_covariances(problem, work.noise, along)
    if solved is not None and (work.trusted < 0.5).any():
        # A frame that does not count is judged by a trajectory that does not know it.
        blank = 1 - work.trusted
        knot = problem.frames.knot
        for start, inverse, beside in solved.factor.covariances():
            rows = slice(*np.searchsorted(knot, [start, start + len(beside)]))
            own = seen_covariances(inverse[knot[rows] - start], offset[rows, None, None])
            spread[rows] += blank[rows, None, None] * own
    squares = np.einsum("fi,fi->f", seen, np.linalg.solve(spread, seen[..., None])[..., 0])
    source = problem.frames.source
    for _ in range(3):
        work.trusted = trust(squares, source, work.shares, problem.m)
        work.shares = outlier_shares(work.trusted, source, problem.count)


def _taken(work: _Work, stamps: Sequence[Stamped]) -> Array:
    """(f,) jitter taken off the stamp of each frame."""
    found = np.empty(len(work.problem.frames.knot))
    for number, one in enumerate(stamps):
        own = work.problem.frames.source == number
        found[own] = one.taken
    return found


def _grid_wrong(work: _Work, stamps: Sequence[Stamped]) -> list[bool]:
    """For each source whether the poses ask for the jitter that was taken off its stamps."""
    problem, taken = work.problem, _taken(work, stamps)
    if not taken.any():
        return [False] * problem.count
    seen, _, along = frame_residuals(problem, work.state)
    inverse = np.linalg.inv(frame_covariances(problem, work.noise, along))
    inverse *= work.trusted[:, None, None]
    late = along * taken[:, None]
    top = np.einsum("fi,fij,fj->f", late, inverse, seen)
    bottom = np.einsum("fi,fij,fj->f", late, inverse, late)
    source, count = problem.frames.source, problem.count
    asked = np.bincount(source, top, count)
    whole = np.bincount(source, bottom, count)
    return [bool(w > 0 and a > GRID_WRONG * w) for a, w in zip(asked, whole, strict=True)]


def _told(
    sources: Sequence[Source],
    stamps: Sequence[Stamped],
    work: _Work,
    solved: Solved,
    times: npt.ArrayLike | None,
) -> Fused:
    """The result at the times asked for."""
    problem, noise = work.problem, work.noise
    asked = problem.times if times is None else np.asarray(times, dtype=float)
    strength = strengths(problem, noise)
    poses, rates, covariances = at_times(problem, work.state, solved, strength, asked)
    frames = problem.frames
    at = problem.times[frames.knot] + frames.offset
    good = [at[(frames.source == q) & (work.trusted > 0.5)] for q in range(problem.count)]
    supported = both_sides(asked, good, [one.gap for one in stamps])
    first = sources[0].trajectory
    trajectory = Trajectory(
        "fused",
        asked,
        poses,
        problem.kind,
        covariances,
        epoch=first.epoch,
        clock=Clock("capture"),
        longest_interval=min(one.gap for one in stamps),
        frame=first.frame,
        child_frame=first.child_frame,
    )
    names = [component.name for component in first.components]
    told = tuple(_source_noise(sources, stamps, work, solved, q) for q in range(problem.count))
    order = [np.argsort(frames.row[frames.source == q]) for q in range(problem.count)]
    return Fused(
        trajectory,
        supported,
        rates,
        told,
        dict(zip(names, strength.tolist(), strict=False)),
        _odometry(work),
        tuple(work.trusted[frames.source == q][o] for q, o in enumerate(order)),
        tuple(work.flips[frames.source == q][o] for q, o in enumerate(order)),
        (
            *frame_findings(sources, stamps),
            *_findings(told, work, supported),
        ),
    )


def _source_noise(
    sources: Sequence[Source], stamps: Sequence[Stamped], work: _Work, solved: Solved, q: int
) -> SourceNoise:
    own = work.problem.frames.source == q
    delay, sigma = sources[q].delay_s, sources[q].delay_sigma_s
    if ("delay", q) in work.problem.shared_of:
        place = work.problem.shared_of.index(("delay", q))
        delay += float(work.state.shared[place])
        sigma = float(np.sqrt(solved.shared_covariance[place, place]))
    oriented = sources[q].trajectory.has_orientation
    return SourceNoise(
        sources[q].trajectory.system,
        float(work.noise.position[q]),
        float(work.noise.angle[q]) if oriented else float("nan"),
        float(work.noise.jitter[q]),
        float(stamps[q].taken.std()),
        float(np.mean(work.trusted[own] < 0.5)),
        delay,
        sigma,
    )


def _odometry(work: _Work) -> dict[str, float]:
    """Noise and errors of scale of the odometry."""
    if work.problem.steps is None:
        return {}
    names = [f"{part}_{per}" for part in ("along", "across", "angle") for per in ("time", "way")]
    told = dict(zip(names, work.noise.odometry.tolist(), strict=True))
    shared = zip(work.problem.shared_of, work.state.shared.tolist(), strict=True)
    told.update({name: value for (name, _), value in shared if name in {"length", "turn", "bias"}})
    return told


def _findings(told: Sequence[SourceNoise], work: _Work, supported: Mask) -> tuple[Finding, ...]:
    """What a user should know, in words."""
    found = []
    for q, one in enumerate(told):
        own = work.problem.frames.source == q
        if one.outliers > MANY_OUTLIERS:
            text = (
                f"{one.outliers:.0%} of its poses agree with nothing else and were left out. Look "
                "for a wrong frame, delay or mount."
            )
            size = Size("share of poses left out", float(one.outliers))
            found.append(Finding("warning", text, one.system, "many_outliers", (size,)))
        turned = int((work.flips[own] & (work.trusted[own] > 0.5)).sum())
        if turned:
            text = f"{turned} headings were off by half a turn, and were turned back."
            size = Size("headings turned back", turned, "poses")
            found.append(Finding("note", text, one.system, "half_turns", (size,)))
    share = float(np.mean(supported)) if len(supported) else 0.0
    if share < 1:
        text = (
            f"{1 - share:.0%} of the fused poses have no data on both sides. Their covariance "
            "tells how far they may be off."
        )
        size = Size("share of poses without data on both sides", 1 - share)
        found.append(Finding("note", text, "fused", "not_supported", (size,)))
    return tuple(found)
