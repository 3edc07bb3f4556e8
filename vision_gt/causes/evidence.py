"""All that a campaign's images show, and all that was stated, as one least-squares problem.

Cameras, bar, boards, markers on the robot and the robot at its stops stand in one adjustment, so
that a mistake in one of them shows wherever it has to: a marker that is printed too small puts the
robot above the floor at every stop.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.causes.surveyed import Surveyed
from vision_gt.least_squares.adjustment import Knowledge
from vision_gt.least_squares.setups import (
    Ints,
    Setup,
    Views,
    as_views,
    camera_slots,
    part_slots,
)
from vision_gt.network.adjustment import Bar, KnownBody, board_starts
from vision_gt.network.solution import REFERENCE
from vision_gt.optics.camera import Camera, stacked_parameters
from vision_gt.optics.transforms import planar_pose, planar_transform
from vision_gt.patterns.board_views import BoardView
from vision_gt.robot.layout import Frame
from vision_gt.robot.marker_poses import Layout, best_start, marker_views
from vision_gt.robot.robot_pose import Floor, Sighting, floor_information

Mask = npt.NDArray[np.bool_]
CALIBRATION, BAR, REFERENCE_BOARD, WALK, STOP = "calibration", "bar", "reference", "walk", "stop"
"""What an image was taken for."""
_SMALL = 1e-4
"""Radians, metres: how well a thing is known that is stated to be exact. The sums stay sound, and
nothing that is measured here is so well known."""


@dataclass(frozen=True)
class Seen:
    """What was seen and stated, and where the usual solution puts things.

    Parameters
    ----------
    cameras : tuple of Camera
        Of the network, as they are known without it.
    T_gtv_camera : RigidTransform
        Stack, by the usual solution.
    boards : tuple of BoardView
        Of calibration (body 'calibration/...'), double pattern and reference (body 'reference').
    bar : Bar
        The double pattern as stated.
    reference : KnownBody
        Where the reference pattern should lie.
    frames : tuple of Frame
        Of the walk around the robot.
    walker : Camera
        That took them.
    layout : Layout
        The markers, by the usual solution.
    dima : (int, RigidTransform, (6, 6) array)
        The marker whose place on the robot was measured: id, T_robot_marker, covariance.
    stops : mapping of str to sequence of Sighting
        In the order in which the robot stood there.
    T_gtv_robot : mapping of (str, str) to RigidTransform
        By the usual solution, by camera and stop, the one known best first of each stop.
    floor : Floor
        How even it is.
    from_files : tuple of str
        Cameras whose lens comes from a file.
    results : mapping of str to ((3,) array, (3, 3) array)
        The poses x, y, theta that the usual solution gives for stops, and their covariances.
    surveyed : Surveyed
        The poses that the survey gives for stops. No number hangs on them; they tell apart what no
        image can.
    """

    cameras: tuple[Camera, ...]
    T_gtv_camera: RigidTransform
    boards: tuple[BoardView, ...]
    bar: Bar
    reference: KnownBody
    frames: tuple[Frame, ...]
    walker: Camera
    layout: Layout
    dima: tuple[int, RigidTransform, Array]
    stops: Mapping[str, Sequence[Sighting]]
    T_gtv_robot: Mapping[tuple[str, str], RigidTransform]
    floor: Floor
    from_files: tuple[str, ...] = ()
    results: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    surveyed: Surveyed = field(default_factory=Surveyed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the network's cameras."""
        return tuple(camera.name for camera in self.cameras)


@dataclass(frozen=True)
class Group:
    """Corners that stand or fall together: a board, or a marker, in one image.

    Parameters
    ----------
    kind : str
        What the image was taken for.
    camera : str
        Who took it.
    moment : str
        Body of a board, frame of the walk, or stop.
    marker : int or None
        Id of the marker.
    """

    kind: str
    camera: str
    moment: str
    marker: int | None = None


