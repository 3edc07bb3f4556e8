"""A drive without the errors that last: taken out where they stay, left out where they end."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import block_diag

from rtk_gt.lasting.causes import GAIN
from rtk_gt.lasting.errors import changed, lasting_errors
from rtk_gt.lasting.jumps import CLEAR_OVER_MOTION
from rtk_gt.lasting.jumps_back import by_drive_and_motion, contradicts, span_by_the_drive
from rtk_gt.lasting.lacking_fixes import found_again
from rtk_gt.lasting.lasting_error import (
    LARGEST_RESTART,
    JumpErrors,
    LastingError,
    beside,
    beyond_a_base,
    by_motion,
    denied,
    denied_level,
    difference,
    epochs_with,
    is_bump,
    or_others,
    part_of,
    same_span,
    shown,
    starting_rows,
    together,
    told_apart,
    who_has,
    with_another,
    without_errors,
)
from rtk_gt.lasting.whole_drive import WholeDrive
from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.offsets.first_offsets import first_offsets
from rtk_gt.offsets.memory import error_model
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.offsets.slow_errors import ErrorModel
from rtk_gt.receivers.assumptions import ETA, FEWEST_STEPS
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array

MOST_RESTARTS = 6
"""Rounds in which smaller jumps are looked for: a drive with more is no ground truth."""
LEAST_LEFT = 0.2
"""Share of the steps that must be left: a judgement; of fewer nobody knows which are right."""
_ROUNDS, _STAYS = 6, 1e-3
"""At most; and metres that no size changes any more."""


def settle(
    steps: Steps, *, eta: float = ETA, robust: bool = True, prior: OffsetPrior | None = None
) -> tuple[Steps, list[LastingError], JumpErrors | None]:
    """The steps without errors that last, these errors, and what is left of the jumps taken out.

    Parameters
    ----------
    steps : Steps
        As recorded.
    eta : float
        Ratio of the vertical to the horizontal sigma of a position.
    robust : bool
        Without it nothing is looked for.
    prior : OffsetPrior, optional
        What is known of the antennas' heights: a level drive leaves them open otherwise, and with
        them the distances.

    Raises
    ------
    GtvalError
        As `estimate_offsets`, if too few steps are without such errors, or if all receivers jump
        by more than a base station's coordinates are ever wrong.
    """
    if not robust:
        return steps, [], None
    quick = partial(estimate_offsets, eta=eta, bent="never", prior=prior)
    offsets = first_offsets(steps, quick)
    found = lasting_errors(steps, offsets)
    _check_restarts(steps, found)
    found, another = _by_the_drive(steps, quick, offsets, found)
    found = _with_ends(steps, quick, found)
    if not found:
        if another is None:
            return steps, [], None
        found = [another]
    errors, found = found, [by_motion(one) for one in found]
    cleaned, jumps = steps, None
    for _ in range(MOST_RESTARTS):
        if errors:
            _check_left(without_errors(steps, errors), steps, errors)
            found, errors, jumps = _those_that_stay(steps, quick, errors, found)
            cleaned = without_errors(steps, errors)
            offsets = first_offsets(cleaned, quick)
        another = changed(cleaned, offsets)
        if another is None:
            return _under_slow_errors(steps, quick, cleaned, errors, found, jumps)
        settled = errors, found
        found, errors = with_another(steps, found, errors, another)
    return _under_slow_errors(steps, quick, cleaned, *settled, jumps)


def _under_slow_errors(
    steps: Steps,
    quick: Callable[[Steps], Offsets],
    cleaned: Steps,
    errors: Sequence[LastingError],
    found: Sequence[LastingError],
    jumps: JumpErrors | None,
) -> tuple[Steps, list[LastingError], JumpErrors | None]:
    """What `settle` returns, with sizes that slow errors of the receivers are allowed for in."""
    offsets = quick(cleaned)
    model = error_model(cleaned, offsets) if jumps is not None and offsets.known else None
    if model is None:
        return cleaned, list(errors), jumps
    better, jumps = refined(cleaned, offsets, errors, found, model)
    return without_errors(steps, better), better, jumps


def _by_the_drive(
    steps: Steps,
    quick: Callable[[Steps], Offsets],
    offsets: Offsets,
    found: Sequence[LastingError],
) -> tuple[list[LastingError], LastingError | None]:
    """Errors as found, with those that go again as the whole drive shows them.

    It places their ends better, and sees one error where the motion shows only one of its ends.
    Also the likeliest one that stays and that it shows beside them.
    """
    passing: list[LastingError] = []
    # No distance shows what all do; their motion must not pass for that of another error.
    of_all = [one for one in found if one.stays and len(one.receivers) == len(steps.receivers)]
    rest, one = without_errors(steps, of_all), None
    offsets = first_offsets(rest, quick) if of_all else offsets
    for _ in range(MOST_RESTARTS):
        one = changed(rest, offsets)
        if one is None or one.stays:
            break
        clearer = [other for other in found if other.gain > one.gain and beside(other, one)]
        if clearer:
            # An end of it is theirs.
            passing += clearer
            found = [other for other in found if other not in clearer]
            rest = without_errors(steps, [*of_all, *passing])
            if int(rest.complete.sum()) < FEWEST_STEPS:
                break
            offsets = first_offsets(rest, quick)
            continue
        part = [part_of(other, one, len(steps.receivers)) for other in found]
        # Up and down change the distances alike: what the motion at both ends shows is the size.
        shown = [
            other for other, of in zip(found, part, strict=True)
            if of and not other.stays and other.receivers == one.receivers
            and contradicts(other, one)
        ]  # fmt: skip
        single = [
            other for other in found
            if not other.stays and len(other.receivers) == 1 < len(one.receivers)
            and same_span(other, one)
        ]  # fmt: skip
        # A false fix is one receiver's.
        one = (shown or single or [one])[0]
        passing.append(one)
        found = [
            other for other, of in zip(found, part, strict=True) if not of and other is not one
        ]
        rest = without_errors(steps, [*of_all, *passing])
        if int(rest.complete.sum()) < FEWEST_STEPS:
            break
        offsets = first_offsets(rest, quick)
    stays = one if one is not None and one.stays else None
    if passing and int(rest.complete.sum()) >= FEWEST_STEPS:
        # What an error leaves in the distances as the vehicle turns passes for other jumps.
        found = [*of_all, *lasting_errors(rest, offsets)]
    if stays:
        found, stays = told_apart(found, stays, len(steps.receivers))
    return sorted([*found, *passing], key=lambda one: one.start), stays


def _with_ends(
    steps: Steps, quick: Callable[[Steps], Offsets], found: Sequence[LastingError]
) -> list[LastingError]:
    """The errors, those of one receiver with the ends or beginnings that no motion shows."""
    ended = list(found)
    for k, one in enumerate(found):
        if not one.stays or len(one.receivers) > 1:
            continue
        rest = without_errors(steps, [*ended[:k], *ended[k + 1 :]])
        if int(rest.complete.sum()) < FEWEST_STEPS:
            continue
        offsets = first_offsets(rest, quick)
        if not offsets.known:
            # The error itself hides them.
            offsets = first_offsets(without_errors(steps, ended), quick)
        if not offsets.known:
            continue
        placed = rest.corrected(offsets.offsets).select(rest.complete)
        again = found_again(steps, one.receivers[0])
        span = span_by_the_drive(placed.times, placed.positions, offsets, one, again)
        if span is not None:
            size = one.size if span[0] == one.start else -one.size
            epochs = epochs_with(steps, one.receivers, *span)
            ended[k] = replace(one, start=span[0], end=span[1], size=size, epochs=epochs)
    return [one for one in ended if not is_bump(one)]


def _left_by_the_drive(
    steps: Steps, quick: Callable[[Steps], Offsets], errors: Sequence[LastingError]
) -> list[bool]:
    """Of each error whether it stays, or the distances show something of it while it lasts.

    What turned sharply, or lay beside a jump that stays, may look like both ends of a false fix.
    The first of which they show nothing level is told: what lies beside it may tell of others.
    """
    left = [True] * len(errors)
    for k, one in enumerate(errors):
        if one.stays or len(one.receivers) > 1:
            continue
        others = [o for o in errors if o.receivers != one.receivers or not together(o, one)]
        rest = without_errors(steps, others)
        if int(rest.complete.sum()) < FEWEST_STEPS:
            continue
        offsets = first_offsets(rest, quick)
        if not offsets.known:
            continue
        placed = rest.corrected(offsets.offsets).select(rest.complete)
        size, covariance = by_drive_and_motion(placed.times, placed.positions, offsets, one)
        if denied_level(one, replace(one, size=size, covariance=covariance)):
            left[k] = False
            break
    return left


def _those_that_stay(
    steps: Steps,
    quick: Callable[[Steps], Offsets],
    errors: Sequence[LastingError],
    found: Sequence[LastingError],
) -> tuple[list[LastingError], list[LastingError], JumpErrors | None]:
    """As found and with settled sizes, without those of which the whole drive shows nothing.

    The motion about a time may show the end of an error that has gone, or a jolt.
    """
    found = sorted(found, key=lambda one: one.start)
    everyone = tuple(range(len(steps.receivers)))
    while errors:
        errors, jumps = _settled_sizes(steps, quick, errors, found)
        of_all = [_as_one_of_all(*both, everyone) for both in zip(found, errors, strict=True)]
        if any(of_all):
            found = [of or one for of, one in zip(of_all, found, strict=True)]
            errors = [of or one for of, one in zip(of_all, errors, strict=True)]
            continue
        kept = [
            not one.stays or (shown(one) and not denied(rough, one))
            for rough, one in zip(found, errors, strict=True)
        ]
        if all(kept):
            kept = _left_by_the_drive(steps, quick, errors)
        if all(kept):
            return list(found), errors, jumps
        errors = [one for one, stays in zip(errors, kept, strict=True) if stays]
        found = [one for one, stays in zip(found, kept, strict=True) if stays]
    return [], [], None


def _as_one_of_all(
    found: LastingError, settled: LastingError, everyone: tuple[int, ...]
) -> LastingError | None:
    """A jump of some receivers as one of all, if the distances do not show what the motion did."""
    # If all did, the drive shows nothing of some: what is left of theirs is that of the motion.
    clear = found.gain > CLEAR_OVER_MOTION and not shown(settled)
    open_to_all = settled.stays and everyone in found.alike
    if not open_to_all or not (clear or contradicts(found, settled)):
        return None
    return replace(found, receivers=everyone, alike=())


def _settled_sizes(
    steps: Steps,
    quick: Callable[[Steps], Offsets],
    errors: Sequence[LastingError],
    found: Sequence[LastingError],
) -> tuple[list[LastingError], JumpErrors | None]:
    """The errors with sizes that the whole drive tells, and what is left of their errors.

    A jump of a decimetre bends the offsets by as much at first, so this goes on until the sizes
    stay.
    """
    errors = sorted(errors, key=lambda one: one.start)
    jumps = None
    for _ in range(_ROUNDS):
        cleaned = without_errors(steps, errors)
        better, jumps = refined(cleaned, quick(cleaned), errors, found)
        moved = [np.abs(b.size - e.size).max() for b, e in zip(better, errors, strict=True)]
        errors = better
        if max(moved) < _STAYS:
            break
    return errors, jumps


def _check_restarts(steps: Steps, errors: Sequence[LastingError]) -> None:
    """Raise for jumps of all receivers that no restart of a base station makes."""
    for one in errors:
        if one.stays and len(one.receivers) == len(steps.receivers) and beyond_a_base(one):
            raise GtvalError(
                f"all receivers leap by {one.length:.0f} m at second "
                f"{one.start - steps.times[0]:.1f} of the record and stay so. No restart of a base "
                f"station makes more than {LARGEST_RESTART:g} m: the receivers hung, their clocks "
                "leapt while the vehicle drove, or two records were put together. Cut the files "
                "there; `robust = false` in [rtk] takes the fixes as they are"
            )


def _check_left(cleaned: Steps, steps: Steps, errors: Sequence[LastingError]) -> None:
    """Raise if false fixes leave too little of a drive."""
    left, all_of = int(cleaned.complete.sum()), int(steps.complete.sum())
    if left < max(FEWEST_STEPS, LEAST_LEFT * all_of):
        raise GtvalError(
            f"{len(errors)} jumps and false fixes leave {left} of {all_of} times at which all "
            "receivers are RTK-fixed: this record is no ground truth. Look at the base station, "
            "its radio link and what hides the sky; `robust = false` in [rtk] takes the fixes as "
            "they are"
        )


def refined(
    steps: Steps,
    offsets: Offsets,
    errors: Sequence[LastingError],
    found: Sequence[LastingError],
    model: ErrorModel | None = None,
) -> tuple[list[LastingError], JumpErrors | None]:
    """The errors with better sizes of those that stay, and what is left of their errors.

    Parameters
    ----------
    steps : Steps
        With the errors taken out, offsets not added.
    offsets : Offsets
        From these steps.
    errors : sequence of LastingError
        That were taken out, in the order of time.
    found : sequence of LastingError
        The same as they were found, with sizes and covariances by the time around each.
    model : ErrorModel, optional
        Of the receivers' errors, where they are slow. Without it each independent step counts once.

    Notes
    -----
    The distances of the whole drive, and how the vehicle leans on its way, tell a jump better than
    what is around it: least squares of the jumps, the offsets and the distances together, with the
    sizes found around each as knowledge beforehand. Slow errors make the means before and after
    differ by themselves: what the drive then tells is weighed by what its scores vary by.
    """
    errors, found = (sorted(some, key=lambda one: one.start) for some in (errors, found))
    staying = [error for error in errors if error.stays]
    if not staying:
        return list(errors), None
    used = steps.select(steps.complete)
    good = offsets.weights > 0
    positions = used.positions[good] + offsets.offsets.values
    drive = WholeDrive.of(used.times[good], positions, offsets)
    own, residuals = drive.own, drive.residuals
    n, q = residuals.shape
    who = np.array([who_has(steps, error) for error in staying], dtype=float)
    after = np.column_stack([starting_rows(used, error)[good] for error in staying]).astype(float)
    each = np.stack([drive.error(k, np.zeros(3))[..., :3] for k in range(who.shape[1])])
    by_jump = np.einsum("tj,jr,rtqa->tqja", after, who, each).reshape(n, q, -1)
    weight, _ = drive.weight(residuals)
    oo = np.einsum("tpa,pq,tqb->ab", own, weight, own, optimize=True)
    os = np.einsum("tpa,pq,tqb->ab", own, weight, by_jump, optimize=True)
    ss = np.einsum("tpa,pq,tqb->ab", by_jump, weight, by_jump, optimize=True)
    around = [one for one in found if one.stays]
    known = np.linalg.inv(block_diag(*(one.covariance for one in around)))
    off = np.concatenate([a.size - b.size for a, b in zip(around, staying, strict=True)])
    by_offsets = np.linalg.pinv(oo, rcond=1e-9, hermitian=True) @ os
    information = ss - os.T @ by_offsets
    right = np.einsum("tpa,pq,tq->a", by_jump - own @ by_offsets, weight, residuals, optimize=True)
    if model is not None:
        scored = np.swapaxes(by_jump - own @ by_offsets, 1, 2) @ weight
        spread = drive.score_spread(used.times[good], scored, model, offsets.eta)
        # Of a jump of all the distances tell nothing.
        trusted = np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ information
        information, right = information @ trusted, trusted.T @ right
    covariance = np.linalg.inv(information + known)
    sizes = (covariance @ (right + known @ off)).reshape(-1, 3)
    by_offsets = by_offsets[: len(offsets.covariance)]
    better = [
        replace(error, size=error.size + change, covariance=covariance[k : k + 3, k : k + 3])
        for error, change, k in zip(staying, sizes, range(0, 3 * len(staying), 3), strict=True)
    ]
    told = _differences(better, after, each, (oo, own, weight))
    better = [
        replace(one, alike=tuple(a for a, t in zip(one.alike, some, strict=True) if t < GAIN))
        for one, some in zip(better, told, strict=True)
    ]
    starts = np.array([error.start for error in staying])
    rest = [error for error in errors if not error.stays]
    both = sorted([*better, *rest], key=lambda one: one.start)
    return both, or_others(JumpErrors(starts, who, covariance, by_offsets), better)


def _differences(
    staying: Sequence[LastingError], after: Array, each: Array, drive: tuple[Array, Array, Array]
) -> list[list[float]]:
    """What the whole drive would show of each jump that stays if others had jumped, one a cause.

    Squared sigmas of the jump's size for the receivers that only one of the two causes has; the
    designs ``each`` (r, t, q, 3) are of each receiver's error.
    """
    oo, own, weight = drive
    found = []
    for k, one in enumerate(staying):
        shown = []
        for other in one.alike:
            way = difference(one, other, len(each))
            design = np.einsum("t,r,rtqa,a->tq", after[:, k], way, each, one.size)
            crossed = np.einsum("tqk,qp,tp->k", own, weight, design, optimize=True)
            alone = np.einsum("tq,qp,tp->", design, weight, design, optimize=True)
            free = crossed @ np.linalg.pinv(oo, rcond=1e-9, hermitian=True) @ crossed
            shown.append(float(alone - free))
        found.append(shown)
    return found
