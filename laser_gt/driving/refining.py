"""All sweeps placed against the map that the solved keyframes make."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laser_gt.driving.local_map import merged, on_map
from laser_gt.driving.tracking import LOST
from laser_gt.matching.local import align
from laser_gt.scans.evidence import MARGIN
from laser_gt.scans.planar import compose, compose_jacobians, transform, wrapped
from laser_gt.scans.scan import Sweep, digest_of
from laser_gt.scans.surfaces import surface
from validation.pieces.store import code_of, kept_here, key_of
from validation.pieces.work import done_once
from validation.poses.angles import Array

REACH = 0.08
"""Metres within which points are paired at first: the guess is good to the odometry since the last
keyframe, half a metre ago."""
CODE = ("laser_gt.scans", "laser_gt.matching", "laser_gt.driving", "laser_gt.logs.motion")
"""What places sweeps."""
SURPRISE = 25.0
"""Squared distance from the guess, in standard deviations, beyond which a match is not believed."""


@dataclass(frozen=True)
class Place:
    """A submap, and the sweeps that are placed in it.

    Parameters
    ----------
    base : int
        Keyframe in whose frame it is.
    keyframes : sequence of int
        Sweeps that it is made of.
    poses : (k, 3) array
        Of them, in the frame of the base.
    sweeps : sequence of int
        To be placed.
    guesses : (m, 3) array
        Of them, in the frame of the base.
    covariances : (m, 3, 3) array
        Of the guesses.
    """

    base: int
    keyframes: Sequence[int]
    poses: Array
    sweeps: Sequence[int]
    guesses: Array
    covariances: Array


@dataclass(frozen=True)
class Placed:
    """A sweep placed in a submap.

    Parameters
    ----------
    sweep, base : int
        The sweep, and the keyframe in whose frame it is.
    pose : (3,) array
        Of it.
    covariance : (3, 3) array
        Of the pose, from the noise of the scans and of the guess.
    matched : bool
        Whether the scan was used.
    """

    sweep: int
    base: int
    pose: Array
    covariance: Array
    matched: bool


Job = tuple[Mapping[int, Sweep], Place]


def placed_sweeps(
    sweeps: Sequence[Sweep],
    places: Sequence[Place],
    workers: int,
    report: Callable[[float], None],
) -> list[Placed]:
    """Every sweep of the places, matched to its submap; in parallel processes."""
    jobs: list[Job] = [
        ({n: replace(sweeps[n]) for n in {*place.keyframes, *place.sweeps}}, place)
        for place in places
    ]
    few = workers if len(jobs) > workers else 1
    kept = kept_here("laser_places.jsonl", "stretches of a drive")
    done = done_once(_placed, jobs, _key, kept, _Form(), few, report)
    return [one for found in done for one in found]


class _Form:
    """Sweeps placed in one submap, as they are kept."""

    @staticmethod
    def written(result: Sequence[Placed], _job: Job) -> dict[str, Any]:
        """As values that JSON has, in the order of the place."""
        rows = [[one.pose.tolist(), one.covariance.tolist(), one.matched] for one in result]
        return {"placed": rows}

    @staticmethod
    def read(told: dict[str, Any], job: Job) -> list[Placed]:
        """The placed sweeps, by the numbers of the place."""
        place = job[1]
        return [
            Placed(sweep, place.base, np.array(pose), np.array(covariance), bool(matched))
            for sweep, (pose, covariance, matched) in zip(place.sweeps, told["placed"], strict=True)
        ]


def _key(job: Job) -> str:
    """Hash of all that the poses in one submap depend on."""
    sweeps, place = job
    order = (*place.keyframes, *place.sweeps)
    digests = (digest_of(sweeps[number]).encode() for number in order)
    arrays = (place.poses, place.guesses, place.covariances)
    told = repr(len(place.keyframes)).encode()
    return key_of(code_of(*CODE), told, *digests, *(one.tobytes() for one in arrays))


def _placed(job: Job) -> list[Placed]:
    """The sweeps of one place."""
    sweeps, place = job
    submap = merged([surface(sweeps[number]) for number in place.keyframes], place.poses)
    result = []
    for number, guess, covariance in zip(
        place.sweeps, place.guesses, place.covariances, strict=True
    ):
        own = surface(sweeps[number])
        found = align(submap, own, guess, reach=REACH)
        pose, spread = found.pose[0], found.covariance[0]
        off = wrapped(pose - guess)
        good = np.isfinite(spread).all()
        if good:
            surprise = off @ np.linalg.solve(spread + covariance, off)
            share = on_map(submap, transform(pose, own.points), MARGIN).mean()
            good = surprise <= SURPRISE and share >= LOST
        if good:
            gain = spread @ np.linalg.inv(spread + covariance)
            joint = gain @ covariance
            pose, spread = wrapped(pose - gain @ off), (joint + joint.T) / 2
        else:  # where the match points elsewhere, the guess is known no better than that
            doubt = np.outer(off, off) if np.isfinite(spread).all() else np.zeros((3, 3))
            pose, spread = guess, covariance + doubt
        result.append(Placed(number, place.base, pose, spread, bool(good)))
    return result


def carried(base: Array, covariance: Array, own: Placed) -> tuple[Array, Array]:
    """Pose and covariance in the frame of the graph of a sweep in the frame of its base."""
    by_base, by_own = compose_jacobians(base, own.pose)
    spread = by_base @ covariance @ by_base.T + by_own @ own.covariance @ by_own.T
    return compose(base, own.pose), spread
