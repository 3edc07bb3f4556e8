"""The sides of markers, fitted to the grey levels around them.

Each side of a marker is a straight line in undistorted coordinates, black on one side and white
on the other. The grey levels around it are fitted by a blurred step whose position, slope, width
and levels are free, the levels changing evenly along the edge; so neither uneven light nor the
width of the blur moves the line, and every pixel along the side has its say. The edges of all
markers of an image are fitted together, as one stack.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from validation.poses.angles import Array
from vision_gt.prints.edge_samples import Flat, Image, Mask, Samples, edge_frame, profiles, samples
from vision_gt.prints.grey_fits import (
    BLUR_INFORMATION,
    LEAST_BLUR,
    LEAST_VARIANCE,
    MOST_BLUR,
    SATURATED,
    START_BLUR,
    believable,
    tukey,
)

Places = npt.NDArray[np.intp]

HALF_WINDOW = 3.5
"""Pixels to either side of an edge that are looked at, at most: four widths of a usual blur."""
LEAST_HALF_WINDOW = 1.5
"""Pixels, at least: a step of usual blur is seen over three of them."""
_HOLDS, _CROWDED = 2.0, 2.5
"""Widths of the blur, and pixels, that a window has to hold on either side: else the edge may as
well be the next one's, and its marker is known to such a width, or to a pixel. Of markers whose
whole prints could not be fitted, under motion over 9 and 12 pixels or small and seen from flat,
corners were off by 1 to 4 pixels at stated 0.1 to 0.3."""
_MAX_STATIONS = 40
"""Along an edge. A judgement: more take longer and gain little, as what lens and blur leave is
larger than the noise of 280 pixels."""
_MOST_STEPS = 4
_CONVERGED = 0.05
"""Pixels that no end of an edge moves any more: the steps shrink quadratically, so the one after
would be some thousandths."""
_SEARCH = np.arange(-4.0, 2.51, 0.5)
"""Displacements (pixels, inwards) among which the edge is sought first: found corners tend to
lie inside, and two cells further in the next edges of the same kind begin."""
_STEPS = np.arange(-5.0, 3.51, 0.5)
"""Where the profiles are taken: a pixel before and after each of these."""
_SEARCH_STATIONS = 6
"""For each half of an edge: enough to average noise of some grey levels."""
_LEVEL_PRIOR = 20.0
"""Standard deviation (grey levels) of the levels about where they start and of their slopes about
zero: narrow windows of small markers see no plateau, and would trade levels for position."""
_UNDISTURBED = 0.88
"""Of Tukey's weights, which end at six standard deviations, normal noise keeps 0.947, and noise
that is larger on the edge than beside it some 0.91; less is left where something lies over it."""
_ALIKE = 2.0
"""Edges of one marker have about the same noise: with 100 pixels its estimates differ by a tenth,
so twice as much on one edge is a thing that lies over it."""
_UNKNOWNS = 7
_PRIOR = np.array([1e-3, 1e-3, BLUR_INFORMATION, *[1 / _LEVEL_PRIOR**2] * 4])
"""Information on the unknowns, for noise of one grey level."""


@dataclass(frozen=True)
class _Edges:
    """Fitted edges: displacements (e, 2) of their two ends to the inside, in undistorted pixels.

    ``kept`` (e,) is the mean weight that outliers have left, ``noise`` (e,) the standard
    deviation of the others, grey levels.
    """

    ends: Array
    normal: Array
    shift: Array
    covariance: Array
    good: Mask
    kept: Array
    noise: Array


def fit_edges(
    image: Image, corners: Array, half: Array, flat: Flat
) -> tuple[Array, Array, Mask, Mask]:
    """Corners where the fitted edges cross.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    corners : (m, 4, 2) array
        To about 2 pixels, in order around the marker, undistorted pixels.
    half : (4 m,) array
        Pixels to either side of each edge that nothing but the edge reaches.
    flat : Flat
        The lens.

    Returns
    -------
    corners : (m, 4, 2) array
        Undistorted pixels; where an edge could not be fitted, where it was sought.
    covariances : (m, 4, 2, 2) array
        Of the fit alone.
    good : (m, 4) array of bool
        Whether both edges of the corner could be fitted.
    disturbed : (m,) array of bool
        Whether something lies over an edge of the marker, or it could not be fitted.
    """
    sought, start_values = _sought_edges(image, _sides(corners), half, flat)
    corners, _, _ = _crossings(corners, sought)
    edges = _fitted_edges(image, _sides(corners), half, flat, start_values)
    noise = edges.noise.reshape(-1, 4)
    disturbed = (~edges.good | (edges.kept < _UNDISTURBED)).reshape(-1, 4).any(1)
    disturbed |= noise.max(1) > _ALIKE * noise.min(1)
    corners, covariances, good = _crossings(corners, edges)
    return corners, covariances, good, np.asarray(disturbed)


def sought_corners(image: Image, corners: Array, half: Array, flat: Flat) -> Array:
    """(m, 4, 2) corners where grey levels drop most near each side: quicker than fits, and rougher.

    Parameters
    ----------
    image, corners, half, flat
        As for `fit_edges`.
    """
    return _crossings(corners, _sought_edges(image, _sides(corners), half, flat)[0])[0]


def _sides(corners: Array) -> Array:
    """(4 m, 2, 2) the two ends of each side."""
    return np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)


def _sought_edges(image: Image, ends: Array, half: Array, flat: Flat) -> tuple[_Edges, Array]:
    """Edges where the grey level drops most on the way into the marker, and values (e, 7) there.

    The border drops along its whole length; white cells behind it rise first. Each half of an
    edge is sought for itself.
    """
    frame = edge_frame(ends)
    grey = profiles(image, ends, _STEPS, flat, frame, 2 * _SEARCH_STATIONS)
    grey = grey.reshape(len(ends), 2, _SEARCH_STATIONS, -1).mean(2)
    drop = grey[..., :-4] - grey[..., 4:]
    drop = np.where((half[:, None] + 0.5 < _SEARCH)[:, None], -1.0, drop)
    place = np.clip(np.argmax(drop, axis=2), 1, drop.shape[2] - 2)
    before, at, after = (_picked(drop, place + k) for k in (-1, 0, 1))
    bend = np.minimum(before - 2 * at + after, -1e-9)
    top = np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
    first, second = (_SEARCH[place] + 0.5 * top).T
    # Each half's displacement is that of its middle.
    shift = np.column_stack([1.5 * first - 0.5 * second, 1.5 * second - 0.5 * first])
    # A judgement: halves that differ by a fifth of the side's length (11 degrees) saw two edges.
    far = np.abs(first - second) > 0.2 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shift[far] = 0.0
    bright = np.maximum(_picked(grey, place - 1), _picked(grey, place))
    dark = np.minimum(_picked(grey, place + 4), _picked(grey, place + 5))
    values = np.zeros((len(ends), _UNKNOWNS))
    values[:, 2] = START_BLUR
    for first_of, level in ((3, dark), (5, bright)):
        values[:, first_of] = 1.5 * level[:, 0] - 0.5 * level[:, 1]
        values[:, first_of + 1] = 2 * (level[:, 1] - level[:, 0])
    unknown = np.broadcast_to(np.eye(2), (len(ends), 2, 2))
    sure = np.ones(len(ends))
    return _Edges(ends, frame[1], shift, unknown, sure > 0, sure, sure), values


def _picked(profile: Array, place: Places) -> Array:
    """(e, 2) the values of profiles (e, 2, k) at places (e, 2)."""
    return np.take_along_axis(profile, place[..., None], axis=2)[..., 0]


def _fitted_edges(image: Image, ends: Array, half: Array, flat: Flat, start: Array) -> _Edges:
    """Blurred steps fitted from values (e, 7), with covariances and a judgement."""
    frame = edge_frame(ends)
    seen = samples(image, ends, half, flat, frame, _MAX_STATIONS)
    fit = _fitted_steps(seen, start)
    found, count = fit.values, np.maximum(fit.weights.sum(1), 1.0)
    variance = (fit.weights * fit.residual**2).sum(1) / np.maximum(count - _UNKNOWNS, 1.0)
    unscaled = np.linalg.inv(fit.normal)[:, :2, :2]
    covariance = np.asarray(
        unscaled * np.maximum(variance, LEAST_VARIANCE)[:, None, None], dtype=float
    )
    contrast = np.minimum(found[:, 5], found[:, 5] + found[:, 6]) - np.maximum(
        found[:, 3], found[:, 3] + found[:, 4]
    )
    kept = fit.weights.sum(1) / np.maximum(seen.weight.sum(1), 1.0)
    sigma = np.sqrt(np.abs(covariance[:, [0, 1], [0, 1]])).max(1)
    good = (
        fit.enough
        & believable(contrast, kept, sigma, np.sqrt(variance))
        & (np.abs(found[:, :2]).max(1) < HALF_WINDOW)
    )
    crowded = (_HOLDS * found[:, 2] > half) | (half < _CROWDED)
    crowded = np.repeat(crowded.reshape(-1, 4).any(1), 4)
    unseen = np.where(crowded, np.maximum(found[:, 2], 1.0), 0.0)
    covariance = covariance + np.square(unseen)[:, None, None] * np.eye(2)
    return _Edges(ends, frame[1], found[:, :2], covariance, good, kept, np.sqrt(variance))


@dataclass(frozen=True)
class _StepFit:
    """Fitted steps: unknowns (e, 7), residuals and weights (e, n), and normal matrices (e, 7, 7).

    The unknowns are the shifts of the two
    ends, the width, dark and its slope, bright and its slope. ``enough`` (e,) says whether there
    was enough to fit.
    """

    values: Array
    residual: Array
    weights: Array
    normal: Array
    enough: Mask


def _fitted_steps(seen: Samples, prior: Array) -> _StepFit:
    """Gauss-Newton steps from what is expected (e, 7); outliers are held back after the first."""
    found = prior
    enough = seen.weight.sum(1) >= 3 * _UNKNOWNS
    bright = seen.grey >= SATURATED
    for step in range(_MOST_STEPS):
        residual, jacobian = _step_model(found, seen)
        weights = seen.weight * ~(bright & (residual < 0))
        if step > 0:
            contrast = np.abs(found[:, 5] - found[:, 3])
            weights = weights * tukey(residual, seen.weight, contrast, step)
        change, normal = _solve(residual, jacobian, weights, prior - found)
        change[:, :2] = np.clip(change[:, :2], -1.5, 1.5)
        change[~enough] = 0.0
        found = found + change
        found[:, 2] = np.clip(found[:, 2], LEAST_BLUR, MOST_BLUR)
        if step > 0 and np.abs(change[:, :2]).max() < _CONVERGED:
            break
    # The last step was small: what it changed is linear.
    residual = residual - (change[:, None] @ jacobian)[:, 0]
    return _StepFit(found, residual, weights, normal, enough)


def _step_model(values: Array, seen: Samples) -> tuple[Array, Array]:
    """Grey minus model (e, n), and the model's derivative (e, 7, n)."""
    v = values[:, :, None]
    share, width = seen.share, v[:, 2]
    z = (seen.distance - v[:, 0] - (v[:, 1] - v[:, 0]) * share) / width
    inside = ndtr(z)
    contrast = (v[:, 3] - v[:, 5]) + (v[:, 4] - v[:, 6]) * share
    by_shift = contrast * np.exp(-0.5 * z * z) * (-1 / np.sqrt(2 * np.pi) / width)
    jacobian = np.empty((len(values), _UNKNOWNS, share.shape[1]))
    np.multiply(by_shift, share, out=jacobian[:, 1])
    np.subtract(by_shift, jacobian[:, 1], out=jacobian[:, 0])
    np.multiply(by_shift, z, out=jacobian[:, 2])
    jacobian[:, 3] = inside
    np.multiply(inside, share, out=jacobian[:, 4])
    np.subtract(1, inside, out=jacobian[:, 5])
    np.subtract(share, jacobian[:, 4], out=jacobian[:, 6])
    return seen.grey - (v[:, 5] + v[:, 6] * share + contrast * inside), jacobian


