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
_MAX_STATIONS = 40
_ROUGH_STEPS, _FINAL_STEPS = 3, 4
"""Steps of the rough and the final fit; the windows follow the edges between the two."""
_SEARCH = np.arange(-4.0, 2.51, 0.5)
"""Displacements (pixels, inwards) among which the edge is sought first: found corners tend to
lie inside, and two cells further in the next edges of the same kind begin."""
_SATURATED = 254
"""Such a pixel says that the light is at least so much: a brighter model is no misfit."""
_START_BLUR = 0.8
_BLUR_PRIOR = 0.5
"""Standard deviation of the width about its start: keeps a saturated edge solvable."""
_UNKNOWNS = 7
_LEAST_CONTRAST = 12.0
_TUKEY = 6.0
_FLOOR = 0.015
"""Pixels of corner error that no fit sees: the model of the blur, the print."""

Mask = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8]


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
    image: Image, start: Array, cells: int, parameters: Array | None = None
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
    for stage in (_sought_edges, _rough_edges, _final_edges):
        ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
        edges = stage(image, ends, half.ravel(), flat)
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
        flat = undistort(pixels, self.parameters) * self.parameters[:2] + self.parameters[2:4]
        return np.asarray(flat)

    def to_image(self, flat: Array) -> Array:
        if self.parameters is None:
            return flat
        normalised: Array = (flat - self.parameters[2:4]) / self.parameters[:2]
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
    return np.asarray(np.clip(0.8 * cell, _LEAST_HALF_WINDOW, _HALF_WINDOW))


@dataclass(frozen=True)
class _Edges:
    """Fitted edges: displacements (e, 2) of their two ends to the inside, in undistorted pixels."""

    ends: Array
    normal: Array
    shift: Array
    covariance: Array
    good: Mask


def _frame(ends: Array) -> tuple[Array, Array]:
    """Unit vectors (e, 2) along edges and, as corners run clockwise, into the marker."""
    along = ends[:, 1] - ends[:, 0]
    unit = along / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return unit, np.column_stack([-unit[:, 1], unit[:, 0]])


def _sought_edges(image: Image, ends: Array, half: Array, flat: _Flat) -> _Edges:
    """Edges where the mean grey level drops most on the way into the marker, in each half.

    The border drops along its whole length; white cells behind it rise first.
    """
    frame = _frame(ends)
    reach = np.full(len(ends), 1.0)
    limits = (reach - _SEARCH[0], reach + _SEARCH[-1])
    grey, share, distance, weight = _samples(image, ends, limits, flat, frame)
    halves = []
    for side in (share < 0.5, share >= 0.5):
        profile = _profile(grey, distance, weight * side)
        drop = profile[:, :-4] - profile[:, 4:]
        drop[half[:, None] + 0.5 < _SEARCH] = -1.0
        halves.append(_SEARCH[np.argmax(np.nan_to_num(drop, nan=-1.0), axis=1)])
    # Each half's displacement is that of its middle.
    first, second = halves
    shift = np.column_stack([1.5 * first - 0.5 * second, 1.5 * second - 0.5 * first])
    far = np.abs(first - second) > 0.2 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shift[far] = 0.0
    unknown = np.broadcast_to(np.eye(2), (len(ends), 2, 2))
    return _Edges(ends, frame[1], shift, unknown, np.ones(len(ends), dtype=bool))


def _profile(grey: Array, distance: Array, weight: Array) -> Array:
    """(e, k + 4) mean grey levels at displacements half a pixel apart, NaN where unknown.

    They begin one pixel before `_SEARCH` and end one pixel after it.
    """
    steps = np.arange(len(_SEARCH) + 4)
    place = (distance - (_SEARCH[0] - 1.0)) / 0.5
    near = weight[..., None] * np.maximum(1 - np.abs(place[..., None] - steps), 0)
    total = near.sum(1)
    with np.errstate(all="ignore"):
        return np.asarray((near * grey[..., None]).sum(1) / np.where(total > 0, total, np.nan))


def _rough_edges(image: Image, ends: Array, half: Array, flat: _Flat) -> _Edges:
    """Blurred steps fitted in a few steps, so that the final window is in place."""
    frame = _frame(ends)
    samples = _samples(image, ends, (half, half), flat, frame)
    values, fitted, _weights = _fitted_steps(samples, _ROUGH_STEPS, robust=False)
    good = fitted & (np.abs(values[:, :2]).max(1) < _HALF_WINDOW)
    unknown = np.broadcast_to(np.eye(2), (len(ends), 2, 2))
    return _Edges(ends, frame[1], values[:, :2], unknown, good)


