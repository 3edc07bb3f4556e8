"""A plan of cameras worked out: shares of the floor and of the stops, sizes, accuracy, a rule."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.pieces.results import kept_result
from validation.poses.angles import Array
from vision_gt.images.markers import LEAST_CELL
from vision_gt.optics.camera import Camera
from vision_gt.planning.accuracy import (
    Views,
    best_and_merged,
    planar_covariances,
    views_of,
)
from vision_gt.planning.floor import (
    FloorGrid,
    Hole,
    area_of,
    floor_grid,
    floor_seen,
    holes,
)
from vision_gt.planning.mounting import MountedCamera, mounted
from vision_gt.robot.marker_poses import Layout

ACCURACY_POINTS, HEADINGS = 400, 6
"""Places at which the accuracy is predicted, and headings of the robot at each. Judgements: on a
floor of 36 square metres one place is 0.3 m from the next, over which the accuracy changes little;
six headings meet each of four markers at other angles."""
RULE_DISTANCES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_SIDES = np.geomspace(0.02, 1.5, 60)
"""Metres: markers from a match-box to a door, among which the rule finds the smallest."""


@dataclass(frozen=True)
class PlanInput:
    """What is planned.

    Parameters
    ----------
    mounts : tuple of MountedCamera
        The cameras.
    layout : Layout
        The robot's markers.
    outline : (k, 2) array
        The floor that has to be seen, metres, GTV frame.
    stops : mapping of str to (3,) array
        Poses.
    corner_sigma : float
        Of a corner's coordinate, pixels.
    cells : int
        Along a marker's side.
    floor : (6, 6) array or None
        Information of a robot that is held to the floor; None where it is not.
    wanted : float
        Standard deviation that a place should have, metres.
    """

    mounts: tuple[MountedCamera, ...]
    layout: Layout
    outline: Array
    stops: Mapping[str, Array]
    corner_sigma: float
    cells: int
    floor: Array | None = None
    wanted: float = 0.01


@dataclass(frozen=True)
class Predicted:
    """The robot seen at many poses.

    Parameters
    ----------
    poses : (p, 3) array
        Where it stands.
    views : tuple of Views
        Of each camera.
    single : (c, p, 3, 3) array
        Covariance of x, y, theta from each camera by itself; NaN where it gives no sure pose.
    best, merged : (p, 3, 3) arrays
        From the camera that knows the pose best, and from all together.
    """

    poses: Array
    views: tuple[Views, ...]
    single: Array
    best: Array
    merged: Array

    @property
    def cameras_with_pose(self) -> npt.NDArray[np.intp]:
        """(p,) how many cameras give a sure pose."""
        return np.asarray(np.sum([one.gives_pose for one in self.views], axis=0), dtype=np.intp)


@dataclass(frozen=True)
class RuleRow:
    """How large a marker has to be at a distance.

    Parameters
    ----------
    distance : float
        From the foot of the pole, metres.
    side_pixels : float
        Width of the planned marker in the image, pixels, as the shorter of its widths.
    sigma : float
        Standard deviation of the robot's place (root of the sum of both variances), metres.
    sigma_heading : float
        Radians.
    readable_side, wanted_side : float
        Smallest side that is read, and that places the robot as well as wanted, metres; NaN
        where no side does.
    """

    distance: float
    side_pixels: float
    sigma: float
    sigma_heading: float
    readable_side: float
    wanted_side: float


@dataclass(frozen=True)
class CameraPlan:
    """A plan worked out.

    Parameters
    ----------
    given : PlanInput
        What was planned.
    grid : FloorGrid
        On which the floor is counted.
    seen : (c, n) array of bool
        Which camera has which point of the floor in its image.
    holes : list of Hole
        Parts of the floor that none sees.
    over_floor : Predicted
        The robot at places all over the floor, in several headings at each.
    at_stops : Predicted
        The robot at its stops.
    stops_seen : (c, s) array of bool
        Which camera has which stop's place on the floor in its image.
    rule : mapping of str to list of RuleRow
        By camera; cameras of one lens and height share theirs, under all their names.
    """

    given: PlanInput
    grid: FloorGrid
    seen: npt.NDArray[np.bool_]
    holes: list[Hole]
    over_floor: Predicted
    at_stops: Predicted
    stops_seen: npt.NDArray[np.bool_]
    rule: Mapping[str, list[RuleRow]]

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""
        return [one.camera.name for one in self.given.mounts]

    def footprint(self, number: int) -> float:
        """Area of the floor that one camera sees, square metres."""
        return float(self.seen[number].mean()) * area_of(self.grid.outline)

    def share(self, at_least: int) -> float:
        """Share of the floor seen by so many cameras and more."""
        return float((self.seen.sum(0) >= at_least).mean())

    def share_with_pose(self, at_least: int) -> float:
        """Share of places and headings with a sure pose from so many cameras and more."""
        return float((self.over_floor.cameras_with_pose >= at_least).mean())


@kept_result()
def work_out(given: PlanInput) -> CameraPlan:
    """What planned cameras will see, and how well they will know the robot's pose."""
    grid = floor_grid(given.outline)
    seen = floor_seen(grid.points, given.mounts)
    coarse = floor_grid(given.outline, ACCURACY_POINTS).points
    turns = np.arange(HEADINGS) * 2 * np.pi / HEADINGS
    poses = np.column_stack([
        np.repeat(coarse, HEADINGS, axis=0),
        np.tile(turns, len(coarse)),
    ])  # fmt: skip
    stops = np.array([given.stops[name] for name in given.stops]).reshape(-1, 3)
    return CameraPlan(
        given,
        grid,
        seen,
        holes(grid, np.asarray(seen.any(0))),
        predict(given, poses),
        predict(given, stops),
        floor_seen(stops[:, :2], given.mounts),
        _rules(given),
    )


