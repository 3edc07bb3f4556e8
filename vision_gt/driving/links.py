"""The clocks of all cameras, through those that see the robot at the same time."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from validation.poses.angles import Array
from validation.trajectories.clock.jumps import jumping
from validation.trajectories.clock.result import ClockEstimate, Place, Verdict
from validation.trajectories.smoothing.source import NORMAL_95
from vision_gt.driving.pair_delay import PairDelay, jump_between, pair_delay
from vision_gt.driving.seen import Seen
from vision_gt.driving.stream import Stream

UNKNOWN: Verdict = "not_determinable"


@dataclass(frozen=True)
class Clock:
    """What is added to the stamps of a camera to get the common time.

    Parameters
    ----------
    delay, drift : float
        Seconds at the stamp ``at``, and its change, s/s.
    at : float
        Seconds since the common epoch.
    covariance : (2, 2) array
        Of delay and drift.
    """

    delay: float
    drift: float
    at: float
    covariance: Array

    def after(self, pair: PairDelay) -> "Clock":
        """The clock of a camera with a delay against the one that has this clock."""
        since = pair.at + pair.delay - self.at
        carried = np.array([1.0, since])
        own = self.covariance
        more = np.array(
            [
                [carried @ own @ carried, carried @ own[:, 1]],
                [carried @ own[:, 1], own[1, 1]],
            ]
        )
        return Clock(
            pair.delay + self.delay + self.drift * since,
            pair.drift + self.drift,
            pair.at,
            pair.covariance * (pair.quantile / NORMAL_95) ** 2 + more,
        )

    @classmethod
    def of(cls, estimate: ClockEstimate) -> "Clock":
        """The clock that Time tells; its reference's epoch is the common one."""
        halves = np.array(
            [
                estimate.high_s - estimate.low_s,
                np.nan_to_num(estimate.drift_high_ppm - estimate.drift_low_ppm) * 1e-6,
            ]
        )
        at = estimate.at_s - estimate.delay_s
        drift = 1e-6 * float(np.nan_to_num(estimate.drift_ppm))
        return cls(estimate.delay_s, drift, at, np.diag((halves / 2 / NORMAL_95) ** 2))

    def told(self, system: str, epoch: int, interval: float) -> ClockEstimate:
        """The same as Time tells it."""
        half = NORMAL_95 * np.sqrt(np.diag(self.covariance))
        return ClockEstimate(
            system,
            epoch,
            "determined",
            delay_s=self.delay,
            at_s=self.at + self.delay,
            low_s=self.delay - float(half[0]),
            high_s=self.delay + float(half[0]),
            drift_ppm=1e6 * self.drift,
            drift_low_ppm=1e6 * (self.drift - float(half[1])),
            drift_high_ppm=1e6 * (self.drift + float(half[1])),
            interval_s=interval,
        )


Node = tuple[str, int]
"""A camera, and the number of a piece between two jumps of its clock."""
MOST_JUMPS = 4
"""Jumps in one drive, of all cameras together, that are followed; a judgement."""


