"""Corners of a marker from its whole print.

The cells of a small marker blur into each other, so that no edge is seen alone. But its print is
known once its id has been read: a pattern of white and black cells with a white rim, a homography
away from the image without its distortion. Homography, blur and light are fitted to all of its
grey levels, and every edge between two cells helps to place the corners.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.special import ndtr

from validation.poses.angles import Array
from vision_gt.images.edge_samples import Flat, Image
from vision_gt.images.grey_fits import (
    BLUR_INFORMATION,
    LEAST_BLUR,
    LEAST_VARIANCE,
    MOST_BLUR,
    SATURATED,
    START_BLUR,
    believable,
    tukey,
)
from vision_gt.images.sampling import sampled

_SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
"""Corners in the frame of the print: x to the right, y down, half a side long."""
_CORNERS_BY_CHANGE = np.array(
    [
        [[x, y, 1, 0, 0, 0, -x * x, -x * y], [0, 0, 0, x, y, 1, -x * y, -y * y]]
        for x, y in _SQUARE.tolist()
    ]
)
"""Derivative (4, 2, 8) of the corners in the print by a change D of H (1 + D)."""
_UNKNOWNS = 15
"""Eight of the homography, the blur, three of the light on black, three of that on white."""
_BLUR = 8
_FINENESS = 1.8
"""Steps of the tables a width of the blur, which makes them good to some hundredths of the
contrast between the steps; and how few and many steps a cell has."""
_STEPS_A_CELL = 10, 32
_MOST_STEPS = 8
"""A judgement: one that has not ended by then has found no print."""
_CONVERGED, _DIVERGED = 0.05, 3.0
"""Pixels that a corner moves: as steps shrink fast, the one after would be far smaller; and more
than the start is off, which is a pixel or two."""


@dataclass(frozen=True)
class _Seen:
    """A print (c + 2, c + 2), its white rim included, and the pixels around it.

    ``places`` (3, n) are undistorted pixels, homogeneous, ``grey`` (n,) their levels.
    """

    cells: Array
    places: Array
    grey: Array


@dataclass(frozen=True)
class _State:
    """A homography (3, 3) from the print to undistorted pixels, blur (pixels), and light (6,)."""

    H: Array
    blur: float
    light: Array


@dataclass(frozen=True)
class _Fit:
    """Where the fit ended: the state, the inverse of the normal matrix, and what is left."""

    state: _State
    inverse: Array
    variance: float
    kept: float
    contrast: float


def fit_print(
    image: Image, start: Array, bits: Array, rim: float, flat: Flat
) -> tuple[Array, Array, bool]:
    """The corners of one marker, their covariances, and whether it could be fitted.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (4, 2) array
        Corners to about a pixel, from the top left of the print clockwise, undistorted pixels.
    bits : (c, c) array
        1 where the print is white, the first row at its top.
    rim : float
        Cells of white around it that are looked at.
    flat : Flat
        The lens.

    Returns
    -------
    corners : (4, 2) array
        Undistorted pixels; the start if there is no fit.
    covariances : (4, 2, 2) array
        Of the fit alone.
    good : bool
        Whether the fit came to an end and explains the grey levels.

    Notes
    -----
    Gauss-Newton steps with Tukey's weights, so that what covers a part of the print does no
    harm. The homography changes as H (1 + D), so its derivatives are those of the point of the
    print that a pixel shows: Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56 (2004).
    """
    bad = start, np.broadcast_to(np.eye(2), (4, 2, 2)), False
    if not np.isfinite(start).all():
        return bad
    H = cv2.getPerspectiveTransform(_SQUARE.astype(np.float32), start.astype(np.float32))
    seen = _around(image, np.asarray(H, dtype=float), bits, rim, flat)
    if len(seen.grey) < 3 * _UNKNOWNS:
        return bad
    try:
        fit = _fitted(seen, np.asarray(H, dtype=float))
    except np.linalg.LinAlgError:
        return bad
    if fit is None:
        return bad
    corners, slopes = _corners(fit.state.H)
    spread = fit.inverse[:_BLUR, :_BLUR] * max(fit.variance, LEAST_VARIANCE)
    covariances = slopes @ spread @ np.swapaxes(slopes, 1, 2)
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2).max())
    numbers = (fit.contrast, fit.kept, sigma, np.sqrt(fit.variance))
    return (corners, covariances, True) if believable(*map(np.asarray, numbers)) else bad


def _around(image: Image, H: Array, bits: Array, rim: float, flat: Flat) -> _Seen:
    """The pixels of the print and its rim."""
    reach = 1 + 2 * rim / len(bits)
    outline = flat.to_image(_mapped(H, reach * _SQUARE))
    height, width = image.shape
    low = np.maximum(np.floor(np.nan_to_num(outline.min(0))).astype(int), 0)
    high = np.minimum(np.ceil(np.nan_to_num(outline.max(0))).astype(int) + 1, [width, height])
    high = np.maximum(high, low)
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]].reshape(2, -1)
    places = np.ones((3, len(x)))
    places[:2] = flat.from_patch(np.stack([x, y], axis=1).astype(float)).T
    u, v, nearness = np.linalg.inv(H) @ places
    inside = np.maximum(np.abs(u), np.abs(v)) < reach * nearness
    cells = np.pad(np.asarray(bits, dtype=float), 1, constant_values=1.0)
    grey = image[low[1] : high[1], low[0] : high[0]].reshape(-1)
    return _Seen(cells, places[:, inside], grey[inside].astype(float))


def _fitted(seen: _Seen, H: Array) -> _Fit | None:
    """The fit from a first homography; None if it finds no rest."""
    state = _State(H, START_BLUR, np.zeros(6))
    grey, all_alike = seen.grey, np.ones((1, len(seen.grey)))
    for step in range(1, _MOST_STEPS + 1):
        look = _look(state, seen)
        if step == 1:
            # The light has no start of its own: it follows from the first look.
            by_light = look.by_light
            light = np.linalg.solve(by_light @ by_light.T, by_light @ grey)
            state = replace(state, light=np.asarray(light, dtype=float))
        residual, jacobian = grey - state.light @ look.by_light, look.jacobian(state.light)
        contrast = float(state.light[3] - state.light[0])
        weights = tukey(residual[None], all_alike, np.array([contrast]), step)[0]
        weights *= ~((grey >= SATURATED) & (residual < 0))
        weighted = jacobian * weights
        normal, right = weighted @ jacobian.T, weighted @ residual
        normal[_BLUR, _BLUR] += BLUR_INFORMATION
        right[_BLUR] += BLUR_INFORMATION * (START_BLUR - state.blur)
        inverse = np.asarray(np.linalg.inv(normal), dtype=float)
        change = inverse @ right
        moved = np.abs(_corners(state.H)[1] @ change[:_BLUR]).max()
        if not moved < _DIVERGED:
            return None
        state = _changed(state, change)
        if moved < _CONVERGED:
            # The last step was small: what it changed is linear.
            left = residual - change @ jacobian
            variance = float(weights @ left**2) / max(float(weights.sum()) - _UNKNOWNS, 1.0)
            return _Fit(state, inverse, variance, float(weights.mean()), contrast)
    return None


def _changed(state: _State, change: Array) -> _State:
    """The state after a step (15,)."""
    D = np.append(change[:_BLUR], 0.0).reshape(3, 3)
    blur = float(np.clip(state.blur + change[_BLUR], LEAST_BLUR, MOST_BLUR))
    return _State(state.H @ (np.eye(3) + D), blur, state.light + change[_BLUR + 1 :])


@dataclass(frozen=True)
class _Look:
    """What a state says of n pixels, but for the light.

    ``lit`` (3, n) is 1 and the point of the print, ``by_x``, ``by_y`` and ``by_blur`` (n,) are
    the derivatives of the share of white, ``by_light`` (6, n) that of the grey level.
    """

    lit: Array
    by_x: Array
    by_y: Array
    by_blur: Array
    by_light: Array

    def jacobian(self, light: Array) -> Array:
        """(15, n) derivative of the grey levels."""
        contrast = (light[3:] - light[:3]) @ self.lit
        x, y = self.lit[1:]
        across, down = -contrast * self.by_x, -contrast * self.by_y
        away = -(across * x + down * y)
        parts = (across * x, across * y, across, down * x, down * y, down, away * x, away * y)
        return np.concatenate([parts, [contrast * self.by_blur], self.by_light])


def _look(state: _State, seen: _Seen) -> _Look:
    """The share of white of each pixel, and its derivatives.

    Blur is round in the image and an ellipse in the print. Its widths along x and y are those
    in the middle of the print, and what they are elsewhere, and how far the ellipse is aslant,
    is taken into account to first order, as heat would spread.
    """
    to_print = np.asarray(np.linalg.inv(state.H), dtype=float)
    x, y, nearness = to_print @ seen.places
    x, y, nearness = x / nearness, y / nearness, 1 / nearness
    (x_right, x_down), (y_right, y_down) = (
        [(row[k] - place * to_print[2, k]) * nearness for k in (0, 1)]
        for row, place in ((to_print[0], x), (to_print[1], y))
    )
    along_x, along_y = np.hypot(x_right, x_down), np.hypot(y_right, y_down)
    slant = x_right * y_right + x_down * y_down
    usual = state.blur * np.array([along_x.mean(), along_y.mean()])
    white, by_x, by_y, by_both, wider_x, wider_y = _blurred(seen.cells, usual, x, y)
    white = white + wider_x * (state.blur * along_x - usual[0])
    white += wider_y * (state.blur * along_y - usual[1]) + state.blur**2 * slant * by_both
    by_blur = wider_x * along_x + wider_y * along_y + 2 * state.blur * slant * by_both
    lit = np.stack([np.ones_like(x), x, y])
    return _Look(lit, by_x, by_y, by_blur, np.concatenate([lit * (1 - white), lit * white]))


def _blurred(cells: Array, width: Array, x: Array, y: Array) -> list[Array]:
    """White (n,) of a print blurred by widths (2,) along its x and y, at points of it.

    Then its derivatives by x, by y, by both, and by either width. They are tabled on a grid and
    interpolated, as a cell is as white as a step up less the step down behind it, in x times y.
    """
    count = len(cells) - 2
    end = 1 + 2 / count
    finest = int(np.ceil(_FINENESS * 2 / count / float(width.min())))
    grid = np.linspace(-end, end, int(np.clip(finest, *_STEPS_A_CELL)) * len(cells) + 1)
    (on_x, on_y), (by_x, by_y), (wider_x, wider_y) = _shares(grid, width, count)
    rows = [np.asarray(a @ cells, dtype=np.float32) for a in (on_y, by_y, wider_y)]
    plain, sloped, wider = (a.astype(np.float32).T for a in (on_x, by_x, wider_x))
    products = (
        (rows[0], plain),
        (rows[0], sloped),
        (rows[1], plain),
        (rows[1], sloped),
        (rows[0], wider),
        (rows[2], plain),
    )
    columns, lines = ((p + end) / (grid[1] - grid[0]) for p in (x, y))
    found: list[Array] = []
    for three in (products[:3], products[3:]):
        table = cv2.merge([a @ b for a, b in three])
        found.extend(sampled(table, columns, lines).T)
    return found


def _shares(place: Array, width: Array, cells: int) -> tuple[Array, Array, Array]:
    """How much each row and column of cells has of places (g,) blurred by widths (2,).

    Three arrays (2, g, cells + 2): the shares, and their derivatives by place and by width. The
    rim's cells have no end.
    """
    width = width[:, None, None]
    z = (place[:, None] - np.linspace(-1, 1, cells + 1)) / width
    up = np.ones((2, len(place), cells + 3))
    up[..., 1:-1], up[..., -1] = ndtr(z), 0.0
    by_place, by_width = np.zeros_like(up), np.zeros_like(up)
    by_place[..., 1:-1] = np.exp(-0.5 * z * z) / (np.sqrt(2 * np.pi) * width)
    by_width[..., 1:-1] = -z * by_place[..., 1:-1]
    share, placed, widened = (a[..., :-1] - a[..., 1:] for a in (up, by_place, by_width))
    return share, placed, widened


def _mapped(H: Array, points: Array) -> Array:
    """Points (n, 2) through a homography."""
    ahead = points @ H[:, :2].T + H[:, 2]
    return np.asarray(ahead[:, :2] / ahead[:, 2:])


def _corners(H: Array) -> tuple[Array, Array]:
    """Corners (4, 2), and their derivatives (4, 2, 8) by a change D of H (1 + D)."""
    corners = _mapped(H, _SQUARE)
    ahead = _SQUARE @ H[2, :2] + H[2, 2]
    slope = (H[:2, :2] - corners[:, :, None] * H[2, :2]) / ahead[:, None, None]
    return corners, np.asarray(slope @ _CORNERS_BY_CHANGE)
