"""Jumps of the error of one receiver, of several on one base station, or of all.

A base station that restarts at other coordinates moves all its rovers at once; a false fix that
lasts moves one of them, and back. Every such cause has three numbers, the jump. At each interval
all causes are held against the contrasts, and the likeliest is taken where chance and the usual
motion make none so large.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rtk_gt.lasting.bumps import SOON, followed, upwards
from rtk_gt.lasting.causes import (
    GAIN,
    GAIN_OF_MOTION,
    LOOKED_AT,
    SMALLEST,
    SMALLEST_IN_MOTION,
    SMALLEST_OF_ALL,
    UNSURE,
    Jumped,
    fit_of,
    jumped,
    rotation_within,
    told_at,
)
from rtk_gt.lasting.continuity import gain_over_motion
from rtk_gt.lasting.contrasts import Contrasts, contrasts, of_motion, sides_of, spoilt
from rtk_gt.lasting.lacking_fixes import has_fix, often
from rtk_gt.receivers.fixes import Ints
from validation.pieces.results import kept_result
from validation.poses.angles import Array

GAIN_OVER_MOTION = 40.0
"""The same against motion of any roughness about the interval, see `gain_over_motion`: in 2,700
intervals without a jump, of drives that brake and turn, it was at most 34; of jumps of 10 cm of all
receivers at 5 and 10 Hz and a noise of 6 mm at least 59."""
CLEAR_OVER_MOTION = 60.0
"""The same where the usual motion of the drive makes as much (`LOOKED_AT`)."""
GAIN_OF_LIFT = 25.0
"""The same of a jump upwards of all receivers that the guess by its neighbours makes clear: nobody
brakes or steers upwards. One of some receivers upwards is none of their motion at all."""
GAIN_WITHOUT_ONE = 12.0
"""The same without any one of the two epochs on either side, so that one false fix is no jump: of
those intervals without a jump at most 10, of jumps of 10 cm less in one of 150."""
NEAR = 30.0
"""Gain below the greatest within which a cause may be the right one elsewhere nearby."""
SPOILT, LARGE = 0.05, 0.15
"""Metres by which means of distances over seconds usually change where they tell nothing, five
times what noise makes; and of the jumps that motion must tell alone there."""
_ROUNDS = 40
"""At most; each takes the first jump of some receivers, and those of all before it."""
CHANCE = 0.95
"""Share of the intervals, and of the jumps at them, that are seen of a size."""
ALIKE = 9.0
"""Gain by which a cause must be better than another to be told from it: 1 in 100 by chance."""


@dataclass(frozen=True)
class Jump:
    """A jump between two epochs.

    Parameters
    ----------
    row : int
        Of the last epoch before it.
    receivers : tuple of int
        Columns of the receivers whose errors jump.
    size : (3,) array
        East, north, up, metres.
    covariance : (3, 3) array
        Of the size, m^2.
    gain : float
        Twice the log likelihood ratio against no jump.
    alike : tuple of tuples of int
        Other receivers whose jump explains it nearly as well.
    by_motion : bool
        Whether only the motion tells it, no distance.
    told : tuple of (2, c, 3) array and (2, c, 3, 3) array
        Information on the size of each cause's jump, times the size and by itself, east, north, up,
        of an error that begins and of one that ends.
    """

    row: int
    receivers: tuple[int, ...]
    size: Array
    covariance: Array
    gain: float
    alike: tuple[tuple[int, ...], ...] = ()
    by_motion: bool = False
    told: tuple[Array, Array] = (np.zeros((2, 0, 3)), np.zeros((2, 0, 3, 3)))


@kept_result()
def find_jumps(
    times: Array, positions: Array, headings: Array, causes: Sequence[tuple[int, ...]]
) -> list[Jump]:
    """Jumps in the order of time.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, metres; constant errors do not matter, nor decimetres of the directions.
        NaN where a receiver that writes less often than others has none.
    headings : (n,) array
        Of something fixed to the vehicle, radians.
    causes : sequence of tuples of int
        Columns of the receivers that may jump together.
    """
    found: list[Jump] = []
    bumps: list[float] = []
    for _ in range(_ROUNDS):
        # Where one jumped already, motion alone does not tell that others did, too.
        new = [
            jump for jump in _greatest(times, positions, headings, causes)
            if not (jump.by_motion and any(abs(jump.row - one.row) <= UNSURE for one in found))
            and not (_is_lift(jump) and _soon(times, jump, bumps))
        ]  # fmt: skip
        more = _bumps(times, positions, headings, causes, found, new)
        bumps += more
        gone = [one for one in found if _is_lift(one) and _soon(times, one, bumps)]
        new = [one for one in new if not (_is_lift(one) and _soon(times, one, bumps))]
        new = _undisturbed(new, positions.shape[1])
        if not new and not more:
            break
        positions = _without(_without(positions, gone, -1.0), new)
        found = [one for one in found if not any(one is other for other in gone)] + new
    return _merged(found)


def _is_lift(jump: Jump) -> bool:
    """Whether a jump goes upwards, as a bump of the road does."""
    return bool(upwards(jump.size))


def _bumps(
    times: Array,
    positions: Array,
    headings: Array,
    causes: Sequence[tuple[int, ...]],
    found: Sequence[Jump],
    new: Sequence[Jump],
) -> list[float]:
    """Times of the new lifts that other lifts follow or precede at once."""
    lifts = [one for one in new if _is_lift(one)]
    if not lifts:
        return []
    places = [(one.row, one.receivers) for one in lifts]
    many = followed(times, _without(positions, new), headings, causes, places)
    all_at = [float(times[one.row]) for one in [*found, *lifts] if _is_lift(one)]
    bumped = [
        one for one, more in zip(lifts, many, strict=True)
        if more or _soon(times, one, [at for at in all_at if at != times[one.row]])
    ]  # fmt: skip
    return [float(times[one.row]) for one in bumped]


def _soon(times: Array, jump: Jump, others: Sequence[float]) -> bool:
    """Whether a jump is near other times."""
    return any(abs(times[jump.row] - at) < SOON for at in others)


def _without(positions: Array, jumps: Sequence[Jump], share: float = 1.0) -> Array:
    """The positions with a share of some jumps taken out."""
    rest = positions.copy()
    for jump in jumps:
        rest[jump.row + 1 :, list(jump.receivers)] -= share * jump.size
    return rest


def _undisturbed(found: list[Jump], receivers: int) -> list[Jump]:
    """Jumps up to the first of some receivers, in the order of time.

    While the error of one lasts, the distances change whenever the vehicle turns.
    """
    found = sorted(found, key=lambda one: one.row)
    some = (n for n, one in enumerate(found) if len(one.receivers) < receivers)
    return found[: next(some, len(found)) + 1]


@dataclass(frozen=True)
class SeenSizes:
    """Jumps that motion and distances show within seconds: (5 %, 95 %) of each, metres.

    Of the smaller size five in a hundred are seen, where they are seen best; of the larger one 95
    in a hundred, wherever it happens, but beside a pause.

    Parameters
    ----------
    level, up : (float, float)
        In any level direction, and upwards.
    """

    level: tuple[float, float] = (np.inf, np.inf)
    up: tuple[float, float] = (np.inf, np.inf)

    def best(self, other: "SeenSizes") -> "SeenSizes":
        """What one of two looks shows."""
        return min(self, other, key=lambda one: one.level[1] + one.up[1])


def seen_sizes(
    times: Array, positions: Array, headings: Array, causes: Sequence[tuple[int, ...]]
) -> SeenSizes:
    """Sizes of jumps of some receivers, whichever, that are seen; parameters as of `find_jumps`.

    Notes
    -----
    At each interval the look that sees most counts. The gain of a jump is a normal number, squared,
    about its size in sigmas, and must exceed `GAIN_OF_MOTION`.
    """
    n = len(times) - 1
    sigmas = np.full((len(causes), 2, n), np.inf)
    for sides in sides_of(times, positions):
        # Where one that writes less often lacks a fix, as beside a pause, little is seen of it.
        seen = None if sides.own else contrasts(times, positions, headings, sides)
        if seen is None or not seen.moving.any():
            continue
        rows = np.flatnonzero(seen.moving)
        for k, cause in enumerate(causes):
            _, _, spreads = fit_of(seen, cause, rows)
            level = np.linalg.eigvalsh(spreads[:, :2, :2])[:, -1]
            both = np.sqrt([level, spreads[:, 2, 2]])
            sigmas[k][:, rows] = np.minimum(sigmas[k][:, rows], both)
    told = np.isfinite(sigmas).all((0, 1))
    if not told.any():
        return SeenSizes()
    everyone = positions.shape[1]
    smallest = SMALLEST_OF_ALL if len(causes[0]) == everyone else SMALLEST_IN_MOTION
    low = np.quantile(sigmas[..., told], 1 - CHANCE, axis=2).min(0)
    high = np.quantile(sigmas[..., told], CHANCE, axis=2).max(0)
    gain, normal = np.sqrt(GAIN_OF_MOTION), float(special.ndtri(CHANCE))
    ends = [
        (max((gain - normal) * small, smallest), max((gain + normal) * large, smallest))
        for small, large in zip(low, high, strict=True)
    ]
    return SeenSizes(*((float(small), float(large)) for small, large in ends))


def _greatest(
    times: Array, positions: Array, headings: Array, causes: Sequence[tuple[int, ...]]
) -> list[Jump]:
    """The jumps that are the greatest within their windows."""
    candidates: list[tuple[float, int, Jump, float]] = []
    looked = [contrasts(times, positions, headings, sides) for sides in sides_of(times, positions)]
    views = [seen for seen in looked if seen is not None]
    places = _Places(times, positions, headings, looked[0] if looked else None)
    for seen, told, smallest in _looks(views, causes):
        large = np.linalg.norm(told.sizes, axis=2) > smallest
        lacking = np.where(told.by_motion, GAIN_OF_MOTION - LOOKED_AT, 0.0)
        best = np.where(told.allowed & large, told.gains + lacking, -np.inf).max(1)
        for peak in _peaks(best, 2 * seen.window):
            some = np.flatnonzero(told.gains[peak] > told.gains[peak].max() - NEAR)
            # Who it was the motion tells, where it was.
            reach = seen.window // 3
            rows = np.array(
                [
                    _sharpest(told.gains[:, k], int(peak), reach) if seen.guessed
                    else places.best(int(peak), causes[int(k)], reach)
                    for k in some.tolist()
                ]
            )  # fmt: skip
            reached = told.gains[rows, some]
            likely = reached > reached.max() - ALIKE
            sure = likely & told.allowed[rows, some]
            if not sure.any():
                continue
            chosen = int(np.where(sure, reached, -np.inf).argmax())
            row, cause = int(rows[chosen]), int(some[chosen])
            alike = tuple(causes[int(k)] for k in some[likely] if k != cause)
            east = rotation_within(headings[row : row + 2])
            jump = Jump(
                row, causes[cause], east @ told.sizes[row, cause],
                east @ told.spreads[row, cause] @ east.T,
                float(best[peak] - lacking[row, cause]) + GAIN, alike,
                bool(told.by_motion[row, cause]), told_at(seen, headings, row, causes),
            )  # fmt: skip
            least = _least_over_motion(jump, positions.shape[1], seen.guessed)
            candidates.append((float(best[peak]), seen.window, jump, least))
    taken: list[tuple[int, int, Jump]] = []
    for _, side, jump, least in sorted(candidates, key=lambda one: -one[0]):
        if all(abs(jump.row - row) > 2 * max(side, other) for row, other, _ in taken) and (
            least == 0 or _over_motion(times, positions, jump, least)
        ):
            taken.append((jump.row, side, jump))
    return [jump for _, _, jump in taken]


def _looks(
    views: Sequence[Contrasts], causes: Sequence[tuple[int, ...]]
) -> Iterator[tuple[Contrasts, Jumped, float]]:
    """What each view says of the causes, and the least length of a jump that is taken from it.

    One after the other: of an hour each is 10 MB.
    """
    for seen in views:
        yield seen, jumped(seen, causes), 0.0
    # With a large error that stays, distances change by themselves wherever the vehicle turns; and
    # upwards, as by heights of antennas that are a decimetre wrong, they may do anything.
    for seen in views:
        alone = of_motion(seen)
        found = jumped(alone, causes)
        found.allowed[...] &= spoilt(seen, SPOILT)[:, None] | upwards(found.sizes)
        yield alone, found, LARGE


def _sharpest(gains: Array, peak: int, reach: int) -> int:
    """The row with the greatest gain within ``reach`` of a peak."""
    low = max(peak - reach, 0)
    return low + int(gains[low : peak + reach + 1].argmax())


def _least_over_motion(jump: Jump, receivers: int, guessed: bool) -> float:
    """Gain that a jump must have against motion of any roughness."""
    if not jump.by_motion:
        return 0.0
    up = bool(upwards(jump.size))
    if guessed and up and jump.gain > GAIN and len(jump.receivers) < receivers:
        return 0.0
    if guessed and up and jump.gain > CLEAR_OVER_MOTION:
        return GAIN_OF_LIFT
    return GAIN_OVER_MOTION if jump.gain > GAIN else CLEAR_OVER_MOTION


def _over_motion(times: Array, positions: Array, jump: Jump, least: float) -> bool:
    """Whether no motion of the receivers that jump explains it nearly as well."""
    every = often(positions)
    who = [k for k in jump.receivers if k in every] or list(jump.receivers)
    rows = np.flatnonzero(has_fix(positions)[:, who].all(1))
    times, places = times[rows], positions[rows][:, who].mean(1)
    jump = replace(jump, row=int(np.searchsorted(rows, jump.row, side="right")) - 1)
    around = range(max(jump.row - UNSURE, 0), min(jump.row + UNSURE + 1, len(times) - 1))
    gains = [gain_over_motion(times, places, row) for row in around]
    at = around[int(np.argmax(gains))]
    return max(gains) > least and all(
        gain_over_motion(*_but(times, places, epoch), at - (epoch <= at)) > GAIN_WITHOUT_ONE
        for epoch in range(at - 1, at + 3)
    )


def _but(times: Array, places: Array, epoch: int) -> tuple[Array, Array]:
    """Times and places but those of an epoch."""
    return np.delete(times, epoch), np.delete(places, epoch, axis=0)


class _Places:
    """Where in time a jump is, as the receivers that write most often show it."""

    def __init__(
        self, times: Array, positions: Array, headings: Array, seen: Contrasts | None
    ) -> None:
        self._often = often(positions)
        self._reach = (len(positions) - 1) // max(min(has_fix(positions).sum(0)) - 1, 1)
        self._seen = seen
        if seen is not None and len(self._often) < positions.shape[1]:
            own = positions[:, self._often]
            self._seen = contrasts(times, own, headings, sides_of(times, own)[0])

    def best(self, row: int, cause: tuple[int, ...], reach: int) -> int:
        """The row within ``reach`` of one at which a jump explains the contrasts about it best.

        Of a jump the intervals beside show half, the other way round (`step_weights` of two fixes).
        """
        seen = self._seen
        columns = tuple(np.flatnonzero(np.isin(self._often, cause)).tolist())
        if seen is None or not columns:
            return row
        reach = max(reach, self._reach if self._reach > 1 else 0)
        n = len(seen.values)
        motion = seen.values.shape[1] - seen.rods.shape[2]
        rows = np.arange(max(row - reach, 1) - 1, min(row + reach + 1, n - 1) + 1)
        along = (seen.values[rows] @ seen.axes) / seen.floor
        designs = seen.designs(columns, rows=rows)
        designs = np.einsum("ji,nja->nia", seen.axes, designs) / seen.floor[:, None]
        best, place = -np.inf, row
        for at in range(1, len(rows) - 1):
            if not seen.moving[rows[at - 1 : at + 2]].all():
                continue
            near = [-0.5 * designs[at - 1, :motion], designs[at], -0.5 * designs[at + 1, :motion]]
            design = np.concatenate(near)
            found = np.concatenate([along[at - 1, :motion], along[at], along[at + 1, :motion]])
            size, *_ = np.linalg.lstsq(design, found, rcond=None)
            gain = float(found @ design @ size)
            if gain > best:
                best, place = gain, int(rows[at])
        return place


def _peaks(values: Array, apart: int) -> Ints:
    """Rows of values above 0 that none within ``apart`` exceeds."""
    rows = np.flatnonzero(values > 0)
    if len(rows) == 0:
        return rows
    padded = np.pad(values, apart, constant_values=-np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * apart + 1)[rows]
    return np.asarray(rows[values[rows] >= windows.max(1)])


def _merged(found: list[Jump]) -> list[Jump]:
    """In the order of time; what several rounds took of one jump is one."""
    kept: list[Jump] = []
    for jump in sorted(found, key=lambda one: -one.gain):
        for k, other in enumerate(kept):
            if jump.receivers == other.receivers and abs(jump.row - other.row) <= UNSURE:
                kept[k] = replace(other, size=other.size + jump.size)
                break
        else:
            kept.append(jump)
    whole = [one for one in kept if np.linalg.norm(one.size) > SMALLEST]
    return sorted(whole, key=lambda one: (one.row, one.receivers))
