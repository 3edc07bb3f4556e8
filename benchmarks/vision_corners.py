"""Corners of a 156 mm marker at 2 to 5 m: this package against OpenCV and pupil-apriltags.

f = 1000 px, lens blur 0.7 px, noise 2 grey levels, tilts of 10 to 55 degrees. For each distance
and detector: root mean square of the corners' errors (length, pixels), bias of the sides, poses
of the single marker off by more than 10 degrees, and milliseconds of processor time for the part
of the image around the marker. Then, with this package's corners and their covariances: how many
poses are declared ambiguous, and how many are off by more than 10 degrees without being so.
pupil-apriltags comes with the extra `bench`.

    python benchmarks/vision_corners.py [renders a distance [distance ...]]
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from vision_scenes import APRIL, SIDE, close_up, exact_network, opencv_markers, random_marker

from validation.poses.angles import Array
from vision_gt.images.markers import Image, detect_markers
from vision_gt.optics.camera import Camera
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.optics.transforms import angle_between
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor, Sighting, robot_pose

SQUARE = SIDE / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
OPENCV = ("none", "subpix", "apriltag")


def peer() -> Any:
    """The detector of pupil-apriltags, None where it is not installed."""
    try:
        from pupil_apriltags import Detector
    except ImportError:
        return None
    return Detector(families="tag36h11", quad_decimate=1.0)


def found_corners(
    name: str, detector: Any, photograph: tuple[Camera, Image, Array], number: int
) -> Array | None:
    """Corners (4, 2) in the order of the truth; None if the marker was not found."""
    camera, image, true = photograph
    if name == "edges":
        views = detect_markers(image, APRIL, camera, [number]).views
        return views[0].corners if views else None
    if name in OPENCV:
        return opencv_markers(image, APRIL, name).get(number)
    tags = [tag.corners - 0.5 for tag in detector.detect(image) if tag.tag_id == number]
    if not tags:
        return None
    orders = [np.roll(c, k, axis=0) for c in (tags[0], tags[0][::-1]) for k in range(4)]
    return min(orders, key=lambda corners: np.abs(corners - true).sum())


def judged(photograph: tuple[Camera, Image, Array], number: int, T: RigidTransform) -> Array:
    """Whether the pose is declared ambiguous, and whether it is wrong and not declared so."""
    camera, image, _ = photograph
    views = detect_markers(image, APRIL, camera, [number]).views
    layout = Layout((number,), np.array([SIDE]), RigidTransform.identity(1), np.zeros((6, 6)))
    network = replace(exact_network(RigidTransform.identity()), cameras=(camera,))
    pose = (
        robot_pose([Sighting("1", views)], network, layout, Floor(0.003, 0.005)) if views else None
    )
    if pose is None:
        return np.array([0, 0])
    # The print's frame in the scenes has y down, the marker's has y up.
    upright = T * RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
    off = np.rad2deg(angle_between(pose.T_gtv_robot, upright))
    return np.array([pose.ambiguous, off > 10 and not pose.ambiguous], dtype=int)


def main(count: int, distances: list[int]) -> None:
    cv2.setNumThreads(1)
    detector = peer()
    names = [*OPENCV, "edges", *(["pupil"] if detector else [])]
    print(f"{count} renders a distance")
    print("distance  detector   rms [px]  side bias [px]  flips  missed  ms")
    for distance in distances:
        rng = np.random.default_rng(distance)
        verdicts = np.zeros(2, dtype=int)
        errors, sides, flips, spent = ({n: [] for n in names} for _ in range(4))
        for _ in range(count):
            number = int(rng.integers(200))
            T = random_marker(rng, distance)
            photograph = close_up(rng, T, number)
            camera, _, true = photograph
            verdicts += judged(photograph, number, T)
            for name in names:
                start = time.process_time()
                corners = found_corners(name, detector, photograph, number)
                spent[name].append(time.process_time() - start)
                if corners is None:
                    continue
                errors[name].append(corners - true)
                lengths = [np.linalg.norm(np.roll(c, -1, 0) - c, axis=1) for c in (corners, true)]
                sides[name].append((lengths[0] - lengths[1]).mean())
                best = planar_solutions(SQUARE, corners, camera.parameters)
                flips[name].append(best and np.rad2deg(angle_between(best.best, T)) > 10)
        for name in names:
            rms = np.sqrt((np.array(errors[name]) ** 2).sum(-1).mean())
            print(
                f"{distance:8d}  {name:9s}  {rms:8.3f}  {np.mean(sides[name]):+14.3f}  "
                f"{sum(map(bool, flips[name])):5d}  {count - len(errors[name]):6d}  "
                f"{1e3 * np.median(spent[name]):.1f}",
                flush=True,
            )
        print(f"          with covariances: {verdicts[0]} ambiguous, {verdicts[1]} wrong unsaid")
    print("asked of edges: rms at most 0.10 px, side bias below 0.05 px, no flip, none missed")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:]]
    main(numbers[0] if numbers else 40, numbers[1:] or [2, 3, 4, 5])
