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
from vision_gt.prints.edge_samples import Flat, Image
from vision_gt.prints.grey_fits import (
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
from vision_gt.prints.pixels import (
    SQUARE,
    Rim,
    Seen,
    mapped,
    pixels_around,
    white_rim,
)
from vision_gt.prints.print_look import (
    PADDING,
    Places,
    Whiteness,
    boundaries,
    fill_by_light,
    levels_of_light,
    places_in_print,
    whiteness,
)

Mask = npt.NDArray[np.bool_]

_CORNERS_BY_CHANGE = np.array(
    [
        [[x, y, 1, 0, 0, 0, -x * x, -x * y], [0, 0, 0, x, y, 1, -x * y, -y * y]]
        for x, y in SQUARE.tolist()
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
_TOLD, _SLOPE_ENDS = 3, 2.0
"""Pixels from a boundary within which pixels tell where it is, as long as it is known to a pixel or
two; and widths of the blur within which they do, once it is known: what they say goes with the
square of the slope, of which two widths and half a pixel leave out 1e-4."""
_FIRST_LOOKED_AT = 900
"""Pixels of a large print that its first steps look at: they place its corners to 0.05 pixels."""
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
class _State:
    """A homography (3, 3) from print to undistorted pixels, blur (pixels), and light (6 or 9,)."""

    H: Array
    blur: float
    light: Array
    amount: float = 0.0

    @property
    def contrast(self) -> float:
        """Grey levels between white and black, in the middle of the print."""
        return float(self.light[3] - self.light[0])


@dataclass(frozen=True)
class _Step:
    """The last step: Jacobian (u, n), the same with weights, the inverse of the normal matrix.

    And the weights (n,) and what is left of the grey levels (n,) after it.
    """

    jacobian: Array
    weighted: Array
    inverse: Array
    weights: Array
    left: Array


@dataclass(frozen=True)
class _Rest:
    """Where steps came to rest: the state, the last look, and which pixels (n,) tell."""

    state: _State
    look: Whiteness
    at: Places
    lit: Array
    told: Mask
    step: _Step


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
    image: Image,
    start: Array,
    bits: Array,
    rim: Rim,
    flat: Flat,
    radius: float = 0.0,
    *,
    widely: bool = False,
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
    widely : bool
        Whether pixels are looked at as far from boundaries as where sharpening is sought, so that
        misfits with and without can be compared.

    Notes
    -----
    Gauss-Newton steps with Tukey's weights, so that what covers a part of the print does no
    harm. The homography changes as H (1 + D), so its derivatives are those of the point of the
    print that a pixel shows: Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56 (2004).
    """
    bad = PrintFit(start, np.broadcast_to(np.eye(2), (4, 2, 2)), good=False)
    if not np.isfinite(start).all():
        return bad
    H = cv2.getPerspectiveTransform(SQUARE.astype(np.float32), start.astype(np.float32))
    H = np.asarray(H, dtype=float)
    try:
        fit, count = _sought(image, H, bits, rim, flat, radius, widely=widely or radius > 0)
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
    return PrintFit(corners, covariances, True, blur, fit.misfit, amount, fit.halo, count)


def _sought(
    image: Image, H: Array, bits: Array, rim: Rim, flat: Flat, radius: float, *, widely: bool
) -> tuple[_Fit | None, int]:
    """The fit from a first homography, or None, and how many pixels were fitted.

    A large print is first fitted to some of its pixels, and then to all near its boundaries: the
    first steps need not be exact, and once it is known where the boundaries are, they are few.
    """
    seen = pixels_around(image, H, bits, rim, flat, _TOLD, None if widely else _FIRST_LOOKED_AT)
    light = np.zeros(9 if len(seen.grey) > _BENT_LIGHT else 6)
    start, halo = _State(H, START_BLUR, light), None
    if seen.some:
        seen = seen.without_zones()
        rest = _fitted(seen, start, radius, _SETTLED)
        if rest is None:
            return None, 0
        start, halo = rest.state, _halo(rest, seen.cells)
        told = max(round(_SLOPE_ENDS * start.blur), 1)
        seen = pixels_around(image, start.H, bits, rim, flat, told)
    if len(seen.grey) < 3 * _UNKNOWNS:
        return None, 0
    found = _fitted(seen, start, radius, _CONVERGED, judged=halo is not None)
    if found is None:
        return None, 0
    return _ended(found, seen.cells, radius, halo), len(seen.grey)


def _fitted(
    seen: Seen, state: _State, radius: float, enough: float, *, judged: bool = False
) -> _Rest | None:
    """Where steps from a state come to rest; None if they find none.

    They end when a corner moves by less than ``enough`` pixels. A state without light is the very
    first; ``judged`` says that there is nothing but white around the print, or that it was fitted
    without what is beyond its rim.
    """
    grey = seen.grey
    fresh = not state.light.any()
    used = np.ones(len(grey), dtype=bool)
    plain = not seen.zone.any()
    rounds, settled = int(judged), not fresh
    judged = plain
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
        if step == 1 and fresh:
            # Neither the light nor the amount has a start of its own: the first look tells them.
            state = _lit(state, by_light, sharper, grey)
            if sharper is not None:
                look, sharper = _look(state, seen.cells, at, radius)
                fill_by_light(lit, look.white, by_light)
        residual = grey - state.light @ by_light
        _jacobian(look, lit, state.light, sharper, jacobian)
        contrast = float(state.light[3] - state.light[0])
        if settled and not judged:
            white = white_rim(seen.zone, residual, used)
            rounds += 1
            changed = float((white != used).mean())
            judged, used = changed < _SAME_RIM or rounds == _MOST_ROUNDS, white
        told = used
        if clipped:
            # Where the light is cut off as the model foretells, a pixel says no more: no outlier.
            told = used & ~((bright & (residual < 0)) | (dark & (residual > 0)))
        weights = tukey_of_one(residual, contrast, step + (not fresh)) * told
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
        if moved < enough and judged:
            # The last step was small: what it changed is linear.
            left = residual - change @ jacobian
            taken = _Step(jacobian, weighted, inverse, weights, left)
            return _Rest(state, look, at, lit, told, taken)
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


def _ended(rest: _Rest, cells: Array, radius: float, halo: float | None) -> _Fit:
    """What a fit says, once a step has moved it no more."""
    state, lit, step = rest.state, rest.lit, rest.step
    contrast, left, weights = state.contrast, step.left, step.weights
    variance = _variance(step)
    spread = step.inverse[:_BLUR, :_BLUR] * max(variance, LEAST_VARIANCE)
    moves = (step.inverse[:_BLUR] @ step.weighted) * left
    in_cells = by_cell(moves, lit, len(cells) - 2 * PADDING)
    excess = excess_of_cells(_corners(state.H)[1], spread, in_cells, _UNKNOWNS)
    if halo is None:
        halo = 0.0 if radius > 0 else _halo(rest, cells)
    kept = float(weights.sum()) / float(rest.told.sum())
    # Weights would hide what a fit does not explain. The rim may have a halo of what is behind it.
    inside = rest.told & (np.abs(lit[1:]).max(0) < 1)
    share = np.abs(left[inside]) / contrast if inside.any() else np.ones(1)
    misfit = float(np.sqrt(np.mean(np.minimum(share, _WORST_SHARE) ** 2)))
    return _Fit(state, spread, variance, kept, contrast, excess, halo, misfit)


def _variance(step: _Step) -> float:
    """Of the grey levels that are left, square levels."""
    weights = step.weights
    freedom = float(weights.sum()) - len(step.inverse)
    return float(weights @ step.left**2) / max(freedom, 1.0)


def _halo(rest: _Rest, cells: Array) -> float:
    """Which share of what is left looks as if the image had been sharpened."""
    step = rest.step
    if not np.sqrt(_variance(step)) > HALO_FROM * rest.state.contrast:
        return 0.0
    wide = float(np.hypot(rest.state.blur, HALO_WIDTH))
    soft = whiteness(cells, rest.at, wide, boundaries(rest.at, wide, cells)).white
    tried = (step.jacobian, step.weighted, step.inverse)
    return share_explained(rest.look.white - soft, tried, step.weights, step.left)


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


def _corners(H: Array) -> tuple[Array, Array]:
    """Corners (4, 2), and their derivatives (4, 2, 8) by a change D of H (1 + D)."""
    corners = mapped(H, SQUARE)
    ahead = SQUARE @ H[2, :2] + H[2, 2]
    slope = (H[:2, :2] - corners[:, :, None] * H[2, :2]) / ahead[:, None, None]
    return corners, np.asarray(slope @ _CORNERS_BY_CHANGE)
