"""Distances among fixed points, unknown places and unknown stops, as one least-squares problem.

A unit is a fixed point, a place (x, y) or a stop (x, y, theta) that carries the points of the
rig. Readings are taken as independent: what they share (marks, the rig, the Vframe) is added to
the variance of each. That is quick and finds where everything is; how exact it is, the joint
adjustment says.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from survey.estimation.geometry import rotate
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array, wrap

Index = npt.NDArray[np.intp]
Equations = Callable[[Array], tuple[Array, csr_array]]
"""Unknowns (u,) -> standardised residuals (o,), measured less computed, and the derivative (o, u)
of the computed."""

FAR = 100.0
"""Metres and radians, one standard deviation, within which everything is: keeps matrices regular
where nothing else determines an unknown, and is nothing beside any reading."""
CAP = 5.0
"""Standardised residual from which a reading counts no further when solutions are compared: a
reading of ten metres too many must not choose the place of everything else."""
_PASSES = 60
_REST = 1e-7
"""Metres and radians: a descent ends at steps below."""
_DULL = 1e-6
"""A descent ends where a pass lowers the sum of squares by less than this and this share of it."""
_MOST_DAMPING = 1e7


@dataclass(frozen=True)
class Units:
    """The problem.

    Parameters
    ----------
    names : tuple of str, length n
        Fixed points first, then places, then stops.
    fixed, places : int
        How many of the first two.
    first, second : (m,) array of int
        Units at the ends of each reading.
    first_body, second_body : (m, 2) array
        Points of the rig there, metres, robot frame; zero for points and places.
    distance, sigma : (m,) array
        Metres; sigma with all that stands behind the ends.
    row : (m,) array of int
        Rows of the readings among those given.
    """

    names: tuple[str, ...]
    fixed: int
    places: int
    first: Index
    second: Index
    first_body: Array
    second_body: Array
    distance: Array
    sigma: Array
    row: Index

    @property
    def stops(self) -> int:
        """How many stops."""
        return len(self.names) - self.fixed - self.places

    @property
    def columns(self) -> Index:
        """(n, 3) columns of x, y, theta among the unknowns, -1 where it is none."""
        columns = np.full((len(self.names), 3), -1, dtype=np.intp)
        p = self.places
        columns[self.fixed : self.fixed + p, :2] = np.arange(2 * p).reshape(-1, 2)
        columns[self.fixed + p :] = 2 * p + np.arange(3 * self.stops).reshape(-1, 3)
        return columns

    @property
    def unknowns(self) -> int:
        """How many numbers are sought."""
        return 2 * self.places + 3 * self.stops

    @property
    def freedom(self) -> int:
        """Readings less unknowns."""
        return len(self.distance) - self.unknowns

    def residuals(self, state: Array) -> Array:
        """Standardised residuals (m,) at states (n, 3)."""
        gap = self._arm(state, self.first, self.first_body)
        gap = gap - self._arm(state, self.second, self.second_body)
        return np.asarray((self.distance - np.linalg.norm(gap, axis=1)) / self.sigma)

    def _arm(self, state: Array, unit: Index, body: Array) -> Array:
        return np.asarray(state[unit, :2] + rotate(state[unit, 2], body))

    def equations(self, state: Array, weight: Array | None = None) -> Equations:
        """The problem as a function of the unknowns, all else as in ``state`` (n, 3).

        ``weight`` (m,) are weights of the readings. What only `FAR` holds is held where it is.
        """
        columns = self.columns
        free = columns >= 0
        root = np.ones(len(self.distance)) if weight is None else np.sqrt(weight)
        held = np.full(self.unknowns, 1 / FAR)
        start = state[free]
        rows = np.repeat(np.arange(len(self.distance)), 6)
        wanted = np.concatenate([columns[self.first], columns[self.second]], axis=1).ravel()
        kept = wanted >= 0
        own = np.arange(self.unknowns)
        row = np.concatenate([rows[kept], len(root) + own])
        column = np.concatenate([wanted[kept], own])

        def at(unknowns: Array) -> tuple[Array, csr_array]:
            now = state.copy()
            now[free] = unknowns
            a = rotate(now[self.first, 2], self.first_body)
            b = rotate(now[self.second, 2], self.second_body)
            gap = now[self.first, :2] + a - now[self.second, :2] - b
            length = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
            unit = gap / length[:, None]
            turn_a = unit[:, 1] * a[:, 0] - unit[:, 0] * a[:, 1]
            turn_b = unit[:, 1] * b[:, 0] - unit[:, 0] * b[:, 1]
            values = np.column_stack([unit, turn_a, -unit, -turn_b]) * (root / self.sigma)[:, None]
            entries = np.concatenate([values.ravel()[kept], held])
            residual = root * (self.distance - length) / self.sigma
            shape = (len(root) + self.unknowns, self.unknowns)
            whole = np.concatenate([residual, held * (start - unknowns)])
            return whole, csr_array((entries, (row, column)), shape=shape)

        return at

    def settled(self, start: Array) -> Array:
        """The states (n, 3) to which a damped Gauss-Newton descent leads, grave blunders aside."""
        free = self.columns >= 0
        state = start.copy()
        state[free] = descend(self.equations(state), state[free])
        residual = self.residuals(state)
        for _ in range(8):
            if np.abs(residual).max(initial=0.0) < CAP:
                break
            weight = 1 / (1 + (residual / CAP) ** 2) ** 2
            state[free] = descend(self.equations(state, weight), state[free], 10)
            before, residual = residual, self.residuals(state)
            if np.abs(before - residual).max() < 1e-2:
                break
        state[:, 2] = wrap(state[:, 2])
        return state

    def cost(self, state: Array) -> float:
        """Chi-squared of the readings at states (n, 3), none counting more than `CAP` squared."""
        return capped(self.residuals(state))

    def sigmas(self, state: Array) -> Array:
        """(n, 3) standard deviations at a solution, metres and radians; `FAR` where open."""
        residual = self.residuals(state)
        weight = np.where(np.abs(residual) < CAP, 1.0, 0.0)
        free = self.columns >= 0
        _, jacobian = self.equations(state, weight)(state[free])
        inverse = np.linalg.inv((jacobian.T @ jacobian).toarray())
        out = np.zeros((len(self.names), 3))
        out[free] = np.sqrt(np.diagonal(inverse))
        return out


def capped(residual: Array) -> float:
    """Sum of squares of standardised residuals, none counting more than `CAP` squared."""
    return float((np.minimum(np.abs(residual), CAP) ** 2).sum())


def descend(equations: Equations, start: Array, passes: int = _PASSES) -> Array:
    """Unknowns (u,) at a minimum of the sum of squares, by Levenberg and Marquardt's descent."""
    x, damping = start, 1e-3
    residual, jacobian = equations(x)
    cost = residual @ residual
    for _ in range(passes):
        normal = (jacobian.T @ jacobian).toarray()
        right = jacobian.T @ residual
        scale = np.diagonal(normal) + 1e-3 * np.diagonal(normal).mean() + 1e-12
        while True:
            damped = normal + np.diag(damping * scale)
            step = cho_solve(cho_factor(damped, check_finite=False), right, check_finite=False)
            there, slope = equations(x + step)
            lower = there @ there
            if lower < cost or damping > _MOST_DAMPING:
                break
            damping *= 5
        if not lower < cost:
            break
        gain, x, residual, jacobian, cost = cost - lower, x + step, there, slope, lower
        damping = max(damping / 5, 1e-10)
        if np.abs(step).max() < _REST or gain < _DULL * (1 + cost):
            break
    return x


