"""Delay, drift, mount and wandering frame of a source against a path, by least squares."""

from copy import copy
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from validation.poses.angles import Array, wrap
from validation.trajectories.clock.chain import Links, Solved, block_equations, solve_chain
from validation.trajectories.clock.continuous import ContinuousPath
from validation.trajectories.clock.rows import (
    DELAY,
    DRIFT,
    Residuals,
    Rows,
    State,
    Variances,
    link_variances,
    node_medians,
    rotated,
)

POSITION_CUT, HEADING_CUT = 11.8, 9.0
"""Squared distances beyond which a position or a heading loses weight: chi-squared, 0.3 % of good
positions (two numbers) and headings (one)."""
PRIOR = np.array([10.0, 10.0, 30.0, 1e3, 0.01, 0.05, 0.05, 0.01])
"""Standard deviations of the parameters before anything is seen: metres, metres, radians, seconds,
s/s, shares, rad/s. Wide but for the last four: clocks that differ by more than 1 % are broken, and
so are odometers that are wrong by more than 15 %."""
FIRST_PRIOR = np.array([10.0, 10.0, 30.0, 1e3, 1e-4, 1e-6, 1e-6, 1e-9])
"""While a start is being refined: clocks and odometers as they usually are."""
WANDER, WANDER_TURNING = (1.0, 0.5), (0.1, 1.0)
"""What a metre of way and a radian of turning count for in the wandering of a frame: a judgement,
an odometer that is wrong by as much in a half turn as on a way of a metre and a half; and of the
heading of one whose wheels slip when it turns. The more likely of the two is taken."""
IDLE = 0.05
"""What a second counts for, without motion."""
LEAST_VARIANCES = np.array([1e-10, 1e-10, 1e-10, 1e-10, 1e-10])
"""Of positions (m^2), headings (rad^2), of the frame's wandering in place and turn per unit, and
of stamps (s^2): 10 um, 10 urad and 10 us. A motion capture has ten times that; only made poses are
better. Beside links of 1e-4 units (`Fit.activity`) the equations are then conditioned to 1e14,
which numbers of 16 digits bear; poses without noise would have 1e20."""
SETTLED = 0.1
"""Change of -2 log likelihood in one step; verdicts ask for rises of 9 and more."""


