"""The vision system's part of the report: tables and figures."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from validation.poses.angles import Array
from validation.results import Figure, Section, Table, TableColumn, Text
from vision_gt.campaign.check_sections import check_sections
from vision_gt.campaign.detections import detection_blocks
from vision_gt.campaign.outcome import StopPose, VisionOutcome
from vision_gt.campaign.printed import seen_in
from vision_gt.causes.tables import hypothesis_table, noise_table
from vision_gt.images.files import Image
from vision_gt.network.intrinsics import Calibration, lens_words
from vision_gt.network.solution import NetworkSolution
from vision_gt.optics.camera import PARAMETERS
from vision_gt.optics.transforms import change_between
from vision_gt.patterns.board_views import BoardView
from vision_gt.robot.robot_pose import RobotPose
from vision_gt.stages.inputs import placed

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.campaign.folder import Campaign

MM, MRAD = 1e3, 1e3
GTV = "the GTV frame"
_SIGMAS = (
    "Sigmas are against the camera whose frame it is.",
    "Sigmas include how well the reference pattern was laid.",
)


def vision_sections(outcome: VisionOutcome, campaign: "Campaign") -> list[Section]:
    """All sections of the report."""
    sections = [
        Section("Vision: cameras", _camera_blocks(outcome, campaign)),
        Section(
            "Vision: intrinsic parameters",
            calibration_blocks(outcome.calibrations, outcome.examples),
        ),
        Section("Vision: markers on the robot", _layout_blocks(outcome)),
    ]
    if outcome.stops:
        seen = detection_blocks(seen_in(outcome), outcome.printed)
        poses = [pose_table(outcome), attitude_table(outcome), pairs_table(outcome)]
        sections.append(Section("Vision: poses", [one for one in poses if one.rows]))
        sections.append(Section("Vision: marker detection", seen))
    if outcome.diagnosis is not None:
        tables = [hypothesis_table(outcome.diagnosis), noise_table(outcome.diagnosis.noise)]
        sections.append(Section("Vision: what may be wrong", tables))
    if outcome.steadiness:
        sections.append(Section("Vision: steadiness of the cameras", _steadiness_blocks(outcome)))
    sections += check_sections(outcome.checks)
    return [section for section in sections if section.blocks]


def _figure(
    name: str, caption: str, alternative: str, draw: "Callable[[], MatplotlibFigure]"
) -> Figure:
    return Figure(f"vision_{name}", caption, alternative, draw)


def _camera_blocks(outcome: VisionOutcome, campaign: "Campaign") -> list[Table | Figure | Text]:
    from vision_gt.campaign.figures import camera_map, residual_plot  # noqa: PLC0415

    solution = outcome.network
    stops = {stop.pose: stop.chosen.planar[0] for stop in outcome.stops if stop.chosen is not None}
    blocks: list[Table | Figure | Text] = [
        camera_table(solution),
        link_table(solution),
        _figure(
            "camera_map",
            "Cameras, what each sees of the floor, the chain that links them (with the number of "
            "snapshots), and the robot's stops.",
            "A map of the room with the cameras and their fields of view.",
            lambda: camera_map(solution, campaign.settings.room.walls, stops),
        ),
    ]
    if solution.network.views:
        blocks.append(
            _figure(
                "residuals",
                "Reprojection residuals of all board corners, by camera.",
                "Clouds of points around zero, one for each camera.",
                lambda: residual_plot(solution.network),
            )
        )
    return blocks


def camera_table(solution: NetworkSolution, frame: str = GTV) -> Table:
    """Poses of the cameras with their standard deviations along the chain."""
    network, chain = solution.network, solution.chain
    T = network.T_gtv_camera
    variances = [np.diagonal(network.pose_covariance(name)) for name in network.names]
    sigmas = np.sqrt(variances)
    tilt = np.arcsin(T.rotation.as_matrix()[:, 2, 2])
    off = change_between(solution.averaged.T_gtv_camera, T)
    columns: list[TableColumn] = [
        ("camera", "", network.names),
        ("chain", "", [_chain(chain.path(name)) for name in network.names]),
        ("x [m]", ".4f", T.translation[:, 0]),
        ("y [m]", ".4f", T.translation[:, 1]),
        ("z [m]", ".4f", T.translation[:, 2]),
        ("tilt [deg]", ".1f", np.rad2deg(tilt)),
        ("sigma x [mm]", ".1f", MM * sigmas[:, 0]),
        ("sigma y [mm]", ".1f", MM * sigmas[:, 1]),
        ("sigma z [mm]", ".1f", MM * sigmas[:, 2]),
        ("sigma angle [deg]", ".3f", np.rad2deg(sigmas[:, 3:].max(1))),
        ("averaged chain off by [mm]", ".1f", MM * _length(off)),
    ]
    note = (
        f"{_SIGMAS[frame == GTV]} The last column is what the document's averaging gives instead "
        "of the joint adjustment."
    )
    return Table.of_columns(f"Cameras in {frame}", columns, note)


def _chain(names: Iterable[str | int]) -> str:
    """Names from the root to the end of a chain."""
    return " <- ".join(reversed([str(name) for name in names]))


def _length(change: Array) -> Array:
    """How far transforms moved (n,), of changes (n, 6)."""
    return np.asarray(np.linalg.norm(change[..., :3], axis=-1))


def _angle(change: Array) -> Array:
    """How far they turned (n,), radians."""
    return np.asarray(np.linalg.norm(change[..., 3:], axis=-1))


def attitude_table(outcome: VisionOutcome) -> Table:
    """Height, roll and pitch of the robot at each stop, by each camera that sees it."""
    listed = [
        (stop.pose, camera, pose)
        for stop in outcome.stops
        for camera, pose in stop.by_camera.items()
    ]
    tilts = np.array(
        [pose.T_gtv_robot.rotation.as_euler("ZYX")[::-1] for _, _, pose in listed]
    ).reshape(-1, 3)
    sigmas = np.sqrt([np.diagonal(pose.covariance) for _, _, pose in listed]).reshape(-1, 6)
    columns: list[TableColumn] = [
        ("stop", "", [stop for stop, _, _ in listed]),
        ("camera", "", [camera for _, camera, _ in listed]),
        ("height [mm]", ".1f", [MM * float(pose.best.t[2]) for _, _, pose in listed]),
        ("sigma [mm]", ".1f", MM * sigmas[:, 2]),
        ("roll [deg]", ".2f", np.rad2deg(tilts[:, 0])),
        ("pitch [deg]", ".2f", np.rad2deg(tilts[:, 1])),
        ("sigma [deg]", ".2f", np.rad2deg(sigmas[:, 3:5].max(1, initial=0.0))),
    ]
    note = "A robot on an even floor has zeros; what all stops share comes of reference or markers."
    return Table.of_columns("Height, roll and pitch, by camera", columns, note)


def pairs_table(outcome: VisionOutcome) -> Table:
    """Cameras against each other at the stops that both see, by medians."""
    apart: dict[tuple[str, str], list[Array]] = {}
    for stop in outcome.stops:
        sure = [(name, pose) for name, pose in stop.by_camera.items() if not pose.ambiguous]
        for (one, first), (other, second) in combinations(sorted(sure, key=lambda p: p[0]), 2):
            off = change_between(second.T_gtv_robot, first.T_gtv_robot)
            apart.setdefault((one, other), []).append(off)
    medians = [np.median(offs, axis=0) for offs in apart.values()]
    lengths = [np.median(np.linalg.norm(np.array(offs)[:, :2], axis=1)) for offs in apart.values()]
    columns: list[TableColumn] = [
        ("cameras", "", [f"{one}-{other}" for one, other in apart]),
        ("common stops", "", [len(offs) for offs in apart.values()]),
        ("dx [mm]", "+.1f", [MM * float(m[0]) for m in medians]),
        ("dy [mm]", "+.1f", [MM * float(m[1]) for m in medians]),
        ("dz [mm]", "+.1f", [MM * float(m[2]) for m in medians]),
        ("dtheta [mrad]", "+.1f", [MRAD * float(m[5]) for m in medians]),
        ("distance [mm]", ".1f", [MM * float(length) for length in lengths]),
    ]
    note = "Medians of the second camera's pose minus the first one's, and of their distance."
    return Table.of_columns("Cameras against cameras", columns, note)


def link_table(solution: NetworkSolution) -> Table:
    """The pairs of cameras with their snapshots."""
    links = solution.links
    columns: list[TableColumn] = [
        ("cameras", "", [f"{link.first}-{link.second}" for link in links]),
        ("snapshots", "", [len(link.snapshots) for link in links]),
        ("left out", "", [len(link.outliers) for link in links]),
        ("spread [mm]", ".1f", [MM * float(link.spread[0]) for link in links]),
        ("spread [deg]", ".2f", [float(np.rad2deg(link.spread[1])) for link in links]),
    ]
    note = "Spread of single snapshots about their mean, before the joint adjustment."
    return Table.of_columns("Links between cameras", columns, note)


def calibration_blocks(
    calibrations: Mapping[str, Calibration], examples: Mapping[str, tuple[Image, BoardView]]
) -> list[Table | Figure | Text]:
    """What the calibrations gave, with an image of each."""
    from vision_gt.campaign.figures import coverage_plot  # noqa: PLC0415
    from vision_gt.figures.boards import drawn_corners, extrinsics  # noqa: PLC0415

    if not calibrations:
        return [Text("The intrinsic parameters came from camera files.")]
    shown = {
        f"camera {name}: {view.source}": (image, view, calibrations[name].camera)
        for name, (image, view) in examples.items()
    }
    return [
        calibration_table(calibrations),
        parameter_table(calibrations),
        _figure(
            "coverage",
            "Corners of the calibration board in each part of each camera's image.",
            "A grid for each camera with the number of corners in each cell.",
            lambda: coverage_plot(calibrations),
        ),
        _figure(
            "extrinsics",
            "Where each camera saw the calibration board: its outline in every image, from above "
            "and from the side, in the camera's frame; dotted: the field of view.",
            "Outlines of boards at different distances and tilts in front of each camera.",
            lambda: extrinsics(calibrations),
        ),
        _figure(
            "corners",
            "For each camera the image with the most tilted board: corners found (crosses) and the "
            "board's frame, x solid, y dashed, towards the viewer dotted.",
            "Images of the calibration board with its corners and axes drawn on them.",
            lambda: drawn_corners(shown),
        ),
    ]


def calibration_table(calibrations: Mapping[str, Calibration]) -> Table:
    """How good each camera's calibration images are."""
    found = calibrations.values()
    coverages = [calibration.coverage for calibration in found]
    columns: list[TableColumn] = [
        ("camera", "", list(calibrations)),
        ("images", "", [len(one.views) for one in found]),
        ("left out", "", [len(one.outliers) for one in found]),
        ("rms [px]", ".3f", [one.rms for one in found]),
        ("worst image [px]", ".3f", [float(one.image_rms.max()) for one in found]),
        ("image covered [%]", ".0f", [100 * one.share for one in coverages]),
        ("nearest [m]", ".2f", [float(one.distances.min()) for one in coverages]),
        ("farthest [m]", ".2f", [float(one.distances.max()) for one in coverages]),
        ("largest tilt [deg]", ".0f", [np.rad2deg(one.tilts.max()) for one in coverages]),
    ]
    return Table.of_columns("Calibration images", columns)


