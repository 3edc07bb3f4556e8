"""The files that the vision system writes under results/, besides its poses."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from validation.text_files.csv_text import csv_text
from vision_gt.campaign.check_sections import check_files
from vision_gt.campaign.detections import success_csv
from vision_gt.campaign.findings import fate
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.campaign.printed import seen_in
from vision_gt.network.adjustment import Network
from vision_gt.optics.written_cameras import write_camera
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.marker_poses import Layout

PLACED = ("x", "y", "z", "rx", "ry", "rz")
"""Columns of a transform: translation in metres, rotation vector in radians."""


def vision_files(outcome: VisionOutcome) -> dict[str, str | bytes]:
    """All of them, by their names relative to results/."""
    files: dict[str, str | bytes] = {
        "vision_camera_poses.csv": camera_poses_csv(outcome),
        "vision_detections.csv": detections_csv(outcome),
        "vision_success.csv": success_csv(seen_in(outcome), outcome.printed),
        "vision_rejected.csv": rejected_csv(outcome.rejections),
        "vision_cameras.csv": cameras_csv(outcome.network.network),
        "vision_layout.csv": layout_csv(outcome.layout.layout),
    }
    files |= check_files(outcome.checks)
    if outcome.steadiness:
        files["vision_steadiness.csv"] = steadiness_csv(outcome)
    cameras = {name: one.camera for name, one in outcome.calibrations.items()}
    cameras |= {camera.name: camera for camera in outcome.network.network.cameras}
    for camera in cameras.values():
        files[f"vision_camera_{camera.name}.yaml"] = write_camera(".yaml", "opencv", camera)
    return files


def camera_poses_csv(outcome: VisionOutcome) -> str:
    """The pose of each stop from each camera by itself, as the document does not merge them."""
    rows = []
    for stop in outcome.stops:
        for name, pose in stop.by_camera.items():
            planar, covariance = pose.planar
            used, apart, chance = fate(stop, name)
            _, pitch, roll = pose.T_gtv_robot.rotation.as_euler("ZYX")
            rows.append(
                [
                    stop.pose,
                    name,
                    *planar.tolist(),
                    *covariance[np.triu_indices(3)].tolist(),
                    " ".join(str(number) for number in pose.numbers),
                    pose.p_value,
                    "yes" if pose.ambiguous else "no",
                    pose.floor_p,
                    "yes" if used else "no",
                    float(pose.best.t[2]),
                    float(roll),
                    float(pitch),
                    apart,
                    chance,
                ]
            )
    header = ["pose", "camera", "x", "y", "theta", "xx", "xy", "xt", "yy", "yt", "tt"]
    header += ["markers", "p_value", "ambiguous", "floor_p_value", "used"]
    return csv_text([*header, "z", "roll", "pitch", "apart", "apart_p_value"], rows)


def detections_csv(outcome: VisionOutcome) -> str:
    """Which markers each camera recognised at each stop: AD2.3, "Marker detection"."""
    numbers = outcome.layout.layout.numbers
    rows = [
        [
            camera,
            pose,
            len(detection.views),
            *("yes" if number in detection.numbers else "no" for number in numbers),
        ]
        for (camera, pose), detection in outcome.detections.items()
    ]
    return csv_text(["camera", "pose", "markers", *(str(n) for n in numbers)], rows)


def rejected_csv(rejections: Sequence[tuple[str, Rejection]]) -> str:
    """What was seen in images and not used, or is rough: where, and why."""
    rows = [
        [image, one.kind, "" if one.number is None else one.number, *one.place.tolist(), one.reason]
        for image, one in rejections
    ]
    return csv_text(["image", "what", "number", "x", "y", "reason"], rows)


def steadiness_csv(outcome: VisionOutcome) -> str:
    """Whether each camera moved: how likely so large a move is by chance, and the verdict."""
    rows = [
        [
            one.camera,
            float("nan") if one.board is None else one.board.p_value,
            float("nan") if one.image is None else one.image.p_value,
            one.verdict,
        ]
        for one in outcome.steadiness
    ]
    return csv_text(["camera", "board_p_value", "image_p_value", "verdict"], rows)


def cameras_csv(network: Network) -> str:
    """Poses of the cameras in the GTV frame with their standard deviations."""
    sigmas = [np.sqrt(np.diagonal(network.pose_covariance(name))) for name in network.names]
    labels = [[name] for name in network.names]
    return _placed_csv(["camera"], labels, network.T_gtv_camera, np.array(sigmas))


def layout_csv(layout: Layout) -> str:
    """Places of the markers on the robot with their standard deviations."""
    labels = [[n, float(side)] for n, side in zip(layout.numbers, layout.sides, strict=True)]
    return _placed_csv(["marker", "side"], labels, layout.T_robot_marker, layout.sigmas())


def _placed_csv(
    header: Sequence[str],
    labels: Sequence[Sequence[object]],
    poses: RigidTransform,
    sigmas: Array,
) -> str:
    """Translations and rotation vectors with their standard deviations (n, 6)."""
    rows = [
        [*label, *T.translation.tolist(), *T.rotation.as_rotvec().tolist(), *sigma.tolist()]
        for label, T, sigma in zip(labels, poses, sigmas, strict=True)
    ]
    return csv_text([*header, *PLACED, *(f"sigma_{name}" for name in PLACED)], rows)
