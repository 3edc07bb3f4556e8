"""The solution of a whole network and its rivals: several starts, minima compared by cost."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from survey.estimation.distance_fit import SAME, DistanceFit, place_fit
from survey.estimation.geometry import rotate
from survey.estimation.robot_frames import PoseReadings, pose_starts, why_undetermined
from survey.estimation.whole.lifted import lifted_start
from survey.estimation.whole.units import CAP, Index, Units, capped
from survey.estimation.world_points import MOST_CIRCLES, circle_starts
from survey.readings.readings import Mask
from validation.poses.angles import Array, wrap

TIE = 16.3
"""Costs nearer than this (chi-squared, 3 degrees of freedom, 0.1 %) do not tell solutions apart."""
OPEN_SIGMA = 0.1
"""Standard deviation of x or y, in metres, from which a place or a stop counts as not determined.
A judgement: beyond it the derivatives at one place say little about the next."""
OPEN_HEADING = 0.2
"""The same for headings, radians: half a rig's arm times this is a decimetre."""
_STARTS = 12
"""Most starts in space. Of 40 rooms with 60 % of the pairs missing, single starts led to the
solution in 75 to 100 %, where 72 % are missing in 0 to 100 %."""
_ENOUGH = 2
"""Starts that must have led to the best solution, which fits, before no more are tried."""
_ENOUGH_OF_BAD = 3
"""The same where the best solution does not fit: readings that contradict each other do so from
every start, and each start in space takes as long as all the rest."""
_FITS = 5.0
"""A solution fits if its cost is at most so many standard deviations above its expectation."""


@dataclass(frozen=True)
class Group:
    """The best solution of a network, and the others that fit as well.

    Parameters
    ----------
    units : Units
        The network.
    state : (n, 3) array
        The best solution.
    sigma : (n, 3) array
        Its standard deviations.
    tied : tuple of (n, 3) array
        Other solutions whose costs, rough values included, are within `TIE` of its own.
    """

    units: Units
    state: Array
    sigma: Array
    tied: tuple[Array, ...]

    @property
    def weak(self) -> Mask:
        """(n,) True where the readings leave a coordinate or heading open."""
        return is_weak(self.sigma)

    @property
    def ambiguous(self) -> Mask:
        """(n,) True where another solution is elsewhere."""
        out = np.zeros(len(self.state), dtype=bool)
        for other in self.tied:
            out |= differs(other, self.state, self.sigma)
        return np.asarray(out & ~self.weak)

    def candidates(self, unit: int) -> Array:
        """(c, 3) states of a unit in the solutions that fit, the best first."""
        found = [self.state[unit]]
        for other in self.tied:
            near = [np.linalg.norm(other[unit, :2] - one[:2]) < 10 * SAME for one in found]
            turned = [abs(float(wrap(other[unit, 2] - one[2]))) < 10 * SAME for one in found]
            if not any(n and t for n, t in zip(near, turned, strict=True)):
                found.append(other[unit])
        return np.array(found)

    def outliers(self, unit: int) -> tuple[Index, Array, int]:
        """Rows of a unit's readings that do not fit, their misfits in metres, how many it has."""
        units = self.units
        own = np.flatnonzero((units.first == unit) | (units.second == unit))
        residual = units.residuals(self.state)[own]
        bad = np.abs(residual) >= CAP
        return units.row[own[bad]], residual[bad] * units.sigma[own[bad]], len(own)


def is_weak(sigma: Array) -> Mask:
    """(n,) True for standard deviations (n, 3) of which one is too large."""
    return np.asarray((sigma[:, :2] > OPEN_SIGMA).any(1) | (sigma[:, 2] > OPEN_HEADING))


def differs(other: Array, state: Array, sigma: Array) -> Mask:
    """(n,) True where two states differ by more than either solution is inexact."""
    off = np.linalg.norm(other[:, :2] - state[:, :2], axis=1)
    turn = np.abs(wrap(other[:, 2] - state[:, 2]))
    limit = np.maximum(3 * SAME, 6 * np.linalg.norm(sigma[:, :2], axis=1))
    return np.asarray((off > limit) | (turn > np.maximum(0.05, 6 * sigma[:, 2])))


