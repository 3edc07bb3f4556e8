"""From data to outcome: everything that the vision system does with a campaign, in order."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.campaign.folder import Campaign
from validation.poses.pose_table import PoseTable
from validation.results import VALIDATION_SYSTEM
from validation.systems import Progress, no_progress
from vision_gt.campaign.checks import campaign_checks
from vision_gt.campaign.outcome import StopPose, VisionOutcome
from vision_gt.campaign.printed import printed_detections
from vision_gt.causes.diagnosis import Diagnosis, diagnose
from vision_gt.causes.evidence import Seen
from vision_gt.causes.reference import ReferenceTurn, reference_turn
from vision_gt.causes.surveyed import Surveyed
from vision_gt.images.files import counting, read_image
from vision_gt.images.markers import Detection
from vision_gt.least_squares.adjustment import NotDeterminedError
from vision_gt.network.adjustment import Network
from vision_gt.network.solution import NetworkSolution
from vision_gt.network.steadiness import Steadiness, board_move, image_move
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView
from vision_gt.robot.layout import Frame, LayoutFit
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import (
    Floor,
    RobotPose,
    Sighting,
    best_of,
    published_pose,
    robot_pose,
)
from vision_gt.settings import stated
from vision_gt.stages.inputs import (
    VisionInputs,
    known_reference,
    made_board,
)
from vision_gt.stages.lacks import Lack
from vision_gt.stages.lenses import Begun, begin, examples, left_out
from vision_gt.stages.places import bar_of, dima_of, layout_of, network_of, of_layout

BoardViews = Mapping[str, Sequence[BoardView]]
"""Views of boards by what their image was taken for."""


def solve_campaign(
    campaign: Campaign,
    progress: Progress = no_progress,
    *,
    workers: int | None = None,
    **choices: bool,
) -> VisionOutcome:
    """Cameras, markers and robot poses of a campaign: `begin` and `finish`.

    Raises
    ------
    GtvalError
        If files are bad, or do not determine cameras, markers or poses.
    """
    return finish(begin(campaign, progress, workers=workers, **choices))


def finish(begun: Begun) -> VisionOutcome:
    """Cameras, markers and robot poses, once boards and lenses are known.

    Cameras that nothing links to the reference pattern are left out, and said.

    Raises
    ------
    NoFrameError
        If no camera sees the reference pattern.
    NoLayoutError
        If the images do not tell where the markers are on the robot.
    GtvalError
        If what there is does not determine cameras or poses.
    """
    boards, calibrations, lacks = begun.boards, begun.calibrations, begun.lacks
    begun.given.progress("adjusting the camera network", 0.55)
    solution = network_of(begun, known_reference(begun.given.settings))
    given = _with_cameras(begun.given, solution.network.names)
    progress, campaign, workers = given.progress, given.campaign, given.workers
    by_name = {**begun.cameras, **{c.name: c for c in solution.network.cameras}}
    frames, detections = given.marker_views(by_name)
    progress("marker layout", 0.87)
    layout, walker = layout_of(given, frames, detections, by_name, lacks)
    detections = of_layout(given, detections, layout.layout)
    progress("poses", 0.9)
    stops = stops_of(given, detections, solution.network, layout.layout)
    progress("looking for causes of what does not fit", 0.93)
    seen = seen_of(given, begun, solution, (frames, walker, detections), layout, stops)
    validation = validation_table(campaign)
    seen = replace(seen, surveyed=Surveyed.of(validation))
    diagnosis = _diagnosis(seen, lacks)
    return VisionOutcome(
        given.settings,
        calibrations,
        solution,
        layout,
        stops,
        detections,
        _published(given, solution, layout, by_name) if given.settings.as_published else None,
        tuple(_steadiness(given, name, boards, by_name[name]) for name in given.watched),
        tuple(given.oddities),
        printed_detections(campaign, given.settings),
        examples(begun),
        campaign_checks(campaign, given.settings, solution.network, validation, workers),
        (*given.rejections, *left_out(begun, solution)),
        diagnosis,
        _reference_turn(given, stops, validation),
        boards,
        tuple(lacks),
    )


def _with_cameras(given: VisionInputs, names: Sequence[str]) -> VisionInputs:
    """The inputs of these cameras alone."""
    if tuple(names) == given.names:
        return given
    settings = given.settings.model_copy(update={"cameras": list(names)})
    return replace(given, settings=settings)


def _diagnosis(seen: Seen, lacks: list[Lack]) -> Diagnosis | None:
    """What is wrong; None, and said, where not everything can be adjusted together."""
    if not seen.boards or not seen.stops:
        return None
    try:
        return diagnose(seen)
    except (NotDeterminedError, np.linalg.LinAlgError):
        text = (
            "Causes were not looked for: all images together do not determine where everything is. "
            "Look at what is said of the calibration and of the network."
        )
        lacks.append(Lack("causes", text, costs_poses=False))
        return None


def _reference_turn(
    given: VisionInputs, stops: Sequence[StopPose], validation: PoseTable | None
) -> ReferenceTurn | None:
    """Whether the surveyed stops say that the reference pattern lies another way."""
    found = {stop.pose: stop.chosen.planar[0] for stop in stops if stop.chosen is not None}
    common = [pose for pose in found if validation is not None and pose in validation.ids]
    if validation is None or not common:
        return None
    settings = given.settings
    return reference_turn(
        np.array([found[pose] for pose in common]),
        validation.select(common).poses,
        known_reference(settings).T_gtv_body,
        made_board(stated(settings.reference.board)),
    )


def validation_table(campaign: Campaign) -> PoseTable | None:
    """The surveyed stops, where the survey was solved before."""
    solved = campaign.solved.get(VALIDATION_SYSTEM)
    return None if solved is None else next(iter(solved.tables), None)


def _sightings(
    given: VisionInputs, detections: Mapping[tuple[str, str], Detection]
) -> dict[str, list[Sighting]]:
    """What the cameras see at each stop, in the order that people count."""
    names = dict.fromkeys(pose for images in given.images.poses.values() for pose in images)
    by_stop: dict[str, list[Sighting]] = {pose: [] for pose in sorted(names, key=counting)}
    for (camera, stop), detection in detections.items():
        if detection.views:
            by_stop[stop].append(Sighting(camera, detection.views))
    return by_stop


def seen_of(
    given: VisionInputs,
    begun: Begun,
    solution: NetworkSolution,
    robot: tuple[Sequence[Frame], Camera, Mapping[tuple[str, str], Detection]],
    layout: LayoutFit,
    stops: Sequence[StopPose],
) -> Seen:
    """All that was seen and stated, for the search for causes.

    Parameters
    ----------
    given : VisionInputs
        The campaign.
    begun : Begun
        Boards and lenses, as they are known without the network.
    solution : NetworkSolution
        The camera network.
    robot : (sequence of Frame, Camera, mapping)
        Markers in the walk, who took it, and markers at the stops by camera and stop.
    layout : LayoutFit
        The markers.
    stops : sequence of StopPose
        Poses.
    """
    network = solution.network
    frames, walker, detections = robot
    return Seen(
        tuple(begun.cameras[name] for name in network.names),
        network.T_gtv_camera,
        (*network.views, *solution.left_out),
        bar_of(given.settings.bar),
        known_reference(given.settings),
        tuple(frames),
        walker,
        layout.layout,
        dima_of(given),
        _sightings(given, detections),
        {
            (camera, stop.pose): pose.T_gtv_robot
            for stop in stops
            for camera, pose in stop.best_first
        },
        _floor(given),
        tuple(name for name in network.names if name not in begun.calibrations),
        {stop.pose: stop.chosen.planar for stop in stops if stop.chosen is not None},
    )


def _floor(given: VisionInputs) -> Floor:
    return Floor(given.settings.floor.height, given.settings.floor.tilt)


def stops_of(
    given: VisionInputs,
    detections: Mapping[tuple[str, str], Detection],
    network: Network,
    layout: Layout,
) -> tuple[StopPose, ...]:
    """Poses of all stops, by the markers in their images (by camera and stop)."""
    stated, on_floor = _floor(given), given.settings.on_floor
    stops = []
    for pose, sightings in _sightings(given, detections).items():
        single = {
            s.camera: robot_pose([s], network, layout, stated, on_floor=on_floor) for s in sightings
        }
        by_camera = {name: found for name, found in single.items() if found is not None}
        chosen: RobotPose | None
        if given.settings.merge_cameras and len(by_camera) > 1:
            merged = robot_pose(sightings, network, layout, stated, on_floor=on_floor)
            chosen = None if merged is None or merged.ambiguous else merged
        else:
            best = best_of(by_camera)
            chosen = None if best is None else by_camera[best]
        stops.append(StopPose(pose, by_camera, chosen))
    return tuple(stops)


def _published(
    given: VisionInputs,
    solution: NetworkSolution,
    fit: LayoutFit,
    cameras: Mapping[str, Camera],
) -> dict[str, list[tuple[str, RigidTransform]]]:
    """The document's way: stock corners, averaged network and layout, single markers."""
    layout, network = fit.layout, solution.averaged
    nothing = np.zeros((6 * len(layout.numbers),) * 2)
    chained = Layout(layout.numbers, layout.sides, fit.chained, nothing)
    by_pose: dict[str, list[tuple[str, RigidTransform]]] = {}
    for (name, pose), detection in given.published_views(cameras).items():
        i = network.index(name)
        sighting = Sighting(name, detection.views)
        T = published_pose(sighting, network.cameras[i], network.T_gtv_camera[i], chained)
        if T is not None:
            by_pose.setdefault(pose, []).append((name, T))
    return {pose: by_pose[pose] for pose in sorted(by_pose, key=counting)}


def _steadiness(given: VisionInputs, name: str, boards: BoardViews, camera: Camera) -> Steadiness:
    """A verdict on a camera with images of before and after."""
    images = (given.images.before[name], given.images.after[name])
    before, after = (read_image(path) for path in images)
    seen = [
        next((view for view in boards.get(purpose, ()) if view.camera == name), None)
        for purpose in ("before", "after")
    ]
    board = None
    if seen[0] is not None and seen[1] is not None:
        board = board_move(seen[0], seen[1], camera)
    return Steadiness(name, board, image_move(before, after), before, after)
