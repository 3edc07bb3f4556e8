"""What jumps between two epochs, beside what motion before and after goes on doing.

The way of an antenna from one fix to the next, seen from the vehicle, changes slowly: speed and
turning go on. A line through some fixes before and one with the same slope through as many after
therefore differ by noise, unless the error of a receiver jumped. Distances of the antennas stay
whatever the vehicle does: their means before and after differ by noise alone.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import special

from rtk_gt.lasting.continuity import NEAREST, reaches_of, unexpected_ways
from rtk_gt.lasting.lacking_fixes import filled, fixed_rows, often, spread_over, together_rows
from rtk_gt.lasting.seen_from_vehicle import turned
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.fixes import Bools, Ints
from rtk_gt.receivers.steps import pair_differences
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

SIDE = 2
"""Fixes on each side of a jump whose lines are compared: two see it where the vehicle turns
sharply."""
PLANE = 8
"""Fixes on each side whose plane through the antennas says what is level."""
DISTANCE_SIDES = (2.0, 10.0)
"""Seconds on each side whose distances are averaged: in five seconds, the shortest error that
lasts, both of its ends are then seen apart; ten find the smaller jumps that stay."""
FEWEST_DISTANCES = 3
"""Fixes on each side whose distances are averaged at least."""
_EVEN = 1.5
"""Intervals of a window are as long as usual within this factor: over a pause all motion fits."""
_ROUNDS = 4
"""Covariances of the smaller contrasts settle in two."""
_GOOD = 0.75
"""Share of the contrasts, the smaller ones, whose covariance has the axes."""
_FAR = 0.02
"""Share of the contrasts by which the length of their tails is judged; jumps are fewer."""
TINY = 1e-5
"""Metres added to all sigmas: far below any receiver's noise."""
_EFFICIENCY = 0.37
"""Of a standard deviation from the median of normal numbers."""
NEVER = 1e3
"""Metres of sigma of the motion over a pause: it says nothing."""
_AROUND = 10
"""Windows before and after an interval that say how rough the drive is there."""


class Sides(NamedTuple):
    """Fixes on each side of an interval that are looked at.

    Those of the motion, and those whose distances are averaged; ``guessed``: the motion is held
    against the guess by its neighbours, not against a line; ``own``: of the receivers that have a
    position at every epoch, where one that writes less often lacks fixes.
    """

    motion: int
    averaged: int
    guessed: bool = False
    own: bool = False


@dataclass(frozen=True)
class Contrasts:
    """Jumps that each of n intervals between epochs seems to have, as noise and motion make them.

    Parameters
    ----------
    window : int
        Fixes on each side within which a second jump would disturb.
    values : (n, 3 c + p) array
        Jump of each of c receivers, along and across its baseline and up, then that of each
        distance, metres.
    axes : (3 c + p, 3 c + p) array
        Principal axes of the contrasts of the whole drive, one a column.
    sigmas : (n, 3 c + p) array
        Standard deviations along them, those of the whole drive or, where more, of the time around.
    floor : (3 c + p,) array
        Those of the whole drive, without what its tails add.
    freedom : float
        How many independent contrasts the sigmas are from.
    rods : (2, n, p, 3) array
        Directions of the pairs, seen from the baseline: how a jump changes the distances. First the
        mean after the interval, for an error that begins there, then that before, for one that
        ends: meanwhile a vehicle may turn.
    moving : (n,) bool array
        False at intervals whose window has a pause: only distances tell there.
    effects : (n, 3 c, 3 r) array
        What a jump of each of r receivers does to those that c seem to have: its own, level and up
        above the plane through the antennas.
    guessed : bool
        Whether the motion is held against the guess by its neighbours.
    """

    window: int
    values: Array
    axes: Array
    sigmas: Array
    floor: Array
    freedom: float
    rods: Array
    moving: Bools
    effects: Array
    guessed: bool = False

    def designs(
        self, cause: tuple[int, ...], ends: bool = False, rows: Ints | slice = slice(None)
    ) -> Array:
        """(m, 3 c + p, 3) what a jump of these receivers does to the contrasts of some intervals.

        Of an error that begins, or ends.
        """
        rods, effects = self.rods[int(ends)][rows], self.effects[rows]
        n, p = rods.shape[:2]
        shown, count = effects.shape[1], effects.shape[2] // 3
        hit = np.isin(np.arange(count), cause).astype(float)
        whole = effects.reshape(n, shown, count, 3)[:, :, list(cause)].sum(2)
        if p == 0:
            return np.asarray(whole)
        by_distance = (pair_incidence(count) @ hit)[:, None] * rods
        return np.asarray(np.concatenate([whole, by_distance], axis=1))