def _solve(
    residual: Array, jacobian: Array, weights: Array, to_prior: Array
) -> tuple[Array, Array]:
    """Gauss-Newton steps (e, 7) and normal matrices (e, 7, 7), for noise of one grey level."""
    weighted = jacobian * weights[:, None]
    normal = weighted @ np.swapaxes(jacobian, 1, 2)
    normal[:, np.arange(_UNKNOWNS), np.arange(_UNKNOWNS)] += _PRIOR
    right = (weighted @ residual[..., None])[..., 0] + _PRIOR * to_prior
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0]), np.asarray(normal)


def _crossings(start: Array, edges: _Edges) -> tuple[Array, Array, Mask]:
    """Corners (m, 4, 2) where consecutive edges cross, covariances (m, 4, 2, 2), and validity."""
    m = len(start)
    shifted = edges.ends + edges.shift[..., None] * edges.normal[:, None]
    a, b = shifted[:, 0].reshape(m, 4, 2), shifted[:, 1].reshape(m, 4, 2)
    good = edges.good.reshape(m, 4)
    # Corner i lies on edge i (its start) and on edge i - 1 (its end).
    direction, before = b - a, np.roll(b - a, 1, axis=1)
    apart = np.roll(b, 1, axis=1) - a
    determinant = _cross(direction, before)
    crossing = np.abs(determinant) > 1e-3
    t = _cross(apart, before) / np.where(crossing, determinant, 1.0)
    both = good & np.roll(good, 1, axis=1) & crossing
    normal = edges.normal.reshape(m, 4, 2)
    covariance = edges.covariance.reshape(m, 4, 2, 2)
    variances = np.stack([covariance[..., 0, 0], np.roll(covariance[..., 1, 1], 1, axis=1)], -1)
    # n_k . (corner - line_k) = 0 for both lines.
    lines = np.stack([normal, np.roll(normal, 1, axis=1)], -2)
    lines = np.where(crossing[..., None, None], lines, np.eye(2))
    inverse = np.linalg.inv(lines)
    spread = inverse @ (variances[..., None] * np.swapaxes(inverse, -1, -2))
    return np.where(both[..., None], a + t[..., None] * direction, start), spread, both


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
