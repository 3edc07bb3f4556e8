"""Errors that stay or go again, from what the whole drive says of the offsets with and without.

A base station that restarts changes the offsets of its receivers for good, a false fix those of one
for a while. Turns and slopes show offsets to millimetres over minutes, and so a change of them that
is too small to be seen within a second. Who it was, and the second, the motion about it tells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.lasting.causes import SMALLEST, SMALLEST_IN_MOTION, USUAL, tempered
from rtk_gt.lasting.contrasts import of_motion
from rtk_gt.lasting.drive_sums import DriveSums
from rtk_gt.lasting.edges import NEAR, Edge, Motion, View, edge_of, views_of
from rtk_gt.lasting.jumps import ALIKE, LARGE
from rtk_gt.lasting.jumps_back import LONGEST_FALSE
from rtk_gt.lasting.lasting_error import LastingError
from rtk_gt.lasting.whole_drive import WholeDrive
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.fixes import Ints
from validation.pieces.results import kept_result
from validation.poses.angles import Array

EDGE = 20
"""Epochs at both ends at which no change that stays is looked for: fewer tell no offsets."""
FEWEST = 4
"""Epochs of an error that goes again, and before and after it, at least."""
SHORTEST, _LONGER = 4.0, 1.25
"""Seconds of the shortest error that goes again that is looked for, below the 5 s of the shortest
that lasts, and by how much the next is longer: at most an eighth of it is then missed."""
GAIN, GAIN_OF_PASSING = 40.0, 50.0
"""Gain of an error that stays, chance makes that of three normal numbers in one of 10^8 epochs; and
of one that goes again, of which there are ten times as many."""
PASSING = 20.0
"""Gain that an error that goes again must have above one that stays: its end is one more number
that is chosen, and a number that is chosen from thousands is worth that."""
SLOW, WANDERING = 3.0, 1.25
"""Epochs that one independent one is worth, above which errors wander by themselves (white noise of
five records came to 1.1 at most, slow errors of 30 and 60 s at 1 Hz to 6 and more), and times the
gain that a jump needs there: of sixty clean records with such errors one came to 48 where the jump
was sharp, too."""
SHARP, SHARP_IN_WHITE = 25.0, 9.0
"""Gain that a jump must have between two epochs, where errors wander and where they do not: of
three normal numbers at a hundred epochs chance makes the first in one of 600 drives; of 24 clean
drives with slow errors one came to 24. What the motion has beyond it may make up for what the
distances lack."""
CLEAR_IN_WHITE, CLEAR = 160.0, 300.0
"""Gain from which on no jump need be sharp where errors do not wander, and where they do: a vehicle
that stands, or goes on straight, may show nothing within half a minute of it, and a receiver may
jump while it has no fix. Four times the least; and of 24 clean drives of five memories the greatest
was 115."""
RAMP = 5.0
"""Seconds to both sides of a slow change that a jump must explain better, where no motion is sharp:
errors that wander by multipath take longer."""
TOLD_APART = 16.0
"""Gain by which receivers must be likelier than the others to be told from them: these write more
or less often, and the best of more intervals is better by chance. A restart of a receiver at 1 Hz
was taken for one of two at 5 Hz by 12."""
UPWARDS = (0.15, -0.15)
"""Metres upwards from which a vertical error is looked for, beside level ones."""
_ROUNDS = 8
"""Sizes settle to a millimetre in three; a metre upwards in six."""
_REBASED = 3
"""Offsets that an error bends by a decimetre settle to a millimetre in two."""


@dataclass(frozen=True)
class _Candidate:
    """An error of one receiver in the epochs [first, last), by distances alone."""

    who: int
    first: int
    last: int
    size: Array
    spread: Array
    gain: float
    tau: float
    sums: DriveSums
    weight: Array

    def edge_gains(self, edge: str) -> Array:
        """(n + 1,) gains of errors that begin, or end, at other epochs."""
        n = len(self.sums.right) - 1
        at = np.arange(n + 1)
        if edge == "first":
            some = at < self.last
            first, last = at[some], np.full(some.sum(), self.last)
        else:
            some = at > self.first
            first, last = np.full(some.sum(), self.first), at[some]
        found = np.zeros(n + 1)
        found[some] = self.sums.fit(first, last)[2]
        # One that begins or ends elsewhere, far from it in gain, is another error.
        here = self.first if edge == "first" else self.last
        far = np.flatnonzero(found < found[here] - 2 * NEAR)
        found[: max(far[far < here], default=0)] = 0.0
        found[min(far[far > here], default=n + 1) :] = 0.0
        return found

    def sudden(self, every: float) -> float:
        """Gain above that of an error that comes and goes slowly."""
        reach = max(round(RAMP / every), 1)
        if self.last < len(self.sums.right) - 1:
            reach = min(reach, max((self.last - self.first) // 2, 1))
        return self.gain - self.sums.gain_of_slow(self.first, self.last, reach)


@kept_result()
def find_change(
    times: Array, positions: Array, offsets: Offsets, about: Sequence[Motion]
) -> LastingError | None:
    """The likeliest error of one receiver against the others that lasts; None if none is sure.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, offsets added, metres.
    offsets : Offsets
        That were added, with the distances.
    about : sequence of Motion
        Of the same vehicle, which tell when it was: that of all antennas, and those of some while
        another one has no fix.

    Returns
    -------
    LastingError
        Its epochs are not counted: 0.

    Notes
    -----
    The residuals that are left with it tell noise and correlation, so that errors that are slow by
    themselves pass for none.
    """
    n, r = positions.shape[:2]
    if n < 4 * EDGE:
        return None
    drive = WholeDrive.of(times, positions, offsets)
    each = [_likeliest(drive, k) for k in range(r)]
    near = [one for one in each if _told(one, n) > -SHARP]
    views = views_of(about) if near else []
    if not views:
        return None
    some = [one for one in each if one.gain > max(other.gain for other in near) / 2]
    bent = [other for one in some for other in _bent(drive, one)]
    # The distances are all in the sums of the drive; what is told once must not count twice.
    alone = [replace(view, seen=of_motion(view.seen)) for view in views] if bent else []
    options = [placed for one in bent for placed in _placed(times, alone, one)]
    options.sort(key=lambda one: -one.total)
    sure = [one for one in options if _sure(one, n, drive.every)]
    if not sure or options[0].total - sure[0].total > ALIKE:
        return None
    best = sure[0]
    # A false fix is one receiver's, unless it is told from that.
    single = [one for one in sure if one.of.last < n and len(one.cause) == 1]
    if best.of.last < n and single and best.total - single[0].total < ALIKE:
        best = single[0]
    alike = dict.fromkeys(
        one.cause for one in options
        if one.cause != best.cause and best.total - one.total < TOLD_APART
    )  # fmt: skip
    if best.of.last < n:
        best = _with_its_offsets(times, positions, offsets, best, alone)
    return best.error(tuple(alike)) if np.linalg.norm(best.size) > SMALLEST else None


def _with_its_offsets(
    times: Array, positions: Array, offsets: Offsets, best: "_Option", views: Sequence[View]
) -> "_Option":
    """An error that goes again with the offsets that the drive has beside it.

    Without it taken out they are those that it bends: a decimetre up for half a minute makes
    heights a decimetre wrong, and these centimetres of its level part.
    """
    found, sign = best.of, pair_incidence(positions.shape[1])
    pairs = len(sign)
    for _ in range(_REBASED):
        change = found.sums.change(found.first, found.last, found.size)
        moved = np.zeros(positions.shape[1:])
        moved[1:] = change[: moved[1:].size].reshape(-1, 3)
        distances = change[moved[1:].size :][:pairs]
        positions = positions - moved
        offsets = replace(offsets, distances=offsets.distances - distances)
        found = _settled(WholeDrive.of(times, positions, offsets), found)
    placed = [one for one in _placed(times, views, found) if one.cause == best.cause]
    return placed[0]


def _sure(one: "_Option", n: int, every: float) -> bool:
    """Whether the distances tell an error, with the motion, and it came at once.

    Or nothing else makes as much.
    """
    if len(one.edges) > 1:
        lasts = one.edges[1].after - one.edges[0].after
        if not SHORTEST <= lasts <= _LONGER * LONGEST_FALSE:
            return False  # the motion shows no two ends of a false fix
    wander = one.of.tau > SLOW
    told = _told(one.of, n)
    if told > 0 and one.of.gain > (CLEAR if wander else CLEAR_IN_WHITE):
        return True
    sharp, least = max(one.motion, one.of.sudden(every)), SHARP if wander else SHARP_IN_WHITE
    # What only the motion makes sure must be as large as it must be there.
    seen = one.motion > SHARP and told + one.motion > SHARP
    seen = seen and bool(np.linalg.norm(one.size) > SMALLEST_IN_MOTION)
    return sharp > least and (told > 0 or seen)


def _told(one: _Candidate, n: int) -> float:
    """Gain above the least that an error must have to be sure."""
    least = GAIN if one.last == n else GAIN_OF_PASSING
    told = tempered(np.array(one.gain), n * len(one.weight) / one.tau)
    return float(told) - (WANDERING if one.tau > SLOW else 1.0) * least


def _likeliest(drive: WholeDrive, who: int) -> _Candidate:
    """The likeliest error of a receiver, small beside the distances."""
    n = len(drive.residuals)
    error = drive.error(who, np.zeros(3))[..., :3]
    weight, _ = drive.weight(drive.residuals)
    for _ in range(2):
        sums = DriveSums.of(drive.own, error, drive.residuals, weight)
        first, last, gain = _best(sums, drive.every)
        sizes, spreads, _ = sums.fit(np.array([first]), np.array([last]))
        at = ((np.arange(n) >= first) & (np.arange(n) < last))[:, None]
        change = sums.change(first, last, sizes[0])
        fitted = drive.residuals - drive.own @ change - at * (error @ sizes[0])
        used = weight
        weight, tau = drive.weight(fitted)
    return _Candidate(who, first, last, sizes[0], spreads[0], gain, tau, sums, used)


def _bent(drive: WholeDrive, found: _Candidate) -> list[_Candidate]:
    """The same with distances that are no straight lines, from several sizes at first.

    Upwards a distance hardly changes at first, and by the same up and down: from a few centimetres
    nothing leads to the decimetres of a false fix.
    """
    sizes = found.size, *(np.array([0.0, 0.0, up]) for up in UPWARDS)
    return [_settled(drive, replace(found, size=size)) for size in sizes]


def _settled(drive: WholeDrive, one: _Candidate) -> _Candidate:
    """The same with a size, and edges, that linearising about it does not change any more."""
    for _ in range(_ROUNDS):
        error = drive.error(one.who, one.size)
        first, last = one.first, one.last
        seen = drive.as_seen(first, last)
        weight = one.weight.copy()
        if np.linalg.norm(one.size) > LARGE:  # slopes are seen with an antenna out of place
            pairs = drive.rods.shape[1]
            weight[pairs:, pairs:] = 0.0
        sums = DriveSums.of(drive.own, error, seen, weight)
        if last < len(drive.rods):
            first, last, _ = _moved(sums, (first, last, 0.0), drive.every)
        sizes, spreads, gains = sums.fit(np.array([first]), np.array([last]))
        one = replace(
            one, first=first, last=last, size=sizes[0], spread=spreads[0],
            gain=float(gains[0]), sums=sums,
        )  # fmt: skip
    return one


def _best(sums: DriveSums, every: float) -> tuple[int, int, float]:
    """First and last epoch of the error with the greatest gain, and the gain."""
    n = len(sums.right) - 1
    first = np.arange(EDGE, n - EDGE)
    best = _greatest_of(sums, first, np.full(len(first), n))
    passing = (0, 0, 0.0)
    length = max(SHORTEST, FEWEST * every)
    while length < min(LONGEST_FALSE, n * every / 2):
        count = round(length / every)
        first = np.arange(FEWEST, n - FEWEST - count)
        if len(first):
            passing = max(passing, _greatest_of(sums, first, first + count), key=lambda one: one[2])
        length *= _LONGER
    if passing[2] > 0:
        passing = _moved(sums, passing, every)
    return passing if passing[2] > best[2] + PASSING else best


def _moved(
    sums: DriveSums, passing: tuple[int, int, float], every: float
) -> tuple[int, int, float]:
    """The same with the best beginning and end about it."""
    n, most = len(sums.right) - 1, round(LONGEST_FALSE / every)
    for _ in range(3):
        first, last, _ = passing
        reach = max((last - first) // 4, 1)
        earliest = max(first - reach, FEWEST, last - most)
        begins = np.arange(earliest, min(first + reach + 1, last - FEWEST + 1))
        if len(begins):
            passing = max(
                passing,
                _greatest_of(sums, begins, np.full(len(begins), last)),
                key=lambda one: one[2],
            )
        first = passing[0]
        latest = min(last + reach, n - FEWEST, first + most)
        ends = np.arange(max(last - reach, first + FEWEST), latest + 1)
        if len(ends):
            passing = max(
                passing, _greatest_of(sums, np.full(len(ends), first), ends), key=lambda one: one[2]
            )
    return passing


def _greatest_of(sums: DriveSums, first: Ints, last: Ints) -> tuple[int, int, float]:
    """The first and last epoch of those that have the greatest gain, and the gain."""
    sizes, _, gains = sums.fit(first, last)
    gains = np.where(np.linalg.norm(sizes, axis=1) > SMALLEST, gains, 0.0)
    at = int(gains.argmax())
    return int(first[at]), int(last[at]), float(gains[at])


@dataclass(frozen=True)
class _Option:
    """An error of some receivers, by distances and motion together."""

    of: _Candidate
    cause: tuple[int, ...]
    edges: tuple[Edge, ...]
    size: Array
    covariance: Array
    motion: float

    @property
    def total(self) -> float:
        """Gain of distances and motion."""
        return self.of.gain + self.motion

    def error(self, alike: tuple[tuple[int, ...], ...]) -> LastingError:
        """What is told of it."""
        first, end = self.edges[0], self.edges[1].after if len(self.edges) > 1 else np.inf
        spread = np.asarray(np.linalg.inv(first.information + np.eye(3) * USUAL**-2), float)
        return LastingError(
            self.cause, first.after, end, self.size, self.covariance, self.of.gain, 0,
            first.after - first.before, alike, first.window,
            (spread @ first.right, spread),
        )  # fmt: skip


def _placed(times: Array, views: Sequence[View], found: _Candidate) -> list[_Option]:
    """The error as the receiver's and as the others', at the intervals that the motion shows."""
    n, r = len(times), len(views[0].motion.columns)
    others = tuple(k for k in range(r) if k != found.who)
    names = ["first"] if found.last == n else ["first", "last"]
    options = []
    for cause, sign in (((found.who,), 1.0), (others, -1.0)):
        size = sign * found.size
        edges = [
            edge_of(times, views, cause, name, found.edge_gains(name), (way * size, found.spread))
            for name, way in zip(names, (1.0, -1.0), strict=False)
        ]
        # The motion at both edges and the distances tell the size independently.
        told = np.linalg.inv(found.spread)
        covariance = np.linalg.inv(told + sum(edge.information for edge in edges))
        ways = zip(edges, (1.0, -1.0), strict=False)
        size = covariance @ (told @ size + sum(way * edge.right for edge, way in ways))
        motion = sum(edge.gain for edge in edges)
        options.append(_Option(found, cause, tuple(edges), size, covariance, motion))
    return options