@kept_result()
def predict(given: PlanInput, poses: Array) -> Predicted:
    """How well the pose will be known of a robot that stands at poses (p, 3)."""
    held = given.floor is not None
    views = tuple(
        views_of(one, given.layout, poses, given.corner_sigma, given.cells, on_floor=held)
        for one in given.mounts
    )
    single, best, merged = best_and_merged(views, poses[:, 2], given.floor)
    return Predicted(poses, views, single, best, merged)


def place_sigma(covariances: Array) -> Array:
    """(...) root of the sum of the variances of x and y, of covariances (..., 3, 3), metres."""
    return np.asarray(np.sqrt(covariances[..., 0, 0] + covariances[..., 1, 1]))


def over_headings(values: Array) -> Array:
    """Root mean squares (n,) of values (n * HEADINGS,) of a place over its headings, NaN apart."""
    squares = values.reshape(-1, HEADINGS) ** 2
    count = np.isfinite(squares).sum(1)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.nansum(squares, 1) / np.where(count, count, np.nan)))


def _rules(given: PlanInput) -> dict[str, list[RuleRow]]:
    """The rule of each kind of camera, under the names of all of its kind."""
    kinds: dict[tuple[object, ...], list[MountedCamera]] = {}
    for one in given.mounts:
        lens = tuple(np.round(one.camera.parameters, 6))
        kinds.setdefault((one.camera.size, lens, round(float(one.eye[2]), 3)), []).append(one)
    return {
        ", ".join(one.camera.name for one in same): rule_of(
            same[0].camera, float(same[0].eye[2]), given
        )
        for same in kinds.values()
    }


@kept_result()
def rule_of(camera: Camera, height: float, given: PlanInput) -> list[RuleRow]:
    """Sizes of a marker by its distance, for a camera that looks straight at it.

    Parameters
    ----------
    camera : Camera
        Its lens.
    height : float
        Where it hangs, metres.
    given : PlanInput
        Corner noise, cells, floor, the accuracy that is wanted, and the planned markers: the one
        in front is taken, and the robot faces the camera.
    """
    marker = given.layout.T_robot_marker[0]
    rows = []
    for distance in RULE_DISTANCES:
        middle = float(marker.translation[2])
        tilt = np.arctan2(height - middle, distance)
        mount = MountedCamera(camera, mounted(camera, [0.0, 0.0], height, 0.0, tilt), tilt)
        # The marker itself is at that distance, its robot behind it.
        pose = np.array([[distance + float(marker.translation[0]), 0.0, np.pi]])
        sizes = np.concatenate([[float(given.layout.sides[0])], _SIDES])
        found = [_one_marker(mount, given, pose, float(side)) for side in sizes]
        pixels, sigmas, headings = np.array(found).T
        readable = pixels[1:] >= LEAST_CELL * given.cells
        rows.append(
            RuleRow(
                distance,
                float(pixels[0]),
                float(sigmas[0]),
                float(headings[0]),
                _smallest(readable),
                _smallest(readable & (sigmas[1:] <= given.wanted)),
            )
        )
    return rows


def _one_marker(
    mount: MountedCamera, given: PlanInput, pose: Array, side: float
) -> tuple[float, float, float]:
    """Width in pixels, and standard deviations of place and heading, with one marker of a side."""
    first = given.layout.T_robot_marker[[0]]
    layout = Layout((0,), np.array([side]), first, np.zeros((6, 6)))
    # Cells of no size: the width is wanted also where the marker cannot be read.
    held = given.floor is not None
    views = views_of(mount, layout, pose, given.corner_sigma, 0, on_floor=held)
    covariance = planar_covariances(views.information, pose[:, 2], given.floor)[0]
    if not views.readable[0, 0]:
        return np.nan, np.nan, np.nan
    width = float(views.sides[0, 0])
    if views.ambiguous[0]:
        return width, np.nan, np.nan
    return width, float(place_sigma(covariance)), float(np.sqrt(covariance[2, 2]))


def _smallest(good: npt.NDArray[np.bool_]) -> float:
    """The smallest of the sides that are good, metres."""
    return float(_SIDES[np.argmax(good)]) if good.any() else np.nan


def rows_of(values: Sequence[float]) -> list[float | None]:
    """Numbers for a table: None where there is none."""
    return [None if not np.isfinite(v) else float(v) for v in values]