def stop_key(pose: str) -> str:
    """What a stop is called among places: '7/'."""
    return f"{pose}/"


def make_units(
    fixed: Mapping[str, tuple[Array, float]],
    places: Sequence[str],
    stops: Sequence[str],
    readings: Readings,
    rig: RobotFrame,
) -> Units:
    """The readings among the given points, places and stops.

    Parameters
    ----------
    fixed : mapping of str to ((2,) array, float)
        Places of known points and a coordinate's standard deviation, metres.
    places, stops : sequence of str
        What is sought; stops by their `stop_key`, as a stop and a mark may both be called 7.
    readings : Readings
        All readings.
    rig : RobotFrame
        Nominal rig.
    """
    names = (*fixed, *places, *stops)
    unit = {name: i for i, name in enumerate(names[: len(fixed) + len(places)])}
    of_stop = {name: len(unit) + i for i, name in enumerate(stops)}
    variance = np.zeros(len(names))
    variance[: len(fixed)] = [sigma**2 for _, sigma in fixed.values()]
    variance[len(unit) :] = rig.mark_variance
    nowhere = np.zeros(2)
    body = {name: np.asarray(point, dtype=float) for name, point in rig.points.items()}

    def end(name: str) -> tuple[int, Array] | None:
        if name in unit:
            return unit[name], nowhere
        stop, point = robot_point(name) or ("", "")
        of = of_stop.get(stop_key(stop))
        return None if of is None else (of, body[point])

    ends = [(end(a), end(b)) for a, b in zip(readings.start, readings.end, strict=True)]
    row = np.array(
        [
            i
            for i, (a, b) in enumerate(ends)
            if a and b and a[0] != b[0] and max(a[0], b[0]) >= len(fixed)
        ],
        dtype=np.intp,
    )
    used = [cast("tuple[tuple[int, Array], tuple[int, Array]]", ends[i]) for i in row]
    first = np.array([a[0] for a, _ in used], dtype=np.intp)
    second = np.array([b[0] for _, b in used], dtype=np.intp)
    return Units(
        names=names,
        fixed=len(fixed),
        places=len(places),
        first=first,
        second=second,
        first_body=np.array([a[1] for a, _ in used]).reshape(-1, 2),
        second_body=np.array([b[1] for _, b in used]).reshape(-1, 2),
        distance=readings.distance[row],
        sigma=np.sqrt(readings.sigma[row] ** 2 + variance[first] + variance[second]),
        row=row,
    )