def solve_group(
    units: Units, known: Array, rough: Array, rough_sigma: Array, rng: np.random.Generator
) -> Group:
    """The solution of a network, from several starts.

    Parameters
    ----------
    units : Units
        The network.
    known : (n, 3) array
        Fixed points, and starts of the others where there are any, else NaN.
    rough : (n, 3) array
        Rough values, else NaN. They are starts, and decide between solutions that fit the
        readings equally well.
    rough_sigma : (n, 3) array
        Their standard deviations.
    rng : Generator
        Draws starts.
    """
    found = _Minima(units, rough, rough_sigma)
    fits = _fitting(units.freedom)
    placed = _placed_in_turn(units, known)
    for start in _starts(units, known, rough, rng) if placed is None else [placed]:
        found.add(units.settled(start))
        if found.hits >= (_ENOUGH if found.least <= fits else _ENOUGH_OF_BAD):
            break
    state = found.best
    sigma = units.sigmas(state)
    for start in _flipped(units, state, sigma):
        found.add(units.settled(start))
    if found.best is not state:
        state = found.best
        sigma = units.sigmas(state)
    return Group(units, state, sigma, found.rivals())


def _fitting(freedom: int) -> float:
    """The largest chi-squared of a solution that fits."""
    return float(freedom + _FITS * np.sqrt(2 * max(freedom, 1)))


def _placed_in_turn(units: Units, known: Array) -> Array | None:
    """A start where what is open has more readings to what is known than it needs, else None.

    Such units are open because their readings contradict each other. If what is known agrees, no
    other start finds more: the search in space would take its time and end the same.
    """
    told = np.isfinite(known[:, 0])
    alone = told[units.first] != told[units.second]
    neither = ~told[units.first] & ~told[units.second]
    count, other = (_ends(units, rows) for rows in (alone, neither))
    checked = (count >= CHECKED * (units.columns >= 0).sum(1)) | (other == 0)
    if told.all() or not checked[~told].all():
        return None
    among = told[units.first] & told[units.second]
    state = _agreeing(units, np.nan_to_num(known), among)
    if state is None:
        return None
    for unit in np.flatnonzero(~told):
        fit = _alone(units, state, np.zeros_like(state), int(unit), told)
        starts = np.empty((0, 3)) if fit is None else _starts_of(fit)
        if fit is None or not len(starts):
            state[unit, :2] = state[told, :2].mean(0)
            continue
        found, costs = fit.solutions(starts)
        if not len(found):
            found, costs = starts, fit.costs(starts)
        state[unit, : fit.unknowns] = found[int(np.argmin(costs))]
    return state


def _ends(units: Units, rows: Mask) -> Index:
    """(n,) how many of some readings (m,) end at each unit."""
    ends = np.concatenate([units.first[rows], units.second[rows]])
    return np.bincount(ends, minlength=len(units.names))


def _agreeing(units: Units, state: Array, among: Mask) -> Array | None:
    """The states to which the readings ``among`` (m,) lead, if no unit is against most of its."""
    part = replace(
        units,
        first=units.first[among],
        second=units.second[among],
        first_body=units.first_body[among],
        second_body=units.second_body[among],
        distance=units.distance[among],
        sigma=units.sigma[among],
        row=units.row[among],
    )
    there = part.settled(state)
    bad = np.abs(part.residuals(there)) >= CAP
    of, all_of = _ends(part, bad), _ends(part, np.ones(len(bad), dtype=bool))
    few = bad.sum() <= FEW * len(bad)
    good = np.abs(part.residuals(there)[~bad])
    fits = capped(good) <= _fitting(len(good))
    return there if few and fits and (2 * of <= all_of).all() else None


FEW = 0.1
"""Share of the readings that may contradict all others. A judgement: with more, somebody has to
look for another place of everything."""
CHECKED = 2
"""Readings for each unknown of a place or a stop from which its readings check each other."""


def _starts_of(fit: DistanceFit) -> Array:
    """Where a place or a stop may be, from pairs of its readings."""
    if isinstance(fit, PoseReadings):
        return np.empty((0, 3)) if why_undetermined(fit) else pose_starts(fit)
    return circle_starts(fit.known, fit.distance, MOST_CIRCLES)


