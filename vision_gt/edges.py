"""Marker corners where the fitted edges of the marker cross.

Each side of a marker is a straight line in undistorted coordinates, black on one side and white
on the other. The grey levels around it are fitted by a blurred step whose position, slope, width
and levels are free, the levels changing evenly along the edge; so neither uneven light nor the
width of the blur moves the line, and every pixel along the side has its say.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from validation.angles import Array
from vision_gt.camera import project, undistort

_HALF_WINDOW = 3.5
_LEAST_HALF_WINDOW = 1.5
_CORNER_MARGIN = 2.5
"""Pixels near a corner that are left out: there the other side's blur reaches in."""
_MAX_STATIONS = 64
_ITERATIONS = 8
_SATURATED = 254
_START_BLUR = 0.8
_BLUR_PRIOR = 0.5
"""Standard deviation of the width about its start: keeps a saturated edge solvable."""
_UNKNOWNS = 7
_LEAST_CONTRAST = 12.0
_TUKEY = 6.0
_FLOOR = 0.015
"""Pixels of corner error that no fit sees: the model of the blur, the print."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class CornerFit:
    """Refined corners of m markers.

    Parameters
    ----------
    corners : (m, 4, 2) array
        Pixels in the image; where an edge could not be fitted, the start.
    covariances : (m, 4, 2, 2) array
        Of each corner, square pixels.
    good : (m, 4) array of bool
        Whether both edges of the corner could be fitted.
    """

    corners: Array
    covariances: Array
    good: Mask


def refine_corners(
    image: npt.NDArray[np.uint8], start: Array, cells: int, parameters: Array | None = None
) -> CornerFit:
    """Corners of markers from their fitted edges.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (m, 4, 2) array
        Corners to about 2 pixels, in order around the marker.
    cells : int
        Cells along a side of the marker: the fit keeps to its black border.
    parameters : (9,) array, optional
        Intrinsic parameters, so that edges are straight; without them they are taken as
        straight in the image.
    """
    m = len(start)
    if m == 0:
        nothing = np.zeros((0, 4), dtype=bool)
        return CornerFit(np.zeros((0, 4, 2)), np.zeros((0, 4, 2, 2)), nothing)
    flat = _Flat(parameters)
    corners = flat.from_image(np.asarray(start, dtype=float))
    half = _half_windows(corners, cells)
    for _round in range(2):
        ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
        edges = _fit_edges(image, ends, half.ravel(), flat)
        corners, covariances, good = _crossings(corners, edges)
    refined = flat.to_image(corners)
    scale = flat.slope_to_image(corners)
    covariances = scale @ covariances @ np.swapaxes(scale, -1, -2) + _FLOOR**2 * np.eye(2)
    far = np.linalg.norm(refined - start, axis=-1) > 2 * _HALF_WINDOW
    good &= ~far & np.isfinite(refined).all(-1)
    return CornerFit(
        np.where(good[..., None], refined, start),
        np.where(good[..., None, None], covariances, np.eye(2)),
        good,
    )


class _Flat:
    """Undistorted pixels: what the image would be without lens distortion."""

    def __init__(self, parameters: Array | None) -> None:
        self.parameters = parameters

    def from_image(self, pixels: Array) -> Array:
        if self.parameters is None:
            return pixels
        return undistort(pixels, self.parameters) * self.parameters[:2] + self.parameters[2:4]

    def to_image(self, flat: Array) -> Array:
        if self.parameters is None:
            return flat
        normalised = (flat - self.parameters[2:4]) / self.parameters[:2]
        ones = np.ones((*flat.shape[:-1], 1))
        return project(np.concatenate([normalised, ones], -1), self.parameters)

    def slope_to_image(self, flat: Array) -> Array:
        """(..., 2, 2) derivative of image pixels by undistorted ones."""
        step = 0.5
        columns = [
            (self.to_image(flat + step * axis) - self.to_image(flat - step * axis)) / (2 * step)
            for axis in np.eye(2)
        ]
        return np.stack(columns, -1)


def _half_windows(corners: Array, cells: int) -> Array:
    """(m, 4) half widths of the windows around the edges: not beyond the black border."""
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)
    opposite = np.roll(corners, -2, axis=1)
    along = after - corners
    length = np.maximum(np.linalg.norm(along, axis=-1), 1e-9)
    heights = [
        np.abs(along[..., 0] * (p - corners)[..., 1] - along[..., 1] * (p - corners)[..., 0])
        / length
        for p in (before, opposite)
    ]
    cell = np.minimum(*heights) / cells
    return np.clip(0.8 * cell, _LEAST_HALF_WINDOW, _HALF_WINDOW)


@dataclass(frozen=True)
class _Edges:
    """Fitted edges: displacements (e, 2) of their two ends to the inside, in undistorted pixels."""

    ends: Array
    normal: Array
    shift: Array
    covariance: Array
    good: Mask


def _fit_edges(
    image: npt.NDArray[np.uint8], ends: Array, half: Array, flat: _Flat
) -> _Edges:
    """Blurred steps fitted along edges that run from ends[:, 0] to ends[:, 1]."""
    along = ends[:, 1] - ends[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    unit = along / length[:, None]
    # Corners run clockwise in the image, so this normal points into the marker.
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    grey, share, distance, weight = _samples(image, ends, half, flat, (unit, normal, length))
    values, fitted = _start_values(grey, distance, weight)
    weights = weight
    for step in range(_ITERATIONS):
        residual, jacobian = _step_model(values, grey, share, distance)
        if step >= 3:  # outliers (sun-blades, stains) count less once the edge is about right
            weights = weight * _tukey(residual, weight)
        change, normal_matrix = _solve(residual, jacobian, weights, values)
        change[:, :2] = np.clip(change[:, :2], -1.5, 1.5)
        values = values + np.where(fitted[:, None], change, 0.0)
        values[:, 2] = np.clip(values[:, 2], 0.3, 3.0)
    residual, jacobian = _step_model(values, grey, share, distance)
    _change, normal_matrix = _solve(residual, jacobian, weights, values)
    count = np.maximum(weights.sum((1, 2)), 1.0)
    variance = (weights * residual**2).sum((1, 2)) / np.maximum(count - _UNKNOWNS, 1.0)
    inverse = np.linalg.inv(normal_matrix)
    covariance = inverse[:, :2, :2] * np.maximum(variance, 0.1)[:, None, None]
    contrast = np.minimum(values[:, 5], values[:, 5] + values[:, 6]) - np.maximum(
        values[:, 3], values[:, 3] + values[:, 4]
    )
    kept = weights.sum((1, 2)) / np.maximum(weight.sum((1, 2)), 1.0)
    sigma = np.sqrt(np.abs(covariance[:, [0, 1], [0, 1]])).max(1)
    good = (
        fitted
        & (contrast > _LEAST_CONTRAST)
        & (kept > 0.5)
        & (sigma < 0.5)
        & (np.abs(values[:, :2]).max(1) < _HALF_WINDOW)
        & (np.sqrt(variance) < 0.25 * np.maximum(contrast, 1.0))
    )
    return _Edges(ends, normal, values[:, :2], covariance, good)


def _samples(
    image: npt.NDArray[np.uint8],
    ends: Array,
    half: Array,
    flat: _Flat,
    frame: tuple[Array, Array, Array],
) -> tuple[Array, Array, Array, Array]:
    """Pixels around the edges: grey, share along the edge, distance to it, weight: (e, k, j).

    Whole pixels are taken as they are: interpolation would blur and shift the edge.
    """
    unit, normal, length = frame
    height, width = image.shape
    in_image = flat.to_image(ends)
    run = in_image[:, 1] - in_image[:, 0]
    steep = np.abs(run[:, 1]) > np.abs(run[:, 0])
    major, minor = (np.where(steep, a, b) for a, b in ((1, 0), (0, 1)))
    rows = np.arange(len(ends))
    start, span = in_image[rows, 0, major], run[rows, major]
    margin = np.minimum(_CORNER_MARGIN, 0.25 * np.abs(span))
    count = int(np.clip(np.ceil(np.abs(span).max() - 2 * margin.min()), 2, _MAX_STATIONS))
    # Stations are distinct whole pixels along the major axis, thinned out on long edges.
    stride = np.maximum((np.abs(span) - 2 * margin) / count, 1.0)
    travelled = margin[:, None] + stride[:, None] * np.arange(count)
    at_major = np.rint(start[:, None] + np.sign(span)[:, None] * travelled)
    share = (at_major - start[:, None]) / np.where(span == 0, 1.0, span)[:, None]
    valid = travelled <= (np.abs(span) - margin)[:, None]
    on_edge = ends[:, None, 0] + share[..., None] * (ends[:, 1] - ends[:, 0])[:, None]
    at_minor = np.take_along_axis(flat.to_image(on_edge), minor[:, None, None], axis=2)[..., 0]
    reach = int(np.ceil(half.max() * np.sqrt(2)))
    across = np.rint(at_minor)[..., None] + np.arange(-reach, reach + 1)
    majors = np.broadcast_to(at_major[..., None], across.shape)
    vertical = np.broadcast_to(steep[:, None, None], across.shape)
    x = np.where(vertical, across, majors)
    y = np.where(vertical, majors, across)
    valid = valid[..., None] & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    column = np.clip(np.nan_to_num(x), 0, width - 1).astype(np.intp)
    row = np.clip(np.nan_to_num(y), 0, height - 1).astype(np.intp)
    grey = image[row, column].astype(float)
    pixel = flat.from_image(np.stack([column, row], -1).astype(float))
    offset = pixel - ends[:, None, None, 0]
    distance = (offset * normal[:, None, None]).sum(-1)
    share = (offset * unit[:, None, None]).sum(-1) / length[:, None, None]
    valid &= np.isfinite(distance) & (np.abs(distance) <= half[:, None, None])
    valid &= grey < _SATURATED
    return grey, np.nan_to_num(share), np.nan_to_num(distance), valid.astype(float)


def _start_values(grey: Array, distance: Array, weight: Array) -> tuple[Array, Mask]:
    """Unknowns (e, 7): shifts of the two ends, width, dark and its slope, bright and its slope."""
    inside, outside = weight * (distance > 1), weight * (distance < -1)
    n_in, n_out = inside.sum((1, 2)), outside.sum((1, 2))
    dark = (inside * grey).sum((1, 2)) / np.maximum(n_in, 1)
    bright = (outside * grey).sum((1, 2)) / np.maximum(n_out, 1)
    none = np.zeros_like(dark)
    values = np.column_stack(
        [none, none, np.full_like(dark, _START_BLUR), dark, none, bright, none]
    )
    return values, np.asarray((n_in >= 4) & (weight.sum((1, 2)) >= 3 * _UNKNOWNS))


def _step_model(
    values: Array, grey: Array, share: Array, distance: Array
) -> tuple[Array, Array]:
    """Grey minus model (e, k, j), and the model's derivative (e, k, j, 7)."""
    v = values[:, None, None, :]
    width = v[..., 2]
    z = (distance - (v[..., 0] * (1 - share) + v[..., 1] * share)) / width
    inside = ndtr(z)
    density = np.exp(-0.5 * z * z) * (1 / np.sqrt(2 * np.pi))
    dark, bright = v[..., 3] + v[..., 4] * share, v[..., 5] + v[..., 6] * share
    contrast = dark - bright
    by_z = contrast * density / width
    jacobian = np.stack(
        [
            -by_z * (1 - share),
            -by_z * share,
            -by_z * z,
            inside,
            inside * share,
            1 - inside,
            (1 - inside) * share,
        ],
        -1,
    )
    return grey - (bright + contrast * inside), jacobian


