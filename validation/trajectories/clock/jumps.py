"""A clock that jumps within a record: where the delay before fits no longer, and another does."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median
from validation.trajectories.clock.judging import Best
from validation.trajectories.clock.result import ClockEstimate, Jump, Place
from validation.trajectories.clock.rows import DRIFT, Variances, link_variances
from validation.trajectories.clock.search import (
    Candidate,
    restarted,
    thinned,
    transferred,
)

SHIFTS = 0.01 * 2.0 ** np.arange(9)
"""Seconds by which the delay is moved to see where it fits better: 10 ms to 2.6 s. A jump in
between two of them is off by a third at most, and shows nearly as well."""
STEADY = 2e-4
"""Rate of a clock against another's beyond which there is none: ten times that of a poor quartz."""
ROWS = 450
"""Poses among which a jump is looked for at first: a place to a quarter of a percent."""
LEAST_ROWS = 20
"""Poses on each side of a jump: fewer have no delay of their own."""
SUSPECT = 40.0
"""Rise of -2 log likelihood from which on a jump is looked at. Records without one had up to 27;
what is looked at for nothing costs time only: both parts must tell delays that differ clearly."""
LIKELY = 9.0
"""Rise of -2 log likelihood of a place up to which a jump may be there: three standard
deviations."""
MOST_UNLIKELY = 100.0
"""Bound of what stamps say against a place: ten standard deviations."""
CLEAR = 2.5
"""Times the half of its 95 % interval that a jump is at least: 4.9 standard deviations, as any pose
of any record may be the first after one; and an odometer's errors, which last, make two parts of a
record differ by up to twice that half."""


def suspected(best: Best) -> Place | None:
    """Where among the fit's rows another delay begins to fit clearly better; None where none does.

    Notes
    -----
    The fit is made with the delay held at a row of values (`SHIFTS`). With what each pose costs
    under each, the best two values and the best place between them follow from running sums.
    """
    one = best.candidate
    few = thinned(one.fit, ROWS)
    parameters = one.state.parameters.copy()
    parameters[DRIFT] = np.clip(parameters[DRIFT], -STEADY, STEADY)
    state = replace(one.state, parameters=parameters)
    if few is not one.fit:
        one = Candidate(few, restarted(few, one.fit, state), few.activity(one.delay))
    else:
        one = replace(one, state=state)
    delays = one.delay + np.concatenate([[0.0], -SHIFTS, SHIFTS])
    times = few.rows.times
    last = jump_place(_under(one, delays, best.variances))
    return None if last is None else Place.between(float(times[last]), float(times[last + 1]))


def sharpened(best: Best, delays: Array, noise: Array, wander: Array) -> Place:
    """Where among the fit's rows one delay gives way to another, with the noise of both sides.

    That of one delay to all is as large as the jump, and hides where it is.

    Parameters
    ----------
    best : Best
        The fit of one delay to all.
    delays : (2,) array
        Of the fit's rows, before and after.
    noise, wander : (2,) arrays
        As in a `ClockEstimate`; NaN where there are none.
    """
    own = best.variances
    known = np.array([own.position, own.heading, own.walk, own.turn_walk])
    found = np.concatenate([noise, wander]) ** 2
    variances = Variances(*np.where(np.isfinite(found), found, known).tolist())
    one = best.candidate
    parameters = one.state.parameters.copy()
    parameters[DRIFT] = 0.0
    one = replace(one, state=replace(one.state, parameters=parameters))
    costs, times = _under(one, delays, variances), one.fit.rows.times
    last, least, most = sharpest_place(costs, times, float(delays[1] - delays[0]))
    middle = float(times[last] + times[last + 1]) / 2
    return Place(middle, float(times[least]), float(times[most + 1]))


def sharpest_place(costs: Array, times: Array, size: float) -> tuple[int, int, int]:
    """The last pose before a jump of a size, and the first and the last that it may be.

    Parameters
    ----------
    costs : (2, n) array
        Of each pose under the delay before and after.
    times : (n,) array
        Stamps.
    size : float
        Seconds.
    """
    total = np.cumsum(costs[0] - costs[1])[:-1] + _unlikely(times, size)
    total = total[LEAST_ROWS - 1 : 1 - LEAST_ROWS]
    likely = np.flatnonzero(total < total.min() + LIKELY)
    best, first, last = (LEAST_ROWS - 1 + int(i) for i in (total.argmin(), likely[0], likely[-1]))
    return best, first, last


def _unlikely(times: Array, size: float) -> Array:
    """(n-1,) how unlikely it is that a clock jumped by a size between each stamp and the next.

    Frames of a source with a rate are whole periods apart, once the jump is taken off; and they
    are never in another order. In the unit of -2 log likelihood, bounded.
    """
    steps = np.diff(times)
    period = float(np.median(steps))

    def off(gaps: Array) -> Array:
        return np.asarray(gaps - period * np.maximum(np.round(gaps / period), 1.0))

    sigma = max(float(sigma_from_median(off(steps))), 0.01 * period)
    return np.minimum((off(steps + size) / sigma) ** 2, MOST_UNLIKELY)