def _final_edges(image: Image, ends: Array, half: Array, flat: _Flat) -> _Edges:
    """Blurred steps fitted with outliers held back, with covariances and a judgement."""
    frame = _frame(ends)
    samples = _samples(image, ends, (half, half), flat, frame)
    values, fitted, weights = _fitted_steps(samples, _FINAL_STEPS, robust=True)
    residual, jacobian = _step_model(values, *samples[:3])
    _change, normal_matrix = _solve(residual, jacobian, weights, values)
    count = np.maximum(weights.sum(1), 1.0)
    variance = (weights * residual**2).sum(1) / np.maximum(count - _UNKNOWNS, 1.0)
    inverse = np.linalg.inv(normal_matrix)
    covariance = inverse[:, :2, :2] * np.maximum(variance, 0.1)[:, None, None]
    contrast = np.minimum(values[:, 5], values[:, 5] + values[:, 6]) - np.maximum(
        values[:, 3], values[:, 3] + values[:, 4]
    )
    kept = weights.sum(1) / np.maximum(samples[3].sum(1), 1.0)
    sigma = np.sqrt(np.abs(covariance[:, [0, 1], [0, 1]])).max(1)
    good = (
        fitted
        & (contrast > _LEAST_CONTRAST)
        & (kept > 0.5)
        & (sigma < 0.5)
        & (np.abs(values[:, :2]).max(1) < _HALF_WINDOW)
        & (np.sqrt(variance) < 0.25 * np.maximum(contrast, 1.0))
    )
    return _Edges(ends, frame[1], values[:, :2], covariance, good)


def _fitted_steps(
    samples: tuple[Array, Array, Array, Array], steps: int, *, robust: bool
) -> tuple[Array, Mask, Array]:
    """Unknowns (e, 7) after Gauss-Newton steps, whether there was enough to fit, and weights."""
    grey, share, distance, weight = samples
    values, fitted = _start_values(grey, distance, weight)
    weights = weight
    for step in range(steps):
        residual, jacobian = _step_model(values, grey, share, distance)
        weights = weight * ~((grey >= _SATURATED) & (residual < 0))
        if robust and step >= 1:
            weights = weights * _tukey(residual, weight)
        change, _normal = _solve(residual, jacobian, weights, values)
        change[:, :2] = np.clip(change[:, :2], -1.5, 1.5)
        values = values + np.where(fitted[:, None], change, 0.0)
        values[:, 2] = np.clip(values[:, 2], 0.3, 3.0)
    return values, fitted, weights


def _samples(
    image: Image,
    ends: Array,
    limits: tuple[Array, Array],
    flat: _Flat,
    frame: tuple[Array, Array],
) -> tuple[Array, Array, Array, Array]:
    """Pixels around the edges: grey, share along the edge, distance to it, weight: each (e, n).

    Whole pixels are taken as they are: interpolation would blur and shift the edge. Stations
    along the edge are mapped into the image exactly; from a station to the few pixels across
    it the lens is as good as linear.
    """
    unit, normal = frame
    outside, inside = limits
    height, width = image.shape
    stations, share, used = _stations(ends, flat)
    middle = np.linalg.inv(flat.slope_to_image(ends.mean(1)))
    across = np.einsum("ei,eij->ej", normal, middle)
    along = np.einsum("ei,eij->ej", unit, middle)
    run = stations[:, -1] - stations[:, 0]
    steep = np.abs(run[:, 1]) > np.abs(run[:, 0])
    reach = int(np.ceil(outside.max() * np.sqrt(2)))
    nearest = np.rint(np.nan_to_num(stations, nan=-99.0)).astype(np.intp)[:, :, None]
    steps = np.arange(-reach, reach + 1)
    column = nearest[..., 0] + np.where(steep[:, None, None], steps, 0)
    row = nearest[..., 1] + np.where(steep[:, None, None], 0, steps)
    used = used[..., None] & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    dx, dy = column - stations[:, :, None, 0], row - stations[:, :, None, 1]
    distance = across[:, 0, None, None] * dx + across[:, 1, None, None] * dy
    used &= (distance >= -outside[:, None, None]) & (distance <= inside[:, None, None])
    grey = image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-9)
    share = (
        share[..., None]
        + (along[:, 0, None, None] * dx + along[:, 1, None, None] * dy) / (length[:, None, None])
    )
    return _packed(used, grey.astype(float), share, distance)