def _solve(
    residual: Array, jacobian: Array, weights: Array, values: Array
) -> tuple[Array, Array]:
    """Gauss-Newton steps (e, 7) and normal matrices (e, 7, 7), for noise of one grey level."""
    e = len(residual)
    flat = jacobian.reshape(e, -1, _UNKNOWNS)
    weighted = flat * weights.reshape(e, -1, 1)
    normal = np.swapaxes(weighted, 1, 2) @ flat
    right = (np.swapaxes(weighted, 1, 2) @ residual.reshape(e, -1, 1))[..., 0]
    normal[:, 2, 2] += 4 / _BLUR_PRIOR**2
    right[:, 2] += 4 / _BLUR_PRIOR**2 * (_START_BLUR - values[:, 2])
    # Levels and displacements that nothing in the window tells stay near their start.
    normal[:, np.arange(_UNKNOWNS), np.arange(_UNKNOWNS)] += 1e-3
    return np.linalg.solve(normal, right[..., None])[..., 0], normal


def _tukey(residual: Array, weight: Array) -> Array:
    """Tukey's weights (e, k, j), the scale taken from each edge's own residuals."""
    size = np.abs(residual)
    used = np.where(weight > 0, size, np.nan).reshape(len(size), -1)
    some = np.isfinite(used).any(1)
    scale = np.full(len(size), 1.0)
    scale[some] = 1.4826 * np.nanmedian(used[some], axis=1)
    ratio = size / (_TUKEY * np.maximum(scale, 1.0))[:, None, None]
    return np.where(ratio < 1, (1 - np.minimum(ratio, 1) ** 2) ** 2, 0.0)


