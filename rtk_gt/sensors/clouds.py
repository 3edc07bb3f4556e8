"""Coloured point clouds of a drive, and PLY files of them."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from rtk_gt.sensors.camera_pose import Lens, in_camera
from validation.errors import GtvalError
from validation.poses.angles import Array

Bytes = npt.NDArray[np.uint8]
NOT_SEEN = (128, 128, 128)
"""Colour of points that no image shows."""


def colour_points(
    points: Array,
    images: Iterable[Bytes],
    vehicle: Array,
    camera: Array,
    lens: Lens,
    *,
    farthest: float = 25.0,
) -> tuple[Bytes, npt.NDArray[np.bool_]]:
    """Colours (n, 3) of points, from the image that shows each from nearest, and which are seen.

    Parameters
    ----------
    points : (n, 3) array
        Local frame, metres.
    images : m of (h, w, 3) uint8 arrays
        Red, green, blue; taken one at a time, so that they need not all be in memory.
    vehicle : (m, 6) array
        Vehicle poses at the images.
    camera : (6,) array
        Pose of the camera on the vehicle.
    lens : Lens
        Its projection.
    farthest : float
        Points farther away take no colour, metres.

    Notes
    -----
    Blanco 2009, section 7.2. A point hidden behind a nearer one would take its colour: in each
    image, of all points in a cell of 4 x 4 pixels only those within 5 % of the nearest are
    coloured.
    """
    colours = np.tile(np.array(NOT_SEEN, dtype=np.uint8), (len(points), 1))
    best = np.full(len(points), np.inf)
    for image, pose in zip(images, vehicle, strict=True):
        height, width = image.shape[:2]
        own = in_camera(points, pose, camera)
        with np.errstate(invalid="ignore", over="ignore"):
            pixels = np.round(lens.project(own))
            inside = (
                np.isfinite(pixels).all(1) & lens.shows(own)
                & (pixels[:, 0] >= 0) & (pixels[:, 0] < width)
                & (pixels[:, 1] >= 0) & (pixels[:, 1] < height)
            )  # fmt: skip
        distance = np.linalg.norm(own, axis=1)
        rows = np.flatnonzero(inside & (distance < farthest))
        x, y = pixels[rows].astype(np.int64).T
        nearest = np.full((height // 4 + 1, width // 4 + 1), np.inf)
        np.minimum.at(nearest, (y // 4, x // 4), distance[rows])
        # A judgement: within 5 % of the nearest of its 4 x 4 pixels a point is not hidden.
        front = distance[rows] < 1.05 * nearest[y // 4, x // 4]
        better = front & (distance[rows] < best[rows])
        rows, x, y = rows[better], x[better], y[better]
        colours[rows], best[rows] = image[y, x], distance[rows]
    return colours, np.isfinite(best)


def ply(points: Array, colours: Bytes | None = None) -> bytes:
    """A binary PLY file of points, with colours if given.

    Parameters
    ----------
    points : (n, 3) array
        Metres; written as 32-bit floats, exact to 0.03 mm within 500 m.
    colours : (n, 3) uint8 array, optional
        Red, green, blue.

    Raises
    ------
    GtvalError
        If the colours do not belong to the points, or a point is not finite.
    """
    if not np.isfinite(points).all():
        raise GtvalError("a point cloud with points that are not finite cannot be written")
    fields: list[tuple[str, str]] = [(axis, "<f4") for axis in "xyz"]
    header = [f"property float {axis}" for axis in "xyz"]
    if colours is not None:
        if colours.shape != points.shape:
            raise GtvalError(f"{len(colours)} colours for {len(points)} points")
        fields += [(name, "u1") for name in ("red", "green", "blue")]
        header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    table = np.empty(len(points), dtype=fields)
    for column, axis in enumerate("xyz"):
        table[axis] = points[:, column]
    if colours is not None:
        for column, name in enumerate(("red", "green", "blue")):
            table[name] = colours[:, column]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    return "\n".join([*lines, *header, "end_header", ""]).encode("ascii") + table.tobytes()
