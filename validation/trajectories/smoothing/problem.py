"""The equations of a fusion: frames of the sources, odometry and the prior, along one chain.

A knot is a time at which the pose and its rates are unknown. A frame belongs to one knot, and lies
at most `NEAR` of the usual interval from it; the rates carry it over.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import FREEDOMS, Kind
from validation.trajectories.smoothing.geometry import (
    advance,
    axes,
    difference,
    lengths,
    step_jacobians,
    turning,
)

Rows = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Frames:
    """Frames of all sources, sorted by knot.

    Parameters
    ----------
    knot : (f,) array of int
        The knot of each.
    offset : (f,) array
        Seconds from the knot to the frame.
    source : (f,) array of int
        Number of its source.
    row : (f,) array of int
        Row in the source's trajectory.
    poses : (f, k) array
        As measured.
    stated : (f, m, m) array or None
        Covariances as stated, None where no source states any: then unit matrices are meant.
    since : (f,) array
        Seconds since its source's delay holds.
    """

    knot: Rows
    offset: Array
    source: Rows
    row: Rows
    poses: Array
    stated: Array | None
    since: Array

    def select(self, rows: npt.ArrayLike) -> "Frames":
        """Some of the frames."""
        kept = np.asarray(rows)
        stated = None if self.stated is None else self.stated[kept]
        return Frames(
            self.knot[kept],
            self.offset[kept],
            self.source[kept],
            self.row[kept],
            self.poses[kept],
            stated,
            self.since[kept],
        )


@dataclass(frozen=True)
class Steps:
    """Odometry from each knot to the next.

    Parameters
    ----------
    motions : (n - 1, m) array
        Small motion in the moving frame at the first knot.
    known : (n - 1,) array of bool
        Whether odometry spans the step.
    moved : (n - 1,) array
        Metres, turns counted as `TURN_LENGTH` metres a radian.
    """

    motions: Array
    known: Mask
    moved: Array


@dataclass(frozen=True)
class Problem:
    """Everything measured, and what is known beforehand.

    Parameters
    ----------
    kind : Kind
        Of the poses.
    times : (n,) array
        Of the knots, seconds.
    linked : (n - 1,) array of bool
        Whether the prior links a knot to the next.
    frames : Frames
        Of all sources.
    steps : Steps or None
        Odometry.
    count : int
        Number of sources.
    shared : (s,) array
        Standard deviations of the shared unknowns: delay and drift of each source that has
        any, then errors of scale and rate of odometry.
    shared_of : tuple of (str, int)
        What each is: ('delay', source), ('drift', source), ('length', 0), ('turn', 0), ('bias', 0).
    """

    kind: Kind
    times: Array
    linked: Mask
    frames: Frames
    steps: Steps | None
    count: int
    shared: Array
    shared_of: tuple[tuple[str, int], ...]

    @property
    def m(self) -> int:
        """Freedoms of a pose."""
        return FREEDOMS[self.kind]

    def stretch(self, parts: list[tuple[int, int]]) -> tuple["Problem", Rows, Rows]:
        """Some stretches of knots as a problem; also the knots and the frames that are in it."""
        knots = np.concatenate([np.arange(a, b) for a, b in parts])
        joined = np.diff(knots) == 1
        place = np.full(len(self.times), -1)
        place[knots] = np.arange(len(knots))
        kept = np.flatnonzero(place[self.frames.knot] >= 0)
        frames = self.frames.select(kept)
        frames = replace(frames, knot=place[frames.knot])
        steps = self.steps
        if steps is not None:
            some = knots[:-1].clip(max=len(steps.known) - 1)
            steps = Steps(steps.motions[some], steps.known[some] & joined, steps.moved[some])
        linked = self.linked[knots[:-1].clip(max=len(self.linked) - 1)] & joined
        part = replace(
            self,
            times=self.times[knots],
            linked=linked,
            frames=frames,
            steps=steps,
        )
        return part, knots, kept


@dataclass(frozen=True)
class State:
    """Poses and rates at the knots, and the shared unknowns.

    Parameters
    ----------
    poses : (n, k) array
        Metres, radians or quaternions.
    rates : (n, m) array
        Along and about the fixed axes.
    shared : (s,) array
        See `Problem`.
    """

    poses: Array
    rates: Array
    shared: Array

    def moved(self, kind: Kind, changes: Array, shared: Array) -> "State":
        """After changes (n, 2m) and of the shared unknowns (s,)."""
        m = self.rates.shape[1]
        poses = advance(kind, self.poses, changes[:, :m])
        return State(poses, self.rates + changes[:, m:], self.shared + shared)


@dataclass(frozen=True)
class Residuals:
    """All residuals at a state and how they change.

    Parameters
    ----------
    frames : (f, m) array
        Measured less expected.
    offset : (f,) array
        Seconds from the knot to the frame, with the delay as estimated: what a rate counts.
    along : (f, m) array
        Rates at the frames: what a second of delay counts.
    prior : (n - 1, 2m) array
        Noise of the prior over the steps.
    moved : (n - 1, m) array
        Small motion over each step.
    kind : Kind
        Of the poses.
    odometry : (n - 1, m) array
        Odometry less expected, in the fixed frame; zero where there is none.
    turned : (n - 1, m, m) array
        From the moving frame to the fixed one.
    leads : (n - 1, m, m) array
        How the odometry's part changes with the pose at the start of the step.
    world : (n - 1, m) array
        Odometry's motion in the fixed frame.
    """

    frames: Array
    offset: Array
    along: Array
    prior: Array
    moved: Array
    kind: Kind
    odometry: Array = field(default_factory=lambda: np.empty(0))
    turned: Array = field(default_factory=lambda: np.empty(0))
    leads: Array = field(default_factory=lambda: np.empty(0))
    world: Array = field(default_factory=lambda: np.empty(0))

    def jacobians(self, which: slice | Mask) -> tuple[Array, Array]:
        """How motions over some steps change with the poses at end and start, two (c, m, m)."""
        return step_jacobians(self.kind, self.moved[which])


def residuals(problem: Problem, state: State) -> Residuals:
    """Residuals of frames, prior and odometry at a state."""
    kind = problem.kind
    seen, offset, along = frame_residuals(problem, state)
    dt = np.diff(problem.times)
    moved = difference(kind, state.poses[1:], state.poses[:-1])
    prior = np.concatenate(
        [moved - dt[:, None] * state.rates[:-1], np.diff(state.rates, axis=0)], axis=1
    )
    if problem.steps is None:
        return Residuals(seen, offset, along, prior, moved, kind)
    steps = problem.steps
    turned = axes(kind, state.poses[:-1])
    scaled = steps.motions * scales(problem, state.shared)
    world = np.einsum("nij,nj->ni", turned, scaled)
    bias = _named(problem, state.shared, "bias")
    world[:, -1] += bias * dt
    odometry = np.where(steps.known[:, None], world - moved, 0.0)
    leads = turning(kind, world) - step_jacobians(kind, moved)[1]
    return Residuals(seen, offset, along, prior, moved, kind, odometry, turned, leads, world)


def frame_residuals(problem: Problem, state: State) -> tuple[Array, Array, Array]:
    """Residuals (f, m), seconds from the knots (f,) and rates (f, m) of the frames at a state."""
    frames = problem.frames
    offset = frames.offset + shifts(problem, state.shared)
    along = state.rates[frames.knot]
    expected = advance(problem.kind, state.poses[frames.knot], along * offset[:, None])
    return difference(problem.kind, frames.poses, expected), offset, along


def shifts(problem: Problem, shared: Array) -> Array:
    """(f,) seconds that delays and drifts, as estimated, add to the frames' times."""
    frames = problem.frames
    found = np.zeros(len(frames.knot))
    for value, (what, source) in zip(shared, problem.shared_of, strict=True):
        if what == "delay":
            found[frames.source == source] += value
        elif what == "drift":
            own = frames.source == source
            found[own] += value * frames.since[own]
    return found