def _starts(units: Units, known: Array, rough: Array, rng: np.random.Generator) -> Iterator[Array]:
    """States to start from: known ones, rough ones, then drawn ones."""
    fixed = np.full_like(known, np.nan)
    fixed[: units.fixed] = known[: units.fixed]
    told = np.where(np.isfinite(rough), rough, fixed)
    free = units.columns >= 0
    for start in (known, told):
        if np.isfinite(start[free]).all():
            yield np.nan_to_num(start)
        elif np.isfinite(start[units.fixed :, 0]).any():
            yield lifted_start(units, start, rng)
    for _ in range(_STARTS):
        yield lifted_start(units, fixed, rng)


class _Minima:
    """Solutions found, with their costs."""

    def __init__(self, units: Units, rough: Array, rough_sigma: Array) -> None:
        self._units, self._rough, self._sigma = units, rough, rough_sigma
        self._states: list[Array] = []
        self._costs: list[float] = []
        self._totals: list[float] = []

    def add(self, state: Array) -> None:
        """One more, however it was reached."""
        self._states.append(state)
        self._costs.append(self._units.cost(state))
        off = state - self._rough
        off[:, 2] = wrap(off[:, 2])
        told = np.nan_to_num(off / self._sigma)
        # A rough value says which of two places is meant, however rough: it cannot outvote more.
        self._totals.append(self._costs[-1] + float(np.minimum(told**2, CAP**2).sum()))

    @property
    def least(self) -> float:
        """The least cost of the readings."""
        return min(self._costs)

    @property
    def hits(self) -> int:
        """How many starts led to it."""
        return sum(cost < self.least + 1.0 for cost in self._costs)

    def _good(self) -> list[int]:
        return [i for i, cost in enumerate(self._costs) if cost - self.least < TIE]

    @property
    def best(self) -> Array:
        """Of the solutions that fit the readings the one that fits the rough values best."""
        return self._states[min(self._good(), key=self._totals.__getitem__)]

    def rivals(self) -> tuple[Array, ...]:
        """The others that fit nearly as well as the best one."""
        good = self._good()
        total = min(self._totals[i] for i in good)
        return tuple(
            self._states[i]
            for i in good
            if self._totals[i] - total < TIE and self._states[i] is not self.best
        )


def _flipped(units: Units, state: Array, sigma: Array) -> Iterator[Array]:
    """States with one place or stop where its readings, the others held, would have it as well."""
    solid = ~is_weak(sigma)
    for unit in range(units.fixed, len(units.names)):
        fit = _alone(units, state, sigma, unit) if solid[unit] else None
        if fit is None:
            continue
        starts = _starts_of(fit)
        if not len(starts):
            continue
        here = state[unit : unit + 1, : fit.unknowns]
        found, costs = fit.solutions(starts)
        limit = float(fit.costs(here)[0]) + 3 * TIE
        for other, cost in zip(found, costs, strict=True):
            moved = state.copy()
            moved[unit, : fit.unknowns] = other
            if cost < limit and differs(moved, state, sigma)[unit]:
                yield moved


def _alone(
    units: Units, state: Array, sigma: Array, unit: int, told: Mask | None = None
) -> DistanceFit | None:
    """The readings of a unit to where the others are, or those of them that are ``told`` (n,)."""
    forward = units.first == unit
    mine = forward | (units.second == unit)
    if told is not None:
        mine &= told[units.first] | told[units.second]
    own = np.flatnonzero(mine)
    forward = forward[own]
    other = np.where(forward, units.second[own], units.first[own])
    body = np.where(forward[:, None], units.second_body[own], units.first_body[own])
    if len(own) < 2:
        return None
    places = state[other, :2] + rotate(state[other, 2], body)
    spread = np.sqrt((sigma[other, :2] ** 2).mean(1) + (body**2).sum(1) * sigma[other, 2] ** 2)
    mine = np.where(forward[:, None], units.first_body[own], units.second_body[own])
    if unit < units.fixed + units.places:
        return place_fit(places, spread, units.distance[own], units.sigma[own])
    _, ends = np.unique(places, axis=0, return_inverse=True)
    _, points = np.unique(mine, axis=0, return_inverse=True)
    return PoseReadings(
        known=places,
        body=mine,
        distance=units.distance[own],
        sigma=units.sigma[own],
        known_sigma=spread,
        body_sigma=0.0,
        world_index=np.asarray(ends, dtype=np.intp).ravel(),
        rig_index=np.asarray(points, dtype=np.intp).ravel(),
    )