def step_weights(side: int) -> Array:
    """(2 side - 1,) weights of the intervals about one that estimate a jump within it.

    Least squares of a line and a jump through the fixes of both sides; a parabola falls out, as the
    jump is odd and it is even.
    """
    place = np.arange(2 * side) - side + 0.5
    design = np.column_stack([np.ones(2 * side), place, place > 0])
    by_fix = np.linalg.pinv(design)[2]
    return np.asarray(np.cumsum(by_fix[::-1])[-2::-1])


def _summed(values: Array, weights: Array) -> Array:
    """(n, ...) weighted sums of the rows about each; rows beyond the ends count as none."""
    half = len(weights) // 2
    padded = np.concatenate(
        [np.zeros((half, *values.shape[1:])), values, np.zeros((half, *values.shape[1:]))]
    )
    found = np.zeros(values.shape)
    for k, weight in enumerate(weights):
        found += weight * padded[k : k + len(values)]
    return found


def sides_of(times: Array, positions: Array) -> list[Sides]:
    """Fixes on each side whose motion, and whose distances, are looked at together.

    Of positions (n, r, 3) at times (n,); lines come first.
    """
    if len(times) < 8 * FEWEST_DISTANCES:
        return []
    every = float(np.median(np.diff(times)))
    short, long = (max(round(side / every), FEWEST_DISTANCES) for side in DISTANCE_SIDES)
    reaches = reaches_of(times)
    found = [Sides(SIDE, short), Sides(SIDE, long)]
    found += [Sides(reach, short, True) for reach in reaches]
    if 1 < len(often(positions)) < positions.shape[1]:
        found.append(Sides(reaches[-1], short, True, True))
    return found


def contrasts(times: Array, positions: Array, headings: Array, sides: Sides) -> Contrasts | None:
    """The contrasts of the n intervals between n + 1 epochs; None of too few without pauses.

    Parameters
    ----------
    times : (n + 1,) array
        Seconds.
    positions : (n + 1, r, 3) array
        Of the antennas, offsets added as far as known, metres; NaN where a receiver that writes
        less often has none.
    headings : (n + 1,) array
        Of something fixed to the vehicle, radians.
    sides : Sides
        What is looked at.

    Notes
    -----
    Along and across are seen from the vehicle, where the way of an antenna is the same all through
    a turn. Heights are those above the plane through the antennas, averaged over the window: on an
    even slope a vehicle that turns keeps them. What a receiver shows that writes less often is that
    of its own interval, for all intervals within it.
    """
    side, averaged, guessed, own_only = sides
    if len(times) < 8 * averaged:
        return None
    n = len(times) - 1
    whole = filled(times, positions, headings)
    if guessed:
        told = unexpected_ways(times, positions, whole, headings, side, own=own_only)
        if told is None:
            return None
        motion, effects, moving = told.values, told.effects, told.told
    else:
        motion, effects, moving = _against_lines(times, positions, whole, headings, side)
    if moving.sum() < 8 * side:
        return None
    rods = pair_differences(whole)
    distances = np.linalg.norm(rods, axis=-1)
    along = rods / np.maximum(distances, TINY)[..., None]
    changes, sides_seen = np.zeros((n, distances.shape[1])), np.zeros((2, n, *along.shape[1:]))
    wider, turning = np.ones(n), np.zeros((n, distances.shape[1]))
    for rows, pairs in together_rows(positions):
        fixes = max(round(averaged * (len(rows) - 1) / n), FEWEST_DISTANCES)
        own = _wider(times[rows], distances[rows][:, pairs], fixes)
        wider = np.maximum(wider, spread_over(rows, own, n))
        before, after = _means(distances[rows][:, pairs], fixes)
        changes[:, pairs] = spread_over(rows, after - before, n)
        ways = _means(along[rows][:, pairs], fixes)
        turning[:, pairs] = spread_over(rows, _turning(after, before, ways), n)
        for seen, mean in zip(sides_seen, reversed(ways), strict=True):
            seen[:, pairs] = spread_over(rows, mean, n)
    directions = np.stack([turned(-headings[:-1], seen) for seen in sides_seen])
    motion[~moving] = 0.0
    values = np.concatenate([motion.reshape(n, -1), changes], axis=1)
    axes, sigmas, floor = _scaled(values, moving, motion[0].size, 2 * max(side, averaged))
    sigmas[:, motion[0].size :] *= wider[:, None]
    sigmas = np.sqrt(sigmas**2 + turning @ axes[motion[0].size :] ** 2)
    if own_only:
        # Where all tell, they tell more.
        all_tell = unexpected_ways(times, positions, whole, headings, NEAREST)
        moving = moving & ~all_tell.told if all_tell else moving
        sigmas[~moving, : motion[0].size] = NEVER
    # What neighbours guess is new at each interval; lines and means are so once a side.
    freedom = _EFFICIENCY * n / (SIDE if guessed else max(side, averaged))
    return Contrasts(
        max(side, averaged), values, axes, sigmas, floor, freedom, directions, moving, effects,
        guessed,
    )  # fmt: skip