def _under(one: Candidate, delays: Array, variances: Variances) -> Array:
    """(k, n) cost of each row with the delay held at each of k values."""
    times = one.fit.rows.times
    costs = np.full((len(delays), len(times)), np.nan)
    for row, delay in enumerate(delays):
        held = transferred(one, float(delay), variances)
        if held is not None:
            costs[row, np.searchsorted(times, held.fit.rows.times)] = _costs(held, variances)
    # Without a pose on both sides of its time nothing speaks for a delay, nor against it.
    usual = np.nan_to_num(costs, nan=np.inf).min(0)
    return np.where(np.isnan(costs), np.where(np.isinf(usual), 0.0, usual), costs)


def _costs(one: Candidate, variances: Variances) -> Array:
    """(n,) cost of each row, with that of the frame's wandering up to it."""
    costs = one.fit.row_costs(one.state, variances)
    errors = one.fit.residuals(one.state).errors
    costs[one.fit.rows.starts[1:]] += (errors**2 / link_variances(one.activity, variances)).sum(1)
    return costs


def jump_place(costs: Array) -> int | None:
    """The last pose before a jump, if two rows of costs with a jump are less than any one.

    Parameters
    ----------
    costs : (k, n) array
        Of each pose under each delay.
    """
    n = costs.shape[1]
    if n < 2 * LEAST_ROWS:
        return None
    before = np.cumsum(costs, axis=1)
    total = before[:, -1:]
    places = np.arange(LEAST_ROWS - 1, n - LEAST_ROWS)
    first, second = before[:, places], (total - before)[:, places]
    place = int(np.argmin(first.min(0) + second.min(0)))
    one, two = int(np.argmin(first[:, place])), int(np.argmin(second[:, place]))
    if one == two:
        return None
    single = int(np.argmin(total))
    last = int(places[place])
    joined = np.concatenate([costs[one, : last + 1], costs[two, last + 1 :]])
    rise = float((costs[single] - joined).sum())
    return last if rise > SUSPECT else None


def joined(
    whole: ClockEstimate, pieces: Sequence[ClockEstimate], places: Sequence[Place]
) -> ClockEstimate:
    """The estimate of a clock that jumps between pieces; the whole one where none is clear.

    Parameters
    ----------
    whole : ClockEstimate
        As if there were no jump.
    pieces : sequence of ClockEstimate
        Of the parts between jumps, in order.
    places : sequence of Place
        Between each piece and the next.
    """
    if any(piece.verdict != "determined" for piece in pieces):
        return whole
    found = jumping(pieces, places)
    return found if all(clear(jump) for jump in found.jumps) else whole


def jumping(pieces: Sequence[ClockEstimate], places: Sequence[Place]) -> ClockEstimate:
    """The estimate of a clock that jumps between determined pieces; see `joined`."""
    jumps = [
        jump_between(one, two, place)
        for one, two, place in zip(pieces[:-1], pieces[1:], places, strict=True)
    ]
    longest = max(pieces, key=lambda piece: piece.poses)
    return replace(longest, jumps=tuple(jumps), pieces=tuple(pieces))


def jump_between(before: ClockEstimate, after: ClockEstimate, place: Place) -> Jump:
    """By how much the delay changes between two parts of a record, at a place between them.

    Drifts that short parts tell badly are held against those that clocks have (`STEADY`).
    """
    delays, squares = [], []
    for one in (before, after):
        since = place.stamp_s - (one.at_s - one.delay_s)
        drift = 1e-6 * float(np.nan_to_num(one.drift_ppm))
        half = 1e-6 * float(np.nan_to_num(one.drift_high_ppm - one.drift_low_ppm)) / 2
        known = STEADY**2 / (STEADY**2 + half**2)
        delays.append(one.delay_s + known * drift * since)
        squares.append(((one.high_s - one.low_s) / 2) ** 2 + known * (half * since) ** 2)
    size, half = delays[1] - delays[0], float(np.sqrt(sum(squares)))
    return Jump(place, delays[0], delays[1], size - half, size + half)


def clear(jump: Jump) -> bool:
    """Whether a jump is one, and not two estimates of the same delay."""
    return abs(jump.size_s) > CLEAR * (jump.high_s - jump.low_s) / 2


def parted(times: Array, stamps: Sequence[float]) -> list[npt.NDArray[np.bool_]]:
    """Which of some times are in each of the parts that jumps leave."""
    place = np.searchsorted(np.asarray(stamps), times)
    return [place == number for number in range(len(stamps) + 1)]
