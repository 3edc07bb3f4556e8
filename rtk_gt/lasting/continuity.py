"""Whether an antenna goes on as it would without a jump.

Two measures. By the whole drive: how a vehicle goes on, which antennas its body moves together and
how long errors keep their memory all show in how the ways of a drive vary together. Of a jump the
best linear measure is what a way has beyond the best linear guess from the intervals before and
after and from the other antennas (a matched filter in coloured noise; Van Trees 1968, section 4.3).
No shape of a motion is taken for granted, and slow errors are weighed as such.

And by the seconds about it: who brakes or turns in changes the acceleration within tenths of a
second, and nothing of that kind need be anywhere else on a calm road, so that it looks unlike all
the drive. Therefore a jump that only the motion tells is held against motions of any roughness: the
acceleration wanders (a Wiener process, Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3), by as
much as explains the positions of some epochs before and after best.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtk_gt.lasting.lacking_fixes import fixed_rows, spread_over
from rtk_gt.lasting.seen_from_vehicle import turned
from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array

REACH = 1.0
"""Seconds before and after an interval whose ways are looked at: in simulated drives with errors of
30 to 120 s twice as many make the sigma of a jump 3 % smaller, half as many 10 % larger."""
NEAREST = 1
"""Intervals before and after, beside pauses: the sigma is then a third larger."""
WORTH = 4
"""Intervals a number that is fitted, at least: the guess is then wrong by a seventh more than the
best one could be."""
EVEN = 1.5
"""Intervals are as long as usual within this factor."""
_UNUSUAL = 60.0
"""Squared sigmas of a way above which its window tells nothing of what is usual: one of nine normal
numbers passes that in 10^9."""
_MOST_UNUSUAL = 0.2
"""Share of the windows that are left out for that at most."""
_ROUNDS = 3
"""What is usual settles in two."""
_AT_ONCE = 2048
"""Windows that are copied at a time: those of an hour are 14 MB."""
_TINY = 1e-5
"""Metres of white noise that is added."""
EPOCHS = 12
"""Positions on each side that are looked at."""
_FEWEST = 5
"""On each side: of fewer a parabola leaves nothing."""
_PAUSE = 3.0
"""Times the usual spacing after which the positions are not of one motion."""
_ROUGHNESS = np.geomspace(1e-3, 1e7, 31)
"""Variance of the jerk's sum over one interval against that of the noise, spacing of 1: from motion
that is a parabola for all epochs to one that noise does not hide from one epoch to the next."""


@dataclass(frozen=True)
class Unexpected:
    """What n intervals have beyond the guess by their neighbours.

    Parameters
    ----------
    values : (n, c, 3) array
        Jump of each of c receivers, along and across the baseline and up, metres.
    effects : (n, 3 c, 3 r) array
        What a jump of each of all receivers does to the values.
    told : (n,) bool array
        False where the neighbours tell nothing, as beside a pause.
    """

    values: Array
    effects: Array
    told: Bools


def reaches_of(times: Array) -> list[int]:
    """Intervals before and after one that are looked at, fewest first."""
    return sorted({NEAREST, max(round(REACH / float(np.median(np.diff(times)))), NEAREST)})


def unexpected_ways(
    times: Array, positions: Array, whole: Array, headings: Array, reach: int, *, own: bool = False
) -> Unexpected | None:
    """What the ways between n + 1 epochs have beyond the guess; None of too few.

    Parameters
    ----------
    times : (n + 1,) array
        Seconds.
    positions : (n + 1, r, 3) array
        Of the antennas, offsets added as far as known, metres; NaN where a receiver that writes
        less often has none.
    whole : (n + 1, r, 3) array
        The same with what is between filled in.
    headings : (n + 1,) array
        Of something fixed to the vehicle, radians.
    reach : int
        Intervals before and after each that are looked at.
    own : bool
        Only the receivers with a position at every epoch.

    Notes
    -----
    Receivers that write at every epoch are guessed from these; one that writes less often from its
    own neighbours and from what the others do meanwhile, in parts of the interval, so that a jump
    of theirs shows in it, too.
    """
    n, r = len(times) - 1, positions.shape[1]
    often, rare = _groups(positions, n)
    if not len(often):
        return None
    ways = _ways(whole[:, often], headings).reshape(n, -1)
    even = _even(times)
    told, values = _guessed(ways, even, reach)
    if not told.any():
        return None
    effects = np.broadcast_to(np.eye(3 * r), (n, 3 * r, 3 * r))
    if own:
        shown = (3 * often[:, None] + np.arange(3)).ravel()
        return Unexpected(values.reshape(n, -1, 3), effects[:, shown], told)
    found = Unexpected(np.zeros((n, r, 3)), effects.copy() if rare else effects, told)
    found.values[:, often] = values.reshape(n, -1, 3)
    for rows, columns in rare:
        some = _of_rare((times, whole, headings, even), often, rows, columns)
        if some is None:
            return None
        found.values[:, columns] = some[0]
        at = (3 * columns[:, None] + np.arange(3)).ravel()
        by = (3 * often[:, None] + np.arange(3)).ravel()
        found.effects[:, at[:, None], by] = some[1]
        found.told[...] &= some[2]
    return found if found.told.any() else None


def _groups(positions: Array, n: int) -> tuple[Ints, list[tuple[Ints, Ints]]]:
    """Columns of the receivers with all fixes, and epochs and columns of the others."""
    groups = fixed_rows(positions)
    often = [columns for rows, columns in groups if len(rows) == n + 1]
    rare = [(rows, columns) for rows, columns in groups if len(rows) <= n]
    return (often[0] if often else np.zeros(0, dtype=int)), rare


def _even(times: Array) -> Bools:
    """(n,) True for intervals that are as long as usual."""
    spacing = np.diff(times)
    return np.asarray(np.abs(spacing / np.median(spacing) - 1) < EVEN - 1)


def _ways(positions: Array, headings: Array) -> Array:
    """(n, c, 3) ways between epochs, seen from the vehicle in the middle of each."""
    middle = headings[:-1] + np.angle(np.exp(1j * np.diff(headings))) / 2
    return turned(-middle, np.diff(positions, axis=0))


def _guessed(ways: Array, even: Bools, reach: int) -> tuple[Bools, Array]:
    """(n,) where neighbours tell of ways (n, d), and (n, d) what these have beyond the guess."""
    n, d = ways.shape
    wide = 2 * reach + 1
    if n < wide:
        return np.zeros(n, dtype=bool), np.zeros((n, d))
    inside = np.convolve(~even, np.ones(wide), "same") < 0.5
    inside[:reach] = inside[n - reach :] = False
    rows = np.flatnonzero(inside)
    values = np.zeros((n, d))
    if len(rows) < WORTH * wide * d:
        return np.zeros(n, dtype=bool), values
    windows = np.moveaxis(np.lib.stride_tricks.sliding_window_view(ways, wide, axis=0), 2, 1)
    own = slice(reach * d, (reach + 1) * d)
    usual = np.ones(len(rows), dtype=bool)
    for _ in range(_ROUNDS):
        mean, square = _moments(windows, rows[usual] - reach)
        inverse = np.linalg.inv(square + _TINY**2 * np.eye(len(square)))
        scores, told = np.empty((len(rows), d)), inverse[own, own]
        for some, there in _in_parts(windows, rows - reach):
            scores[some] = (there - mean) @ inverse[:, own]
        spread = np.linalg.inv(told)
        values[rows] = scores @ spread
        squares = np.zeros(n)
        squares[rows] = np.einsum("ni,ij,nj->n", scores, spread, scores)
        far = np.convolve(squares > _UNUSUAL, np.ones(wide), "same") > 0.5
        if not far.any() or far[rows].mean() > _MOST_UNUSUAL:
            break
        usual = ~far[rows]
    return inside, values


def _moments(windows: Array, rows: Ints) -> tuple[Array, Array]:
    """Mean (k,) and covariance (k, k) of some windows (m, w, d), k = w d."""
    total, square = 0.0, 0.0
    start = windows[rows[len(rows) // 2]].reshape(-1)
    for _, there in _in_parts(windows, rows):
        total = total + (there - start).sum(0)
        square = square + (there - start).T @ (there - start)
    mean = np.asarray(total) / len(rows)
    return start + mean, np.asarray(square) / len(rows) - np.outer(mean, mean)


def _in_parts(windows: Array, rows: Ints) -> Iterator[tuple[slice, Array]]:
    """Some windows (m, w, d) as rows (p, w d), a few thousand at a time, and which these are."""
    for first in range(0, len(rows), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        there = windows[rows[some]]
        yield some, there.reshape(len(there), -1)


def _of_rare(
    drive: tuple[Array, Array, Array, Bools], often: Ints, rows: Ints, columns: Ints
) -> tuple[Array, Array, Bools] | None:
    """Of receivers that write less often, at ``rows``: values, effects of the others, where told.

    (n, c, 3), (n, 3 c, 3 f) and (n,).
    """
    times, whole, headings, even = drive
    n, stride = len(times) - 1, round(float(np.median(np.diff(rows))))
    cuts = np.unique([0, round(stride / 3), stride - round(stride / 3), stride])
    edges = np.concatenate(
        [
            [-2 * stride],
            cuts[:-1] - stride,
            cuts[:-1],
            cuts[:-1] + stride,
            2 * stride + cuts[:1],
            [3 * stride],
        ]
    )
    regular = np.diff(rows) == stride
    good = np.flatnonzero(regular[:-2] & regular[1:-1] & regular[2:]) + 1
    first = rows[good]
    inside = (first - 2 * stride >= 0) & (first + 3 * stride <= n)
    good, first = good[inside], first[inside]
    broken = np.concatenate([[0], np.cumsum(~even)])
    inside = broken[first + 3 * stride] == broken[first - 2 * stride]
    good, first = good[inside], first[inside]
    middle = -(headings[first] + headings[first + stride]) / 2
    parts = np.diff(whole[first[:, None] + edges][:, :, often], axis=1)
    parts = turned(middle, parts).reshape(len(first), -1)
    own = [
        turned(middle, whole[first + end][:, columns] - whole[first + begin][:, columns])
        for begin, end in ((0, stride), (-stride, 0), (stride, 2 * stride))
    ]
    wanted, before, after = (one.reshape(len(first), -1) for one in own)
    by = np.column_stack([parts, before, after])
    if len(by) < WORTH * by.shape[1]:
        return None
    left, guess = _fitted(by, wanted)
    values, told = np.zeros((len(rows) - 1, len(columns), 3)), np.zeros(len(rows) - 1, dtype=bool)
    values[good], told[good] = left.reshape(len(good), -1, 3), True
    # In which part of its interval each interval between all epochs is.
    place = np.clip(np.arange(n) - spread_over(rows, rows[:-1], n), 0, stride - 1)
    part = (
        1 + 2 * (len(cuts) - 1) - (len(cuts) - 1) + np.searchsorted(cuts, place, side="right") - 1
    )
    wide = 3 * len(often)
    by_part = -np.swapaxes(guess[: parts.shape[1]].reshape(-1, wide, wanted.shape[1]), 1, 2)
    return spread_over(rows, values, n), by_part[part], spread_over(rows, told, n)


def _fitted(by: Array, wanted: Array) -> tuple[Array, Array]:
    """What is left of values (m, c) by numbers (m, k), and (k, c) what each of these adds."""
    usual = np.ones(len(by), dtype=bool)
    left, guess = wanted, np.zeros((by.shape[1], wanted.shape[1]))
    for _ in range(_ROUNDS):
        centre, level = by[usual].mean(0), wanted[usual].mean(0)
        known = by[usual] - centre
        square = known.T @ known + _TINY**2 * usual.sum() * np.eye(by.shape[1])
        guess = np.linalg.solve(square, known.T @ (wanted[usual] - level))
        left = wanted - level - (by - centre) @ guess
        spread = np.linalg.inv(
            left[usual].T @ left[usual] / usual.sum() + _TINY**2 * np.eye(wanted.shape[1])
        )
        far = np.einsum("mi,ij,mj->m", left, spread, left) > _UNUSUAL
        if not far.any() or far.mean() > _MOST_UNUSUAL:
            break
        usual = ~far
    return np.asarray(left), np.asarray(guess)


def gain_over_motion(times: Array, places: Array, row: int) -> float:
    """Twice the log likelihood ratio of a jump after a row against motion of any roughness.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    places : (n, 3) array
        East, north, up, metres; of several antennas that jump together their mean.
    row : int
        The last before the jump.

    Returns
    -------
    float
        0 where too few positions stand on either side.
    """
    about = _about(times, row)
    before = row - about[0] + 1
    if min(before, len(about) - before) < _FEWEST:
        return 0.0
    usual = float(np.median(np.diff(times[about])))
    at = (times[about] - times[about[0]]) / usual
    after = (np.arange(len(about)) >= before).astype(float)
    parabola = np.vander(at / at[-1], 3)
    wandering = _wandering(at)
    level, up = places[about, :2], places[about, 2:]
    gain = 0.0
    for part in (level - level.mean(0), up - up.mean(0)):
        smooth = _cost(parabola, wandering, part)
        jumped = _cost(np.column_stack([parabola, after]), wandering, part)
        gain += smooth - jumped
    return max(gain, 0.0)


def _about(times: Array, row: int) -> npt.NDArray[np.intp]:
    """Rows about the interval after a row, up to a pause on either side."""
    low, high = max(row - EPOCHS + 1, 0), min(row + EPOCHS + 1, len(times))
    rows = np.arange(low, high)
    spacing = np.diff(times[rows])
    pauses = np.flatnonzero(spacing > _PAUSE * np.median(spacing))
    first = max((int(k) + 1 for k in pauses if low + k < row), default=0)
    last = min((int(k) + 1 for k in pauses if low + k > row), default=len(rows))
    return rows[first:last]


def _wandering(at: Array) -> Array:
    """(n, n) covariance of places whose acceleration wanders from the first time on."""
    first, late = np.minimum(at[:, None], at), np.abs(at[:, None] - at)
    return np.asarray(first**5 / 20 + late * first**4 / 8 + late**2 * first**3 / 12)


def _cost(design: Array, wandering: Array, values: Array) -> float:
    """Least twice the negative log likelihood, over roughness and noise, of columns (n, c)."""
    n, columns = values.shape
    V = _ROUGHNESS[:, None, None] * wandering + np.eye(n)
    factor = np.linalg.cholesky(V)
    both = np.concatenate([design, values], axis=1)
    solved = np.linalg.solve(factor, np.broadcast_to(both, (len(V), *both.shape)))
    by, left = solved[..., : design.shape[1]], solved[..., design.shape[1] :]
    q, _ = np.linalg.qr(by)
    left = left - q @ (np.swapaxes(q, 1, 2) @ left)
    squares = np.square(left).sum((1, 2))
    level = 2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(1)
    return float((n * columns * np.log(squares) + columns * level).min())
