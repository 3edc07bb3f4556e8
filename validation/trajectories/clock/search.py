"""The best delay among the starts, with the variances that belong to it, and its rivals."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.trajectories.clock.fit import (
    FIRST_PRIOR,
    PRIOR,
    Fit,
)
from validation.trajectories.clock.rows import (
    DELAY,
    Rows,
    State,
    Variances,
    first_variances,
    link_variances,
)

MARGIN = 0.3
"""Seconds by which a delay may move while it is refined: rows have support so far around."""
FEWEST_ROWS = 30
"""Poses in common with the path, below which nothing is said: eight parameters, and frames."""
SEARCH_ROWS = 900
"""Poses that starts are judged by; the best has all."""
VARIANCE_ROWS = 1500
"""Poses that variances are judged by: a standard deviation to 2 %."""
FIRST_TRIES = 90
"""Points at which the likelihood is asked for the most likely variances, at first."""


@dataclass(frozen=True)
class Candidate:
    """A delay with all that belongs to it.

    Parameters
    ----------
    fit : Fit
        With the rows that have support around the delay.
    state : State
        Where it was refined to.
    activity : array
        Of its nodes, (k-1, 3).
    """

    fit: Fit
    state: State
    activity: Array

    @property
    def delay(self) -> float:
        """Seconds at the fit's middle."""
        return float(self.state.parameters[DELAY])


def candidate(
    fit: Fit, delay: float, margin: float = MARGIN, drift: float = 0.0
) -> Candidate | None:
    """A start at a delay, with the rows that have support; None where these are too few."""
    par = np.zeros(8)
    par[DELAY : DELAY + 2] = delay, drift
    times = fit.times(par)
    inside = fit.path.supported(times - margin) & fit.path.supported(times + margin)
    if inside.sum() < FEWEST_ROWS:
        return None
    new = fit.with_rows(inside)
    return Candidate(new, new.start(delay, drift), new.activity(delay))


