"""An error of receivers that begins with a jump, and stays or goes again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from rtk_gt.lasting.bumps import SOON, upwards
from rtk_gt.lasting.causes import GAIN, GAIN_OF_MOTION, SMALLEST, SMALLEST_IN_MOTION, UNSURE
from rtk_gt.lasting.jumps_back import LONGEST_FALSE, contradicts, mismatch
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.receivers.fixes import RTK_FIXED, Bools
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array

EITHER = 0.25
"""Variance of which of two equally likely causes it was: of a number that is 0 or 1."""
NOT_USED = -1
"""Kind of a fix that is left out."""
DENIED, DIFFERS = 0.3, 0.001
"""Share of a jump that the whole drive takes off where it denies it, and metres by which sizes may
differ at least."""
DENIED_WHOLLY, DENIES = 2 / 3, 16.0
"""The same of an error that goes again, and the squared sigmas of two numbers that deny it: chance
makes them in one of 3,000."""
LARGEST_RESTART = 10.0
"""Metres by which the coordinates of a base station change at most where it restarts: a judgement;
those of a single point position, the worst that bases take, are off by some metres."""


@dataclass(frozen=True)
class LastingError:
    """An error that begins with a jump.

    Parameters
    ----------
    receivers : tuple of int
        Columns of those that have it.
    start, end : float
        Seconds since 1970 of the first fix that has it and the first that has it no more; infinite
        if it stays.
    size : (3,) array
        East, north and up, metres.
    covariance : (3, 3) array
        Of the size, m^2.
    gain : float
        Twice the log likelihood ratio against no jump.
    epochs : int
        Times at which the receivers have it.
    spacing : float
        Seconds between the fixes before and after the jump.
    alike : tuple of tuples of int
        Other receivers whose jump would explain it nearly as well.
    window : (float, float)
        Seconds since 1970 between which it may have begun, where no motion tells it to the fix.
    around : (3,) and (3, 3) array, optional
        Size and covariance by the motion about it alone, where the whole drive told it first.
    told_by_motion : bool
        Whether only the motion told it, no distance.
    """

    receivers: tuple[int, ...]
    start: float
    end: float
    size: Array
    covariance: Array
    gain: float
    epochs: int
    spacing: float
    alike: tuple[tuple[int, ...], ...] = ()
    window: tuple[float, float] = (np.inf, -np.inf)
    around: tuple[Array, Array] | None = None
    told_by_motion: bool = False

    @property
    def stays(self) -> bool:
        """Whether it lasts to the end of the record."""
        return bool(np.isinf(self.end))

    @property
    def length(self) -> float:
        """Metres of the jump."""
        return float(np.linalg.norm(self.size))

    @property
    def length_sigma(self) -> float:
        """Standard deviation of the length."""
        along = self.size / max(self.length, 1e-9)
        return float(np.sqrt(along @ self.covariance @ along))


def beyond_a_base(error: LastingError) -> bool:
    """Whether a jump is clearly larger than a restart of a base station makes."""
    return error.length - 3 * error.length_sigma > LARGEST_RESTART


def shown(error: LastingError) -> bool:
    """Whether the whole drive says as much of a jump as the time around it must."""
    moved = error.told_by_motion
    squares = float(error.size @ np.linalg.solve(error.covariance, error.size))
    least = SMALLEST_IN_MOTION if moved else SMALLEST
    return error.length >= least and squares > (GAIN_OF_MOTION if moved else GAIN)


def denied(found: LastingError, settled: LastingError) -> bool:
    """Whether the whole drive leaves much less of a jump than the seconds about it said.

    The settled size is that of both: what it differs by varies by the difference of the
    covariances. Slow errors wander meanwhile; a third of the jump is more than that.
    """
    off = found.size - settled.size
    values, axes = np.linalg.eigh(found.covariance - settled.covariance)
    squares = np.square(axes.T @ off) / np.maximum(values, DIFFERS**2)
    return bool(np.linalg.norm(off) > DENIED * found.length and squares.sum() > GAIN_OF_MOTION)


def denied_level(found: LastingError, settled: LastingError) -> bool:
    """Whether the drive leaves next to nothing of what the motion said of an error level.

    Up and down change the distances too little to tell. Slow errors of a centimetre, and an end
    that is wrong, leave more.
    """
    off = (found.size - settled.size)[:2]
    values, axes = np.linalg.eigh((found.covariance - settled.covariance)[:2, :2])
    squares = np.square(axes.T @ off) / np.maximum(values, DIFFERS**2)
    much = np.linalg.norm(off) > DENIED_WHOLLY * np.linalg.norm(found.size)
    return bool(much and squares.sum() > DENIES)


def is_bump(error: LastingError) -> bool:
    """Whether an error goes upwards and again so soon that a bump of the road is as likely."""
    return bool(upwards(error.size)) and error.end - error.start < SOON


def by_motion(error: LastingError) -> LastingError:
    """The same with what the whole drive does not say: what is told once must not count twice."""
    if error.around is None or not error.stays:
        return error
    return replace(error, size=error.around[0], covariance=error.around[1])


def epochs_with(steps: Steps, receivers: tuple[int, ...], start: float, end: float) -> int:
    """Times from a start to before an end at which one of the receivers is fixed."""
    at = (steps.times >= start - 1e-6) & (steps.times < end - 1e-6)
    fixed = (steps.kinds[:, list(receivers)] == RTK_FIXED).any(1)
    return int((at & fixed).sum())


def starting_rows(steps: Steps, error: LastingError) -> Bools:
    """(t,) True from the first epoch on that has the error."""
    return np.asarray(steps.times >= error.start - 1e-6)


def without_errors(steps: Steps, errors: Sequence[LastingError]) -> Steps:
    """The steps with errors that stay taken out, and fixes with errors that end left out.

    Some epochs on both sides of a jump are left out, too: noise moves the place where it is found.
    """
    positions, kinds = steps.positions.copy(), steps.kinds.copy()
    for error in errors:
        if error.stays:
            positions -= who_has(steps, error)[:, None] * np.where(
                starting_rows(steps, error)[:, None, None], error.size, 0.0
            )
        begin, end = left_out(error)
        at = (steps.times > begin) & (steps.times < end)
        kinds[at[:, None] & who_has(steps, error)] = NOT_USED
    return replace(steps, positions=positions, kinds=kinds)


def who_has(steps: Steps, error: LastingError) -> Bools:
    """(r,) True for the receivers that have the error."""
    return np.asarray(np.isin(np.arange(len(steps.receivers)), error.receivers))


def left_out(error: LastingError) -> tuple[float, float]:
    """Times between which the receivers' fixes are left out."""
    margin = (UNSURE + 0.5) * error.spacing
    last = error.start if error.stays else error.end
    begin, end = error.start - margin, last + margin - error.spacing
    if error.stays:
        begin, end = min(begin, error.window[0]), max(end, error.window[1])
    return begin, end


