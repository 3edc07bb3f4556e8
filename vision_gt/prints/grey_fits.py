"""What the fits of grey levels have in common: the blur, and how outliers are held back."""

from typing import Any

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN

Mask = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.floating[Any]]
"""Of single precision where there is one number a pixel: grey levels are whole numbers, and places
in a print are then good to a millionth of a pixel."""

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
BEND_INFORMATION, MOST_BEND = 4.0, 4.0
"""On the bend of the tone curve about none, for noise of one grey level: as of a pixel with noise
of 2 grey levels that knows it to 1; and at most: a gamma of 2.2 has 1.5. Keeps it solvable."""
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
_ENOUGH_FOR_SCALE = 500
"""Residuals whose median is taken, about: it is then good to 5 %."""
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


def tukey_of_filled(residual: Floats, contrast: Array, step: int) -> Floats:
    """Tukey's weights (m, n) of the residuals of m fits, as `tukey` has them, all of weight 1.

    Parameters
    ----------
    residual : (m, n) array
        Grey levels.
    contrast, step
        As for `tukey`.
    """
    some = np.abs(residual[:, :: max(residual.shape[1] // _ENOUGH_FOR_SCALE, 1)])
    middle = some.shape[1] // 2
    scale = SIGMA_OF_MEDIAN * np.partition(some, middle, axis=1)[:, middle]
    scale = np.maximum(np.maximum(scale, _MISFIT[min(step, 2) - 1] * contrast), 1.0)
    narrow = (1 / (_TUKEY * scale))[:, None].astype(residual.dtype)
    ratio = np.minimum(np.square(residual * narrow), 1)
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


def left_over(change: Floats, step: tuple[Floats, Floats, Array]) -> Floats:
    """What derivatives (m, n) have that none of a step's unknowns has.

    ``step`` is the Jacobian, the same with weights, and the inverse of the normal matrix.
    """
    jacobian, weighted, inverse = step
    known = (inverse @ (weighted @ change[..., None])).astype(jacobian.dtype)
    return np.asarray(change - (np.swapaxes(known, 1, 2) @ jacobian)[:, 0])


def share_explained(
    change: Floats, step: tuple[Floats, Floats, Array], weights: Floats, left: Floats
) -> Array:
    """Which share (m,) of what is left (m, n) one more unknown would explain.

    Its derivatives are ``change`` (m, n). ``step`` is the Jacobian, the same with weights, and the
    inverse of the normal matrix.
    """
    own = left_over(change, step)
    said = weights * own
    most = (said * own).sum(1, dtype=float) * (weights * left**2).sum(1, dtype=float)
    explained = (said * left).sum(1, dtype=float) ** 2
    return np.asarray(np.where(most > 0, explained / np.where(most > 0, most, 1.0), 0.0))


def inverses(normal: Array) -> Array:
    """(m, u, u) inverses of normal matrices; NaN for those that have none."""
    try:
        return np.asarray(np.linalg.inv(normal), dtype=float)
    except np.linalg.LinAlgError:
        found = np.full_like(normal, np.nan)
        for i, one in enumerate(normal):
            if np.linalg.matrix_rank(one) == len(one):
                found[i] = np.linalg.inv(one)
        return found
