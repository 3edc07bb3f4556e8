"""The vision system's part of the report: tables and figures."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from validation.results import Figure, Section, Table, Text
from vision_gt.campaign.inputs import placed
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.optics.camera import PARAMETERS
from vision_gt.optics.transforms import change_between

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.campaign.folder import Campaign

MM, MRAD = 1e3, 1e3


def vision_sections(outcome: VisionOutcome, campaign: "Campaign") -> list[Section]:
    """All sections of the report."""
    sections = [
        Section("Vision: cameras", _camera_blocks(outcome, campaign)),
        Section("Vision: intrinsic parameters", _calibration_blocks(outcome)),
        Section("Vision: markers on the robot", _layout_blocks(outcome)),
        Section("Vision: poses", _pose_blocks(outcome)),
    ]
    if outcome.steadiness:
        sections.append(Section("Vision: steadiness of the cameras", _steadiness_blocks(outcome)))
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
        camera_table(outcome),
        link_table(outcome),
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


def camera_table(outcome: VisionOutcome) -> Table:
    """Poses of the cameras with their standard deviations along the chain."""
    network, chain = outcome.network.network, outcome.network.chain
    rows: list[Sequence[str | float]] = []
    for i, camera in enumerate(network.cameras):
        T = network.T_gtv_camera[i]
        sigma = np.sqrt(np.diagonal(network.pose_covariance(camera.name)))
        axis = T.rotation.as_matrix()[:, 2]
        off = change_between(outcome.network.averaged.T_gtv_camera[i], T)
        rows.append(
            (
                camera.name,
                " <- ".join(reversed(chain.path(camera.name))),
                *T.translation,
                float(np.rad2deg(np.arcsin(axis[2]))),
                *(MM * sigma[:3]),
                float(np.rad2deg(sigma[3:].max())),
                MM * float(np.linalg.norm(off[:3])),
            )
        )
    return Table(
        "Cameras in the GTV frame",
        (
            "camera",
            "chain",
            "x [m]",
            "y [m]",
            "z [m]",
            "tilt [deg]",
            "sigma x [mm]",
            "sigma y [mm]",
            "sigma z [mm]",
            "sigma angle [deg]",
            "averaged chain off by [mm]",
        ),
        rows,
        ("", "", ".4f", ".4f", ".4f", ".1f", ".1f", ".1f", ".1f", ".3f", ".1f"),
        note="Sigmas include how well the reference pattern was laid. The last column is what "
        "the document's averaging gives instead of the joint adjustment.",
    )


def link_table(outcome: VisionOutcome) -> Table:
    """The pairs of cameras with their snapshots."""
    rows = [
        (
            f"{link.first}-{link.second}",
            len(link.snapshots),
            len(link.outliers),
            MM * float(link.spread[0]),
            float(np.rad2deg(link.spread[1])),
        )
        for link in outcome.network.links
    ]
    return Table(
        "Links between cameras",
        ("cameras", "snapshots", "left out", "spread [mm]", "spread [deg]"),
        rows,
        ("", "", "", ".1f", ".2f"),
        note="Spread of single snapshots about their mean, before the joint adjustment.",
    )


def _calibration_blocks(outcome: VisionOutcome) -> list[Table | Figure | Text]:
    from vision_gt.campaign.figures import coverage_plot  # noqa: PLC0415

    if not outcome.calibrations:
        return [Text("The intrinsic parameters came from camera files.")]
    return [
        calibration_table(outcome),
        parameter_table(outcome),
        _figure(
            "coverage",
            "Corners of the calibration board in each part of each camera's image.",
            "A grid for each camera with the number of corners in each cell.",
            lambda: coverage_plot(outcome.calibrations),
        ),
    ]


def calibration_table(outcome: VisionOutcome) -> Table:
    """How good each camera's calibration images are."""
    rows = []
    for name, calibration in outcome.calibrations.items():
        coverage = calibration.coverage
        rows.append(
            (
                name,
                len(calibration.views),
                len(calibration.outliers),
                calibration.rms,
                float(calibration.image_rms.max()),
                100 * coverage.share,
                float(coverage.distances.min()),
                float(coverage.distances.max()),
                float(np.rad2deg(coverage.tilts.max())),
            )
        )
    return Table(
        "Calibration images",
        (
            "camera",
            "images",
            "left out",
            "rms [px]",
            "worst image [px]",
            "image covered [%]",
            "nearest [m]",
            "farthest [m]",
            "largest tilt [deg]",
        ),
        rows,
        ("", "", "", ".3f", ".3f", ".0f", ".2f", ".2f", ".0f"),
    )