def _crossings(start: Array, edges: _Edges) -> tuple[Array, Array, Mask]:
    """Corners (m, 4, 2) where consecutive edges cross, covariances (m, 4, 2, 2), and validity."""
    m = len(start)
    shifted = edges.ends + edges.shift[..., None] * edges.normal[:, None]
    a, b = (shifted[:, i].reshape(m, 4, 2) for i in (0, 1))
    good = edges.good.reshape(m, 4)
    # Corner i lies on edge i (its start) and on edge i - 1 (its end).
    direction, before = b - a, np.roll(b - a, 1, axis=1)
    origin, origin_before = a, np.roll(b, 1, axis=1)
    matrix = np.stack([direction, -before], -1)
    determinant = np.linalg.det(matrix)
    crossing = np.abs(determinant) > 1e-3
    matrix = np.where(crossing[..., None, None], matrix, np.eye(2))
    t = np.linalg.solve(matrix, (origin_before - origin)[..., None])[..., 0, 0]
    corners = origin + t[..., None] * direction
    both = good & np.roll(good, 1, axis=1) & crossing
    normals = edges.normal.reshape(m, 4, 2)
    covariance = edges.covariance.reshape(m, 4, 2, 2)
    variances = np.stack([covariance[..., 0, 0], np.roll(covariance[..., 1, 1], 1, axis=1)], -1)
    # n_k . (corner - line_k) = 0 for both lines.
    lines = np.stack([normals, np.roll(normals, 1, axis=1)], -2)
    lines = np.where(crossing[..., None, None], lines, np.eye(2))
    inverse = np.linalg.inv(lines)
    spread = inverse @ (variances[..., None] * np.swapaxes(inverse, -1, -2))
    return np.where(both[..., None], corners, start), spread, both
