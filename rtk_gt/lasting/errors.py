"""Errors that last: what jumps, who jumps, and until when.

Receivers do not all write at one rate. Those that write most often show best when something jumped
and whether the vehicle did; all together show who.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from rtk_gt.lasting.causes import SMALLEST_OF_ALL, UNSURE, causes_of
from rtk_gt.lasting.edges import Motion
from rtk_gt.lasting.jumps import Jump, SeenSizes, find_jumps, seen_sizes
from rtk_gt.lasting.jumps_back import LONGEST_FALSE, missing_jumps, passed
from rtk_gt.lasting.lacking_fixes import (
    OFTEN,
    SPACING,
    often,
    own_interval,
    spaced_rows,
    with_lost_fixes,
)
from rtk_gt.lasting.lasting_error import LastingError, epochs_with, is_bump
from rtk_gt.lasting.restarts import find_change
from rtk_gt.lasting.seen_from_vehicle import baseline_headings
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Ints
from rtk_gt.receivers.steps import Steps
from validation.pieces.results import kept_result
from validation.poses.angles import Array

FASTER = 1.5
"""Times as many epochs that some receivers must have together to be looked at by themselves."""
MOST = 4000
"""Epochs at most from which jumps of the offsets are told: enough for every correlation time."""
COURSE, SLOWEST = 1.0, 0.3
"""Seconds to both sides over which a course is averaged, and metres a second below which there is
none: noise of a centimetre turns it by a degree."""
GAIN_OF_ONE = 110.0
"""Twice the log likelihood ratio above which one receiver is said to have jumped. Its antenna is
thrown sideways where the vehicle changes its turn from 15 degrees a second to one side to 15 to the
other between two fixes: in simulated drives that do so all the time it made gains of up to 96. It
is not thrown upwards."""
GAIN_THERE_AND_BACK = 55.0
"""The same of one that ends with a jump back of the same size, which turns hardly make."""
EDGE = 5
"""Epochs at the ends of a record that show no jump of one receiver: nothing holds them outside."""
SHORT = 3
"""Epochs below which an error is a single false fix, which are counted and not listed."""


@dataclass(frozen=True)
class _Timed:
    """A jump between two times."""

    before: float
    after: float
    jump: Jump


def lasting_errors(steps: Steps, offsets: Offsets) -> list[LastingError]:
    """Errors that begin with a jump, in the order of time.

    Parameters
    ----------
    steps : Steps
        As recorded.
    offsets : Offsets
        Of the receivers, to a decimetre.
    """
    recorded, spaced = steps, spaced_rows(steps)
    bad = _bad(steps, offsets)[spaced]
    steps = with_lost_fixes(_placed(steps, offsets).select(spaced))
    everyone = tuple(range(len(steps.receivers)))
    rows = _looked_at(steps)
    found = _jumps(steps, rows, everyone, bad[rows])
    fast = _often(steps)
    for some in dict.fromkeys([*([] if fast is None else [fast]), *_while_one_lacks(steps)]):
        found = sorted([*found, *_alone(steps, some, found)], key=lambda one: one.after)
    found = sorted([*found, *_missing(steps, rows, bad[rows], found)], key=lambda one: one.after)
    return [one for one in _episodes(recorded, found) if not is_bump(one)]


def _looked_at(steps: Steps) -> Ints:
    """Rows of the steps that are looked at.

    Those of the receivers that write most often, if these are some but not all; else those at which
    all are fixed.
    """
    every = np.flatnonzero(steps.complete)
    fast = _often(steps)
    rows = every if fast is None else np.flatnonzero((steps.kinds[:, fast] == RTK_FIXED).all(1))
    if len(rows) <= FASTER * len(every):
        rows = every
    return rows


def _bad(steps: Steps, offsets: Offsets) -> Bools:
    """(t,) True at single bad epochs."""
    found = np.zeros(len(steps), dtype=bool)
    found[np.flatnonzero(steps.complete)[_single(offsets)]] = True
    return found


def _single(offsets: Offsets) -> Bools:
    """(t,) the bad steps that are fewer in a row than an error that lasts, and unlike those beside.

    At the edge of an error that lasts some steps may be bad and others not.
    """
    bad = offsets.weights <= 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bad, [False]]).astype(int)))
    found = np.zeros(len(bad), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        inside, beside = [(begin, begin - 1), (end - 1, end)], offsets.residuals
        alike = [
            np.linalg.norm(beside[own] - beside[other]) < np.linalg.norm(beside[own]) / 2
            for own, other in inside
            if 0 <= other < len(bad)
        ]
        if end - begin < SHORT and not any(alike):
            found[begin:end] = True
    return found


def _while_one_lacks(steps: Steps) -> list[tuple[int, ...]]:
    """All receivers but one that is not fixed for a while in which the others are.

    Of these those that write most often.
    """
    fixed = steps.kinds == RTK_FIXED
    everyone = range(fixed.shape[1])
    found = []
    for k in everyone if len(everyone) > 2 else ():
        others = tuple(j for j in everyone if j != k)
        alone = _fixed_often(steps, others) & ~fixed[:, k]
        runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], alone, [0]]))))[::2]
        if len(runs) and runs.max() > 2 * EDGE:
            found.append(others)
    return found


def _alone(steps: Steps, fast: tuple[int, ...], found: list[_Timed]) -> list[_Timed]:
    """Jumps of some receivers while the others have no fix.

    Where all of these jump, and no distance to the others changes meanwhile, these jump, too.
    """
    together = steps.times[steps.complete]
    if len(together) < 2:
        return []
    usual = float(np.median(np.diff(together)))
    rows = np.flatnonzero(_fixed_often(steps, fast))
    unequal = not (steps.kinds[rows][:, fast] == RTK_FIXED).all()
    kept = []
    for one in _jumps(steps, rows, fast, np.zeros(len(rows), dtype=bool)):
        at = int(np.searchsorted(together, one.after - 1e-6))
        # Beside a pause of all, too, their motion tells less.
        beside = np.diff(together[max(at - 1 - UNSURE, 0) : at + 1 + UNSURE])
        gap = beside.max() if 0 < at < len(together) else np.inf
        near = any(other.before - usual < one.after < other.after + usual for other in found)
        if gap > FASTER * usual and not (np.isfinite(gap) and near):
            everyone = tuple(range(len(steps.receivers)))
            of_all = len(one.jump.receivers) == len(fast)
            if unequal and not of_all:
                continue  # the look at all tells it better
            who = everyone if of_all else one.jump.receivers
            kept.append(replace(one, jump=replace(one.jump, receivers=who)))
    return kept


def _missing(steps: Steps, rows: Ints, bad: Bools, found: list[_Timed]) -> list[_Timed]:
    """Jumps forth or back of those of one receiver of which only the other was found."""
    everyone = tuple(range(len(steps.receivers)))
    times, positions = _thinned(steps, rows, everyone, bad)
    last = len(times) - 2
    at = [min(max(int(np.searchsorted(times, one.after - 1e-6)) - 1, 0), last) for one in found]
    known = [replace(one.jump, row=row) for one, row in zip(found, at, strict=True)]
    new = missing_jumps(times, positions, _headings(times, positions), known)
    return [_timed(times, positions, one, everyone) for one in new]


def errors_of_one(steps: Steps) -> tuple[list[LastingError], SeenSizes]:
    """Errors of a single receiver that begin with a jump, and the sizes of jumps that show.

    Parameters
    ----------
    steps : Steps
        Of one receiver.

    Notes
    -----
    Its motion alone tells them, seen along and across the way that it takes. Infinite are the
    sizes where the fixes are too few.
    """
    rows = np.flatnonzero(steps.complete)
    if len(rows) < 2:
        return [], SeenSizes()
    times, positions = _thinned(steps, rows, (0,), np.zeros(len(rows), dtype=bool))
    course = _course(times, positions[:, 0, :2])
    jumps = find_jumps(times, positions, course, [(0,)])
    found = [
        one
        for one in [*jumps, *missing_jumps(times, positions, course, jumps)]
        if np.linalg.norm(one.size) > SMALLEST_OF_ALL and EDGE <= one.row < len(times) - 1 - EDGE
    ]
    found.sort(key=lambda one: one.row)
    timed = [_Timed(float(times[one.row]), float(times[one.row + 1]), one) for one in found]
    errors = [one for one in _episodes(steps, timed) if one.gain > _gain_of_one(one)]
    return errors, seen_sizes(times, positions, course, [(0,)])


def _gain_of_one(error: LastingError) -> float:
    """Gain that an error of a single receiver must have to be told; see `GAIN_OF_ONE`."""
    upwards = abs(error.size[2]) > np.hypot(error.size[0], error.size[1])
    return 0.0 if upwards else GAIN_OF_ONE if error.stays else GAIN_THERE_AND_BACK


def _course(times: Array, level: Array) -> Array:
    """(n,) directions of the way of positions (n, 2); where they stand still, those beside."""
    reach = max(round(COURSE / float(np.median(np.diff(times)))), 1)
    smooth = uniform_filter1d(level, 2 * reach + 1, axis=0, mode="nearest")
    speed = np.gradient(smooth, times, axis=0)
    moving = np.hypot(speed[:, 0], speed[:, 1]) > SLOWEST
    if not moving.any():
        return np.zeros(len(times))
    way = np.unwrap(np.arctan2(speed[moving, 1], speed[moving, 0]))
    return np.asarray(np.interp(times, times[moving], way))


def changed(steps: Steps, offsets: Offsets) -> LastingError | None:
    """The likeliest error that is still in the steps by the whole drive; None if none is sure.

    Parameters
    ----------
    steps, offsets
        As in `lasting_errors`.
    """
    if not offsets.known:
        return None
    every = np.flatnonzero(steps.complete)
    rows = every[~_single(offsets)]
    rows = rows[:: max(len(rows) // MOST, 1)]
    placed, some = _placed(steps, offsets), spaced_rows(steps)
    whole = with_lost_fixes(placed.select(some))
    looked, bad = _looked_at(whole), _bad(steps, offsets)[some]
    everyone = tuple(range(len(steps.receivers)))
    about = [_motion(whole, looked, everyone, bad[looked])]
    for others in _while_one_lacks(whole):
        shared = np.flatnonzero(_fixed_often(whole, others))
        about.append(_motion(whole, shared, others, np.zeros(len(shared), dtype=bool)))
    found = find_change(steps.times[rows], placed.positions[rows], offsets, about)
    if found is None:
        return None
    return replace(found, epochs=epochs_with(steps, found.receivers, found.start, found.end))


def _motion(steps: Steps, rows: Ints, columns: tuple[int, ...], bad: Bools) -> Motion:
    """That of some receivers at some epochs."""
    times, positions = _thinned(steps, rows, columns, bad)
    return Motion(times, positions, _headings(times, positions), columns)


def _placed(steps: Steps, offsets: Offsets) -> Steps:
    """The steps with offsets added; where these are open, with the antennas on a circle.

    A road that leaves offsets open is straight, and the antennas keep their places along it.
    """
    if offsets.known:
        return steps.corrected(offsets.offsets)
    together = steps.positions[steps.complete]
    angle = 2 * np.pi * np.arange(len(steps.receivers)) / len(steps.receivers)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    return replace(
        steps, positions=steps.positions - np.median(together - together[:, :1], axis=0) + circle
    )


@kept_result()
def seen_of_all(steps: Steps, offsets: Offsets) -> SeenSizes:
    """Sizes of jumps of all receivers that are seen; infinite where the steps are too few.

    Parameters as in `lasting_errors`.
    """
    steps = with_lost_fixes(_placed(steps, offsets).select(spaced_rows(steps)))
    fast, found = _often(steps), SeenSizes()
    for some in (tuple(range(len(steps.receivers))), *([] if fast is None else [fast])):
        rows = np.flatnonzero((steps.kinds[:, some] == RTK_FIXED).all(1))
        found = found.best(_seen(steps, rows, some, [tuple(range(len(some)))]))
    return found


@kept_result()
def seen_of_some(steps: Steps, offsets: Offsets) -> SeenSizes:
    """The same of jumps of some receivers, whichever."""
    steps = with_lost_fixes(_placed(steps, offsets).select(spaced_rows(steps)))
    everyone = tuple(range(len(steps.receivers)))
    some = [one for one in causes_of(len(everyone)) if len(one) < len(everyone)]
    return _seen(steps, _looked_at(steps), everyone, some)


def _seen(
    steps: Steps, rows: Ints, columns: tuple[int, ...], causes: list[tuple[int, ...]]
) -> SeenSizes:
    """Of jumps of some columns at some epochs."""
    if len(rows) < 2 or not causes:
        return SeenSizes()
    times, positions = _thinned(steps, rows, columns, np.zeros(len(rows), dtype=bool))
    return seen_sizes(times, positions, _headings(times, positions), causes)


def _jumps(steps: Steps, rows: Ints, columns: tuple[int, ...], bad: Bools) -> list[_Timed]:
    """Jumps of some receivers at the times at which they are fixed together."""
    times, positions = _thinned(steps, rows, columns, bad)
    found = find_jumps(times, positions, _headings(times, positions), causes_of(len(columns)))
    return [_timed(times, positions, one, columns) for one in found]


def _timed(times: Array, positions: Array, jump: Jump, columns: tuple[int, ...]) -> _Timed:
    """A jump between the fixes of its receivers, which are named by their columns."""
    before, after = own_interval(positions, jump.receivers, jump.row)
    named = replace(jump, receivers=tuple(columns[k] for k in jump.receivers))
    return _Timed(float(times[before]), float(times[after]), named)


def _thinned(steps: Steps, rows: Ints, columns: tuple[int, ...], bad: Bools) -> tuple[Array, Array]:
    """Times and positions (n, r, 3) that are looked at; NaN where one is not fixed."""
    fixed = steps.kinds[rows][:, list(columns)] == RTK_FIXED
    found = np.where(fixed[..., None], steps.positions[rows][:, list(columns)], np.nan)
    positions = _bridged(steps.times[rows], found, bad)
    stride = max(round(SPACING / float(np.median(np.diff(steps.times[rows])))), 1)
    # Those that write less often must not fall between the epochs that are kept.
    first = max(range(stride), key=lambda k: int(fixed[k::stride].all(1).sum()))
    return steps.times[rows][first::stride], positions[first::stride]


def _headings(times: Array, positions: Array) -> Array:
    """(n,) headings of the longest baseline, of (n, r, 3) positions, that no jump turns.

    Of receivers that have one at every epoch, if these are two. A jump of one of its ends turns it
    between two epochs, which the median of the turns about that interval leaves out; over a hundred
    epochs the headings follow the baseline again.
    """
    every = often(positions)
    seen = baseline_headings(times, positions[:, every] if len(every) > 1 else positions)
    if seen is None:
        return np.zeros(len(times))
    turns = median_filter(np.diff(seen), 5, mode="nearest")
    smooth = np.concatenate([[0.0], np.cumsum(turns)])
    return np.asarray(smooth + uniform_filter1d(seen - smooth, 101, mode="nearest"))


def _bridged(times: Array, positions: Array, bad: Bools) -> Array:
    """Positions with the epochs that are bad replaced by what is between their neighbours."""
    if not bad.any() or bad.all():
        return positions
    bridged = positions.copy()
    for k in often(positions):
        for axis in range(3):
            good = positions[~bad, k, axis]
            bridged[bad, k, axis] = np.interp(times[bad], times[~bad], good)
    rare = np.setdiff1d(np.arange(positions.shape[1]), often(positions))
    bridged[np.ix_(bad, rare)] = np.nan
    return bridged


def _often(steps: Steps) -> tuple[int, ...] | None:
    """Receivers that write most often, if they are some but not all."""
    fixes = (steps.kinds == RTK_FIXED).sum(0)
    some = tuple(np.flatnonzero(fixes >= OFTEN * fixes.max()).tolist())
    return some if 2 <= len(some) < len(fixes) else None


def _fixed_often(steps: Steps, columns: tuple[int, ...]) -> Bools:
    """(t,) True where those of some receivers that write most often are fixed."""
    fixed = steps.kinds[:, list(columns)] == RTK_FIXED
    fixes = fixed.sum(0)
    return np.asarray(fixed[:, fixes >= OFTEN * fixes.max()].all(1))


def _episodes(steps: Steps, found: list[_Timed]) -> list[LastingError]:
    """Jumps with the jumps back that end them."""
    count = len(steps.receivers)
    errors: list[LastingError] = []
    used: set[int] = set()
    for k, one in enumerate(found):
        if k in used:
            continue
        end, jump = np.inf, one.jump
        later = [
            n
            for n in range(k + 1, len(found))
            if n not in used and found[n].after - one.after < LONGEST_FALSE
        ]
        ends = [(n, passed(one.jump, found[n].jump, count)) for n in later]
        best = min(
            ((end[0], n, end[1]) for n, end in ends if end is not None),
            key=lambda pair: pair[0], default=None,
        )  # fmt: skip
        if best is not None:
            _, n, jump = best
            used.add(n)
            end = found[n].after
            if end <= one.after:
                continue  # there and back between two fixes of the receiver: it has no such fix
        errors.append(
            LastingError(
                jump.receivers, one.after, float(end), jump.size, jump.covariance, jump.gain,
                epochs_with(steps, jump.receivers, one.after, end), one.after - one.before,
                jump.alike, told_by_motion=jump.by_motion,
            )
        )  # fmt: skip
    return errors
