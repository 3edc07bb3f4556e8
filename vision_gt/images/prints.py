"""Corners of a marker from its whole print.

The cells of a small marker blur into each other, so that no edge is seen alone. But its print is
known once its id has been read: a pattern of white and black cells with a white rim, a homography
away from the image without its distortion. Homography, blur and light are fitted to all of its
grey levels, and every edge between two cells helps to place the corners.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN
from vision_gt.images.edge_samples import Flat, Image
from vision_gt.images.grey_fits import (
    AMOUNT_INFORMATION,
    BLUR_INFORMATION,
    HALO_FROM,
    HALO_WIDTH,
    LEAST_BLUR,
    LEAST_VARIANCE,
    MOST_AMOUNT,
    MOST_BLUR,
    SATURATED,
    START_BLUR,
    believable,
    by_cell,
    excess_of_cells,
    share_explained,
    tukey_of_one,
)
from vision_gt.images.print_look import (
    PADDING,
    Places,
    Whiteness,
    beside_boundaries,
    boundaries,
    fill_by_light,
    levels_of_light,
    places_in_print,
    whiteness,
)

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]
Rim = tuple[float, float]

_SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
"""Corners in the frame of the print: x to the right, y down, half a side long."""
_CORNERS_BY_CHANGE = np.array(
    [
        [[x, y, 1, 0, 0, 0, -x * x, -x * y], [0, 0, 0, x, y, 1, -x * y, -y * y]]
        for x, y in _SQUARE.tolist()
    ]
)
"""Derivative (4, 2, 8) of the corners in the print by a change D of H (1 + D)."""
_BLUR, _UNKNOWNS = 8, 15
"""Eight of the homography, the blur, three of the light on black, three of that on white, and for a
large marker how that bends (three more); and for an image that was sharpened, how much."""
_BENT_LIGHT = 800
"""Pixels of a print from which on its light may bend: a lens that darkens to the image's corners
by a third bends it by 4 % where a marker fills half of it, which moves corners by 0.03 pixels."""
_MOST_STEPS, _MOST_SHARPENED = 8, 25
"""A judgement: one that has not ended by then has found no print. Amount and blur go together, and
more so where white and black are cut off: there it takes up to twenty."""
_CONVERGED, _DIVERGED = 0.05, 3.0
"""Pixels that a corner moves: as steps shrink fast, the one after would be far smaller; and more
than the start is off, which is a pixel or two."""
_ALL_LOOKED_AT = 2000
"""Pixels up to which all are used; of more, those at the cells' boundaries are, for between them
nothing says where the print is."""
_ZONES = 4
"""Into which what lies beyond the rim of each side is divided: of half a pixel or more each."""
_ALIKE, _NOISIER, _LEAST_NOISE = 3.5, 4.0, 0.5
"""Standard deviations that the mean of a zone may be off, and times that it may be more variable
than the print: more is another thing behind the rim. With less noise (grey levels) than the third
nothing would pass, as grey levels are whole numbers."""
_SAME_RIM, _MOST_ROUNDS = 0.03, 2
"""Share of the pixels that may still come or go, and how often it is judged at most."""
_WORST_SHARE = 0.1
"""Of the contrast, that one pixel may count as left over: more is as well a thing in front."""
_SETTLED = 0.3
"""Pixels that a corner moves when it is good enough to judge what lies beyond the rim."""


@dataclass(frozen=True)
class PrintFit:
    """A fitted print.

    Parameters
    ----------
    corners : (4, 2) array
        Undistorted pixels; the start if there is no fit.
    covariances : (4, 2, 2) array
        Of the fit alone.
    good : bool
        Whether the fit came to an end and explains the grey levels.
    blur : float
        Its width, pixels.
    misfit : float
        What is left of the grey levels of the print without its rim, root mean square over the
        contrast, each at most a tenth.
    pixels : int
        How many were fitted.
    halo : float
        Which share of what is left looks as if the image had been sharpened.
    amount : float
        How much it was sharpened: the share that was added of the difference to a blurred copy.
    """

    corners: Array
    covariances: Array
    good: bool
    blur: float = START_BLUR
    misfit: float = np.inf
    amount: float = 0.0
    halo: float = 0.0
    pixels: int = 0


@dataclass(frozen=True)
class _Seen:
    """A print's cells (c + 12, c + 12) with all the white around it, and the pixels there.

    ``places`` (3, n) are undistorted pixels, homogeneous, ``grey`` (n,) their levels. ``zone`` (n,)
    is 0 on the print and its rim; further out it numbers the four sides and how far it is.
    """

    cells: Array
    places: Array
    grey: Array
    zone: Ints


@dataclass(frozen=True)
class _State:
    """A homography (3, 3) from print to undistorted pixels, blur (pixels), and light (6 or 9,)."""

    H: Array
    blur: float
    light: Array
    amount: float = 0.0


@dataclass(frozen=True)
class _Fit:
    """Where the fit ended: the state, the covariance (8, 8) of its homography, and what is left."""

    state: _State
    spread: Array
    variance: float
    kept: float
    contrast: float
    excess: float
    halo: float
    misfit: float


def fit_print(
    image: Image, start: Array, bits: Array, rim: Rim, flat: Flat, radius: float = 0.0
) -> PrintFit:
    """The corners of one marker.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (4, 2) array
        Corners to about a pixel, from the top left of the print clockwise, undistorted pixels.
    bits : (c, c) array
        1 where the print is white, the first row at its top.
    rim : (float, float)
        Cells of white around it that are surely there, and up to which more is looked for.
    flat : Flat
        The lens.
    radius : float
        Of a sharpening whose amount is sought, pixels: the standard deviation of the blurred copy
        from which the image was led away. 0 for an image that was not sharpened.

    Notes
    -----
    Gauss-Newton steps with Tukey's weights, so that what covers a part of the print does no
    harm. The homography changes as H (1 + D), so its derivatives are those of the point of the
    print that a pixel shows: Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56 (2004).
    """
    bad = PrintFit(start, np.broadcast_to(np.eye(2), (4, 2, 2)), good=False)
    if not np.isfinite(start).all():
        return bad
    H = cv2.getPerspectiveTransform(_SQUARE.astype(np.float32), start.astype(np.float32))
    seen = _around(image, np.asarray(H, dtype=float), bits, rim, flat)
    if len(seen.grey) < 3 * _UNKNOWNS:
        return bad
    try:
        fit = _fitted(seen, np.asarray(H, dtype=float), radius)
    except np.linalg.LinAlgError:
        return bad
    if fit is None:
        return bad
    corners, slopes = _corners(fit.state.H)
    covariances = slopes @ fit.spread @ np.swapaxes(slopes, 1, 2)
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2).max())
    numbers = (fit.contrast, fit.kept, sigma, np.sqrt(fit.variance))
    if not believable(*map(np.asarray, numbers)):
        return bad
    covariances = covariances * fit.excess
    blur, amount = fit.state.blur, fit.state.amount
    return PrintFit(corners, covariances, True, blur, fit.misfit, amount, fit.halo, len(seen.grey))


def _around(image: Image, H: Array, bits: Array, rim: Rim, flat: Flat) -> _Seen:
    """The pixels of the print and its rim that say where it is, and some that say how bright."""
    sure, reach = (1 + 2 * cells / len(bits) for cells in rim)
    outline = flat.to_image(_mapped(H, reach * _SQUARE))
    height, width = image.shape
    low = np.maximum(np.floor(np.nan_to_num(outline.min(0))).astype(int), 0)
    high = np.minimum(np.ceil(np.nan_to_num(outline.max(0))).astype(int) + 1, [width, height])
    high = np.maximum(high, low)
    cells = np.pad(np.asarray(bits, dtype=float), PADDING, constant_values=1.0)
    part = image[low[1] : high[1], low[0] : high[0]]
    if part.size > _ALL_LOOKED_AT:
        corners = flat.to_image(_mapped(H, _SQUARE)) - low
        y, x = np.nonzero(beside_boundaries(cells, corners, part.shape))
    else:
        y, x = np.mgrid[: part.shape[0], : part.shape[1]].reshape(2, -1)
    grey = part[y, x]
    places = np.ones((3, len(x)))
    places[:2] = flat.from_patch(np.stack([x, y], axis=1) + low.astype(float)).T
    u, v, nearness = np.linalg.inv(H) @ places
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.maximum(np.abs(u), np.abs(v)) / nearness
    used = np.flatnonzero((out < reach) & (nearness > 0))
    zone = np.zeros(len(used), dtype=np.intp)
    if reach > sure:
        u, v, out = u[used], v[used], out[used]
        side = np.where(np.abs(u) > np.abs(v), 0, 2) + (np.where(np.abs(u) > np.abs(v), u, v) > 0)
        far = ((out - sure) / (reach - sure) * _ZONES).astype(np.intp)
        zone = np.where(out > sure, 1 + side * _ZONES + far, 0)
    return _Seen(cells, places[:, used], grey[used].astype(float), zone)


def _fitted(seen: _Seen, H: Array, radius: float) -> _Fit | None:
    """The fit from a first homography; None if it finds no rest."""
    grey = seen.grey
    state = _State(H, START_BLUR, np.zeros(9 if len(grey) > _BENT_LIGHT else 6))
    used, judged, settled = np.ones(len(grey), dtype=bool), not seen.zone.any(), False
    rounds = 0
    # Large arrays are made once: fresh memory costs more than what is written into it.
    rows = _BLUR + 1 + len(state.light) + (radius > 0)
    jacobian, weighted = np.empty((rows, len(grey))), np.empty((rows, len(grey)))
    by_light = jacobian[_BLUR + 1 : _BLUR + 1 + len(state.light)]
    bright, dark = grey >= SATURATED, grey <= 255 - SATURATED
    clipped = bool(bright.any() or dark.any())
    for step in range(1, (_MOST_SHARPENED if radius > 0 else _MOST_STEPS) + 1):
        at, lit = places_in_print(state.H, seen.places)
        look, sharper = _look(state, seen.cells, at, radius)
        fill_by_light(lit, look.white, by_light)
        if step == 1:
            # Neither the light nor the amount has a start of its own: the first look tells them.
            state = _lit(state, by_light, sharper, grey)
            if sharper is not None:
                look, sharper = _look(state, seen.cells, at, radius)
                fill_by_light(lit, look.white, by_light)
        residual = grey - state.light @ by_light
        _jacobian(look, lit, state.light, sharper, jacobian)
        contrast = float(state.light[3] - state.light[0])
        if settled and not judged:
            white = _white_rim(seen.zone, residual, used)
            rounds += 1
            changed = float((white != used).mean())
            judged, used = changed < _SAME_RIM or rounds == _MOST_ROUNDS, white
        told = used
        if clipped:
            # Where the light is cut off as the model foretells, a pixel says no more: no outlier.
            told = used & ~((bright & (residual < 0)) | (dark & (residual > 0)))
        weights = tukey_of_one(residual, contrast, step) * told
        np.multiply(jacobian, weights, out=weighted)
        normal, right = weighted @ jacobian.T, weighted @ residual
        normal[_BLUR, _BLUR] += BLUR_INFORMATION
        right[_BLUR] += BLUR_INFORMATION * (START_BLUR - state.blur)
        if radius > 0:
            normal[-1, -1] += AMOUNT_INFORMATION
            right[-1] -= AMOUNT_INFORMATION * state.amount
        inverse = np.asarray(np.linalg.inv(normal), dtype=float)
        change = inverse @ right
        moved = np.abs(_corners(state.H)[1] @ change[:_BLUR]).max()
        if not moved < _DIVERGED:
            return None
        state = _changed(state, change)
        settled = bool(moved < _SETTLED)
        if moved < _CONVERGED and judged:
            seen_last = (look, at, lit, told)
            return _ended(
                state,
                seen,
                seen_last,
                (jacobian, weighted, inverse, change),
                left=residual,
                weights=weights,
                radius=radius,
            )
    return None


def _lit(state: _State, by_light: Array, sharper: Array | None, grey: Array) -> _State:
    """The state with the light, and the amount of sharpening, that explain grey levels (n,) best.

    Both are linear: sharpening adds the amount times the contrast times ``sharper`` (n,).
    """
    rows = by_light if sharper is None else np.vstack([by_light, sharper])
    found = np.linalg.solve(rows @ rows.T, rows @ grey)
    light = np.asarray(found[: len(by_light)], dtype=float)
    if sharper is None:
        return replace(state, light=light)
    amount = float(np.clip(found[-1] / max(light[3] - light[0], 1.0), 0.0, MOST_AMOUNT))
    return replace(state, light=light, amount=amount)


def _ended(
    state: _State,
    seen: _Seen,
    last: tuple[Whiteness, Places, Array, Mask],
    step: tuple[Array, Array, Array, Array],
    *,
    left: Array,
    weights: Array,
    radius: float,
) -> _Fit:
    """What a fit says, once a step has moved it no more.

    ``last`` is the last look (shares of white, places in the print, 1 with x and y, what tells),
    ``step`` the Jacobian, the same with weights, the inverse of the normal matrix, and the step.
    """
    look, at, lit, used = last
    jacobian, weighted, inverse, change = step
    contrast = float(state.light[3] - state.light[0])
    # The last step was small: what it changed is linear.
    left = left - change @ jacobian
    variance = float(weights @ left**2) / max(float(weights.sum()) - len(change), 1.0)
    spread = inverse[:_BLUR, :_BLUR] * max(variance, LEAST_VARIANCE)
    moves = (inverse[:_BLUR] @ weighted) * left
    cells = by_cell(moves, lit, len(seen.cells) - 2 * PADDING)
    excess = excess_of_cells(_corners(state.H)[1], spread, cells, _UNKNOWNS)
    halo = 0.0
    if radius <= 0 and np.sqrt(variance) > HALO_FROM * contrast:
        wide = float(np.hypot(state.blur, HALO_WIDTH))
        soft = whiteness(seen.cells, at, wide, boundaries(at, wide, seen.cells)).white
        halo = share_explained(look.white - soft, step[:3], weights, left)
    kept = float(weights.sum()) / float(used.sum())
    # Weights would hide what a fit does not explain. The rim may have a halo of what is behind it.
    inside = used & (np.abs(lit[1:]).max(0) < 1)
    share = np.abs(left[inside]) / contrast if inside.any() else np.ones(1)
    misfit = float(np.sqrt(np.mean(np.minimum(share, _WORST_SHARE) ** 2)))
    return _Fit(state, spread, variance, kept, contrast, excess, halo, misfit)


def _white_rim(zone: Ints, residual: Array, used: Mask) -> Mask:
    """Pixels (n,) of the print and of as much around it as is as white as the rim.

    From a side outwards, up to where the mean of a zone is not the rim's.
    """
    noise = max(SIGMA_OF_MEDIAN * float(np.median(np.abs(residual[zone == 0]))), _LEAST_NOISE)
    count, total, squares = (
        np.bincount(zone, weights, minlength=4 * _ZONES + 1)[1:].reshape(4, _ZONES)
        for weights in (used.astype(float), residual * used, residual**2 * used)
    )
    white = np.abs(total) <= _ALIKE * noise * np.sqrt(count)
    white &= (squares <= _NOISIER * noise**2 * count) & (count > 0)
    white = np.logical_and.accumulate(white, axis=1)
    return np.asarray(np.append(True, white.ravel())[zone])


def _look(state: _State, cells: Array, at: Places, radius: float) -> tuple[Whiteness, Array | None]:
    """The share of white, sharpened by the state's amount; and its derivative by that amount."""
    wide = float(np.hypot(state.blur, radius))
    reached = boundaries(at, wide, cells)
    sharp = whiteness(cells, at, state.blur, reached)
    if radius <= 0:
        return sharp, None
    soft = whiteness(cells, at, wide, reached)
    a = state.amount
    mixed = Whiteness(
        (1 + a) * sharp.white - a * soft.white,
        (1 + a) * sharp.by_x - a * soft.by_x,
        (1 + a) * sharp.by_y - a * soft.by_y,
        (1 + a) * sharp.by_blur - a * soft.by_blur * state.blur / wide,
    )
    return mixed, sharp.white - soft.white