def scales(problem: Problem, shared: Array) -> Array:
    """(m,) factors of the odometry's motions."""
    factors = np.ones(problem.m)
    d = lengths(problem.kind)
    factors[:d] += _named(problem, shared, "length")
    factors[d:] += _named(problem, shared, "turn")
    return factors


def _named(problem: Problem, shared: Array, name: str) -> float:
    found = [
        value for value, (what, _) in zip(shared, problem.shared_of, strict=True) if what == name
    ]
    return float(found[0]) if found else 0.0


def frame_columns(problem: Problem, along: Array, rows: slice) -> Array:
    """(f, m, s) how residuals of some frames change with the shared unknowns.

    ``along`` (all frames, m) are the rates at the frames.
    """
    source, since = problem.frames.source[rows], problem.frames.since[rows]
    along = along[rows]
    columns = np.zeros((len(source), problem.m, len(problem.shared_of)))
    for place, (what, number) in enumerate(problem.shared_of):
        own = source == number
        if what == "delay":
            columns[own, :, place] = -along[own]
        elif what == "drift":
            columns[own, :, place] = -along[own] * since[own, None]
    return columns


def step_columns(problem: Problem, found: Residuals, steps: slice) -> Array:
    """(c, m, s) how residuals of odometry over some steps change with the shared unknowns."""
    world, d = found.world[steps], lengths(problem.kind)
    columns = np.zeros((len(world), problem.m, len(problem.shared_of)))
    for place, (what, _) in enumerate(problem.shared_of):
        if what == "length":
            columns[:, :d, place] = world[:, :d]
        elif what == "turn":
            columns[:, d:, place] = world[:, d:]
        elif what == "bias":
            columns[:, -1, place] = np.diff(problem.times)[steps]
    return columns
