"""Antennas seen from the vehicle: where it heads, and where an antenna is between its fixes."""

import numpy as np

from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array

MOST_LOST = 3
"""Usual spacings between two fixes of a receiver within which it has lost some: a vehicle that
leans by a degree meanwhile moves an antenna by two hundredths of its arm, evenly."""

SELDOM = 0.001
"""Share of its moves on the vehicle that are longer than an antenna usually moves: potholes and
sudden turns lean a vehicle by degrees within two fixes."""
MORE = 1.5
"""Times as far up as these that an antenna moves at most: over twelve rough drives of ten minutes,
and twelve hours, the farthest was at 1.04 to 1.6 times."""


def turned(angles: Array, vectors: Array) -> Array:
    """(n, ..., 3) vectors turned about the vertical by angles (n,), radians, counterclockwise."""
    shape = (-1, *[1] * (vectors.ndim - 2))
    c, s = np.cos(angles).reshape(shape), np.sin(angles).reshape(shape)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def baseline_headings(times: Array, positions: Array) -> Array | None:
    """Headings of the longest baseline, without leaps of a turn, radians.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, metres; NaN where one has no fix.

    Returns
    -------
    (n,) array
        Where one of its ends has no fix for long, by the next longest baseline that has, and by
        what the two differ before and after; else evenly between. None of fewer than two epochs.
    """
    level = positions[..., :2]
    ways = level[:, None] - level[:, :, None]
    apart = np.linalg.norm(ways, axis=-1)
    together = ~np.isnan(apart).all(0)
    reach = np.zeros(together.shape)
    reach[together] = np.nanmedian(apart[:, together], axis=0)
    first, second = np.triu_indices(len(reach), 1)
    order = np.argsort(-reach[first, second], kind="stable")
    found: Array | None = None
    for i, j in zip(first[order], second[order], strict=True):
        rows = np.flatnonzero(~np.isnan(apart[:, i, j]))
        if len(rows) < 2:
            continue
        seen = np.arctan2(ways[rows, i, j, 1], ways[rows, i, j, 0])
        if found is None:
            found = np.full(len(times), np.nan)
            found[rows] = seen
            continue
        known = ~np.isnan(found[rows])
        if not known.any():
            continue
        ahead = np.unwrap(found[rows[known]] - seen[known])
        more = seen + np.interp(times[rows], times[rows[known]], ahead)
        wanted = ~known & _in_long_gaps(times, np.flatnonzero(~np.isnan(found)), rows)
        found[rows[wanted]] = more[wanted]
    if found is None:
        return None
    rows = np.flatnonzero(~np.isnan(found))
    return np.asarray(np.interp(times, times[rows], np.unwrap(found[rows])))


def _in_long_gaps(times: Array, known: Ints, rows: Ints) -> Bools:
    """Which rows are between two that are known and far apart, or outside of all."""
    spacing = np.diff(times[known])
    longest = (MOST_LOST + 0.5) * np.median(spacing) if len(spacing) else 0.0
    after = np.searchsorted(known, rows)
    inside = (after > 0) & (after < len(known))
    gap = np.full(len(rows), np.inf)
    gap[inside] = spacing[after[inside] - 1]
    return np.asarray(gap > longest)


def carried(
    times: Array,
    positions: Array,
    headings: Array,
    who: tuple[int, tuple[int, ...]],
    rows: tuple[Ints, Ints, Ints],
    least: float = np.inf,
) -> Array:
    """Where an antenna is between its fixes: it goes with the vehicle.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, metres; NaN where one has no fix.
    headings : (n,) array
        Of the vehicle, radians.
    who : (int, tuple of int)
        The antenna, and others that tell where it is.
    rows : three (m,) int arrays
        Epochs at which it is wanted, and its own fixes before and after each; where these are one
        it keeps its place on the vehicle.
    least : float
        Metres by which it moves on the vehicle meanwhile, level or up, at least, and more than it
        usually does in that time, where it jumped: beside all others. It then keeps its place
        before until its next fix.

    Returns
    -------
    (m, 3) array
        Metres; the mean of what the others tell, NaN where none has a fix at all three epochs.

    Notes
    -----
    Where it is, seen from the vehicle, changes evenly from fix to fix: as much as the vehicle leans
    and nods meanwhile is wrong.
    """
    own, others = who
    at, before, after = rows
    share = (times[at] - times[before]) / np.maximum(times[after] - times[before], 1e-9)
    told = np.full((len(at), len(others), 3), np.nan)
    jumps = np.zeros((len(at), len(others)), dtype=bool)
    for n, other in enumerate(others):
        arms = turned(-headings, positions[:, own] - positions[:, other])
        first, moves = arms[before], arms[after] - arms[before]
        jumps[:, n] = (_level_and_up(moves) > _most(arms, after - before, least)).any(1)
        arm = first + share[:, None] * np.where(jumps[:, n, None], 0.0, moves)
        told[:, n] = positions[at, other] + turned(headings[at], arm)
    # One of the others that jumps, while it does not beside the rest, tells nothing of it.
    told[jumps & ~jumps.all(1, keepdims=True)] = np.nan
    found = np.full((len(at), 3), np.nan)
    known = ~np.isnan(told[..., 0]).all(1)
    found[known] = np.nanmean(told[known], axis=1)
    return found


def _level_and_up(moves: Array) -> Array:
    """(n, 2) lengths of moves (n, 3)."""
    return np.column_stack([np.hypot(moves[:, 0], moves[:, 1]), np.abs(moves[:, 2])])


def _most(arms: Array, epochs: Ints, least: float) -> Array:
    """(m, 2) metres, level and up, that an arm (n, 3) usually moves in some epochs at most."""
    found = np.full((len(epochs), 2), least)
    for apart in np.unique(epochs) if np.isfinite(least) else ():
        moves = _level_and_up(arms[apart:] - arms[:-apart])
        moves = moves[~np.isnan(moves[:, 0])]
        # A jump, and one back, are in as many.
        beyond = max(int(np.ceil(SELDOM * len(moves))), 2 * int(apart))
        if beyond < len(moves):
            usual = np.sort(moves, axis=0)[-1 - beyond] * [1.0, MORE]
            found[epochs == apart] = np.maximum(usual, least)
    return found