def _jacobian(
    look: Whiteness, lit: Array, light: Array, sharper: Array | None, full: Array
) -> None:
    """Fill in the derivative (u, n) of the grey levels by the unknowns, but that by the light."""
    black, white = levels_of_light(light, lit)
    contrast = white - black
    x, y = lit[1:]
    across, down = -contrast * look.by_x, -contrast * look.by_y
    away = -(across * x + down * y)
    np.multiply(across, x, out=full[0])
    np.multiply(across, y, out=full[1])
    full[2] = across
    np.multiply(down, x, out=full[3])
    np.multiply(down, y, out=full[4])
    full[5] = down
    np.multiply(away, x, out=full[6])
    np.multiply(away, y, out=full[7])
    np.multiply(contrast, look.by_blur, out=full[_BLUR])
    if sharper is not None:
        np.multiply(contrast, sharper, out=full[-1])


def _changed(state: _State, change: Array) -> _State:
    """The state after a step (u,)."""
    D = np.append(change[:_BLUR], 0.0).reshape(3, 3)
    blur = float(np.clip(state.blur + change[_BLUR], LEAST_BLUR, MOST_BLUR))
    last = _BLUR + 1 + len(state.light)
    more = float(change[last]) if len(change) > last else 0.0
    amount = float(np.clip(state.amount + more, 0.0, MOST_AMOUNT))
    light = state.light + change[_BLUR + 1 : last]
    return _State(state.H @ (np.eye(3) + D), blur, light, amount)


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
