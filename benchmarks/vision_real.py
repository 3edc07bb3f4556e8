"""Real photographs that nobody here made: what is found, beside OpenCV and pupil-apriltags.

Two webcams that sharpen (`webcam_charuco`): corners of their board found here and by OpenCV's
detector, which is told that the board is inverted; how many of one are not in the other; how far
apart they are, in the middle and at most. Photographs of tags (`apriltag_photos`): tags found here,
by OpenCV and by pupil-apriltags, ids that are not in the room, and the processor time beside
OpenCV's sub-pixel detection, the least of several rounds in turn. Then the median distance to
pupil-apriltags' corners, and of how many prints less of the image is left at the corners found
here, under any blur (`trials.any_blur`), with what is left in the middle, grey levels.
pupil-apriltags comes with the extra `bench`. The folder of real data is named by GTVAL_REAL_DATA.

    python benchmarks/vision_real.py
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from trials.any_blur import left_under_any_blur
from vision_corners import peer

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from vision_scenes import APRIL, opencv_markers

from validation.poses.angles import Array
from vision_gt.images.boards import look_for_boards
from vision_gt.images.files import read_image
from vision_gt.images.markers import Image, detect_markers
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family

REAL = Path(os.environ.get("GTVAL_REAL_DATA", "../shared/real")) / "vision"
WEBCAM_BOARD = Board(4, 5, 0.054, Family("4X4_50"))
TAGS = {22, 24, 58, 85, 144, 198}
"""Ids in the room of the photographs."""
ROUNDS = 5


def webcam(folder: Path) -> None:
    """Print a camera's line."""
    detector = cv2.aruco.CharucoDetector(WEBCAM_BOARD.charuco())
    own, theirs, apart = set[tuple[str, int]](), set[tuple[str, int]](), []
    for path in sorted(folder.glob("*.png")):
        image = read_image(path)
        corners, ids, _, _ = detector.detectBoard(np.asarray(255 - image, dtype=np.uint8))
        places = np.reshape([] if ids is None else corners, (-1, 2))
        seen = dict(zip(np.ravel([] if ids is None else ids).tolist(), places, strict=True))
        board = look_for_boards(image, [WEBCAM_BOARD]).found[0]
        found = {} if board is None else dict(zip(board.ids.tolist(), board.pixels, strict=True))
        own |= {(path.stem, i) for i in found}
        theirs |= {(path.stem, i) for i in seen}
        apart += [float(np.linalg.norm(found[i] - seen[i])) for i in found.keys() & seen.keys()]
    print(
        f"{folder.name}: {len(own)} corners, OpenCV {len(theirs)}; {len(theirs - own)} of OpenCV's "
        f"not here, {len(own - theirs)} only here; apart {np.median(apart):.2f} px, at most "
        f"{max(apart):.2f}"
    )


def least(look: Callable[[Image], object], image: Image) -> float:
    """Milliseconds of processor time, the least of several rounds."""
    spent = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        look(image)
        spent.append(time.process_time() - begin)
    return 1e3 * min(spent)


def stock(image: Image) -> dict[int, Array]:
    """What OpenCV finds, refined to parts of a pixel."""
    return opencv_markers(image, APRIL, "subpix")


def like(corners: Array, other: Array) -> Array:
    """Corners (4, 2) in the order of others."""
    orders = [np.roll(c, k, axis=0) for c in (corners, corners[::-1]) for k in range(4)]
    return min(orders, key=lambda order: float(np.linalg.norm(order - other)))


def photograph(path: Path) -> None:
    """Print a photograph's line."""
    image = read_image(path)
    tags = {view.number: view.corners for view in detect_markers(image, APRIL).views}
    opencv, detector = stock(image), peer()
    peers = {} if detector is None else {t.tag_id: t.corners - 0.5 for t in detector.detect(image)}
    missed = sorted((opencv.keys() | peers.keys()) & TAGS - tags.keys())
    ratio = least(lambda one: detect_markers(one, APRIL), image) / least(stock, image)
    print(
        f"{path.name}: {len(tags)} tags, OpenCV {len(opencv)}, pupil-apriltags {len(peers)}; "
        f"missed {missed}, wrong ids {sorted(tags.keys() - TAGS)}; {ratio:.2f} of OpenCV's time"
    )
    both = sorted(tags.keys() & peers.keys())
    if both:
        theirs = [like(peers[i], tags[i]) for i in both]
        apart = [np.linalg.norm(t - tags[i], axis=1) for t, i in zip(theirs, both, strict=True)]
        left = np.array([judged(image, i, tags[i], t) for i, t in zip(both, theirs, strict=True)])
        left = left[np.isfinite(left).all(1)]
        better, (here, there) = (left[:, 0] < left[:, 1]).sum(), np.median(left, axis=0)
        print(
            f"    apart {np.median(apart):.2f} px; {better} of {len(left)} lie better here, "
            f"{here:.1f} and {there:.1f} grey levels are left"
        )


def judged(image: Image, number: int, *corners: Array) -> list[float]:
    """What is left of an image with a tag at corners."""
    bits = APRIL.bits(number).reshape(APRIL.cells, APRIL.cells)
    return [left_under_any_blur(image, one, bits) for one in corners]


def main() -> None:
    """Print all."""
    cv2.setNumThreads(1)
    for folder in sorted(p for p in (REAL / "webcam_charuco").glob("*") if p.is_dir()):
        webcam(folder)
    for path in sorted((REAL / "apriltag_photos").glob("*.png")):
        photograph(path)


if __name__ == "__main__":
    main()