def same_span(one: LastingError, other: LastingError) -> bool:
    """Whether two errors begin and end together, as nearly as noise leaves it."""
    margin = (UNSURE + 0.5) * max(one.spacing, other.spacing)
    return abs(one.start - other.start) < margin and abs(one.end - other.end) < margin


def ends_with(one: LastingError, whole: LastingError) -> bool:
    """Whether an error ends when another one of the same receivers begins, which stays.

    The end is that beginning, and the seconds about it do not tell which of the two it was.
    """
    begin, end = left_out(whole)
    return not one.stays and one.receivers == whole.receivers and begin <= one.end <= end


def begins_with(one: LastingError, whole: LastingError) -> bool:
    """Whether an error that ends begins with another one of the same receivers, which stays.

    Its end is then another's: the whole drive, which would show it, does not.
    """
    margin = (UNSURE + 0.5) * max(one.spacing, whole.spacing)
    together = abs(one.start - whole.start) < margin
    return not one.stays and one.receivers == whole.receivers and together


def at_one_time(one: LastingError, other: LastingError) -> bool:
    """Whether two errors may have begun together."""
    (begin, end), (start, last) = left_out(one), left_out(other)
    return begin <= last and start <= end


def together(one: LastingError, other: LastingError) -> bool:
    """Whether an error that goes again is the other one, or lasts with it for some time."""
    passing = not (one.stays or other.stays)
    return passing and one.start < other.end and other.start < one.end


