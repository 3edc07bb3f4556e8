"""Detection and pose of a 1280 x 960 image: frames a second against OpenCV with SUBPIX.

Both are timed in turn on each image, in processor time of one thread, and the least of several
rounds counts, so that other work on the machine does not decide. Cameras and markers come with
the covariances of a calibrated campaign, so that the pose is solved as in `gtval run`. Then two
processes, and the network of four cameras with 40 snapshots for each pair of neighbours.

    python benchmarks/vision_speed.py [rounds]
"""

import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from vision_scenes import CameraRow, camera, camera_at, exact_network, opencv_markers, random_robot

from data_samples.rendering.image import Image, Optics, Scene, render
from data_samples.rendering.objects import robot_sheets
from data_samples.rooms.cameras import MARKER_FAMILY, robot_layout
from vision_gt.images.markers import detect_markers
from vision_gt.network.adjustment import Bar, KnownBody
from vision_gt.network.solution import NetworkInput, solve_network
from vision_gt.robot.robot_pose import Floor, Sighting, robot_pose

T_CAMERA = camera_at(3.0)
CAMERA_SIGMAS = [1e-3] * 3 + [5e-4] * 3 + [0.3, 0.3, 0.4, 0.4, 1e-3, 2e-3, 1e-4, 1e-4, 1e-3]
NETWORK = exact_network(T_CAMERA, np.diag(np.square(CAMERA_SIGMAS)))
LAYOUT = replace(robot_layout(), covariance=np.diag(np.square(np.tile([3e-4] * 3 + [1e-3] * 3, 6))))
KNOWN_IDS = list(LAYOUT.numbers)


def photographs(count: int) -> list[Image]:
    rng = np.random.default_rng(0)
    images = []
    for _ in range(count):
        sheets = robot_sheets(LAYOUT, random_robot(rng), T_CAMERA.translation)
        images.append(render(camera(), T_CAMERA, Scene(sheets), Optics(), rng))
    return images


def ours(image: Image) -> int:
    cv2.setNumThreads(1)
    views = detect_markers(image, MARKER_FAMILY, NETWORK.cameras[0], KNOWN_IDS).views
    pose = robot_pose([Sighting("1", views)], NETWORK, LAYOUT, Floor(0.003, 0.005))
    assert pose is not None
    assert np.isfinite(pose.planar[1]).all()
    return len(views)


def detected(image: Image) -> int:
    cv2.setNumThreads(1)
    return len(detect_markers(image, MARKER_FAMILY, NETWORK.cameras[0], KNOWN_IDS).views)


def stock(image: Image) -> int:
    cv2.setNumThreads(1)
    return len(opencv_markers(image, MARKER_FAMILY, "subpix"))


def milliseconds(
    functions: dict[str, Callable[[Image], int]], images: list[Image], rounds: int
) -> tuple[dict[str, float], dict[str, int]]:
    """Mean over the images of the least time of each, and how many markers each found."""
    least = {name: np.full(len(images), np.inf) for name in functions}
    found = dict.fromkeys(functions, 0)
    for turn in range(rounds + 1):
        for place, image in enumerate(images):
            for name, function in functions.items():
                start = time.process_time()
                count = function(image)
                spent = time.process_time() - start
                if turn == 0:
                    found[name] += count
                else:
                    least[name][place] = min(least[name][place], spent)
    return {name: 1e3 * float(times.mean()) for name, times in least.items()}, found


def images_a_second(processes: int, images: list[Image]) -> float:
    """By the clock, with so many processes."""
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        list(pool.map(ours, images[:4]))
        start = time.perf_counter()
        list(pool.map(ours, images * 4, chunksize=4))
        return 4 * len(images) / (time.perf_counter() - start)


def network_seconds() -> float:
    """Processor time of the network of four cameras."""
    row = CameraRow(0, cameras=4, snapshots=40)
    given = NetworkInput(
        tuple(row.cameras),
        tuple(row.snapshots),
        (),
        (row.reference,),
        (),
        Bar(row.nominal_bar, np.full(6, 0.002)),
        KnownBody(row.T_gtv_reference, 1e-6 * np.eye(6)),
        row.reference.pixels[0],
    )
    times = []
    for _ in range(3):
        start = time.process_time()
        solve_network(given)
        times.append(time.process_time() - start)
    return min(times)


def main(rounds: int) -> None:
    images = photographs(10)
    functions = {"stock": stock, "detected": detected, "ours": ours}
    spent, found = milliseconds(functions, images, rounds)
    names = {
        "stock": "OpenCV SUBPIX, detection only",
        "detected": "this package, detection only",
        "ours": "this package, with the pose",
    }
    for name, said in names.items():
        time_of, markers = spent[name], found[name]
        print(f"{said:31s} {time_of:6.1f} ms {1e3 / time_of:6.1f} frames/s  {markers} markers")
    print(f"ratio {spent['ours'] / spent['stock']:.2f} (at most 1.5 asked)")
    for processes in (1, 2):
        rate = images_a_second(processes, images)
        print(f"{processes} process{'es' if processes > 1 else '  '}  {rate:6.1f} frames/s")
    print(f"network of 4 cameras, 3 x 40 snapshots: {network_seconds():.2f} s (below 3 asked)")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8)