def parameter_table(calibrations: Mapping[str, Calibration]) -> Table:
    """The intrinsic parameters with their standard deviations."""
    rows = []
    for name, calibration in calibrations.items():
        camera = calibration.camera
        cells = [
            ("" if own in {"", label} else f"{own} = ")
            + (f"{v:.2f} ± {s:.2f}" if i < 4 else f"{v:.5f} ± {s:.5f}" if own else "")
            for i, (v, s, own, label) in enumerate(
                zip(camera.parameters[:9], camera.sigmas, camera.names, PARAMETERS, strict=True)
            )
        ]
        rows.append((name, *cells))
    note = " ".join(
        f"Camera {name}: {lens_words(one)}"
        for name, one in calibrations.items()
        if one.held_out or one.camera.lens != "brown"
    )
    return Table("Intrinsic parameters", ("camera", *PARAMETERS), rows, note=note)


def _layout_blocks(outcome: VisionOutcome) -> list[Table | Figure | Text]:
    from vision_gt.campaign.figures import layout_graph, layout_map  # noqa: PLC0415

    fit = outcome.layout
    hand = {
        int(name): placed(place).translation
        for name, place in outcome.settings.markers.hand_measured.items()
    }
    return [
        layout_table(outcome),
        _figure(
            "layout_graph",
            "Markers seen together in the movie, with the number of images; the chains to the "
            "dima-marker (square) are drawn thick.",
            "A graph whose nodes are markers and whose edges carry numbers of images.",
            lambda: layout_graph(fit),
        ),
        _figure(
            "layout_map",
            "Middles of the markers in the robot frame, from the images and by hand.",
            "Two views of the marker positions on the robot.",
            lambda: layout_map(fit.layout, hand),
        ),
    ]


