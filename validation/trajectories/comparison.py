"""Errors of a source in time: the reference minus the source, pose by pose."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from validation.poses.angles import Array, mean_angle, wrap
from validation.poses.pose_table import PLANAR, SPATIAL, Component
from validation.poses.trajectory import Kind, Trajectory
from validation.shown import Shown
from validation.statistics.consistency import ConsistencyTest, nees
from validation.statistics.dependence import (
    SeriesMean,
    SeriesRms,
    bias_of_series,
    mean_of_series,
    nees_of_series,
    rms_of_series,
)
from validation.statistics.error_statistics import BiasTest
from validation.statistics.robust import sigma_from_median
from validation.trajectories.alignment import Alignment, DelayOf, align_in_time
from validation.trajectories.association import At, Coverage, Pairs
from validation.trajectories.motion import Motion, along_and_across, motion_at

ROTATIONS = tuple(Component(f"r{axis}", "angle", axis) for axis in "xyz")
"""A small rotation about the fixed axes, as the covariances of a trajectory in space have it."""
ERRORS: dict[Kind, tuple[Component, ...]] = {
    "plane": PLANAR,
    "space": (*SPATIAL[:3], *ROTATIONS),
    "points_plane": PLANAR[:2],
    "points_space": SPATIAL[:3],
}
"""Components of the errors."""
STRETCH_S = 5.0
"""Seconds of the stretches that are searched for the worst: what a robot does in one manoeuvre."""

Verdict = Literal["yes", "no", "cannot_tell"]


@dataclass(frozen=True)
class ComponentInTime:
    """Errors of one component.

    Parameters
    ----------
    component : Component
        Which.
    mean : SeriesMean
        With its interval.
    rms : float
        About zero.
    max_abs : float
        Largest size.
    bias : BiasTest
        Of 'the bias is below the limit'.
    note : str
        What the alignment has to do with it; empty if nothing.
    """

    component: Component
    mean: SeriesMean
    rms: float
    max_abs: float
    bias: BiasTest
    note: str = ""


@dataclass(frozen=True)
class Stretch:
    """A stretch of time with its errors."""

    start_s: float
    end_s: float
    n: int
    rms_m: float
    max_m: float


@dataclass(frozen=True)
class Answer:
    """Whether a source is good enough for a limit.

    Parameters
    ----------
    limit_m : float
        The limit, metres.
    share : float
        Of the position errors that are below it.
    rms : SeriesRms
        Of the position error, its interval widened for what was fitted.
    verdict : {"yes", "no", "cannot_tell"}
        Whether the whole interval of the rms is below the limit or above it.
    """

    limit_m: float
    share: float
    rms: SeriesRms
    verdict: Verdict


@dataclass(frozen=True, repr=False)
class TimeComparison(Shown):
    """What a source differs by from the reference, at n times.

    Parameters
    ----------
    pairs : Pairs
        The reference and the aligned source at these times.
    alignment : Alignment
        What was fitted before.
    errors : (n, k) array
        Reference minus source, metres and radians, in the reference's frame. In space the three
        rotations are the small rotation from the source to the reference about the fixed axes.
    components : tuple of Component
        What the k columns are.
    covariances : (n, k, k) array
        Both added; NaN where one is not stated.
    nees : (n,) array
        NaN where not available.
    unavailable : str
        Why some have no NEES.
    motion : Motion
        Of the reference.
    start : float
        First time of the reference, seconds since its epoch.
    confidence : float
        Of all intervals.
    """

    pairs: Pairs
    alignment: Alignment
    errors: Array
    components: tuple[Component, ...]
    covariances: Array
    nees: Array
    unavailable: str
    motion: Motion
    start: float
    confidence: float = 0.95

    def __len__(self) -> int:
        return len(self.errors)

    @property
    def system(self) -> str:
        """Name of the source."""
        return self.pairs.source.system

    @property
    def times(self) -> Array:
        """(n,) seconds since the reference's epoch."""
        return self.pairs.times

    @property
    def coverage(self) -> Coverage:
        """What part of the reference's time has pairs."""
        return self.pairs.coverage

    @cached_property
    def distances(self) -> Array:
        """(n,) length of the position error, metres."""
        return np.asarray(np.linalg.norm(self.errors[:, : self.pairs.source.dimensions], axis=1))

    @cached_property
    def rotation_angles(self) -> Array:
        """(n,) size of the rotation error, radians; NaN for positions only."""
        if not self.pairs.source.has_orientation:
            return np.full(len(self), np.nan)
        return np.asarray(np.linalg.norm(self.errors[:, self.pairs.source.dimensions :], axis=1))

    @cached_property
    def along_across(self) -> tuple[Array, Array]:
        """(n,) each: position errors in the direction of motion and across; NaN where still."""
        return along_and_across(self.errors[:, : self.pairs.source.dimensions], self.motion.ahead)

    @cached_property
    def rms_position(self) -> SeriesRms:
        """Of the position error; the interval allows for what was fitted."""
        found = rms_of_series(self.distances, self.confidence)
        free = self.pairs.source.dimensions * found.n_effective
        if not self.alignment.freedoms or np.isnan(found.low):
            return found
        if free <= 2 * self.alignment.freedoms:
            why = f"{self.alignment.freedoms} numbers were fitted to so few effective poses"
            return found._replace(low=np.nan, high=np.nan, reason=why)
        wider = float(np.sqrt(free / (free - self.alignment.freedoms)))
        return found._replace(low=found.low * wider, high=found.high * wider)

    @cached_property
    def nees_test(self) -> ConsistencyTest | None:
        """All NEES together; None where there is none or its effective number cannot be told."""
        return nees_of_series(self.nees, len(self.components), self.confidence)

    def statistics(
        self, limit_length: float = 0.05, limit_angle: float = 0.05
    ) -> tuple[ComponentInTime, ...]:
        """Of every component.

        Parameters
        ----------
        limit_length, limit_angle : float
            The d of 'the bias is below d', metres and radians.
        """
        limits = {"length": limit_length, "angle": limit_angle}
        return tuple(
            self._of_component(number, component, limits[component.kind])
            for number, component in enumerate(self.components)
        )

    def _of_component(self, number: int, component: Component, limit: float) -> ComponentInTime:
        values = self.errors[:, number]
        if component.kind == "angle":
            # Counted from the mean on the circle, so that no choice of its cut changes anything.
            centre = float(mean_angle(values))
            found = mean_of_series(centre + wrap(values - centre), self.confidence)
        else:
            found = mean_of_series(values, self.confidence)
        note = ""
        if component.kind == "length" and {"frame", "mount"} & set(self.alignment.parts):
            note = "the frame was fitted to the positions, so that their mean error tells nothing"
        return ComponentInTime(
            component=component,
            mean=found,
            rms=float(np.sqrt(np.square(values).mean())),
            max_abs=float(np.abs(values).max()),
            bias=bias_of_series(found, limit, self.confidence),
            note=note,
        )

    def answer(self, limit: float) -> Answer:
        """Whether the source is good enough for a limit in metres."""
        rms = self.rms_position
        verdict: Verdict = "cannot_tell"
        if rms.high <= limit:
            verdict = "yes"
        elif rms.low > limit:
            verdict = "no"
        return Answer(limit, float((self.distances < limit).mean()), rms, verdict)

    def worst_stretches(self, most: int = 3, seconds: float = STRETCH_S) -> list[Stretch]:
        """The stretches with the largest rms of the position error, the worst first, disjoint.

        Parameters
        ----------
        most : int
            Number of them.
        seconds : float
            Longest; each starts at a pose.
        """
        times, squares = self.times, np.square(self.distances)
        ends = np.searchsorted(times, times + seconds, side="right")
        sums = np.concatenate([[0.0], np.cumsum(squares)])
        starts = np.arange(len(times))
        counts = ends - starts
        means = (sums[ends] - sums[starts]) / counts
        # A few poses at the end of a stretch are no stretch.
        usual = np.median(counts)
        free = counts >= max(1, usual / 2)
        found: list[Stretch] = []
        while len(found) < most and free.any():
            at = int(np.argmax(np.where(free, means, -1.0)))
            end = int(ends[at])
            part = self.distances[at:end]
            found.append(
                Stretch(
                    *(float(times[at]), float(times[end - 1]), end - at),
                    *(float(np.sqrt(means[at])), float(part.max())),
                )
            )
            free &= (ends <= at) | (starts >= end)
        return found

    @cached_property
    def delay_by_speed(self) -> tuple[float, SeriesMean | None]:
        """The delay that the errors along the motion would have, and the mean that it is from.

        Seconds to add to the source's stamps: errors along the motion that grow with the speed.
        NaN where the speed does not change enough to tell it from an offset along the robot. Wrong
        poses do not count.
        """
        along, speed = self.along_across[0], self.motion.speed
        moves = np.isfinite(along)
        if moves.sum() < 3:
            return float("nan"), None
        along, speed = along[moves], speed[moves]
        kept = np.ones(len(along), dtype=bool)
        for _ in range(ROUNDS):
            away = speed[kept] - speed[kept].mean()
            power = float(np.square(away).mean())
            if power <= (LEAST_SPEED_SPREAD * speed[kept].mean()) ** 2:
                return float("nan"), None
            slope = float((away * along[kept]).mean() / power)
            rest = along[kept] - along[kept].mean() - slope * away
            shares = -(slope + away * rest / power)
            left = along - slope * speed
            left -= np.median(left)
            kept = np.abs(left) <= WRONG * sigma_from_median(left) + 1e-12
        return -slope, mean_of_series(shares, self.confidence)