def _against_lines(
    times: Array, positions: Array, whole: Array, headings: Array, side: int
) -> tuple[Array, Array, Bools]:
    """(n, r, 3) jumps beside lines through fixes on both sides, their effects, and where told."""
    n, r = len(times) - 1, positions.shape[1]
    motion, moving = np.zeros((n, r, 3)), np.ones(n, dtype=bool)
    for rows, receivers in fixed_rows(positions):
        few = side if len(rows) == n + 1 else SIDE
        own = _motion(whole[rows], headings[rows], few)[:, receivers]
        motion[:, receivers] = spread_over(rows, own, n)
        moving &= spread_over(rows, _even(times[rows], few), n)
    plane = np.column_stack([antenna_planes(whole)[2][:-1], np.zeros(n)])
    slopes = turned(-headings[:-1], plane)[:, :2]
    slopes = _summed(slopes, np.full(2 * PLANE - 1, 1 / (2 * PLANE - 1)))
    effects = np.tile(np.eye(3 * r), (n, 1, 1))
    for k in range(r):
        effects[:, 3 * k + 2, 3 * k : 3 * k + 2] = -slopes
    return motion, effects, moving


def spoilt(seen: Contrasts, spread: float) -> Bools:
    """(n,) True where the distances change by themselves by more than a spread, metres."""
    motion = seen.values.shape[1] - seen.rods.shape[2]
    return np.asarray(seen.moving & (seen.sigmas[:, motion:] > spread).any(1))


def of_motion(seen: Contrasts) -> Contrasts:
    """The same without what the distances say."""
    motion = seen.values.shape[1] - seen.rods.shape[2]
    values = seen.values[:, :motion]
    axes, sigmas, floor = _scaled(values, seen.moving, motion, 2 * seen.window)
    rods = seen.rods[:, :, :0]
    return replace(seen, values=values, axes=axes, sigmas=sigmas, floor=floor, rods=rods)


def _even(times: Array, side: int) -> Bools:
    """(n,) True for the intervals about which no fix is missing."""
    spacing = np.diff(times)
    even = (np.abs(spacing / np.median(spacing) - 1) < _EVEN - 1).astype(float)
    return np.asarray(_summed(even, np.ones(2 * side - 1)) > 2 * side - 1.5)


def _motion(positions: Array, headings: Array, side: int) -> Array:
    """(n, r, 3) jumps of the antennas against their motion on both sides."""
    weights = step_weights(side)
    moves = np.diff(positions, axis=0)
    # The middle of the interval: half of the turn within it.
    middle = headings[:-1] + np.angle(np.exp(1j * np.diff(headings))) / 2
    values = _summed(turned(-middle, moves), weights)
    lift = _summed(moves, weights)
    slopes = _summed(antenna_planes(positions)[2][:-1], np.full(len(weights), 1 / len(weights)))
    values[..., 2] = lift[..., 2] - np.einsum("nk,nrk->nr", slopes, lift[..., :2])
    return values