def thinned(fit: Fit, most: int) -> Fit:
    """Every k-th row, so that they are few enough."""
    k = -(-len(fit.rows) // most)
    if k == 1:
        return fit
    return fit.with_rows(np.arange(len(fit.rows)) % k == 0)


def refined(one: Candidate, variances: Variances | None) -> tuple[Candidate, Variances]:
    """A start refined, with variances given, or found on the way."""
    fit = one.fit
    rough = Variances(0.1**2, 0.1**2, 1e-3, 1e-3)
    state = fit.refined(one.state, rough, one.activity, FIRST_PRIOR, 4)
    if variances is None:
        values = fit.residuals(state)
        variances = first_variances(values, with_heading=fit.with_heading)
    wide = replace(variances, position=4 * variances.position, heading=4 * variances.heading)
    state = fit.refined(state, wide, one.activity, FIRST_PRIOR, 3)
    state = fit.refined(state, variances, one.activity, FIRST_PRIOR, 5)
    return replace(one, state=state), variances


def settled(one: Candidate, variances: Variances, with_jitter: bool) -> tuple[Candidate, Variances]:
    """The delay with its most likely variances, all rows."""
    fit, state = one.fit, one.state
    for most in (FIRST_TRIES, 50):
        few = thinned(fit, VARIANCE_ROWS)
        sub = state if few is fit else restarted(few, fit, state)
        activity = one.activity if few is fit else few.activity(one.delay)
        variances = few.likely_variances(sub, variances, activity, PRIOR, with_jitter, most)
        if most == FIRST_TRIES and fit.with_heading:
            turning = _turning(few, sub, variances, with_jitter)
            if turning is not None:
                other = fit.turning()
                state = restarted(other, fit, state)
                fit, variances = other, turning
                one = replace(one, activity=fit.activity(one.delay))
        state = fit.refined(state, variances, one.activity, PRIOR, 4)
        fit = fit.based(state.parameters)
        state = fit.refined(state, variances, one.activity, PRIOR, 12)
    return Candidate(fit, state, one.activity), variances


def _turning(few: Fit, state: State, variances: Variances, with_jitter: bool) -> Variances | None:
    """The variances of a heading that wanders by turning, if that is more likely."""

    def cost(fit: Fit, at: State, tried: Variances) -> float:
        values = fit.residuals(at)
        weights = fit.weights(values, tried)
        return fit.solve(at, values, tried, weights, PRIOR, fit.activity(delay))[1]

    delay = float(state.parameters[DELAY])
    other = few.turning()
    at = restarted(other, few, state)
    activity = other.activity(delay)
    ratio = few.activity(delay)[:, 2].sum() / activity[:, 2].sum()
    start = replace(variances, turn_walk=variances.turn_walk * float(ratio))
    found = other.likely_variances(at, start, activity, PRIOR, with_jitter, FIRST_TRIES // 2)
    return found if cost(other, at, found) < cost(few, state, variances) else None


def restarted(few: Fit, fit: Fit, state: State) -> State:
    """A state for some of the rows, whose nodes have other first rows."""
    where = np.searchsorted(fit.rows.times, few.rows.times[few.rows.starts])
    node = fit.rows.node[where]
    offsets = fit.offsets[where]
    c, s = np.cos(state.angles[node]), np.sin(state.angles[node])
    x, y = offsets.T
    places = state.places[node] + np.column_stack([c * x - s * y, s * x + c * y])
    return State(state.parameters, state.angles[node], places)


def transferred(one: Candidate, delay: float, variances: Variances) -> Candidate | None:
    """The least-squares fit with the delay held at another value, from the one that fits."""
    fit = one.fit
    moved = one.state.parameters.copy()
    moved[DELAY] = delay
    inside = fit.path.supported(fit.times(moved))
    if inside.sum() < FEWEST_ROWS:
        return None
    new = fit if inside.all() else fit.with_rows(inside)
    near = abs(delay - one.delay) < 0.3
    if near:
        state = one.state if new is fit else restarted(new, fit, one.state)
        state = replace(state, parameters=moved)
    else:
        state = new.start(delay, float(moved[DELAY + 1]))
        par = moved.copy()
        par[2] = state.parameters[2]
        state = replace(state, parameters=par)
    activity = one.activity if new is fit else new.activity(delay)
    if not near:
        rough = replace(variances, position=25 * variances.position, heading=25 * variances.heading)
        state = new.refined(state, rough, activity, FIRST_PRIOR, 3, fixed=True)
    state = new.refined(
        state, variances, activity, FIRST_PRIOR if not near else PRIOR, 6, fixed=True
    )
    return Candidate(new, state, activity)


@dataclass(frozen=True)
class Gap:
    """How much worse one delay fits than another.

    Parameters
    ----------
    rise : float
        Of the cost over the poses that both have, in the unit of -2 log likelihood.
    score : float
        The rise in its standard deviations, from its scatter along the record.
    share : float
        Of the poses of the better one that the other has, too.
    """

    rise: float
    score: float
    share: float


def gap(better: Candidate, other: Candidate, variances: Variances) -> Gap:
    """How much worse a delay fits, compared pose by pose."""
    one, two = better.fit.rows, other.fit.rows
    costs = better.fit.row_costs(better.state, variances)
    others = other.fit.row_costs(other.state, variances)
    walks = _link_cost(other, variances) - _link_cost(better, variances)
    common = np.isin(one.times, two.times)
    among = np.isin(two.times, one.times)
    if common.sum() < FEWEST_ROWS:
        return Gap(0.0, 0.0, 0.0)
    rises = others[among] - costs[common]
    # Two seconds of errors are counted as one: rates and the path's own noise are alike so long.
    block = np.floor((one.times[common] - one.times[common][0]) / 2.0)
    starts = np.flatnonzero(np.diff(block, prepend=-1.0))
    sums = np.add.reduceat(rises, starts)
    scatter = float(sums.std() * np.sqrt(len(sums))) + 1e-9
    total = float(rises.sum())
    share = float(common.sum() / len(one))
    return Gap(total + walks * share, total / scatter, share)


def _link_cost(one: Candidate, variances: Variances) -> float:
    values = one.fit.residuals(one.state)
    return float(np.sum(values.errors**2 / link_variances(one.activity, variances)))


def rows_of(
    times: Array, positions: Array, headings: Array | None, good: npt.NDArray[np.bool_]
) -> Rows:
    """Rows of the poses that are taken."""
    return Rows.of(times[good], positions[good], None if headings is None else headings[good])
