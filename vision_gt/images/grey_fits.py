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
SHARPENING_WIDTHS = (1.2, 0.7, 2.0)
"""Of the blurred copy from which sharpening leads away, pixels: usual ones are near one of them and
any of them explains some of what any other did."""
HALO_FROM = 0.03
"""What blur leaves of the grey levels, over the contrast, from which on sharpening is looked for:
noise of 2 grey levels on a contrast of 100 is 0.02."""
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