def layout_table(outcome: VisionOutcome) -> Table:
    """The markers on the robot, beside the chains alone and the hand measurements."""
    layout, chains = outcome.layout.layout, outcome.layout.chains
    T = layout.T_robot_marker
    sigmas = layout.sigmas()
    by_hand = [outcome.settings.markers.hand_measured.get(str(n)) for n in layout.numbers]
    off = [
        None if hand is None else change_between(placed(hand), T[i])
        for i, hand in enumerate(by_hand)
    ]
    moved = [None if change is None else MM * float(_length(change)) for change in off]
    turned = [None if change is None else float(np.rad2deg(_angle(change))) for change in off]
    chained = _length(change_between(outcome.layout.chained, T))
    columns: list[TableColumn] = [
        ("marker", "", layout.numbers),
        ("chain", "", [_chain(chains[number]) for number in layout.numbers]),
        ("x [mm]", ".1f", MM * T.translation[:, 0]),
        ("y [mm]", ".1f", MM * T.translation[:, 1]),
        ("z [mm]", ".1f", MM * T.translation[:, 2]),
        ("sigma [mm]", ".1f", MM * sigmas[:, :3].max(1)),
        ("sigma [deg]", ".2f", np.rad2deg(sigmas[:, 3:].max(1))),
        (
            "chains alone off by [mm]",
            ".1f",
            MM * chained,
        ),
        ("hand off by [mm]", ".1f", moved),
        ("hand off by [deg]", ".1f", turned),
    ]
    note = "Sigmas include how well the dima-marker's place on the robot is known."
    return Table.of_columns("Markers in the robot frame", columns, note)