class Links:
    """The delays of all pairs of cameras that see the robot at the same time.

    Parameters
    ----------
    streams : sequence of Stream
        Each on a clock of its own.
    epoch : int
        Seconds that common times count from.
    window : float
        Seconds to both sides in which a delay is looked for.

    Notes
    -----
    Where the delay of a pair jumps, one of the two clocks does: that of the camera in more such
    pairs, and of two alike that of the one with fewer poses. Its stream is two from there on.
    """

    def __init__(self, streams: Sequence[Stream], epoch: int, window: float) -> None:
        found = [Seen.of(stream, epoch) for stream in streams]
        self.seen: dict[Node, Seen] = {(one.camera, 0): one for one in found if one is not None}
        self.epoch, self.window = epoch, window
        self.places: dict[str, list[Place]] = {}
        for _ in range(MOST_JUMPS):
            if not self._split():
                break
        self.pairs: dict[tuple[Node, Node], PairDelay] = {}
        for one, two in self._couples():
            pair = pair_delay(self.seen[one], self.seen[two], window)
            self.pairs[one, two], self.pairs[two, one] = pair, pair.reverse()

    def _couples(self) -> list[tuple[Node, Node]]:
        """Pairs of pieces of different cameras."""
        return [(a, b) for a, b in itertools.combinations(self.seen, 2) if a[0] != b[0]]

    def _split(self) -> bool:
        """Part the stream of a camera whose clock jumps; whether there is one."""
        pairs = [
            (one, two)
            for one, two in self._couples()
            if jump_between(self.seen[one], self.seen[two], self.window)
        ]
        if not pairs:
            return False
        blamed = max(
            (node for pair in pairs for node in pair),
            key=lambda n: (sum(n in pair for pair in pairs), -len(self.seen[n].times)),
        )
        other = next(a if b == blamed else b for a, b in pairs if blamed in (a, b))
        found = jump_between(self.seen[other], self.seen[blamed], self.window)
        if found is None:
            return False
        one = self.seen[blamed]
        parts = one.part(0, found[0] + 1), one.part(found[0] + 1, len(one.times))
        between = self.places.setdefault(one.camera, [])
        between.append(one.place_after(*found))
        between.sort(key=lambda place: place.stamp_s)
        pieces = [n for n in self.seen if n[0] == one.camera and n != blamed]
        rest = [self.seen.pop(n) for n in pieces] + [p for p in parts if p is not None]
        del self.seen[blamed]
        rest.sort(key=lambda piece: float(piece.times[0]))
        self.seen |= {(one.camera, number): piece for number, piece in enumerate(rest)}
        return True

    def reference(self) -> str:
        """The camera with most poses among those that most poses are linked with.

        One whose clock does not jump, if there is one.
        """
        steady = [node for node in self.seen if node[0] not in self.places] or list(self.seen)
        poses = {node: len(one.times) for node, one in self.seen.items()}
        linked = {
            node: sum(poses[other] for other in self.clocks({node: self.own(node)}))
            for node in steady
        }
        return max(steady, key=lambda node: (linked[node], poses[node]))[0]

    def own(self, node: Node) -> Clock:
        """The clock of the camera whose stamps are the common time."""
        times = self.seen[node].times
        return Clock(0.0, 0.0, float(times[0] + times[-1]) / 2, np.zeros((2, 2)))

    def clocks(self, known: Mapping[Node, Clock]) -> dict[Node, Clock]:
        """The clocks of all pieces that links lead to, by the chains that are best known.

        Parameters
        ----------
        known : mapping
            Where chains begin.
        """
        best = dict(known)
        while True:
            tried = [
                (two, best[one].after(pair))
                for (one, two), pair in self.pairs.items()
                if one in best and two not in best and pair.verdict == "determined"
            ]
            if not tried:
                return best
            node, clock = min(tried, key=lambda entry: float(entry[1].covariance[0, 0]))
            best[node] = clock

    def estimates(self, known: Mapping[str, Clock]) -> dict[str, ClockEstimate]:
        """What Time would tell of all cameras that are not known, those without a link too.

        Parameters
        ----------
        known : mapping of str to Clock
            Clocks that do not jump, by camera.
        """
        linked = self.clocks({(name, 0): clock for name, clock in known.items()})
        cameras = dict.fromkeys(camera for camera, _ in self.seen)
        found = {}
        for name in cameras:
            if name in known:
                continue
            nodes = sorted(node for node in self.seen if node[0] == name)
            pieces = [self._estimate(node, linked.get(node)) for node in nodes]
            untold = [one for one in pieces if one.verdict != "determined"]
            found[name] = (
                pieces[0]
                if len(pieces) == 1
                else untold[0]
                if untold
                else jumping(pieces, self.places[name])
            )
        return found

    def _estimate(self, node: Node, clock: Clock | None) -> ClockEstimate:
        """What Time would tell of a piece."""
        one, system = self.seen[node], f"vision_{node[0]}"
        if clock is not None:
            told = clock.told(system, self.epoch, float(np.median(np.diff(one.times))))
            return replace(told, poses=len(one.times))
        pairs = [pair for (_, two), pair in self.pairs.items() if two == node]
        likely = max(pairs, key=lambda pair: pair.rows, default=None)
        reason = "no other camera sees the robot" if likely is None else likely.reason
        if node[0] in self.places:
            reason = f"its clock jumps, and of a part {reason}"
        ambiguous = likely is not None and likely.verdict == "ambiguous"
        return ClockEstimate(system, self.epoch, "ambiguous" if ambiguous else UNKNOWN, reason)
