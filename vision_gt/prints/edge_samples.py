"""Grey levels around the straight sides of markers, by where they are along and across the side."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.optics.camera import distorted, distortion_slopes, undistort
from vision_gt.prints.grey_fits import Floats

CORNER_MARGIN = 2.5
"""Pixels near a corner that are left out: there the other side's blur reaches in, of which three
widths are 2.4 pixels."""

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8]
Levels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]
_ROW = 8192
"""Places a row of what OpenCV is given: it takes no picture of more than 32,767 in a row."""
_OUTSIDE = -99.0


def sampled(image: Levels, x: Array, y: Array) -> Array:
    """Linearly interpolated grey levels.

    Parameters
    ----------
    image : (h, w) or (h, w, c) array of uint8 or float32
        Grey levels; beyond its rim they are those of the rim.
    x, y : (...) arrays
        Places, pixels; where they are no numbers, the corner of the image is taken.

    Returns
    -------
    (...) or (..., c) array
        As many as places, however many.
    """
    count, shape = x.size, x.shape
    width = min(max(count, 1), _ROW)
    rows = -(-max(count, 1) // width)
    maps = []
    for places in (x, y):
        one = np.zeros(rows * width, dtype=np.float32)
        one[:count] = np.clip(np.nan_to_num(places.ravel(), nan=_OUTSIDE), -1e6, 1e6)
        maps.append(one.reshape(rows, width))
    source: Any = image
    grey = cv2.remap(source, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    own = image.shape[2:]
    return np.asarray(grey, dtype=float).reshape(rows * width, *own)[:count].reshape(*shape, *own)


def _monomials(x: Floats, y: Floats, degree: int) -> Floats:
    """(k, ...) monomials of x and y (...) up to a degree: x^i, x^(i - 1) y ... y^i for each i."""
    powers = np.empty(((degree + 1) * (degree + 2) // 2, *x.shape), dtype=x.dtype)
    powers[0] = 1.0
    before = 0
    for i in range(1, degree + 1):
        first = before + i
        np.multiply(powers[before:first], x, out=powers[first : first + i])
        np.multiply(powers[first - 1], y, out=powers[first + i])
        before = first
    return powers


def _nodes(count: int) -> Array:
    """(count^2, 2) places spread over a square from -1 to 1."""
    steps = np.linspace(-1, 1, count)
    return np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)


_NODES = {degree: _nodes(degree + 1) for degree in (2, 4)}
_FROM_NODES: dict[int, Array] = {
    d: np.asarray(np.linalg.pinv(_monomials(nodes[:, 0], nodes[:, 1], d).T))
    for d, nodes in _NODES.items()
}
"""Coefficients of a polynomial of the second or fourth degree from its values at such places."""
_DEGREES = {one.shape[0]: degree for degree, one in _FROM_NODES.items()}
_SMALL_PATCH = 40.0
"""Pixels: over so much the third degree of a lens with k1 = -0.3 and f = 1000 pixels is
0.3 * 1000 * 0.02^3 = 0.002 pixels; over 300 pixels the fifth degree is as small."""


class Flat:
    """Undistorted pixels: what the image would be without lens distortion.

    Parameters
    ----------
    parameters : (9,) array or None
        Intrinsic parameters; None for an image without distortion.
    """

    def __init__(self, parameters: Array | None) -> None:
        self.parameters = parameters

    def from_image(self, pixels: Array) -> Array:
        """(..., 2) undistorted pixels of pixels."""
        if self.parameters is None:
            return pixels
        flat = undistort(pixels, self.parameters) * self.parameters[:2] + self.parameters[2:4]
        return np.asarray(flat)

    def patches(self, low: Array, high: Array) -> "Patches":
        """How the lens bends m patches of the image, from (m, 2) pixels to others.

        Over some dozen pixels the lens is as good as a polynomial of the second degree, over some
        hundred as one of the fourth, fitted here at 9 or 25 places.
        """
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1.0)
        if self.parameters is None or not len(low):
            return Patches(middle, half, None)
        degree = 2 if 2 * half.max() < _SMALL_PATCH else 4
        nodes = middle[:, None] + half[:, None] * _NODES[degree]
        return Patches(middle, half, _FROM_NODES[degree] @ self.from_image(nodes))

    def to_image(self, flat: Array) -> Array:
        """(..., 2) pixels of undistorted ones."""
        if self.parameters is None:
            return flat
        focal, centre = self.parameters[:2], self.parameters[2:4]
        lens = distorted((flat - centre) / focal, self.parameters[4:])
        return np.asarray(lens * focal + centre)

    def to_image_with_slope(self, flat: Array) -> tuple[Array, Array]:
        """Pixels (..., 2), and their derivative (..., 2, 2) by the undistorted ones."""
        if self.parameters is None:
            return flat, np.broadcast_to(np.eye(2), (*flat.shape, 2))
        focal, centre = self.parameters[:2], self.parameters[2:4]
        normalised = (flat - centre) / focal
        slope = distortion_slopes(normalised, self.parameters[4:])
        lens = distorted(normalised, self.parameters[4:])
        return lens * focal + centre, focal[:, None] * slope / focal


@dataclass(frozen=True)
class Patches:
    """The lens over m patches of an image.

    Parameters
    ----------
    middle, half : (m, 2) array
        Of the patches, pixels.
    bends : (m, k, 2) array or None
        Coefficients of undistorted pixels, by places from -1 to 1 in a patch; None without lens.
    """

    middle: Array
    half: Array
    bends: Array | None

    def of(self, rows: Ints) -> "Patches":
        """Some of them."""
        bends = None if self.bends is None else self.bends[rows]
        return Patches(self.middle[rows], self.half[rows], bends)

    def undistorted(self, pixels: Array) -> tuple[Floats, Array]:
        """Undistorted pixels (m, 3, n) of pixels (m, 2, n), homogeneous, from origins (m, 2)."""
        m, _, n = pixels.shape
        places = np.ones((m, 3, n), dtype=np.float32)
        np.subtract(pixels, self.middle[..., None], out=places[:, :2], casting="same_kind")
        if self.bends is None:
            return places, self.middle
        places[:, :2] *= (1 / self.half[..., None]).astype(np.float32)
        powers = _monomials(places[:, 0], places[:, 1], _DEGREES[self.bends.shape[1]])
        for i, bend in enumerate(self.bends[:, 1:].astype(np.float32)):
            np.matmul(bend.T, powers[1:, i], out=places[i, :2])
        return places, self.bends[:, 0]


@dataclass(frozen=True)
class Samples:
    """Pixels around edges, each array (e, n).

    Parameters
    ----------
    grey : (e, n) array
        Their levels.
    share : (e, n) array
        Where along the edge they are: 0 at its first end, 1 at its second.
    distance : (e, n) array
        Undistorted pixels to the edge, positive inside the marker.
    weight : (e, n) array
        1, or 0 for places that do not count.
    """

    grey: Array
    share: Array
    distance: Array
    weight: Array


def edge_frame(ends: Array) -> tuple[Array, Array]:
    """Unit vectors (e, 2) along edges and, as corners run clockwise, into the marker."""
    along = ends[:, 1] - ends[:, 0]
    unit = along / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return unit, np.column_stack([-unit[:, 1], unit[:, 0]])


def profiles(
    image: Image, ends: Array, steps: Array, flat: Flat, frame: tuple[Array, Array], count: int
) -> Array:
    """(e, count, k) interpolated grey levels on lines across edges.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    ends : (e, 2, 2) array
        Ends of the edges, undistorted pixels.
    steps : (k,) array
        Displacements into the marker, pixels.
    flat : Flat
        The lens.
    frame : two (e, 2) arrays
        From `edge_frame`.
    count : int
        Lines across each edge, evenly spread between its corners.
    """
    span = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-9)
    margin = np.minimum(CORNER_MARGIN / span, 0.25)[:, None]
    share = margin + (1 - 2 * margin) * ((np.arange(count) + 0.5) / count)
    on_edge = ends[:, None, 0] + share[..., None] * (ends[:, 1] - ends[:, 0])[:, None]
    across = steps[:, None] * frame[1][:, None, None]
    # The lens is as good as linear over a few pixels.
    places, slope = flat.to_image_with_slope(on_edge)
    where = places[:, :, None] + across @ np.swapaxes(slope, -1, -2)
    return sampled(image, where[..., 0], where[..., 1])


def samples(
    image: Image, ends: Array, half: Array, flat: Flat, frame: tuple[Array, Array], most: int
) -> Samples:
    """The pixels within (e,) ``half`` undistorted pixels of edges, at up to ``most`` stations.

    Whole pixels are taken as they are: interpolation would blur and shift the edge. Stations
    along the edge are mapped into the image exactly; from a station to the few pixels across
    it the lens is as good as linear.
    """
    unit, normal = frame
    height, width = image.shape
    stations, share, used = _stations(ends, flat, most)
    middle = np.linalg.inv(flat.to_image_with_slope(ends.mean(1))[1])
    across = (normal[:, None] @ middle)[:, 0, :, None, None]
    along = (unit[:, None] @ middle)[:, 0, :, None, None]
    run = np.abs(stations[:, -1] - stations[:, 0])
    # Pixels are counted along the image axis that crosses the edge more steeply.
    by_column = (run[:, 1] > run[:, 0])[:, None]
    reach = int(np.ceil(half.max() * np.sqrt(2)))
    steps = np.arange(-reach, reach + 1)
    nearest = np.rint(np.nan_to_num(stations, nan=-99.0)).astype(np.intp)
    inside = _inside(nearest, steps, by_column, (height, width)) & used[..., None]
    stride = np.where(by_column, 1, width)[..., None]
    index = (nearest[..., 1] * width + nearest[..., 0])[..., None] + stride * steps
    grey = image.ravel()[np.where(inside, index, 0)].astype(float)
    off = nearest - stations
    step = np.where(by_column[..., None], across[:, 0], across[:, 1]) * steps
    distance = across[:, 0] * off[..., :1] + across[:, 1] * off[..., 1:] + step
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-9)[:, None, None]
    step = np.where(by_column[..., None], along[:, 0], along[:, 1]) * steps
    on = (
        share[..., None] + (along[:, 0] * off[..., :1] + along[:, 1] * off[..., 1:] + step) / length
    )
    counts = inside & (np.abs(distance) <= half[:, None, None])
    return _gathered(grey, on, distance, counts)


def _gathered(grey: Array, share: Array, distance: Array, counts: Mask) -> Samples:
    """Samples of places (e, k, s), those that count first, without the columns where none does."""
    e = len(grey)
    counts = counts.reshape(e, -1)
    most = int(counts.sum(1).max())
    order = np.argsort(~counts, axis=1, kind="stable")[:, :most]
    order += np.arange(e)[:, None] * counts.shape[1]
    taken = (a.reshape(-1)[order] for a in (grey, share, distance, counts.astype(float)))
    return Samples(*taken)


def _inside(
    nearest: npt.NDArray[np.intp],
    steps: npt.NDArray[np.intp],
    by_column: Mask,
    shape: tuple[int, ...],
) -> Mask:
    """(e, k, s) whether the pixels at steps from the stations (e, k, 2) are in the image."""
    height, width = shape
    x, y = nearest[..., 0], nearest[..., 1]
    stepped = np.where(by_column, x, y)[..., None] + steps
    limit = np.where(by_column, width, height)[..., None]
    fixed = np.where(by_column, y, x)
    fixed_in = (fixed >= 0) & (fixed < np.where(by_column, height, width))
    return np.asarray((stepped >= 0) & (stepped < limit) & fixed_in[..., None])


def _stations(ends: Array, flat: Flat, most: int) -> tuple[Array, Array, Mask]:
    """Places (e, k, 2) along edges, in the image, their shares (e, k) of the way, and validity.

    Each station has a whole pixel of its own; long edges are thinned out.
    """
    run = np.diff(flat.to_image(ends), axis=1)[:, 0]
    span = np.maximum(np.abs(run).max(1), 1e-9)
    margin = np.minimum(CORNER_MARGIN, 0.25 * span)
    count = int(np.clip(np.nan_to_num(np.ceil((span - 2 * margin).max()), nan=2.0), 2, most))
    stride = np.maximum((span - 2 * margin) / count, 1.0)
    travelled = margin[:, None] + stride[:, None] * (np.arange(count) + 0.5)
    used = travelled <= (span - margin)[:, None]
    share = np.minimum(travelled / span[:, None], 1.0)
    on_edge = ends[:, None, 0] + share[..., None] * (ends[:, 1] - ends[:, 0])[:, None]
    return flat.to_image(on_edge), share, np.asarray(used)