def ended(steps: Steps, one: LastingError, other: LastingError) -> LastingError | None:
    """The first of two errors that stay, ended by the second if that is the jump back; else None.

    Parameters
    ----------
    steps : Steps
        As recorded.
    one, other : LastingError
        In any order.
    """
    first, second = sorted((one, other), key=lambda error: error.start)
    apart = second.start - first.start
    if not (first.stays and second.stays and 0 < apart < LONGEST_FALSE):
        return None
    if not np.isfinite(mismatch(first, second, len(steps.receivers))):
        return None
    epochs = epochs_with(steps, first.receivers, first.start, second.start)
    return replace(first, end=second.start, epochs=epochs)


def with_another(
    steps: Steps,
    found: Sequence[LastingError],
    errors: Sequence[LastingError],
    another: LastingError,
) -> tuple[list[LastingError], list[LastingError]]:
    """Errors as found and with settled sizes, and another: a new one, or the rest or end of one.

    Parameters
    ----------
    steps : Steps
        As recorded.
    found, errors : sequence of LastingError
        As they were found, and with sizes that the whole drive tells.
    another : LastingError
        That the drive shows beside them.
    """
    found, errors = (sorted(some, key=lambda one: one.start) for some in (found, errors))
    for k, (rough, one) in enumerate(zip(found, errors, strict=True)):
        joined = _joined(one, another)
        if joined is not None:
            first, whole = (replace(some, receivers=joined, alike=()) for some in (rough, one))
            return [*found[:k], first, *found[k + 1 :]], [*errors[:k], whole, *errors[k + 1 :]]
        both = ended(steps, one, another)
        if both is not None:
            first = ended(steps, rough, another) or both
            return [*found[:k], first, *found[k + 1 :]], [*errors[:k], both, *errors[k + 1 :]]
        rest = rest_of(one, another, len(steps.receivers))
        if rest is not None:
            whole = replace(one, size=one.size + rest, covariance=another.covariance)
            return found, [*errors[:k], whole, *errors[k + 1 :]]
    return [*found, by_motion(another)], [*errors, another]


def _joined(one: LastingError, another: LastingError) -> tuple[int, ...] | None:
    """Receivers of two jumps at one time that are one of both, if that was not told; else None."""
    both = tuple(sorted({*one.receivers, *another.receivers}))
    open_to_both = one.stays and another.stays and both in one.alike
    if not open_to_both or not at_one_time(one, another) or contradicts(one, another):
        return None
    return both if len(both) == len(one.receivers) + len(another.receivers) else None


def of_the_others(one: LastingError, back: LastingError, receivers: int) -> LastingError | None:
    """A jump of all and one back of some at its time: one of the others; None if it is not that.

    Parameters
    ----------
    one : LastingError
        Of all receivers.
    back : LastingError
        Of some, the other way, such as of one that had no fix meanwhile.
    receivers : int
        How many there are.
    """
    if contradicts(one, replace(back, size=-back.size)):
        return None
    told, more = np.linalg.inv(one.covariance), np.linalg.inv(back.covariance)
    covariance = np.linalg.inv(told + more)
    return replace(
        one,
        receivers=tuple(k for k in range(receivers) if k not in back.receivers),
        size=covariance @ (told @ one.size - more @ back.size),
        covariance=covariance,
        alike=(),
        around=(one.size, one.covariance),
    )