def _means(values: Array, side: int) -> tuple[Array, Array]:
    """(n, ...) means of n + 1 values before and after each interval; 0 near the ends."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    before, after = np.zeros((2, len(values) - 1, *values.shape[1:]))
    inside = slice(side - 1, len(before) - side + 1)
    middle = total[side:-side]
    before[inside], after[inside] = (
        (middle - total[: -2 * side]) / side,
        (total[2 * side :] - middle) / side,
    )
    return before, after


def _turning(after: Array, before: Array, ways: tuple[Array, Array]) -> Array:
    """(n, p) variance that errors which stay give to changes of distances as the vehicle turns.

    East and north they go on; along a distance they are another number when it points elsewhere.
    How large they are the means (n, p) before and after each interval show, beside what changes
    where nothing turns; their mean directions (n, p, 3) before and after show the turn.
    """
    inside = after[:, 0] > 0
    if not inside.any():
        return np.zeros(after.shape)
    changes = sigma_from_median((after - before)[inside], axis=0)
    spread = sigma_from_median(after[inside] - np.median(after[inside], axis=0), axis=0)
    lasting = np.maximum(spread**2 - changes**2 / 2, 0.0)
    return np.asarray(lasting * np.square(ways[1] - ways[0]).sum(-1))


def _wider(times: Array, distances: Array, side: int) -> Array:
    """(n,) times that means of distances (n + 1, p) over a pause differ by more than usual ones.

    Errors that wander go on during the pause: their means change as between fixes that are as far
    apart elsewhere. White ones do not.
    """
    found = np.ones(len(times) - 1)
    before, after = _means(times, side)
    every = float(np.median(np.diff(times)))
    extra = np.where(after > 0, (after - before) / every - side, 0.0)
    total = np.concatenate([np.zeros((1, distances.shape[1])), np.cumsum(distances, axis=0)])
    means = (total[side:] - total[:-side]) / side
    usual = sigma_from_median(means[side:] - means[:-side], axis=0) + TINY
    steps = 2.0 ** np.ceil(np.log2(np.maximum(extra, 0.5)))
    for step in np.unique(steps[steps >= 1]):
        apart = min(side + int(step), len(means) // 2)
        spread = sigma_from_median(means[apart:] - means[:-apart], axis=0)
        found[steps == step] = max(float((spread / usual).max()), 1.0)
    return found


def antenna_planes(positions: Array) -> tuple[Array, Array, Array]:
    """Planes through antennas (n, r, 3), of two along their line.

    Returns
    -------
    (n, 2, 2), (n, r, 2) and (n, 2) arrays
        Inverse of the arms' square, 1/m^2; the arms from the middle, metres; and the slopes, east
        and north.
    """
    arms = positions - positions.mean(1, keepdims=True)
    level = arms[..., :2]
    square = np.einsum("nri,nrj->nij", level, level)
    inverse = np.linalg.pinv(square, rcond=1e-3, hermitian=True)
    slopes = np.einsum("nij,nrj,nr->ni", inverse, level, arms[..., 2])
    return np.asarray(inverse, dtype=float), level, np.asarray(slopes, dtype=float)


def _scaled(values: Array, moving: Bools, motion: int, window: int) -> tuple[Array, Array, Array]:
    """Axes of the contrasts, and standard deviations along them, which few jumps do not change.

    Over a pause only the distances, the columns from ``motion`` on, have a spread; the axes are
    therefore those of the motion given the distances, and of the distances.
    """
    known = values[moving]
    size = values.shape[1]
    covariance = np.diag(np.square(sigma_from_median(known, axis=0)) + TINY**2)
    for _ in range(_ROUNDS):
        squares = np.einsum("ni,ij,nj->n", known, np.linalg.inv(covariance), known)
        good = squares <= np.quantile(squares, _GOOD)
        covariance = known[good].T @ known[good] / good.sum() + TINY**2 * np.eye(size)
    axes = _axes(covariance, motion)
    sigmas, floor = np.empty(values.shape), np.empty(size)
    for k in range(size):
        along = np.abs(values @ axes[:, k])
        rows = moving if k < motion else np.ones(len(values), dtype=bool)
        floor[k] = float(sigma_from_median(along[rows])) + TINY
        around = np.maximum(floor[k], _around(along, window))
        far = float(np.quantile((along / around)[rows], 1 - _FAR))
        tail = max(far / -float(special.ndtri(_FAR / 2)), 1.0)
        # Motion with a tail that is too long by some factor at 2 % has one of its square farther
        # out. Slow errors have not: with the square the greatest of 2,800 was at 1.5 to 3 sigmas.
        sigmas[:, k] = np.where(rows, around * tail ** (2 if k < motion else 1), NEVER)
    return axes, sigmas, floor


def _axes(covariance: Array, motion: int) -> Array:
    """Columns: of the motion given the distances, then of the distances.

    Products with them are not correlated; their lengths are those of a change of one metre.
    """
    size = len(covariance)
    distances = covariance[motion:, motion:]
    gain = covariance[:motion, motion:] @ np.linalg.inv(distances)
    given = covariance[:motion, :motion] - gain @ covariance[motion:, :motion]
    axes = np.zeros((size, size))
    _, own = np.linalg.eigh(given)
    axes[:motion, :motion] = own
    axes[motion:, :motion] = -gain.T @ own
    axes[motion:, motion:] = np.linalg.eigh(distances)[1]
    return axes


def _around(sizes: Array, window: int) -> Array:
    """(n,) standard deviation of sizes (n,) around each, the interval's own window left out."""
    stride = max(window // 4, 1)
    shifts = stride * np.arange(4, 4 + _AROUND)
    shifts = np.concatenate([-shifts[::-1], shifts])
    reach = int(shifts[-1])
    padded = np.pad(sizes, reach, mode="reflect") if len(sizes) > reach else np.pad(sizes, reach)
    stack = np.stack([padded[reach + s : reach + s + len(sizes)] for s in shifts])
    return np.asarray(sigma_from_median(stack, axis=0))