def _stations(ends: Array, flat: _Flat) -> tuple[Array, Array, Mask]:
    """Places (e, k, 2) along edges, in the image, their shares (e, k) of the way, and validity.

    Each station has a whole pixel of its own; long edges are thinned out.
    """
    run = np.diff(flat.to_image(ends), axis=1)[:, 0]
    span = np.maximum(np.abs(run).max(1), 1e-9)
    margin = np.minimum(_CORNER_MARGIN, 0.25 * span)
    count = int(np.clip(np.ceil((span - 2 * margin).max()), 2, _MAX_STATIONS))
    stride = np.maximum((span - 2 * margin) / count, 1.0)
    travelled = margin[:, None] + stride[:, None] * (np.arange(count) + 0.5)
    used = travelled <= (span - margin)[:, None]
    share = np.minimum(travelled / span[:, None], 1.0)
    on_edge = ends[:, None, 0] + share[..., None] * (ends[:, 1] - ends[:, 0])[:, None]
    return flat.to_image(on_edge), share, used


def _packed(used: Mask, *arrays: Array) -> tuple[Array, Array, Array, Array]:
    """The used samples of each edge, moved to the front: three arrays (e, n), and weights."""
    flags = used.reshape(len(used), -1)
    size = max(int(flags.sum(1).max()), 1)
    order = np.argsort(~flags, axis=1, kind="stable")[:, :size]
    weight = np.take_along_axis(flags, order, axis=1)
    one, two, three = (
        np.where(weight, np.take_along_axis(a.reshape(len(used), -1), order, axis=1), 0.0)
        for a in arrays
    )
    return one, two, three, weight.astype(float)


def _start_values(grey: Array, distance: Array, weight: Array) -> tuple[Array, Mask]:
    """Unknowns (e, 7): shifts of the two ends, width, dark and its slope, bright and its slope."""
    inside, outside = weight * (distance > 0.7), weight * (distance < -1)
    n_in, n_out = inside.sum(1), outside.sum(1)
    dark = (inside * grey).sum(1) / np.maximum(n_in, 1)
    bright = (outside * grey).sum(1) / np.maximum(n_out, 1)
    none = np.zeros_like(dark)
    values = np.column_stack(
        [none, none, np.full_like(dark, _START_BLUR), dark, none, bright, none]
    )
    return values, np.asarray((n_in >= 4) & (weight.sum(1) >= 3 * _UNKNOWNS))


def _step_model(values: Array, grey: Array, share: Array, distance: Array) -> tuple[Array, Array]:
    """Grey minus model (e, n), and the model's derivative (e, n, 7)."""
    v = values[:, None, :]
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
    return np.asarray(grey - (bright + contrast * inside)), jacobian


def _solve(residual: Array, jacobian: Array, weights: Array, values: Array) -> tuple[Array, Array]:
    """Gauss-Newton steps (e, 7) and normal matrices (e, 7, 7), for noise of one grey level."""
    weighted = np.swapaxes(jacobian * weights[..., None], 1, 2)
    normal = weighted @ jacobian
    right = (weighted @ residual[..., None])[..., 0]
    normal[:, 2, 2] += 4 / _BLUR_PRIOR**2
    right[:, 2] += 4 / _BLUR_PRIOR**2 * (_START_BLUR - values[:, 2])
    # Levels and displacements that nothing in the window tells stay near their start.
    normal[:, np.arange(_UNKNOWNS), np.arange(_UNKNOWNS)] += 1e-3
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0]), np.asarray(normal)


def _tukey(residual: Array, weight: Array) -> Array:
    """Tukey's weights (e, n), the scale taken from each edge's own residuals."""
    size = np.abs(residual)
    ordered = np.sort(np.where(weight > 0, size, np.inf), axis=1)
    middle = (weight.sum(1) / 2).astype(np.intp)
    scale = 1.4826 * ordered[np.arange(len(size)), middle]
    scale = np.where(np.isfinite(scale), np.maximum(scale, 1.0), 1.0)
    ratio = np.minimum(size / (_TUKEY * scale)[:, None], 1.0)
    return np.asarray((1 - ratio**2) ** 2)


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
