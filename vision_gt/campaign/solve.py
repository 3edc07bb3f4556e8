"""From data to outcome: everything that the vision system does with a campaign, in order."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.results import VALIDATION_SYSTEM
from validation.systems import Progress, no_progress
from vision_gt.campaign.checks import campaign_checks
from vision_gt.campaign.inputs import (
    VisionInputs,
    known_reference,
    load_inputs,
    made_board,
    placed,
    sides_of,
)
from vision_gt.campaign.outcome import StopPose, VisionOutcome
from vision_gt.campaign.printed import printed_detections
from vision_gt.causes.diagnosis import Diagnosis, diagnose
from vision_gt.causes.evidence import Seen
from vision_gt.causes.reference import ReferenceTurn, reference_turn
from vision_gt.images.files import Image, counting, read_image
from vision_gt.images.markers import Detection
from vision_gt.images.rejections import Rejection, hull, rejected
from vision_gt.least_squares.adjustment import NotDeterminedError
from vision_gt.network.adjustment import Bar, Network
from vision_gt.network.intrinsics import Calibration, calibrate
from vision_gt.network.left_out import left_out_views
from vision_gt.network.solution import NetworkInput, NetworkSolution, solve_network
from vision_gt.network.steadiness import Steadiness, board_move, image_move
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView
from vision_gt.robot.layout import Frame, LayoutFit, fit_layout
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import (
    Floor,
    RobotPose,
    Sighting,
    best_of,
    published_pose,
    robot_pose,
)
from vision_gt.settings import BarSettings, stated

BoardViews = Mapping[str, Sequence[BoardView]]
"""Views of boards by what their image was taken for."""


def solve_campaign(
    campaign: Campaign,
    progress: Progress = no_progress,
    *,
    workers: int | None = None,
    **choices: bool,
) -> VisionOutcome:
    """Cameras, markers and robot poses of a campaign.

    Parameters
    ----------
    campaign : Campaign
        With images below its [vision] folder.
    progress : callable
        Told what is being done.
    workers : int, optional
        Processes; by default one for each processor.
    **choices : bool
        ``as_published``, ``merge_cameras``, ``on_floor``: used instead of the settings.

    Raises
    ------
    GtvalError
        If files are bad, or do not determine cameras, markers or poses.
    """
    given = load_inputs(campaign, progress, workers, choices)
    boards, sizes = given.board_views()
    calibrations, cameras = _cameras(given, boards, sizes)
    progress("adjusting the camera network", 0.55)
    solution = _network(given, boards, calibrations, cameras)
    by_name = {**cameras, **{c.name: c for c in solution.network.cameras}}
    frames, detections = given.marker_views(by_name)
    progress("marker layout", 0.87)
    layout = _layout(given, frames, by_name[given.movie_camera])
    progress("poses", 0.9)
    stops = _stops(given, detections, solution.network, layout.layout)
    progress("looking for causes of what does not fit", 0.93)
    robot = (frames, detections)
    seen = seen_of(given, cameras, calibrations, solution, robot, layout, stops)
    validation = validation_table(campaign)
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
        {name: _example(given, name, found) for name, found in calibrations.items()},
        campaign_checks(campaign, given.settings, solution.network, validation, workers),
        (*given.rejections, *_left_out(given, boards, calibrations, solution)),
        _diagnosis(seen),
        _reference_turn(given, stops, validation),
        boards,
    )


def _left_out(
    given: VisionInputs,
    boards: BoardViews,
    calibrations: Mapping[str, Calibration],
    solution: NetworkSolution,
) -> Iterator[tuple[str, Rejection]]:
    """Boards that took no part, by their images."""
    for purpose, view, why in left_out_views(boards, calibrations, solution):
        number = None if purpose == "calibration" else view.part + 1
        yield given.image_of(purpose, view), rejected("board", why, number, hull(view.pixels))


def _diagnosis(seen: Seen) -> Diagnosis | None:
    """What is wrong; None where no boards or no stops were adjusted together."""
    if not seen.boards or not seen.stops:
        return None
    try:
        return diagnose(seen)
    except (NotDeterminedError, np.linalg.LinAlgError):
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


def _example(given: VisionInputs, name: str, found: Calibration) -> tuple[Image, BoardView]:
    """The calibration image with the most tilted board, to show what was found in it."""
    view = found.views[int(np.argmax(found.coverage.tilts))]
    paths = {path.name: path for path in given.images.calibration[name]}
    return read_image(paths[view.source]), view


def validation_table(campaign: Campaign) -> PoseTable | None:
    """The surveyed stops, where the survey was solved before."""
    solved = campaign.solved.get(VALIDATION_SYSTEM)
    return None if solved is None else next(iter(solved.tables), None)


def _cameras(
    given: VisionInputs, boards: BoardViews, sizes: Mapping[str, tuple[int, int]]
) -> tuple[dict[str, Calibration], dict[str, Camera]]:
    """Intrinsic parameters of all cameras, from files or from images."""
    calibrations: dict[str, Calibration] = {}
    cameras: dict[str, Camera] = {}
    faults = []
    for number, name in enumerate(given.wanted):
        given.progress(f"calibrating camera {name}", 0.45 + 0.1 * number / len(given.wanted))
        try:
            if name in given.settings.camera_files:
                cameras[name] = given.camera_from_file(name, sizes.get(name))
                continue
            calibrations[name] = _calibrated(given, name, boards, sizes)
            cameras[name] = calibrations[name].camera
        except GtvalError as error:
            faults.append(str(error))
    if faults:
        raise GtvalError("\n".join(faults))
    return calibrations, cameras


def _calibrated(
    given: VisionInputs, name: str, boards: BoardViews, sizes: Mapping[str, tuple[int, int]]
) -> Calibration:
    """One camera from its calibration images."""
    views = [view for view in boards.get("calibration", ()) if view.camera == name]
    if not views:
        board = stated(given.settings.board)
        raise GtvalError(
            f"camera {name}: none of its {len(given.images.calibration[name])} calibration images "
            f"shows a board of {board.columns} x {board.rows} squares; count the squares (not the "
            "inner corners) of yours and correct vision.board"
        )
    return calibrate(name, sizes[name], views)


def _network(
    given: VisionInputs,
    boards: BoardViews,
    calibrations: Mapping[str, Calibration],
    cameras: Mapping[str, Camera],
) -> NetworkSolution:
    """The network; calibration images take part in its adjustment."""
    settings, names = given.settings, given.names
    chosen = [v for name in names if name in calibrations for v in calibrations[name].views]
    origin = settings.reference.origin_near
    network = NetworkInput(
        cameras=tuple(cameras[name] for name in names),
        snapshots=tuple(boards.get("network", ())),
        both=tuple(boards.get("bar", ())),
        reference=tuple(boards.get("reference", ())),
        calibration=tuple(chosen) if len(calibrations) >= len(names) else (),
        bar=_bar(settings.bar),
        known_reference=known_reference(settings),
        origin_near=None if origin is None else np.array(origin),
    )
    return solve_network(network, joint=not settings.averaged_network)


def _bar(settings: BarSettings) -> Bar:
    """The double pattern as built; one without extent where no image shows it."""
    second = settings.second_on_first
    T = RigidTransform.identity() if second is None else placed(second)
    return Bar(T, np.array(settings.sigmas))


def _layout(given: VisionInputs, frames: Sequence[Frame], camera: Camera) -> LayoutFit:
    """The layout from the walk around the robot."""
    return fit_layout(frames, camera, sides_of(given.settings), _dima(given))


def _dima(given: VisionInputs) -> tuple[int, RigidTransform, Array]:
    """The marker whose place on the robot was measured."""
    markers = given.settings.markers
    covariance = np.diag(np.square(markers.dima_sigmas))
    return stated(markers.dima), placed(markers.dima_on_robot), covariance


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
    cameras: Mapping[str, Camera],
    calibrations: Mapping[str, Calibration],
    solution: NetworkSolution,
    robot: tuple[Sequence[Frame], Mapping[tuple[str, str], Detection]],
    layout: LayoutFit,
    stops: Sequence[StopPose],
) -> Seen:
    """All that was seen and stated, for the search for causes.

    Parameters
    ----------
    given : VisionInputs
        The campaign.
    cameras : mapping of str to Camera
        As they are known without the network.
    calibrations : mapping of str to Calibration
        Of those that were calibrated from images.
    solution : NetworkSolution
        The camera network.
    robot : (sequence of Frame, mapping)
        Markers in the walk, and at the stops by camera and stop.
    layout : LayoutFit
        The markers.
    stops : sequence of StopPose
        Poses.
    """
    network = solution.network
    frames, detections = robot
    walker = {**cameras, **{c.name: c for c in network.cameras}}[given.movie_camera]
    return Seen(
        tuple(cameras[name] for name in network.names),
        network.T_gtv_camera,
        (*network.views, *solution.left_out),
        _bar(given.settings.bar),
        known_reference(given.settings),
        tuple(frames),
        walker,
        layout.layout,
        _dima(given),
        _sightings(given, detections),
        {
            (camera, stop.pose): pose.T_gtv_robot
            for stop in stops
            for camera, pose in stop.best_first
        },
        _floor(given),
        tuple(name for name in network.names if name not in calibrations),
        {stop.pose: stop.chosen.planar for stop in stops if stop.chosen is not None},
    )


def _floor(given: VisionInputs) -> Floor:
    return Floor(given.settings.floor.height, given.settings.floor.tilt)


def _stops(
    given: VisionInputs,
    detections: Mapping[tuple[str, str], Detection],
    network: Network,
    layout: Layout,
) -> tuple[StopPose, ...]:
    """Poses of all stops."""
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
