"""Images of the left camera along a synthetic drive, drawn by rays that meet the campus."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from data_samples.drives.drive import LEFT_CAMERA, START, Drive
from data_samples.drives.sensors import HEIGHT, LENS, WIDTH
from rtk_gt.path.orientation import transform_of
from rtk_gt.sensors.camera_pose import Lens
from validation.poses.angles import Array

BLOCK = 8
"""One ray for so many pixels in each direction: 9 cm at 10 m."""
SKY = (0.65, 0.80, 0.95)
REACH = 60.0
EVERY = 2.0
"""Seconds between images."""


def image_times(drive: Drive) -> Array:
    """(m,) seconds since 1970 at which the camera takes its images."""
    return START + np.arange(1.0, drive.duration - 1, EVERY)


def camera_images(drive: Drive, times: Array) -> Iterator[npt.NDArray[np.uint8]]:
    """What the left camera sees, image by image: (768, 1024, 3) red, green, blue.

    Parameters
    ----------
    drive : Drive
        The drive.
    times : (m,) array
        Of the images, seconds since 1970.

    Notes
    -----
    Each surface has its own colour in all images, without light and shadow, so that a point's
    right colour is known: that of `Campus.colours`.
    """
    across, down = np.meshgrid(np.arange(WIDTH // BLOCK), np.arange(HEIGHT // BLOCK))
    blocks = np.column_stack([across.ravel(), down.ravel()]).astype(float)
    own = rays(LENS, BLOCK * blocks + (BLOCK - 1) / 2)
    for T in drive.T_local_vehicle(times):
        camera = T * transform_of(LEFT_CAMERA)
        directions = camera.rotation.apply(own)
        eye = np.tile(camera.translation, (len(own), 1))
        distance = drive.campus.cast(eye, directions, reach=REACH)
        hit = np.isfinite(distance)
        colours = np.tile(SKY, (len(own), 1))
        colours[hit] = drive.campus.colours(eye[hit] + distance[hit, None] * directions[hit])
        small = np.round(255 * colours).astype(np.uint8).reshape(HEIGHT // BLOCK, WIDTH // BLOCK, 3)
        yield small.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)


def rays(lens: Lens, pixels: Array) -> Array:
    """(n, 3) unit vectors in the camera frame that the lens shows at pixels (n, 2).

    Notes
    -----
    The distortion is undone by fixed-point iteration, which gains a digit a round within the
    image of the lenses of Blanco 2009, Table 4.
    """
    wanted = np.asarray(pixels, dtype=float)
    K = lens.matrix
    seen = (wanted - [K[0, 2], K[1, 2]]) / [K[0, 0], K[1, 1]]
    at = seen.copy()
    for _ in range(40):
        shown = lens.project(np.column_stack([at, np.ones(len(at))]))
        at += (wanted - shown) / [K[0, 0], K[1, 1]]
    along = np.column_stack([at, np.ones(len(at))])
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))