WRONG, ROUNDS = 5.0, 4
"""Standard deviations, by the median, beyond which an error along the motion is a wrong pose that
tells nothing of the clock, and rounds of leaving such out. One in two million normal errors is so
far off; of the errors of a delay itself none is, as the line takes them away."""
LEAST_SPEED_SPREAD = 0.1
"""Of the mean speed: with less an offset along the robot and a delay cannot be told apart; an
offset of 1 mm would be a delay of 10 ms at 1 m/s."""


def compare_in_time(
    reference: Trajectory,
    source: Trajectory,
    parts: Iterable[str] = (),
    at: At = "sparser",
    delay_of: DelayOf | None = None,
    confidence: float = 0.95,
) -> TimeComparison:
    """The errors of a source against a reference.

    Parameters
    ----------
    reference, source : Trajectory
        Of any kinds: they are compared in what they share.
    parts : iterable of str
        What is aligned first: 'frame', 'scale', 'mount', 'time'.
    at : {"sparser", "reference", "source"}
        At whose times; the other is interpolated.
    delay_of : callable, optional
        See `validation.trajectories.alignment.align_in_time`.
    confidence : float
        Of the intervals.

    Raises
    ------
    GtvalError
        If there is no common time, or what is to be aligned cannot be told.
    """
    pairs, alignment = align_in_time(reference, source, parts, at, delay_of)
    ours, theirs = pairs.reference, pairs.source
    covariances = np.asarray(ours.covariances)
    if ours.has_covariance.any() and theirs.has_covariance.any():
        covariances = covariances + np.asarray(theirs.covariances)
    else:
        covariances = np.broadcast_to(np.nan, covariances.shape)
    errors = pose_errors(ours, theirs)
    scores, unavailable = _scores(errors, covariances, ours, theirs)
    whole = reference.planar() if ours.dimensions == 2 else reference
    return TimeComparison(
        pairs=pairs,
        alignment=alignment,
        errors=errors,
        components=ERRORS[ours.kind],
        covariances=covariances,
        nees=scores,
        unavailable=unavailable,
        motion=motion_at(whole, pairs.times),
        start=float(reference.times[0]),
        confidence=confidence,
    )