def told_apart(
    found: Sequence[LastingError], whole: LastingError, receivers: int
) -> tuple[list[LastingError], LastingError]:
    """Errors with the one that the whole drive shows in the place of others at its time.

    Whose jump it was the whole drive tells better than the seconds about it, where it tells more.
    If it shows the same receivers, it leaves fewer others in doubt.
    """
    here = [one for one in found if one.stays and at_one_time(one, whole)]
    here += [one for one in found if ends_with(one, whole) or begins_with(one, whole)]
    of_all = [one for one in here if len(one.receivers) == receivers]
    for one in of_all:
        others = of_the_others(one, whole, receivers)
        if others is None:
            return list(found), whole  # beside it
        whole = others
    same = [one for one in here if one.stays and one.receivers == whole.receivers]
    if not same and any(one.gain > whole.gain for one in here):
        return list(found), whole
    told = [replace(one, alike=tuple(a for a in one.alike if a in whole.alike)) for one in same]
    told = told or ([whole] if here else [])
    return [*(one for one in found if one not in here), *told], whole


def beside(one: LastingError, whole: LastingError) -> bool:
    """Whether an error that goes again begins where another one ends, or ends where it begins."""
    margin = 2 * max(one.spacing, whole.spacing)
    at_end, at_start = abs(one.start - whole.end) < margin, abs(one.end - whole.start) < margin
    return not one.stays and (at_end or at_start)


def part_of(one: LastingError, whole: LastingError, receivers: int) -> bool:
    """Whether an error is one that goes again, or a part, or begins within it as its end."""
    who = {whole.receivers, *whole.alike}
    who |= {tuple(k for k in range(receivers) if k not in some) for some in who}
    margin = 2 * max(one.spacing, whole.spacing)
    last = one.start if one.stays else one.end
    beside = last < whole.start - margin or one.start > whole.end + margin
    return one.receivers in who and not beside


def rest_of(one: LastingError, another: LastingError, receivers: int) -> Array | None:
    """What a jump that stays lacks, if another is at its time and of its receivers; else None."""
    if not (one.stays and another.stays):
        return None
    if not at_one_time(one, another):
        return None
    others = tuple(k for k in range(receivers) if k not in one.receivers)
    ways = {one.receivers: 1.0, others: -1.0}
    return ways[another.receivers] * another.size if another.receivers in ways else None


@dataclass(frozen=True)
class JumpErrors:
    """Errors of the jumps that were taken out, and what they do to offsets and poses.

    Parameters
    ----------
    starts : (j,) array
        Seconds since 1970, from when on each jump counts.
    receivers : (j, r) array
        1 where the jump is a receiver's, else 0.
    covariance : (3 j, 3 j) array
        Of the sizes, m^2.
    by_offsets : (k, 3 j) array
        Error of the offsets and distances that one of the sizes makes.
    """

    starts: Array
    receivers: Array
    covariance: Array
    by_offsets: Array

    def spread(self, offsets: Offsets) -> Offsets:
        """Offsets whose covariance contains what these errors do to them."""
        own = self.by_offsets @ self.covariance @ self.by_offsets.T
        return replace(offsets, covariance=offsets.covariance + own)


def difference(one: LastingError, other: tuple[int, ...], count: int) -> Array:
    """(r,) times its size by which each receiver is elsewhere if others jumped.

    All that did not jump would have jumped the other way; others as it did.
    """
    hit, instead = (
        np.isin(np.arange(count), some).astype(float) for some in (one.receivers, other)
    )
    others = (hit + instead == 1).all()
    return np.asarray(-hit - instead if others else instead - hit)


def or_others(jumps: JumpErrors, staying: Sequence[LastingError]) -> JumpErrors:
    """The same with what it does to the poses where others may have jumped instead.

    Nothing tells that; the vehicle would be beside its place by as much as the two differ.
    """
    count = jumps.receivers.shape[1]
    open_ones = [(one, one.alike[0]) for one in staying if one.alike]
    if not open_ones:
        return jumps
    sizes = [EITHER * np.outer(one.size, one.size) for one, _ in open_ones]
    ways = np.array([difference(one, other, count) for one, other in open_ones])
    return JumpErrors(
        np.append(jumps.starts, [one.start for one, _ in open_ones]),
        np.concatenate([jumps.receivers, ways]),
        block_diag(jumps.covariance, *sizes),
        np.pad(jumps.by_offsets, ((0, 0), (0, 3 * len(open_ones)))),
    )
