"""Corners of markers beside the Cramer-Rao bound of the image, at sides of 20 to 160 pixels.

A renderer of its own: the print through a homography, sampled 24 by 24 times a pixel (its own
errors stay below a sixth of the bound), blur of 0.7 pixels, the area of a pixel, noise of 2 grey
levels and rounding. Unknown to the bound are the corners, the levels of black and white, and the
blur. For each side: root mean square of the corners' errors and of the bound in thousandths of a
pixel, the one over the other, the stated standard deviation over the error, and milliseconds of
processor time. 1.15 of the bound is asked. pupil-apriltags comes with the extra `bench`.

    python benchmarks/vision_bound.py [renders a side [side ...]]
"""

import sys
import time

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from vision_corners import peer

from validation.poses.angles import Array
from vision_gt.images.markers import Image, detect_markers
from vision_gt.patterns.dictionaries import Family

FAMILY = Family("APRILTAG_36H11")
FINE, BLUR, NOISE, BLACK, WHITE = 24, 0.7, 2.0, 45.0, 200.0
SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
PHOTOGRAPHS = 6


def quadrangle(rng: np.random.Generator, side: float) -> tuple[Array, int]:
    """Corners (4, 2) of a marker tilted by up to 50 degrees, and the pixels of its image."""
    around, tilt = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(0, 50))
    lean = cv2.Rodrigues(tilt * np.array([np.cos(around), np.sin(around), 0.0]))[0]
    turn = cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))[0]
    places = np.column_stack([SQUARE, np.zeros(4)]) @ (lean @ turn).T
    seen = places[:, :2] / (places[:, 2:] / 12 + 1)
    seen *= side / np.linalg.norm(seen - np.roll(seen, 1, 0), axis=1).mean()
    size = int(1.45 * np.ptp(seen, axis=0).max()) + 14
    return seen + size / 2 - 0.5 + rng.uniform(-0.5, 0.5, 2), size


def homography(corners: Array) -> Array:
    """From the print, -1 to 1, to pixels."""
    rows = [
        row
        for (x, y), (u, v) in zip(SQUARE, corners, strict=True)
        for row in ([x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y])
    ]
    H = np.append(np.linalg.solve(np.array(rows), corners.ravel()), 1.0).reshape(3, 3)
    return np.asarray(H)


def through(H: Array, points: Array) -> Array:
    """Points (..., 2) through a homography."""
    ahead = points @ H[:, :2].T + H[:, 2]
    return np.asarray(ahead[..., :2] / ahead[..., 2:])


def sampled(bits: Array, corners: Array, size: int) -> Array:
    """The print without blur, FINE times as fine as pixels, at places shaken within each."""
    steps = (np.arange(size * FINE) + 0.5) / FINE - 0.5
    places = np.stack(np.meshgrid(steps, steps), axis=-1)
    places += (np.random.default_rng(5).random(places.shape) - 0.5) / FINE
    cell = np.floor((through(np.linalg.inv(homography(corners)), places) + 1) * len(bits) / 2)
    inside = ((cell >= 0) & (cell < len(bits))).all(-1)
    column, row = np.moveaxis(cell[inside].astype(np.intp), -1, 0)
    white = np.ones(places.shape[:2])
    white[inside] = bits[row, column]
    return white


def in_pixels(fine: Array) -> Array:
    """Mean over each pixel's area."""
    return np.asarray(sliding_window_view(fine, (FINE, FINE))[::FINE, ::FINE].mean((2, 3)))


def blurred(white: Array, blur: float) -> Array:
    """As a lens blurs it, still fine."""
    return cv2.GaussianBlur(white, (0, 0), blur * FINE, borderType=cv2.BORDER_REPLICATE)


def rendered(bits: Array, corners: Array, size: int) -> tuple[Array, Array]:
    """The image without noise, and the covariance (8, 8) of the bound on its corners."""
    fine = sampled(bits, corners, size)
    soft = blurred(fine, BLUR)
    share = in_pixels(soft)
    down, right = (in_pixels(one) * FINE for one in np.gradient(soft))
    pixels = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).astype(float)
    places = through(np.linalg.inv(homography(corners)), pixels)
    columns = []
    for change in np.eye(8).reshape(8, 4, 2) * 1e-4:
        flow = (through(homography(corners + change), places) - pixels) / 1e-4
        columns.append(-(WHITE - BLACK) * (right * flow[..., 0] + down * flow[..., 1]))
    wider = in_pixels(blurred(fine, BLUR + 0.05)) - in_pixels(blurred(fine, BLUR - 0.05))
    columns += [(WHITE - BLACK) * wider / 0.1, 1 - share, share]
    J = np.array([column.ravel() for column in columns]).T / np.sqrt(NOISE**2 + 1 / 12)
    return BLACK + (WHITE - BLACK) * share, np.linalg.inv(J.T @ J)[:8, :8]


def show(side: float, renders: int) -> None:
    """One side: errors over the bound of this package and of its peer."""
    rng, detector = np.random.default_rng(int(side)), peer()
    errors: list[Array] = []
    others: list[Array] = []
    stated: list[float] = []
    bounds: list[float] = []
    missed, spent = 0, 0.0
    for _ in range(renders):
        corners, size = quadrangle(rng, side)
        number = int(rng.integers(587))
        bits = FAMILY.bits(number).reshape(FAMILY.cells, FAMILY.cells).astype(float)
        clean, bound = rendered(bits, corners, size)
        for _ in range(PHOTOGRAPHS):
            noisy = clean + NOISE * rng.standard_normal(clean.shape)
            image: Image = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
            start = time.process_time()
            views = detect_markers(image, FAMILY, None, [number]).views
            spent += time.process_time() - start
            missed += not views
            if views:
                errors.append((views[0].corners - corners).ravel())
                stated.append(float(np.trace(views[0].covariances, axis1=1, axis2=2).sum()))
                bounds.append(float(np.trace(bound)))
            tags = [] if detector is None else detector.detect(image)
            others += [_nearest(tag.corners - 0.5, corners) for tag in tags]
    squares = np.square(errors).sum(1)
    over = np.sqrt(np.mean(squares / bounds))
    sigma = np.sqrt(np.mean(stated) / squares.mean())
    beside = np.sqrt(np.mean(np.square(others)) / np.mean(bounds) * 8) if others else np.nan
    print(f"{side:5.0f}  {np.sqrt(squares.mean() / 8) * 1e3:6.1f}  "
          f"{np.sqrt(np.mean(bounds) / 8) * 1e3:6.1f}  {over:9.2f}  {sigma:11.2f}  {missed:6d}  "
          f"{spent / max(len(errors), 1) * 1e3:5.1f}  {beside:12.1f}", flush=True)  # fmt: skip


def _nearest(found: Array, corners: Array) -> Array:
    """Errors (8,) of a peer's corners, which may start at any of the four and run either way."""
    turned = [np.roll(one, k, 0) for one in (found, found[::-1]) for k in range(4)]
    return min(((one - corners).ravel() for one in turned), key=lambda error: float(error @ error))


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    print(f"{count} renders a side, {PHOTOGRAPHS} photographs of each")
    print("side   rms    bound  rms/bound  stated/rms  missed     ms  peer's/bound")
    for chosen in [float(side) for side in sys.argv[2:]] or [20.0, 36.0, 40.0, 80.0, 160.0]:
        show(chosen, count)
