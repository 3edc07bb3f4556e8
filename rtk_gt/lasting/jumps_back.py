"""Jumps that take others back: a false fix that lasts ends with one.

Who jumped each jump tells badly by itself; one cause and one size must do for both.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from rtk_gt.lasting.causes import (
    SMALLEST,
    USUAL,
    causes_of,
    evidence,
    rotations_within,
    tempered,
    told_at,
)
from rtk_gt.lasting.contrasts import FEWEST_DISTANCES, Contrasts, contrasts, sides_of
from rtk_gt.lasting.drive_sums import DriveSums
from rtk_gt.lasting.jumps import ALIKE, Jump
from rtk_gt.lasting.whole_drive import WholeDrive
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.receivers.fixes import Ints
from validation.poses.angles import Array

GAIN_BACK = 25.0
"""Gain, as `GAIN`, of the one number of a jump back whose size is known, within `LONGEST_FALSE`: in
one of 2 million intervals."""
GAIN_BACK_ABOUT = 35.0
"""The same where its three numbers are known about: in one of ten million."""
LONGEST_FALSE = 120.0
"""Seconds after which a jump and one back are no false fix any more: a judgement, receivers check
their ambiguities within a minute."""
BACK = 0.15
"""Share of a jump by which the jump back may differ, beside its sigmas: errors change meanwhile."""
_AWAY = 16.0
"""Squared sigmas by which it may differ: three numbers pass that in one of 900."""
ROUGH = 0.05
"""Share of the gains of two jumps by which one size may be worse besides: antennas whose heights
are a decimetre wrong explain a large jump no better."""


PART = 0.7
"""Share of the smaller of two gains by which one size may be worse at most: what is left must show
that there are two jumps."""


class Sized(Protocol):
    """A jump of some receivers, however it was found."""

    @property
    def receivers(self) -> tuple[int, ...]:
        """Columns of the receivers."""

    @property
    def size(self) -> Array:
        """(3,) east, north, up, metres."""

    @property
    def covariance(self) -> Array:
        """(3, 3) of the size, m^2."""


class EndingError(Sized, Protocol):
    """The same with its beginning."""

    @property
    def start(self) -> float:
        """Seconds since 1970."""

    @property
    def end(self) -> float:
        """Seconds since 1970; infinite if it stays."""


def mismatch(there: Sized, back: Sized, receivers: int) -> float:
    """Squared sigmas by which the second is not the first one back; infinite if it is another.

    What some receivers do, the others seem to do the other way round.
    """
    others = tuple(k for k in range(receivers) if k not in there.receivers)
    if back.receivers not in (there.receivers, others):
        return np.inf
    away = _apart(there, back, back.size if back.receivers == there.receivers else -back.size)
    return away if away < _AWAY else np.inf


def contradicts(one: Sized, other: Sized) -> bool:
    """Whether two sizes of an error, however they were found, are of two errors."""
    return _apart(one, other, -other.size) >= _AWAY


def _apart(one: Sized, other: Sized, back: Array) -> float:
    """Squared sigmas by which a size does not take another one back."""
    off = one.size + back
    spread = one.covariance + other.covariance
    spread = spread + (BACK * np.linalg.norm(one.size)) ** 2 * np.eye(3)
    return float(off @ np.linalg.solve(spread, off))


def passed(there: Jump, back: Jump, receivers: int) -> tuple[float, Jump] | None:
    """How much worse one error that goes again explains two jumps, and that error; None if none.

    Parameters
    ----------
    there, back : Jump
        In the order of time.
    receivers : int
        How many there are.

    Notes
    -----
    Who jumped each jump tells badly by itself; one cause and one size must do for both.
    """
    causes = causes_of(receivers)
    if there.told[0].shape[1] != len(causes) or back.told[0].shape[1] != len(causes):
        away = mismatch(there, back, receivers)
        return (away, there) if np.isfinite(away) else None
    usual = np.eye(3) * USUAL**-2

    def whole(told: tuple[Array, Array]) -> tuple[Array, Array]:
        sizes = np.asarray(np.linalg.solve(told[1] + usual, told[0][..., None])[..., 0], float)
        return sizes, (sizes * told[0]).sum(-1)

    (_, first), (after, second) = whole(there.told), whole(back.told)
    right, information = there.told[0][0], there.told[1][0]
    # The jump back may be another by a share.
    slack = (BACK * np.linalg.norm(there.size)) ** 2 * np.eye(3)
    loose = np.linalg.inv(np.linalg.inv(back.told[1][1] + usual) + slack)
    spreads = np.linalg.inv(information + loose + usual)
    wanted = -after[1]
    sizes = np.einsum("cij,cj->ci", spreads, right + np.einsum("cij,cj->ci", loose, wanted))
    off = sizes - wanted
    both = 2 * (sizes * right).sum(1) - np.einsum("ci,cij,cj->c", sizes, information, sizes)
    both = both + second[1] - np.einsum("ci,cij,cj->c", off, loose, off)
    best = int(both.argmax())
    loss = float(first.max() + second.max() - both[best])
    most = _AWAY + ALIKE + ROUGH * float(first.max() + second.max())
    most = min(most, PART * float(min(first.max(), second.max())))
    if loss > most:
        return _of_the_single_one(there, back, receivers)
    if np.linalg.norm(sizes[best]) < SMALLEST:
        return None
    alike = tuple(c for c, gain in zip(causes, both, strict=True) if both[best] - gain < ALIKE)
    found = replace(
        there, receivers=causes[best], size=sizes[best], covariance=spreads[best],
        alike=tuple(c for c in alike if c != causes[best]),
    )  # fmt: skip
    return loss, found


def _of_the_single_one(there: Jump, back: Jump, receivers: int) -> tuple[float, Jump] | None:
    """Two jumps of one size, the one of a receiver and the other of the rest, as that one's error.

    Distances and the lean do not tell the two apart, and an epoch that one receiver lacks there
    spoils what the motion says.
    """
    single = min(there, back, key=lambda one: len(one.receivers))
    if len(single.receivers) > 1 or len(there.receivers) + len(back.receivers) != receivers:
        return None
    away = mismatch(there, back, receivers)
    if not np.isfinite(away):
        return None
    size = there.size if single is there else -back.size
    alike = tuple(one for one in (there.receivers, *there.alike) if one != single.receivers)
    return away, replace(there, receivers=single.receivers, size=size, alike=alike)


def missing_jumps(
    times: Array, positions: Array, headings: Array, found: Sequence[Jump]
) -> list[Jump]:
    """Jumps of one receiver forth or back where only the other was found: its size is known.

    Parameters
    ----------
    times, positions, headings : arrays
        As of `find_jumps`.
    found : sequence of Jump
        All that are known, whatever showed them.
    """
    count = positions.shape[1]
    single = [one for one in found if len(one.receivers) == 1]
    alone = [
        one for one in single
        if not any(
            other is not one and abs(times[other.row] - times[one.row]) < LONGEST_FALSE
            and passed(*_in_time(one, other), receivers=count) is not None
            for other in found
        )
    ]  # fmt: skip
    new = []
    for one in alone:
        # Its own size, of some seconds, is too rough to be taken out: what it leaves turns with the
        # vehicle.
        rest = positions.copy()
        for other in found:
            if other is not one:
                rest[other.row + 1 :, list(other.receivers)] -= other.size
        views = [contrasts(times, rest, headings, sides) for sides in sides_of(times, rest)]
        backs = [_back(times, headings, seen, one, count) for seen in views if seen is not None]
        best = max(backs, key=lambda back: back.gain)
        if best.gain > GAIN_BACK_ABOUT:
            new.append(best)
    return new


def _in_time(one: Jump, other: Jump) -> tuple[Jump, Jump]:
    return (one, other) if one.row <= other.row else (other, one)


def _back(times: Array, headings: Array, seen: Contrasts, one: Jump, count: int) -> Jump:
    """The likeliest jump that is the opposite of one and near it in time."""
    near = (np.abs(times[:-1] - times[one.row]) < LONGEST_FALSE) & (
        np.abs(np.arange(len(times) - 1) - one.row) > 2 * seen.window
    )
    rows = np.flatnonzero(near)
    if len(rows) == 0:
        return replace(one, gain=0.0)
    turns = rotations_within(headings, rows)
    right, information = evidence(seen, one.receivers, rows)
    # As well as the size is known, and the jump back may be another by a share.
    spread = one.covariance + (BACK * np.linalg.norm(one.size)) ** 2 * np.eye(3)
    known = np.einsum("nji,jk,nkl->nil", turns, np.linalg.inv(spread), turns)
    wanted = np.einsum("nji,j->ni", turns, -one.size)
    pulled = right + np.einsum("nij,nj->ni", known, wanted)
    sizes = np.linalg.solve(information + known, pulled[..., None])[..., 0]
    off = sizes - wanted
    gains = 2 * (sizes * right).sum(1) - np.einsum("ni,nij,nj->n", sizes, information, sizes)
    gains = tempered(np.maximum(gains, 0.0), seen.freedom)
    gains = gains - np.einsum("ni,nij,nj->n", off, known, off)
    best = int(gains.argmax())
    size = turns[best] @ sizes[best]
    row = int(rows[best])
    told = told_at(seen, headings, row, causes_of(count))
    return replace(one, row=row, size=size, gain=float(gains[best]), told=told)


def span_by_the_drive(
    times: Array, positions: Array, offsets: Offsets, error: EndingError, found_again: Array
) -> tuple[float, float] | None:
    """First time with and without an error of one receiver that seems to stay; None if it stays.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, offsets added, metres.
    offsets : Offsets
        That were added, with the distances.
    error : EndingError
        With its beginning, its size and what is known of that.
    found_again : (m,) array
        Seconds since 1970 at which its receiver found its fix again after it had lost it.

    Returns
    -------
    (float, float)
        From its beginning to an end that no motion shows. Or it ends where it seems to begin, and
        is the other way.

    Notes
    -----
    A receiver that loses its fix and finds it again has another one: that is how false fixes end.
    There it need only be clearer than that the error stays.
    Distances hardly change with a vertical error, but of a known size they tell how long it lasts.
    """
    drive = WholeDrive.of(times, positions, offsets)
    n, at = len(times), int(np.searchsorted(times, error.start - 1e-6))
    rows = np.arange(FEWEST_DISTANCES, n - FEWEST_DISTANCES)
    rows = rows[np.abs(times[rows] - error.start) < LONGEST_FALSE]
    lasts, firsts = rows[rows >= at + FEWEST_DISTANCES], rows[rows <= at - FEWEST_DISTANCES]
    weight, _ = drive.weight(drive.residuals)
    (who,) = error.receivers

    def gains(first: Ints, last: Ints, sign: float) -> Array:
        """(m,) gains of errors in the epochs [first, last)."""
        size = sign * error.size
        seen = drive.as_seen(int(first.min()), int(last.max()))
        sums = DriveSums.of(drive.own, drive.error(who, size), seen, weight)
        return sums.gains_of(first, last, (size, error.covariance))

    stays = float(gains(np.array([at]), np.array([n]), 1.0)[0])
    # That there is an error the motion shows; the drive only where it goes again.
    best, span = stays + GAIN_BACK, None
    begins = gains(firsts, np.full(len(firsts), at), -1.0) if len(firsts) else np.zeros(1)
    if len(lasts):
        ends = gains(np.full(len(lasts), at), lasts, 1.0)
        others = max(ends.max(), begins.max()) - ALIKE
        again = found_again[np.isin(np.searchsorted(times, found_again - 1e-6), lasts)]
        at_pauses = ends[np.searchsorted(times, again - 1e-6) - lasts[0]]
        if len(again) and at_pauses.max() > max(stays + ALIKE, others):
            return error.start, float(again[at_pauses.argmax()])
        if ends.max() > best:
            best, span = ends.max(), (error.start, float(times[lasts[ends.argmax()]]))
    if len(firsts) and begins.max() > best:
        span = float(times[firsts[begins.argmax()]]), error.start
    return span


def by_drive_and_motion(
    times: Array, positions: Array, offsets: Offsets, error: EndingError
) -> tuple[Array, Array]:
    """Size (3,) of one receiver's error and its covariance, by the distances and by what is known.

    Parameters are those of `span_by_the_drive`; the error has an end.
    """
    drive = WholeDrive.of(times, positions, offsets)
    first, last = np.searchsorted(times, np.array([error.start, error.end]) - 1e-6).tolist()
    weight, _ = drive.weight(drive.residuals)
    design = drive.error(error.receivers[0], error.size)
    sums = DriveSums.of(drive.own, design, drive.as_seen(first, last), weight)
    return sums.size_of(first, last, (error.size, error.covariance))