def pose_table(outcome: VisionOutcome) -> Table:
    """The pose of each stop from each camera; the one in the results is marked."""
    seen: list[tuple[StopPose, str, RobotPose | None]] = []
    for stop in outcome.stops:
        seen += [(stop, name, pose) for name, pose in stop.by_camera.items()]
        if not stop.by_camera:
            seen.append((stop, "", None))
    poses = [pose for _, _, pose in seen]
    numbers = np.full((len(seen), 6), None)
    for row, pose in enumerate(poses):
        if pose is not None:
            planar, covariance = pose.planar
            sigmas = np.sqrt(np.diagonal(covariance))
            numbers[row] = [*planar, *(MM * sigmas[:2]), MRAD * sigmas[2]]
    columns: list[TableColumn] = [
        ("pose", "", [stop.pose for stop, _, _ in seen]),
        ("camera", "", [name for _, name, _ in seen]),
        ("markers", "", [" ".join(map(str, one.numbers)) if one else "none" for one in poses]),
        ("x [m]", ".4f", numbers[:, 0]),
        ("y [m]", ".4f", numbers[:, 1]),
        ("theta [rad]", ".4f", numbers[:, 2]),
        ("sigma x [mm]", ".1f", numbers[:, 3]),
        ("sigma y [mm]", ".1f", numbers[:, 4]),
        ("sigma theta [mrad]", ".1f", numbers[:, 5]),
        ("p of the fit", ".2g", [None if one is None else one.p_value for one in poses]),
        ("", "", [_verdict(*one) for one in seen]),
    ]
    note = (
        "Cameras are not merged unless vision.merge_cameras is set, as in the document; the "
        "pose known best is used."
    )
    return Table.of_columns("Vision poses", columns, note)


def _verdict(stop: StopPose, camera: str, pose: RobotPose | None) -> str:
    """What became of a pose."""
    if pose is None:
        return "no marker"
    if pose.ambiguous:
        return "ambiguous"
    return "used" if stop.chosen is not None and camera in stop.chosen.cameras else ""


def _steadiness_blocks(outcome: VisionOutcome) -> list[Table | Figure | Text]:
    from vision_gt.campaign.figures import overlay  # noqa: PLC0415

    figures = [
        _figure(
            f"steadiness_{check.camera}",
            f"Camera {check.camera} before and after; what moved shows red or cyan rims in the "
            "overlay.",
            "Two images and their overlay.",
            partial(overlay, check),
        )
        for check in outcome.steadiness
    ]
    return [steadiness_table(outcome), *figures]


def steadiness_table(outcome: VisionOutcome) -> Table:
    """Both tests of each camera with their thresholds' p-values."""
    boards = [one.board for one in outcome.steadiness]
    images = [one.image for one in outcome.steadiness]
    moved = [None if b is None else MM * float(_length(b.change)) for b in boards]
    turned = [None if b is None else MRAD * float(_angle(b.change)) for b in boards]
    rotated = [None if i is None else MRAD * i.rotation for i in images]
    shifted = [None if i is None else float(np.linalg.norm(i.shift)) for i in images]
    columns: list[TableColumn] = [
        ("camera", "", [one.camera for one in outcome.steadiness]),
        ("board moved [mm]", ".2f", moved),
        ("board turned [mrad]", ".2f", turned),
        ("p", ".2g", [None if b is None else b.p_value for b in boards]),
        ("image shift [px]", ".3f", shifted),
        ("image rotation [mrad]", "+.3f", rotated),
        ("p", ".2g", [None if i is None else i.p_value for i in images]),
        ("verdict", "", [one.verdict for one in outcome.steadiness]),
    ]
    note = "p: how likely so large a move is by chance; below 0.001 the camera moved."
    return Table.of_columns("Did the cameras move?", columns, note)
