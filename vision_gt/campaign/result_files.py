"""The files that the vision system writes under results/, besides its poses."""

from collections.abc import Iterable, Sequence

import numpy as np

from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera_files import write_camera
from vision_gt.robot.layout import Layout


def vision_files(outcome: VisionOutcome) -> dict[str, str | bytes]:
    """All of them, by their names relative to results/."""
    files: dict[str, str | bytes] = {
        "vision_camera_poses.csv": camera_poses_csv(outcome),
        "vision_detections.csv": detections_csv(outcome),
        "vision_cameras.csv": cameras_csv(outcome.network.network),
        "vision_layout.csv": layout_csv(outcome.layout.layout),
    }
    for camera in outcome.network.network.cameras:
        files[f"vision_camera_{camera.name}.yaml"] = write_camera(".yaml", "opencv", camera)
    return files


def _csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Plain CSV text; numbers read back to the last bit."""
    cells = ([repr(float(c)) if isinstance(c, float) else str(c) for c in row] for row in rows)
    return "".join(",".join(row) + "\n" for row in [list(header), *cells])


def camera_poses_csv(outcome: VisionOutcome) -> str:
    """The pose of each stop from each camera by itself, as the document does not merge them."""
    rows = []
    for stop in outcome.stops:
        for name, pose in stop.by_camera.items():
            planar, covariance = pose.planar
            used = stop.chosen is not None and pose is stop.chosen
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
                ]
            )
    header = ["pose", "camera", "x", "y", "theta", "xx", "xy", "xt", "yy", "yt", "tt"]
    return _csv([*header, "markers", "p_value", "ambiguous", "floor_p_value", "used"], rows)


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
    return _csv(["camera", "pose", "markers", *(str(n) for n in numbers)], rows)


def cameras_csv(network: Network) -> str:
    """Poses of the cameras in the GTV frame with their standard deviations."""
    rows = []
    for i, camera in enumerate(network.cameras):
        T = network.T_gtv_camera[i]
        sigma = np.sqrt(np.diagonal(network.pose_covariance(camera.name)))
        rows.append(
            [
                camera.name,
                *T.translation.tolist(),
                *T.rotation.as_rotvec().tolist(),
                *sigma.tolist(),
            ]
        )
    names = ["x", "y", "z", "rx", "ry", "rz"]
    return _csv(["camera", *names, *(f"sigma_{name}" for name in names)], rows)


def layout_csv(layout: Layout) -> str:
    """Places of the markers on the robot with their standard deviations."""
    sigmas = layout.sigmas()
    rows = [
        [
            number,
            float(layout.sides[i]),
            *layout.T_robot_marker[i].translation.tolist(),
            *layout.T_robot_marker[i].rotation.as_rotvec().tolist(),
            *sigmas[i].tolist(),
        ]
        for i, number in enumerate(layout.numbers)
    ]
    names = ["x", "y", "z", "rx", "ry", "rz"]
    return _csv(["marker", "side", *names, *(f"sigma_{name}" for name in names)], rows)