def parameter_table(outcome: VisionOutcome) -> Table:
    """The intrinsic parameters with their standard deviations."""
    rows = []
    for name, calibration in outcome.calibrations.items():
        values, sigmas = calibration.camera.parameters, calibration.camera.sigmas
        cells = [
            f"{v:.2f} ± {s:.2f}" if i < 4 else f"{v:.5f} ± {s:.5f}"
            for i, (v, s) in enumerate(zip(values, sigmas, strict=True))
        ]
        rows.append((name, *cells))
    return Table("Intrinsic parameters", ("camera", *PARAMETERS), rows)


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
    layout = outcome.layout.layout
    sigmas = layout.sigmas()
    rows: list[Sequence[str | float | None]] = []
    for i, number in enumerate(layout.numbers):
        T = layout.T_robot_marker[i]
        chained = change_between(outcome.layout.chained[i], T)
        hand = outcome.settings.markers.hand_measured.get(str(number))
        off = None if hand is None else change_between(placed(hand), T)
        rows.append(
            (
                number,
                " <- ".join(str(n) for n in reversed(outcome.layout.chains[number])),
                *(MM * T.translation),
                MM * float(sigmas[i, :3].max()),
                float(np.rad2deg(sigmas[i, 3:].max())),
                MM * float(np.linalg.norm(chained[:3])),
                None if off is None else MM * float(np.linalg.norm(off[:3])),
                None if off is None else float(np.rad2deg(np.linalg.norm(off[3:]))),
            )
        )
    return Table(
        "Markers in the robot frame",
        (
            "marker",
            "chain",
            "x [mm]",
            "y [mm]",
            "z [mm]",
            "sigma [mm]",
            "sigma [deg]",
            "chains alone off by [mm]",
            "hand off by [mm]",
            "hand off by [deg]",
        ),
        rows,
        ("", "", ".1f", ".1f", ".1f", ".1f", ".2f", ".1f", ".1f", ".1f"),
        note="Sigmas include how well the dima-marker's place on the robot is known.",
    )


def _pose_blocks(outcome: VisionOutcome) -> list[Table | Figure | Text]:
    from vision_gt.campaign.figures import detection_matrix  # noqa: PLC0415

    keys = list(outcome.detections)
    numbers = outcome.layout.layout.numbers
    detected = np.array(
        [[n in outcome.detections[key].numbers for n in numbers] for key in keys], dtype=bool
    ).reshape(len(keys), len(numbers))
    rows = [f"camera {camera}, pose {pose}" for camera, pose in keys]
    return [
        pose_table(outcome),
        _figure(
            "detections",
            "Which markers each camera recognised at each stop.",
            "A matrix of images and markers, filled where a marker was recognised.",
            lambda: detection_matrix(detected, rows, [str(n) for n in numbers]),
        ),
    ]


def pose_table(outcome: VisionOutcome) -> Table:
    """The pose of each stop from each camera; the one in the results is marked."""
    rows: list[Sequence[str | float | None]] = []
    for stop in outcome.stops:
        for name, pose in stop.by_camera.items():
            planar, covariance = pose.planar
            sigma = np.sqrt(np.diagonal(covariance))
            used = stop.chosen is not None and name in stop.chosen.cameras
            rows.append(
                (
                    stop.pose,
                    name,
                    " ".join(str(number) for number in pose.numbers),
                    *planar,
                    *(MM * sigma[:2]),
                    MRAD * float(sigma[2]),
                    pose.p_value,
                    "ambiguous" if pose.ambiguous else "used" if used else "",
                )
            )
        if not stop.by_camera:
            rows.append((stop.pose, "", "none", *(None,) * 7, "no marker"))
    return Table(
        "Vision poses",
        (
            "pose",
            "camera",
            "markers",
            "x [m]",
            "y [m]",
            "theta [rad]",
            "sigma x [mm]",
            "sigma y [mm]",
            "sigma theta [mrad]",
            "p of the fit",
            "",
        ),
        rows,
        ("", "", "", ".4f", ".4f", ".4f", ".1f", ".1f", ".1f", ".2g", ""),
        note="Cameras are not merged unless vision.merge_cameras is set, as in the document; the "
        "pose known best is used.",
    )


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
    rows: list[Sequence[str | float | None]] = []
    for check in outcome.steadiness:
        board, image = check.board, check.image
        rows.append(
            (
                check.camera,
                None if board is None else MM * float(np.linalg.norm(board.change[:3])),
                None if board is None else MRAD * float(np.linalg.norm(board.change[3:])),
                None if board is None else board.p_value,
                None if image is None else float(np.linalg.norm(image.shift)),
                None if image is None else MRAD * image.rotation,
                None if image is None else image.p_value,
                check.verdict,
            )
        )
    return Table(
        "Did the cameras move?",
        (
            "camera",
            "board moved [mm]",
            "board turned [mrad]",
            "p",
            "image shift [px]",
            "image rotation [mrad]",
            "p",
            "verdict",
        ),
        rows,
        ("", ".2f", ".2f", ".2g", ".3f", "+.3f", ".2g", ""),
        note="p: how likely so large a move is by chance; below 0.001 the camera moved.",
    )
