"""What the fits of grey levels have in common: the blur, and how outliers are held back."""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN

Mask = npt.NDArray[np.bool_]

SATURATED = 254
"""Such a pixel says that the light is at least so much: a brighter model is no misfit."""
START_BLUR = 0.8
"""Pixels: the standard deviation of the blur of a sharp lens and of the pixels' own area."""
BLUR_INFORMATION = 4 / 0.5**2
"""On the width of the blur about its start, for noise of one grey level: as of one pixel with noise
of 2 grey levels that knows it to half a pixel. Keeps a saturated edge solvable."""
LEAST_BLUR, MOST_BLUR = 0.3, 3.0
"""Pixels: the area of a pixel alone, and an image too blurred to be used."""
AMOUNT_INFORMATION = 16.0
"""On the amount of sharpening about none, for noise of one grey level: as of a pixel with noise of
2 grey levels that knows it to a half. Keeps it solvable; a judgement."""
SHARPENING_WIDTHS = (1.2, 0.7, 2.0, 3.2, 5.0)
"""Of the blurred copy from which sharpening leads away, pixels: usual ones are near one of them and
its neighbours explain some of what any other did."""
HALO_WIDTH = 2.0
"""The one by which sharpening is looked for: it explains some of what any of the others did."""
HALO_FROM = 0.015
"""What blur leaves of the grey levels, over the contrast, from which on sharpening is looked for:
noise of 2 grey levels on a contrast of 130. Below it a halo of five pixels has been seen to move
corners by 0.01 pixels at most."""
MOST_AMOUNT = 8.0
"""Of sharpening: beyond it an image is lines only."""
_LEAST_CONTRAST = 12.0
"""Grey levels. A judgement: six times a usual noise."""
_LEAST_KEPT = 0.5
"""Share of the weights that outliers must leave: with half and more no fit can be told from
others."""
_MOST_NOISE = 0.25
"""Standard deviation of the residuals over the contrast. A judgement: where half of the
cells are wrong it is a half."""
_MOST_SIGMA = 0.5
"""Pixels. A judgement: OpenCV's own corners are as good."""
LEAST_VARIANCE = 0.1
"""Of grey levels, which are whole numbers: rounding alone has 1/12."""
_TUKEY = 6.0
"""Standard deviations at which weights end: nearly all normal noise keeps its say."""
_MISFIT = (0.05, 0.02)
"""Shares of the contrast that are no outlier's sign: after the first step, when the start may be
off, and then, for what the model of the blur leaves. Judgements."""


def tukey(residual: Array, weight: Array, contrast: Array, step: int) -> Array:
    """Tukey's weights (e, n) of residuals, about their median size.

    Parameters
    ----------
    residual, weight : (e, n) array
        Grey levels; places of weight 0 have no say.
    contrast : (e,) array
        Between white and black: a small share of it is never an outlier.
    step : int
        Of the fit, from 1: the first ones are far from the end.
    """
    ordered = np.sort(np.where(weight > 0, np.abs(residual), np.inf), axis=1)
    middle = (weight.sum(1) / 2).astype(np.intp)
    scale = SIGMA_OF_MEDIAN * ordered[np.arange(len(ordered)), middle]
    least = np.maximum(_MISFIT[min(step, 2) - 1] * contrast, 1.0)
    scale = np.maximum(np.where(np.isfinite(scale), scale, 0.0), least)
    ratio = np.minimum(np.square(residual / (_TUKEY * scale)[:, None]), 1.0)
    return np.asarray(np.square(1 - ratio))


def tukey_of_one(residual: Array, contrast: float, step: int) -> Array:
    """Tukey's weights (n,) of the residuals of one fit, as `tukey` has them.

    Parameters
    ----------
    residual : (n,) array
        Grey levels.
    contrast, step
        As for `tukey`.
    """
    middle = len(residual) // 2
    scale = SIGMA_OF_MEDIAN * float(np.partition(np.abs(residual), middle)[middle])
    scale = max(scale, _MISFIT[min(step, 2) - 1] * contrast, 1.0)
    ratio = np.minimum(np.square(residual / (_TUKEY * scale)), 1.0)
    return np.asarray(np.square(1 - ratio))


def believable(contrast: Array, kept: Array, sigma: Array, noise: Array) -> Mask:
    """Whether fits (...) may be believed.

    Parameters
    ----------
    contrast : (...) array
        Between white and black, grey levels.
    kept : (...) array
        Mean weight that outliers have left.
    sigma : (...) array
        Largest standard deviation of a place, pixels.
    noise : (...) array
        Standard deviation of the residuals, grey levels.
    """
    return np.asarray(
        (contrast > _LEAST_CONTRAST)
        & (kept > _LEAST_KEPT)
        & (sigma < _MOST_SIGMA)
        & (noise < _MOST_NOISE * contrast)
    )


def by_cell(moves: Array, lit: Array, cells: int) -> Array:
    """(8, c) what is left of the grey levels of each cell says that the homography should move."""
    column, row = (np.floor((v + 1) * cells / 2).astype(np.intp) for v in lit[1:])
    side = cells + 2
    cell = np.clip(row + 1, 0, side - 1) * side + np.clip(column + 1, 0, side - 1)
    sums = [np.bincount(cell, one, minlength=side * side) for one in moves]
    return np.array(sums, dtype=float)[:, np.bincount(cell, minlength=side * side) > 0]


def excess_of_cells(slopes: Array, spread: Array, moves: Array, unknowns: int) -> float:
    """By how much the corners' variances are larger than noise of single pixels makes them.

    Where what is left has the same sign along a boundary (the model of the blur, the light, the
    print), whole cells err together: the sum of squares over cells has that, that over pixels
    has not (Huber's sandwich, by cells).
    """
    cells = moves.shape[1]
    together = slopes @ (moves @ moves.T) @ np.swapaxes(slopes, 1, 2)
    single = slopes @ spread @ np.swapaxes(slopes, 1, 2)
    ratio = np.trace(together, axis1=1, axis2=2).sum() / np.trace(single, axis1=1, axis2=2).sum()
    return float(max(ratio * cells / max(cells - unknowns, 1), 1.0))


def share_explained(
    change: Array, step: tuple[Array, Array, Array], weights: Array, left: Array
) -> float:
    """Which share of what is left (n,) one more unknown would explain, with a derivative (n,).

    ``step`` is the Jacobian, the same with weights, and the inverse of the normal matrix.
    """
    jacobian, weighted, inverse = step
    own = change - (inverse @ (weighted @ change)) @ jacobian
    most = float(weights @ own**2) * float(weights @ left**2)
    return float(weights @ (own * left)) ** 2 / most if most > 0 else 0.0
