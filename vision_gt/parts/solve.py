"""Lenses, network and poses in the frame of a camera: each as far as the images allow it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from validation.errors import GtvalError
from vision_gt.images.markers import Detection
from vision_gt.network.chain import NotLinkedError
from vision_gt.network.solution import NetworkSolution, NoFrameError
from vision_gt.optics.camera import Camera
from vision_gt.robot.alone import marker_in_camera, pose_in_camera
from vision_gt.robot.layout import LayoutFit
from vision_gt.robot.robot_pose import Floor, RobotPose, Sighting, robot_pose
from vision_gt.stages.inputs import known_reference, sides_of
from vision_gt.stages.lacks import Lack
from vision_gt.stages.lenses import Begun
from vision_gt.stages.places import NoLayoutError, layout_of, network_of, of_layout

VFRAME = "the GTV frame"


@dataclass(frozen=True)
class Placed:
    """A pose by one image.

    Parameters
    ----------
    camera, stop : str
        Of the image.
    number : int or None
        Id of the marker; None for the robot.
    frame : str
        In which: 'camera 1', or 'the GTV frame'.
    pose : RobotPose
        Of the marker, or of the robot.
    """

    camera: str
    stop: str
    number: int | None
    frame: str
    pose: RobotPose


@dataclass(frozen=True)
class PartialOutcome:
    """What there is without poses of the robot in the Vframe.

    Parameters
    ----------
    begun : Begun
        Boards and lenses, and what is missing.
    solution : NetworkSolution or None
        Cameras against each other.
    frame : str
        Of the network.
    layout : LayoutFit or None
        Markers on the robot.
    detections : mapping of (str, str) to Detection
        By camera and stop.
    placed : tuple of Placed
        Poses of the robot, and of single markers.
    """

    begun: Begun
    solution: NetworkSolution | None
    frame: str
    layout: LayoutFit | None
    detections: Mapping[tuple[str, str], Detection] = field(default_factory=dict)
    placed: tuple[Placed, ...] = ()


def solve_parts(begun: Begun, why: GtvalError | None = None) -> PartialOutcome:
    """What the images of a campaign allow.

    Parameters
    ----------
    begun : Begun
        Boards and lenses. What cannot be solved is added to its lacks.
    why : GtvalError, optional
        What made poses in the Vframe impossible.
    """
    if why is not None:
        part = "frame" if isinstance(why, NoFrameError) else "layout"
        if not any(one.part == part and one.costs_poses for one in begun.lacks):
            said = str(why)
            begun.lacks.append(Lack(part, f"{said[0].upper()}{said[1:].rstrip('.')}."))
    begun.given.progress("adjusting the camera network", 0.55)
    solution, frame = _network(begun)
    placed = {} if solution is None else {c.name: c for c in solution.network.cameras}
    cameras = {**begun.cameras, **placed}
    if not begun.given.shows_robot and not begun.given.images.movie:
        return PartialOutcome(begun, solution, frame, None)
    frames, detections = begun.given.marker_views(cameras)
    layout = None
    try:
        layout, _ = layout_of(begun.given, frames, detections, cameras, begun.lacks)
    except NoLayoutError as error:
        said = f"Where the markers are on the robot is not known: {error}."
        begun.lacks.append(Lack("layout", said, begun.given.shows_robot))
    begun.given.progress("poses", 0.9)
    found = _placed(begun, detections, cameras, (solution, frame), layout)
    return PartialOutcome(begun, solution, frame, layout, detections, tuple(found))


def _network(begun: Begun) -> tuple[NetworkSolution | None, str]:
    """The network and its frame: the reference pattern's, or a camera's; None for one camera."""
    known = [name for name in begun.given.names if name in begun.cameras]
    boards = begun.boards
    seen = any(view.camera in known for view in boards.get("reference", ()))
    if seen:
        try:
            return network_of(begun, known_reference(begun.given.settings)), VFRAME
        except NoFrameError as error:
            begun.lacks.append(Lack("frame", f"{error}."))
    if len(known) < 2 or not boards.get("network"):
        return None, ""
    try:
        solution = network_of(begun, None)
    except NotLinkedError as error:
        begun.lacks.append(Lack("network", f"{error}.", costs_poses=False))
        return None, ""
    return solution, f"camera {solution.reference}"


def _placed(
    begun: Begun,
    detections: Mapping[tuple[str, str], Detection],
    cameras: Mapping[str, Camera],
    network: tuple[NetworkSolution | None, str],
    layout: LayoutFit | None,
) -> Iterator[Placed]:
    """Poses of the robot where its markers' places are known, and of all single markers."""
    solution, frame = network
    sides, given = sides_of(begun.given.settings), begun.given
    floor = Floor(given.settings.floor.height, given.settings.floor.tilt)
    known = {} if layout is None else of_layout(given, detections, layout.layout)
    for (camera, stop), found in known.items():
        assert layout is not None
        pose, where = pose_in_camera(cameras[camera], found.views, layout.layout), ""
        if solution is not None and camera in solution.network.names and found.views:
            sighting = [Sighting(camera, found.views)]
            pose, where = robot_pose(sighting, solution.network, layout.layout, floor), frame
        if pose is not None:
            yield Placed(camera, stop, None, where or f"camera {camera}", pose)
    for (camera, stop), found in detections.items():
        for view in found.views:
            pose = marker_in_camera(cameras[camera], view, sides[view.number])
            if pose is not None:
                yield Placed(camera, stop, view.number, f"camera {camera}", pose)