@dataclass(frozen=True)
class Evidence:
    """One least-squares problem of everything.

    Parameters
    ----------
    views : Views
        All corners.
    setup : Setup
        Where to start, and the means of what is known before looking.
    knowledge : Knowledge
        What is known before looking, and what is held.
    groups : tuple of Group
        Boards and markers in images.
    group : (n,) array of int
        To which of them each corner belongs.
    bodies : tuple of str
        Names of the setup's bodies.
    stops : tuple of str
        Stops, in their order; a subset of the bodies.
    cameras, markers : tuple
        Names of the network's cameras; ids of the parts from the second on.
    """

    views: Views
    setup: Setup
    knowledge: Knowledge
    groups: tuple[Group, ...]
    group: Ints
    bodies: tuple[str, ...]
    stops: tuple[str, ...]
    cameras: tuple[str, ...]
    markers: tuple[int, ...]

    def rows(self, chosen: Sequence[bool] | Mask) -> Ints:
        """Corners of chosen groups."""
        return np.flatnonzero(np.asarray(chosen, dtype=bool)[self.group])

    def stop_bodies(self) -> Ints:
        """Places of the stops among the bodies."""
        place = {name: i for i, name in enumerate(self.bodies)}
        return np.array([place[f"stop {name}"] for name in self.stops], dtype=np.intp)

    def marker_part(self, number: int) -> int:
        """Place of a marker among the parts: after the two boards of the bar."""
        return 2 + self.markers.index(number)


def evidence_of(seen: Seen) -> Evidence:
    """Everything that was seen and stated in one problem.

    Parameters
    ----------
    seen : Seen
        All of it.

    Notes
    -----
    The robot stands on the floor: height and tilts of each stop are known as well as the floor is
    even. The walk's camera is the world of its own images, so that its frames are bodies like all
    others; its lens is as well known as before the walk.
    """
    boards, board_bodies = _boards(seen)
    frames, frame_bodies = _frames(seen)
    stops, stop_bodies = _stops(seen)
    bodies = {**board_bodies, **frame_bodies, **stop_bodies}
    order = {name: i for i, name in enumerate(bodies)}
    c = len(seen.cameras)
    pieces, groups = [], []
    if boards:
        pieces.append(as_views(boards, seen.names, list(bodies)))
        groups += [(_board_group(view), len(view.ids)) for view in boards]
    sides = dict(zip(seen.layout.numbers, seen.layout.sides.tolist(), strict=True))
    listed = [
        (c, order[f"walk {f.name}"], f.views, Group(WALK, seen.walker.name, f.name)) for f in frames
    ]
    listed += [
        (
            seen.names.index(one.camera),
            order[f"stop {stop}"],
            one.views,
            Group(STOP, one.camera, stop),
        )
        for stop, sightings in stops.items()
        for one in sightings
    ]
    if listed:
        seen_markers = [(camera, body, views) for camera, body, views, _ in listed]
        found = marker_views(seen_markers, seen.layout.numbers, sides)
        pieces.append(_shifted(found))
        groups += [
            (Group(g.kind, g.camera, g.moment, v.number), 4)
            for _, _, views, g in listed
            for v in views
        ]
    setup = _setup(seen, bodies)
    return Evidence(
        _joined(pieces),
        setup,
        _knowledge(seen, setup, boards, list(bodies)),
        tuple(g for g, _ in groups),
        np.repeat(np.arange(len(groups)), [n for _, n in groups]),
        tuple(bodies),
        tuple(stops),
        seen.names,
        seen.layout.numbers,
    )


def kind_of_board(view: BoardView) -> str:
    """What a board was shown for: 'calibration', 'reference' or 'bar'."""
    kind = view.body.split("/")[0] if "/" in view.body else view.body
    return kind if kind in {CALIBRATION, REFERENCE} else BAR


def _board_group(view: BoardView) -> Group:
    return Group(kind_of_board(view), view.camera, view.body)


def _boards(seen: Seen) -> tuple[list[BoardView], dict[str, RigidTransform]]:
    """Views of boards that give a pose, and where their bodies are."""
    at = {name: seen.T_gtv_camera[i] for i, name in enumerate(seen.names)}
    starts = board_starts(seen.boards, seen.cameras, at, seen.bar)
    if REFERENCE in starts:
        starts[REFERENCE] = seen.reference.T_gtv_body
    return [view for view in seen.boards if view.body in starts], starts


