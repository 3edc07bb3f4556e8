"""The clocks of all cameras, through those that see the robot at the same time."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from validation.trajectories.clock.result import ClockEstimate, Verdict
from validation.trajectories.smoothing.source import NORMAL_95
from vision_gt.driving.pair_delay import PairDelay, Seen, pair_delay
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
    """

    def __init__(self, streams: Sequence[Stream], epoch: int, window: float) -> None:
        found = [Seen.of(stream, epoch) for stream in streams]
        self.seen = {one.camera: one for one in found if one is not None}
        self.epoch = epoch
        self.pairs: dict[tuple[str, str], PairDelay] = {}
        for one, two in itertools.combinations(self.seen, 2):
            pair = pair_delay(self.seen[one], self.seen[two], window)
            self.pairs[one, two], self.pairs[two, one] = pair, pair.reverse()

    def reference(self) -> str:
        """The camera with most poses among those that most poses are linked with."""
        poses = {name: len(one.times) for name, one in self.seen.items()}
        with_others = {
            name: sum(poses[other] for other in self.clocks({name: self.own(name)}))
            for name in poses
        }
        return max(poses, key=lambda name: (with_others[name], poses[name]))

    def own(self, camera: str) -> Clock:
        """The clock of the camera whose stamps are the common time."""
        times = self.seen[camera].times
        return Clock(0.0, 0.0, float(times[0] + times[-1]) / 2, np.zeros((2, 2)))

    def clocks(self, known: Mapping[str, Clock]) -> dict[str, Clock]:
        """The clocks of all cameras that links lead to, by the chains that are best known.

        Parameters
        ----------
        known : mapping of str to Clock
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
            name, clock = min(tried, key=lambda entry: float(entry[1].covariance[0, 0]))
            best[name] = clock

    def estimates(self, known: Mapping[str, Clock]) -> dict[str, ClockEstimate]:
        """What Time would tell of all cameras that are not known, those without a link too."""
        linked = self.clocks(known)
        found = {}
        for name, one in self.seen.items():
            if name in known:
                continue
            if name in linked:
                interval = float(np.median(np.diff(one.times)))
                found[name] = linked[name].told(f"vision_{name}", self.epoch, interval)
                continue
            pairs = [pair for (_, two), pair in self.pairs.items() if two == name]
            told = max(pairs, key=lambda pair: pair.rows, default=None)
            reason = "no other camera sees the robot" if told is None else told.reason
            verdict: Verdict = "ambiguous" if told and told.verdict == "ambiguous" else UNKNOWN
            found[name] = ClockEstimate(f"vision_{name}", self.epoch, verdict, reason)
        return found
