"""Places and poses from which the joint adjustment starts: one by one, or all together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from survey.estimation.adjustment import Adjustment
from survey.estimation.evidence import Evidence
from survey.estimation.points_from_marks import locate_from_marks
from survey.estimation.robot_frames import NotPosed, RobotFrameFit, solve_robot_frames
from survey.estimation.vframe import VframeEstimate
from survey.estimation.whole.located import locate_whole
from survey.estimation.whole.units import stop_key
from survey.estimation.world_points import (
    NotLocated,
    WorldPoint,
    WorldPoints,
    joint_covariance,
)
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array, wrap

_ELSEWHERE = 30.0
"""Chi-squared of what one step gave against the whole from which it is somewhere else. A judgement:
far beyond noise, and far below a mirror image, which costs thousands."""


@dataclass(frozen=True)
class Located:
    """Where world points and stops are, and how that was found.

    Parameters
    ----------
    world : WorldPoints
        Those that the Vframe alone gives, and why it does not give the others.
    frames : tuple of RobotFrameFit
        Stops that these world points give each by itself.
    not_posed : tuple of NotPosed
        Stops that are open in the end.
    places, poses : mapping of str to array
        All that is located, (2,) and (3,).
    spread : mapping of str to (3,) array
        Standard deviations of places that the whole network gave.
    is_whole : bool
        Whether the whole network was searched.
    """

    world: WorldPoints
    frames: tuple[RobotFrameFit, ...]
    not_posed: tuple[NotPosed, ...]
    places: Mapping[str, Array]
    poses: Mapping[str, Array]
    spread: Mapping[str, Array]
    is_whole: bool = False

    @property
    def from_marks(self) -> dict[str, Array]:
        """Places that the Vframe alone does not give."""
        alone = set(self.world.names)
        return {name: place for name, place in self.places.items() if name not in alone}

    @property
    def late_poses(self) -> dict[str, Array]:
        """Poses that their readings to these world points do not give."""
        alone = {frame.pose for frame in self.frames}
        return {name: state for name, state in self.poses.items() if name not in alone}

    def all_points(self) -> WorldPoints:
        """All places as world points; those of the whole network without correlations."""
        late = self.from_marks
        if not late:
            return self.world
        nowhere = np.full(3, 0.01)
        spread = [np.diag(self.spread.get(name, nowhere)[:2] ** 2) for name in late]
        points = tuple(
            WorldPoint(name, place, own, 0.0, 0, None, np.empty((2, 0)), 0)
            for (name, place), own in zip(late.items(), spread, strict=True)
        )
        n = len(self.world.covariance)
        whole = np.zeros((n + 2 * len(late), n + 2 * len(late)))
        whole[:n, :n] = self.world.covariance
        for i, own in enumerate(spread):
            rows = slice(n + 2 * i, n + 2 * i + 2)
            whole[rows, rows] = own
        return WorldPoints((*self.world.points, *points), whole, self.world.missing)

    def agreeing(self, adjustment: Adjustment, frame: VframeEstimate) -> "Located":
        """The same without single solutions that lie elsewhere than those of the whole network.

        With few readings a single solution may be the wrong one of two, or near none.
        """
        if not self.is_whole:
            return self
        network, at = adjustment.network, adjustment.parameters
        place = dict(zip(network.points, at.points, strict=True))
        state = dict(zip(network.poses, at.poses, strict=True))
        points = [p for p in self.world.points if _near(place[p.name] - p.position, p.covariance)]
        kept = {p.name for p in points}
        frames = tuple(
            f for f in self.frames if _near(_turned(state[f.pose] - f.state), f.covariance)
        )
        strayed = [
            NotLocated(p.name, "its few readings to the Vframe fit another place", np.empty((0, 2)))
            for p in self.world.points
            if p.name not in kept
        ]
        if strayed:
            missing = (*self.world.missing, *strayed)
            world = WorldPoints(tuple(points), joint_covariance(points, frame), missing)
            return replace(self, world=world, frames=frames)
        return replace(self, frames=frames)


def _turned(off: Array) -> Array:
    return np.append(off[:2], wrap(off[2]))


def _near(off: Array, covariance: Array) -> bool:
    return bool(off @ np.linalg.solve(covariance, off) < _ELSEWHERE)


@dataclass(frozen=True)
class Search:
    """What there is to locate, and from what.

    Parameters
    ----------
    frame : VframeEstimate
        The frame.
    rig : RobotFrame
        Nominal rig.
    readings : Readings
        All readings.
    world_points : tuple of str
        Names of the world points.
    evidence : Evidence
        Rough values.
    """

    frame: VframeEstimate
    rig: RobotFrame
    readings: Readings
    world_points: Sequence[str]
    evidence: Evidence

    def separately(self, world: WorldPoints) -> Located:
        """Each stop from the world points by itself, then each missing point from the stops."""
        frames, not_posed = solve_robot_frames(
            self.readings.poses, self.readings, world, self.rig, self.evidence.guesses
        )
        late = locate_from_marks(world.missing, self.readings, self.frame, frames, self.rig)
        places = {**dict(zip(world.names, world.positions, strict=True)), **late}
        poses = {fit.pose: fit.state for fit in frames}
        return Located(world, tuple(frames), tuple(not_posed), places, poses, {})

    def leaves_open(self, located: Located) -> bool:
        """Whether something is open that has readings."""
        read = self.readings.rows_of_point
        marks = [name for name in self.world_points if name not in located.places]
        return bool(located.not_posed) or any(name in read for name in marks)

    def together(self, before: Located, *, trusting: bool = False) -> Located:
        """All from all readings; what single steps found is one start of several.

        Of a large survey, ``trusting``, only what single steps left open.
        """
        whole = locate_whole(
            self.frame,
            self.rig,
            self.readings,
            self.world_points,
            self.evidence,
            {**before.places, **{stop_key(pose): at for pose, at in before.poses.items()}},
            trusting=trusting,
        )
        places, poses = dict(whole.places), {key[:-1]: at for key, at in whole.poses.items()}
        weak = {name for name, why in whole.open.items() if why.is_weak}
        places |= {name: at for name, at in before.places.items() if name in weak}
        poses |= {name: at for name, at in before.poses.items() if stop_key(name) in weak}
        missing = {lost.name: lost for lost in before.world.missing}
        points = tuple(p for p in before.world.points if p.name in places)
        missing |= {
            name: NotLocated(name, whole.open[name].reason, whole.open[name].candidates)
            for name in self.world_points
            if name in whole.open and name not in places
        }
        world = before.world
        if len(points) < len(world.points) or missing:
            covariance = joint_covariance(points, self.frame)
            world = WorldPoints(points, covariance, tuple(missing.values()))
        return Located(
            world,
            tuple(fit for fit in before.frames if fit.pose in poses),
            tuple(
                NotPosed(name, why.reason, why.candidates)
                for name in self.readings.poses
                if name not in poses and (why := whole.open[stop_key(name)])
            ),
            {name: places[name] for name in self.world_points if name in places},
            poses,
            whole.sigma,
            is_whole=not trusting,
        )
