"""Corners of a 156 mm marker at 2 to 5 m: this package against OpenCV and pupil-apriltags.

f = 1000 px, lens blur 0.7 px, noise 2 grey levels, tilts of 10 to 55 degrees. For each distance
and detector: root mean square of the corners' errors (length, pixels), bias of the sides, poses
of the single marker off by more than 10 degrees, and milliseconds an image.

    python benchmarks/vision_corners.py [renders a distance]
"""

import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from vision_scenes import APRIL, LENS, SIDE, camera, marker_image, random_marker

from validation.angles import Array
from vision_gt.markers import detect_markers
from vision_gt.planar_pose import planar_solutions
from vision_gt.transforms import angle_between

SQUARE = SIDE / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
OURS = ("none", "subpix", "apriltag", "edges")


def peer() -> Any:
    """The detector of pupil-apriltags, None where it is not installed."""
    try:
        from pupil_apriltags import Detector
    except ImportError:
        return None
    return Detector(families="tag36h11", quad_decimate=1.0)


def found_corners(name: str, detector: Any, image: Array, number: int, true: Array) -> Array | None:
    """Corners (4, 2) in the order of the truth; None if the marker was not found."""
    if name != "pupil":
        views = detect_markers(image, APRIL, camera(), [number], name).views
        return views[0].corners if views else None
    tags = [tag.corners - 0.5 for tag in detector.detect(image) if tag.tag_id == number]
    if not tags:
        return None
    orders = [np.roll(c, k, axis=0) for c in (tags[0], tags[0][::-1]) for k in range(4)]
    return min(orders, key=lambda corners: np.abs(corners - true).sum())


def main(count: int) -> None:
    cv2.setNumThreads(1)
    detector = peer()
    names = [*OURS, *(["pupil"] if detector else [])]
    print(f"{count} renders a distance")
    print("distance  detector   rms [px]  side bias [px]  flips  missed  ms")
    for distance in (2, 3, 4, 5):
        rng = np.random.default_rng(distance)
        errors, sides, flips, spent = ({n: [] for n in names} for _ in range(4))
        for _ in range(count):
            number = int(rng.integers(200))
            T = random_marker(rng, distance)
            image, true = marker_image(rng, T, number)
            for name in names:
                start = time.perf_counter()
                corners = found_corners(name, detector, image, number, true)
                spent[name].append(time.perf_counter() - start)
                if corners is None:
                    continue
                errors[name].append(corners - true)
                lengths = [np.linalg.norm(np.roll(c, -1, 0) - c, axis=1) for c in (corners, true)]
                sides[name].append((lengths[0] - lengths[1]).mean())
                best = planar_solutions(SQUARE, corners, LENS)
                flips[name].append(best and np.rad2deg(angle_between(best.best, T)) > 10)
        for name in names:
            rms = np.sqrt((np.array(errors[name]) ** 2).sum(-1).mean())
            print(
                f"{distance:8d}  {name:9s}  {rms:8.3f}  {np.mean(sides[name]):+14.3f}  "
                f"{sum(map(bool, flips[name])):5d}  {count - len(errors[name]):6d}  "
                f"{1e3 * np.median(spent[name]):.1f}"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