class Fit:
    """Least squares of a source's poses about a path, robust against wrong ones.

    Parameters
    ----------
    path : ContinuousPath
        The better sampled one.
    rows : Rows
        Of the other.
    middle : float
        Stamp at which the delay is asked for: its drift counts from there.
    """

    def __init__(self, path: ContinuousPath, rows: Rows, middle: float) -> None:
        self.path, self.rows, self.middle = path, rows, middle
        self.with_heading = path.has_heading and rows.headings is not None
        self.with_position = path.has_position
        anchors = rows.positions[rows.starts]
        self.offsets = rows.positions - anchors[rows.node]
        self.steps = np.diff(anchors, axis=0)
        self.base, self.bare = np.zeros(3), path
        self.heading_wander = WANDER
        self.columns = np.zeros((len(path.times), 7))

    def with_rows(self, which: npt.NDArray[np.bool_]) -> "Fit":
        """The same fit to some of the rows."""
        new = Fit(self.path, self.rows.select(which), self.middle)
        new.base, new.bare, new.columns = self.base, self.bare, self.columns
        new.heading_wander = self.heading_wander
        return new

    def turning(self) -> "Fit":
        """The same fit with a heading that wanders by turning, and nodes that end in turns."""
        rows = self.rows
        rows = Rows.of(rows.times, rows.positions, rows.headings, by_turn=True)
        new = Fit(self.path, rows, self.middle)
        new.base, new.bare, new.columns = self.base, self.bare, self.columns
        new.heading_wander = WANDER_TURNING
        return new

    def times(self, parameters: Array, rows: Rows | None = None) -> Array:
        """(n,) times on the path."""
        stamps = (rows or self.rows).times
        return np.asarray(stamps + parameters[DELAY] + parameters[DRIFT] * (stamps - self.middle))

    def activity(self, delay: float) -> Array:
        """(k-1, 3) motion between nodes in which a frame may wander, for place and heading."""
        own = self.path
        moved = np.hypot(*np.diff(own.positions, axis=0).T)
        turned, passed = np.abs(np.diff(own.headings)), IDLE * np.diff(own.times)
        nodes = self.rows.times[self.rows.starts] + delay

        def between(way: float, turn: float) -> Array:
            along = np.concatenate([[0.0], np.cumsum(way * moved + turn * turned + passed)])
            return np.asarray(np.maximum(np.diff(np.interp(nodes, own.times, along)), 1e-4))

        place, heading = between(*WANDER), between(*self.heading_wander)
        return np.column_stack([place, place, heading])

    def based(self, parameters: Array) -> "Fit":
        """The same fit with the path's systematic errors taken out once for all."""
        new = copy(self)
        new.base = parameters[5:].copy()
        path, first = self.path, self.path.positions[0]
        new.bare = path.corrected(*new.base)
        turned, elapsed = path.headings - path.headings[0], path.times - path.times[0]
        new.columns = np.column_stack(
            [
                (new.bare.positions - first) / (1 + new.base[0]),
                new.bare.turned_by(turned),
                turned,
                new.bare.turned_by(elapsed),
            ]
        )
        return new

    def _systematic(self, times: Array) -> Array:
        """(n, 3, 3) change of the path's pose with scale, turn scale and turn bias."""
        own = self.path.times
        left = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 2)
        share = ((times - own[left]) / (own[left + 1] - own[left]))[:, None]
        at = (1 - share) * self.columns[left] + share * self.columns[left + 1]
        change = np.zeros((len(times), 3, 3))
        change[:, :2, 0], change[:, :2, 1], change[:, 2, 1] = at[:, :2], at[:, 2:4], at[:, 4]
        change[:, :2, 2], change[:, 2, 2] = at[:, 5:7], times - own[0]
        return change

    def residuals(self, state: State) -> Residuals:
        """Residuals and their changes at a state."""
        rows, par = self.rows, state.parameters
        times = self.times(par)
        pose, rate, _ = self.bare.at(times)
        change = self._systematic(times)
        pose = pose + change @ (par[5:] - self.base)
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        lever = np.column_stack([c * par[0] - s * par[1], s * par[0] + c * par[1]])
        swung = np.column_stack([-lever[:, 1], lever[:, 0]])
        ca, sa = np.cos(state.angles), np.sin(state.angles)
        turned = rotated(self.offsets, ca[rows.node], sa[rows.node])
        n = len(rows)
        out = np.zeros((n, 3, 9))
        out[:, :2, 8] = state.places[rows.node] + turned - pose[:, :2] - lever
        out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1] = -c, s, -s, -c
        moving = rate[:, :2] + rate[:, 2:] * swung
        out[:, :2, DELAY] = -moving
        out[:, :2, 5:8] = -change[:, :2] - swung[:, :, None] * change[:, 2:]
        if self.with_heading and rows.headings is not None:
            off = rows.headings + state.angles[rows.node] + par[2] - pose[:, 2]
            out[:, 2, 8] = wrap(2 * off) / 2
            out[:, 2, 2] = 1.0
            out[:, 2, DELAY] = -rate[:, 2]
            out[:, 2, 5:8] = -change[:, 2]
        out[:, :, DRIFT] = out[:, :, DELAY] * (rows.times - self.middle)[:, None]
        frames = np.zeros((n, 3, 3))
        frames[:, 0, 0] = frames[:, 1, 1] = frames[:, 2, 2] = 1.0
        frames[:, 0, 2], frames[:, 1, 2] = -turned[:, 1], turned[:, 0]
        if not self.with_position:
            out[:, :2], frames[:, :2] = 0.0, 0.0
        step = rotated(self.steps, ca[:-1], sa[:-1])
        back = np.broadcast_to(np.eye(3), (len(step), 3, 3)).copy()
        back[:, 0, 2], back[:, 1, 2] = -step[:, 1], step[:, 0]
        errors = np.column_stack(
            [np.diff(state.places, axis=0) - step, np.diff(state.angles)[:, None]]
        )
        return Residuals(out, frames, -out[:, :, DELAY], back, errors)

    def distances(self, values: Residuals, variances: Variances, wide: float = 1.0) -> Array:
        """(n, 2) squared distances of positions and headings in standard deviations.

        Parameters
        ----------
        values : Residuals
            At a state.
        variances : Variances
            The distances' unit.
        wide : float
            Times the jitter's standard deviation, so that no late stamp counts as a wrong pose.
        """
        r, jitter = values.values, variances.jitter * wide**2
        v = values.rates[:, :2]
        along = np.einsum("ij,ij->i", r[:, :2], v)
        square = np.einsum("ij,ij->i", r[:, :2], r[:, :2])
        speed = np.einsum("ij,ij->i", v, v)
        position = square - jitter * along**2 / (variances.position + jitter * speed)
        heading = r[:, 2] ** 2 / (variances.heading + jitter * values.rates[:, 2] ** 2)
        return np.column_stack([position / variances.position, heading])

    def weights(self, values: Residuals, variances: Variances, slack: float = 1.0) -> Array:
        """(n, 2) of positions and headings: 1, and less where far from all others."""
        far = self.distances(values, variances, 3.0)
        cut = slack * np.array([POSITION_CUT, HEADING_CUT])
        return np.minimum(1.0, (cut / np.maximum(far, 1e-12)) ** 2)

    def inverse_covariances(
        self, values: Residuals, variances: Variances, weights: Array
    ) -> tuple[Array, float]:
        """(n, 3, 3) weights of the residuals, and the log determinant of their covariance."""
        own = np.zeros((len(weights), 3))
        own[:, :2] = weights[:, :1] / variances.position
        own[:, 2] = weights[:, 1] / variances.heading * self.with_heading
        counted = np.array([2.0 * self.with_position, float(self.with_heading)])
        good = (weights > 0.5).sum(0) * counted
        determinant = float(good @ np.log([variances.position, variances.heading]))
        inverse = own[:, :, None] * np.eye(3)
        if variances.jitter > 0:
            pulled = own * values.rates
            more = 1 / variances.jitter + np.einsum("ij,ij->i", pulled, values.rates)
            inverse = inverse - np.einsum("ij,ik->ijk", pulled, pulled / more[:, None])
            determinant += float(np.log(more * variances.jitter).sum())
        return inverse, determinant

    def solve(
        self,
        state: State,
        values: Residuals,
        variances: Variances,
        weights: Array,
        prior: Array,
        activity: Array,
        fixed: bool = False,
    ) -> tuple[Solved, float]:
        """One step of Gauss and Newton, and -2 log likelihood at its end.

        Parameters
        ----------
        fixed : bool
            Delay and drift stay as they are.
        """
        inverse, determinant = self.inverse_covariances(values, variances, weights)
        steps = link_variances(activity, variances)
        information = prior**-2.0
        if not self.path.has_heading:
            information[:2] = 1e12
        if fixed:
            information[DELAY : DRIFT + 1] = 1e16
        away = state.parameters.copy()
        away[2 : DELAY + 1] = 0.0
        if fixed:
            away[DELAY : DRIFT + 1] = 0.0
        links = Links(values.back, values.errors, steps)
        solved = solve_chain(
            values.rows, values.frames, inverse, self.rows.starts, links, (information, away)
        )
        return solved, solved.cost + determinant + solved.determinant

    def blocks(
        self,
        state: State,
        variances: Variances,
        activity: Array,
        first_nodes: npt.NDArray[np.intp],
    ) -> tuple[Array, Array]:
        """Information and gradient of each block, its frame free; see `block_equations`."""
        values = self.residuals(state)
        weights = self.weights(values, variances)
        inverse, _ = self.inverse_covariances(values, variances, weights)
        steps = link_variances(activity, variances)
        steps[first_nodes[1:] - 1] = np.inf
        links = Links(values.back, values.errors, steps)
        return block_equations(
            values.rows, values.frames, inverse, self.rows.starts, links, first_nodes
        )

    def moved(self, state: State, solved: Solved) -> State:
        """The state after a step."""
        return State(
            state.parameters + solved.change,
            state.angles + solved.node_changes[:, 2],
            state.places + solved.node_changes[:, :2],
        )

    def start(self, delay: float, drift: float = 0.0) -> State:
        """Frames from displacements at a delay, and the mount's heading; nothing else.

        Notes
        -----
        A displacement over a second or two turns with the frame, not with the mount. Frames
        are those that turn the source's displacements of ten seconds around into the path's. Where
        the path has no positions they are those of the headings.
        """
        rows = self.rows
        par = np.zeros(8)
        par[DELAY], par[DRIFT] = delay, drift
        times = self.times(par)
        pose = self.path.at(times)[0]
        if not self.with_position:
            return State(par, self._turned_into(times, pose[:, 2]), np.zeros((len(rows.starts), 2)))
        there = pose[:, 0] + 1j * pose[:, 1]
        here = rows.positions[:, 0] + 1j * rows.positions[:, 1]
        later = np.minimum(np.searchsorted(times, times + 1.5), len(times) - 1)
        one, two = there[later] - there, here[later] - here
        product = one * np.conj(two)
        lengths = np.abs(np.abs(one) - np.abs(two))
        product[(lengths > 0.1 + 0.3 * np.abs(one)) | (times[later] > times + 5)] = 0.0
        angles = np.unwrap(np.angle(self._around(times, product, 0.02)))
        if self.with_heading and rows.headings is not None:
            apart = np.exp(2j * (pose[:, 2] - rows.headings - angles[rows.node]))
            weight = np.minimum(np.abs(product), 1.0) + 1e-9
            par[2] = np.angle((apart * weight).sum()) / 2
        turned = rotated(self.offsets, np.cos(angles)[rows.node], np.sin(angles)[rows.node])
        places = node_medians(pose[:, :2] - turned, rows)
        return State(par, angles, places)

    def _around(
        self, times: Array, values: npt.NDArray[np.complex128], whole: float
    ) -> npt.NDArray[np.complex128]:
        """(k,) sums of ten seconds to both sides of each node, and a share of the whole sum."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        middle = times[self.rows.starts]
        low, high = np.searchsorted(times, middle - 10), np.searchsorted(times, middle + 10)
        return np.asarray(total[high] - total[low] + whole * total[-1] + 1e-12)

    def _turned_into(self, times: Array, headings: Array) -> Array:
        """(k,) angles that turn the source's headings of ten seconds around into the path's."""
        own = self.rows.headings
        if own is None:
            return np.zeros(len(self.rows.starts))
        apart = self._around(times, np.exp(2j * (headings - own)), 0.0)
        return np.asarray(np.unwrap(np.angle(apart)) / 2)

    def refined(
        self,
        state: State,
        variances: Variances,
        activity: Array,
        prior: Array,
        rounds: int,
        fixed: bool = False,
        slack: float = 1.0,
    ) -> State:
        """The state after some steps with weights of their own.

        It ends where the delay moves by less than a thousandth of its standard deviation and the
        cost by less than `SETTLED`; not where the delay alone stands, as the rest decides on how
        much worse another delay fits.
        """
        last = np.inf
        for _ in range(rounds):
            values = self.residuals(state)
            weights = self.weights(values, variances, slack)
            solved, _ = self.solve(state, values, variances, weights, prior, activity, fixed)
            limit = max(1.0, abs(float(solved.change[DELAY])) / 0.5)
            if limit > 1:
                solved = replace(
                    solved,
                    change=solved.change / limit,
                    node_changes=solved.node_changes / limit,
                )
            state = self.moved(state, solved)
            still = solved.change[DELAY] ** 2 * abs(solved.information[DELAY, DELAY]) < 1e-6
            if still and abs(solved.cost - last) < SETTLED:
                break
            last = solved.cost
        return state

    def row_costs(self, state: State, variances: Variances) -> Array:
        """(n,) bounded costs of the rows at a state."""
        far = self.distances(self.residuals(state), variances)
        cut = np.array([POSITION_CUT, HEADING_CUT])
        bounded = np.where(far <= cut, far, 2 * cut - cut**2 / np.maximum(far, cut))
        return np.asarray(bounded @ [1.0, float(self.with_heading)])

    def likely_variances(
        self,
        state: State,
        variances: Variances,
        activity: Array,
        prior: Array,
        with_jitter: bool,
        most: int,
    ) -> Variances:
        """The most likely variances at a state, by Nelder and Mead in their logarithms."""
        values = self.residuals(state)
        weights = self.weights(values, variances)
        first = np.log([variances.position, variances.heading, variances.walk, variances.turn_walk])
        if with_jitter:
            first = np.append(first, np.log(max(variances.jitter, 1e-6)))
        low = np.log(LEAST_VARIANCES)[: len(first)]
        high = np.array([2.0, 2.0, 2.0, 2.0, 0.0])[: len(first)]

        def cost(point: Array) -> float:
            inside = np.clip(point, low, high)
            tried = Variances(*np.exp(inside).tolist())
            value = self.solve(state, values, tried, weights, prior, activity)[1]
            return value + 10 * float(np.sum((point - inside) ** 2))

        simplex = np.vstack([first, first + 1.2 * np.diag(np.where(first - 1.2 > low, -1.0, 1.0))])
        found = minimize(
            cost,
            first,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": most, "xatol": 0.03, "fatol": 0.05},
        )
        return Variances(*np.exp(np.clip(found.x, low, high)).tolist())