def pose_errors(reference: Trajectory, source: Trajectory) -> Array:
    """(n, k) reference minus source, of two trajectories of one kind at the same times."""
    errors = reference.positions - source.positions
    if reference.kind == "plane":
        return np.column_stack([errors, wrap(reference.poses[:, 2] - source.poses[:, 2])])
    if reference.kind == "space":
        turned = reference.rotations * source.rotations.inv()
        return np.column_stack([errors, turned.as_rotvec()])
    return np.asarray(errors)


def _scores(
    errors: Array, covariances: Array, ours: Trajectory, theirs: Trajectory
) -> tuple[Array, str]:
    """NEES, and why some are missing."""
    lacking = [one.system for one in (ours, theirs) if not one.has_covariance.all()]
    why = " and ".join(f"'{name}' states no covariance" for name in lacking)
    stated = np.isfinite(covariances).all((1, 2))
    scores = np.full(len(errors), np.nan)
    if stated.any():
        # Printed with few digits, a covariance may not be one any more.
        proper = np.zeros(len(errors), dtype=bool)
        proper[stated] = np.linalg.eigvalsh(covariances[stated]).min(-1) > 0
        if (stated & ~proper).any():
            bad = int((stated & ~proper).sum())
            why = "; ".join(filter(None, [why, f"{bad} covariances are not positive definite"]))
        scores[proper] = nees(errors[proper], covariances[proper])
    return scores, why