def _frames(seen: Seen) -> tuple[list[Frame], dict[str, RigidTransform]]:
    """Frames of the walk that show two markers, and the robot before the camera in each."""
    kept, starts = [], {}
    for frame in seen.frames:
        T = best_start(frame.views, seen.walker, seen.layout) if len(frame.views) > 1 else None
        if T is not None:
            kept.append(frame)
            starts[f"walk {frame.name}"] = T
    return kept, starts


def _stops(seen: Seen) -> tuple[dict[str, list[Sighting]], dict[str, RigidTransform]]:
    """Sightings of the stops that give a pose, and the robot there, standing on the floor."""
    kept: dict[str, list[Sighting]] = {}
    starts = {}
    first = {stop: T for (_, stop), T in reversed(list(seen.T_gtv_robot.items()))}
    for stop, sightings in seen.stops.items():
        T = first.get(stop)
        for one in sightings if T is None else ():
            i = seen.names.index(one.camera)
            T_camera_robot = best_start(one.views, seen.cameras[i], seen.layout)
            if T_camera_robot is not None:
                T = seen.T_gtv_camera[i] * T_camera_robot
                break
        if T is not None:
            kept[stop] = list(sightings)
            starts[f"stop {stop}"] = planar_transform(planar_pose(T))
    return kept, starts


def _shifted(views: Views) -> Views:
    """Markers come after the two boards of the bar among the parts."""
    return Views(
        views.camera, views.body, views.part + 2, views.point, views.pixel, views.covariance
    )


def _joined(pieces: Sequence[Views]) -> Views:
    return Views(
        *(
            np.concatenate([getattr(piece, name) for piece in pieces])
            for name in ("camera", "body", "part", "point", "pixel", "covariance")
        )
    )


def _setup(seen: Seen, bodies: Mapping[str, RigidTransform]) -> Setup:
    number, T_robot_dima, _ = seen.dima
    T_robot_marker = [
        T_robot_dima if n == number else seen.layout.T_robot_marker[i]
        for i, n in enumerate(seen.layout.numbers)
    ]
    return Setup.of(
        RigidTransform.concatenate([seen.T_gtv_camera, RigidTransform.identity()]),
        stacked_parameters((*seen.cameras, seen.walker)),
        RigidTransform.concatenate(list(bodies.values())),
        RigidTransform.concatenate([seen.bar.patterns, *T_robot_marker]),
    )


def _knowledge(
    seen: Seen, setup: Setup, boards: Sequence[BoardView], bodies: Sequence[str]
) -> Knowledge:
    """What was stated: lenses, bar, reference, dima-marker, floor."""
    known = Knowledge.nothing(setup)
    calibrated = {view.camera for view in boards if kind_of_board(view) == CALIBRATION}
    for i, camera in enumerate(seen.cameras):
        slots = camera_slots(i)
        known.free[slots.start : slots.start + 6] = True
        if camera.name in calibrated:
            known.free[slots] = True
            known.free[slots.start + 6 : slots.stop] = camera.estimated
        else:
            known.add_camera(i, camera.covariance)
    known.add_camera(len(seen.cameras), seen.walker.covariance)
    if any(view.part == 1 for view in boards):
        _know_part(known, setup, 1, np.diag(np.square(seen.bar.sigmas)))
    number, _, covariance = seen.dima
    for place, marker in enumerate(seen.layout.numbers):
        slots = part_slots(setup, 2 + place)
        known.free[slots] = True
        if marker == number:
            _know_part(known, setup, 2 + place, covariance)
    for i, name in enumerate(bodies):
        if name == REFERENCE:
            known.bodies[i] = np.linalg.inv(_sound(seen.reference.covariance))
        elif name.startswith("stop "):
            known.bodies[i] = floor_information(seen.floor)
    return known


def _know_part(known: Knowledge, setup: Setup, part: int, covariance: Array) -> None:
    slots = part_slots(setup, part)
    known.free[slots] = True
    known.shared[slots, slots] = np.linalg.inv(_sound(covariance))


def _sound(covariance: Array) -> Array:
    """A covariance (6, 6) that can be inverted."""
    return np.asarray(covariance + np.diag(np.where(np.diagonal(covariance) > 0, 0.0, _SMALL**2)))
