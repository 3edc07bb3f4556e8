"""The way of the robot, each scan matched to the submap of the scans before it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.driving.local_map import merged, on_map
from laser_gt.driving.odometer import Odometer
from laser_gt.matching.kiss import register
from laser_gt.matching.local import align
from laser_gt.matching.search import SearchSettings, global_match
from laser_gt.scans.evidence import MARGIN, Prepared
from laser_gt.scans.planar import between, compose, inverse, transform, wrapped
from laser_gt.scans.scan import Flags, Indices, Sweep, View
from laser_gt.scans.surfaces import Surface, surface
from validation.pieces.results import kept_result
from validation.poses.angles import Array

SPACING = (0.3, 0.2)
"""Metres and radians between two scans of a submap. A judgement: half a step of a person; walls
that a scanner of half a turn loses at one side are still seen in six."""
SUBMAP = 8
"""Scans of a submap. A judgement: two metres and more of the way, over which a match drifts by less
than the noise of a scan."""
LOST = 0.35
"""A scan with a smaller share of its points on the submap is not matched by it. A judgement: below
what a turn into another room leaves in view, above what chance gives."""
SURPRISE = 20.0
"""Squared distance of a match from the odometry, in standard deviations, from which on the match is
not believed: beyond the 99.99 % quantile of chi-squared with 3 degrees of freedom (21.1)."""
GUESS_SIGMAS = np.array([0.15, 0.15, 0.25])
"""Standard deviations of a step that is guessed from the one before it: metres, radians. A
judgement: a robot of 1 m/s that brakes within a step of 0.2 s."""
FAN = (0.0, 0.12, -0.12, 0.25, -0.25, 0.4, -0.4)
"""Radians by which a step that is guessed from the one before it may turn more. Measured on a log
with a scan every 0.6 s: with these, and no motion, 98 % of the steps are found, from the step
before alone 75 %, by kiss-icp from there 89 %."""
WIDE = SearchSettings(window=1.5, heading_window=1.5)
"""Where a sweep is sought that none of these places: metres and radians. A judgement: a robot of
1 m/s and 1 rad/s over a second and a half."""
CLEARLY = (0.85, 0.3)
"""Share of the points of a sweep on the submap, and by how much it must be more than at the pose by
odometry, for odometry to have slipped. Measured on 22 drives with single slips of 0.1 and 0.2 rad:
at the right pose 98 % lie on it and by odometry a tenth to a third; once, with people in the way,
another pose a quarter of a metre off had 73 %."""
REACH = 0.3
"""Metres within which points are paired at first. A judgement: half a doorway."""


@dataclass(frozen=True)
class Track:
    """Sweep frames along the way.

    Parameters
    ----------
    poses : (n, 3) array
        In the frame of the first.
    matched : (n,) bool array
        Whether the sweep was matched; where not, its pose is that of the guess.
    keyframes : (k,) int array
        Sweeps of which the submaps were made.
    """

    poses: Array
    matched: Flags
    keyframes: Indices


Report = Callable[[float], None]


@kept_result("report")
def track(
    sweeps: Sequence[Sweep],
    times: Array,
    mount: Array,
    odometer: Odometer | None,
    kept: Flags,
    slack: Array,
    report: Report,
) -> Track:
    """Each sweep matched to the submap of those before it.

    Parameters
    ----------
    sweeps : sequence of Sweep
        In the order of time.
    times : (n,) array
        Seconds, on the clock of the odometer.
    mount : (3,) array
        Laser frame in the robot frame.
    odometer : Odometer or None
        What a step is guessed from; without it from kiss-icp and the step before.
    kept : (n,) bool array
        Sweeps that are keyframes in any case.
    slack : (3, 3) array
        Covariance of what a step of odometry is worse by, as long as its clock is not known.
    report : callable
        Told the share done.
    """
    way = _Way(odometer, times, mount)
    poses = np.zeros((len(sweeps), 3))
    matched = np.ones(len(sweeps), dtype=bool)
    keyframes = [0]
    surfaces = [surface(sweeps[0])]
    submap, base = surfaces[0], 0
    open_since = np.zeros((3, 3))
    for number in range(1, len(sweeps)):
        if number % 50 == 0:
            report(number / len(sweeps))
        own = surface(sweeps[number])
        step, covariance = way.step(number, poses)
        covariance = open_since = open_since + covariance + slack
        guess = between(poses[base], compose(poses[number - 1], step))
        if odometer is not None:
            pose, matched[number] = _matched(submap, own, guess[None], covariance)
            pose, slipped = _slipped(submap, own, guess, pose)
            matched[number] |= slipped
        else:
            starts = way.starts(guess, sweeps[number - 1 : number + 1], poses[[base, number - 1]])
            pose, matched[number] = _matched(submap, own, starts, covariance)
            if not matched[number]:
                members = keyframes[-len(surfaces) :]
                around = _wide(sweeps, members, between(poses[base], poses[members]))
                found = global_match(around, Prepared(sweeps[number]), guess, WIDE).pose
                pose, matched[number] = _matched(submap, own, found[None], _ANYWHERE)
                pose = pose if matched[number] else guess
        poses[number] = compose(poses[base], pose)
        # What is not matched is carried on, and the next guess is worse by that.
        open_since = np.zeros((3, 3)) if matched[number] else open_since
        off = between(poses[keyframes[-1]], poses[number])
        if np.hypot(off[0], off[1]) > SPACING[0] or abs(off[2]) > SPACING[1] or kept[number]:
            keyframes.append(number)
            surfaces = [*surfaces[1 - SUBMAP :], own]
            base = number
            seen = between(poses[number], poses[keyframes[-len(surfaces) :]])
            submap = merged(surfaces, seen)
    return Track(poses, matched, np.array(keyframes, dtype=np.intp))


@dataclass(frozen=True)
class _Way:
    """Guesses of the steps."""

    odometer: Odometer | None
    times: Array
    mount: Array

    def step(self, number: int, poses: Array) -> tuple[Array, Array]:
        """(3,), (3, 3) motion of the laser frame to a sweep from the one before, covariance."""
        if self.odometer is not None:
            robot = self.odometer.at(self.times[number - 1 : number + 1])
            step = between(robot[0], robot[1])
            covariance = self.odometer.covariance(step[None])[0] + np.diag([1e-3, 1e-3, 1e-3]) ** 2
            if not self.odometer.known(self.times[number - 1 : number + 1]).all():
                covariance = covariance + np.diag(GUESS_SIGMAS**2)
            return compose(compose(inverse(self.mount), step), self.mount), covariance
        before = np.zeros(3)
        if number > 1:
            ratio = (self.times[number] - self.times[number - 1]) / (
                self.times[number - 1] - self.times[number - 2]
            )
            before = between(poses[number - 2], poses[number - 1]) * min(ratio, 2.0)
        return before, np.diag(GUESS_SIGMAS**2)

    def starts(self, guess: Array, pair: Sequence[Sweep], poses: Array) -> Array:
        """(k, 3) where to look for a sweep, the guess first, by the sweep before it.

        The guess is in the frame of the submap; the poses are those of the submap and of the sweep
        before. A fan of turns, no motion, and what kiss-icp makes of the guess.
        """
        before = between(poses[0], poses[1])
        step = register(Prepared(pair[0]), Prepared(pair[1]), between(before, guess))
        fan = guess + np.array([[0.0, 0.0, turn] for turn in FAN])
        return np.vstack([fan, before, compose(before, step)])


_ANYWHERE = np.diag([WIDE.window, WIDE.window, WIDE.heading_window]) ** 2


def _wide(sweeps: Sequence[Sweep], members: Sequence[int], poses: Array) -> Prepared:
    """The sweeps of a submap as one, for a search."""
    views = [
        View(view.scan, compose(pose, view.mount))
        for number, pose in zip(members, poses, strict=True)
        for view in sweeps[number].views
    ]
    return Prepared(Sweep(tuple(views)))


def _matched(submap: Surface, own: Surface, starts: Array, covariance: Array) -> tuple[Array, bool]:
    """Pose of a sweep in a submap from its guess, the first of the starts; whether it is seen."""
    guess = starts[0]
    found = align(submap, own, starts, reach=REACH)
    best = 0
    if len(starts) > 1:
        shares = [on_map(submap, transform(pose, own.points), MARGIN).mean() for pose in found.pose]
        best = int(np.argmax(shares))
    pose, spread = found.pose[best], found.covariance[best]
    if not np.isfinite(spread).all():
        return guess, False
    off = wrapped(pose - guess)
    surprise = off @ np.linalg.solve(spread + covariance, off)
    share = on_map(submap, transform(pose, own.points), MARGIN).mean()
    if surprise > SURPRISE or share < LOST:
        return guess, False
    gain = spread @ np.linalg.inv(spread + covariance)
    return wrapped(pose - gain @ off), True


def _slipped(submap: Surface, own: Surface, guess: Array, pose: Array) -> tuple[Array, bool]:
    """Another pose of a sweep, where the scans say that the odometry before it is wrong.

    Wheels that spin or a robot that is pushed are seen by that: it has clearly more of the sweep on
    the submap than the pose that follows from the odometry.
    """
    there = on_map(submap, transform(pose, own.points), MARGIN).mean()
    if there >= CLEARLY[0]:
        return pose, False
    found = align(submap, own, guess + np.array([[0, 0, turn] for turn in FAN]), reach=REACH)
    shares = [on_map(submap, transform(one, own.points), MARGIN).mean() for one in found.pose]
    best = int(np.argmax(shares))
    clear = shares[best] >= CLEARLY[0] and shares[best] >= there + CLEARLY[1]
    if not clear or not np.isfinite(found.covariance[best]).all():
        return pose, False
    return found.pose[best], True
