"""Signs, in what a fit of a print leaves, of what its model lacks: a halo, a bent curve, motion."""

from dataclasses import fields

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.prints.grey_fits import (
    BEND_INFORMATION,
    HALO_FROM,
    HALO_WIDTH,
    MOST_BEND,
    Floats,
    left_over,
    share_explained,
)
from vision_gt.prints.print_look import Places, boundaries, whiteness
from vision_gt.prints.print_steps import Rest, variances

Mask = npt.NDArray[np.bool_]

_BENT = 3.5
"""Standard deviations from which on the tone curve of an image is taken as bent: chance makes that
of one image in 2,000."""
_EVERY = 3
"""Of the pixels of first steps one of so many is enough to look for sharpening."""
MOST_STRETCHED, _NARROWEST = 8.0, 0.1
"""Of the blur's axes, the longer over the shorter: motion over 20 pixels; and the share of the
variance that one step may leave to the shorter one."""
_MOST_LEFT = 0.3
"""Share of the contrast that a pixel may have left over when motion is looked for: blur that is
wider across some boundaries leaves a half, and a thing in front as well."""


def haloes(rest: Rest, cells: Floats) -> Array:
    """Which share (m,) of what is left looks as if the image had been sharpened.

    Parameters
    ----------
    rest : Rest
        Of a fit without sharpening.
    cells : (m, s, s) array
        Of its prints.
    """
    large = np.sqrt(variances(rest)) > HALO_FROM * rest.state.contrast
    share = np.zeros(len(large))
    if not large.any():
        return share
    some, cells = np.s_[large, ::_EVERY], cells[large]
    wide = np.hypot(rest.state.blur[large], HALO_WIDTH)
    at = Places(*(getattr(rest.at, one.name)[some] for one in fields(Places)))
    soft = whiteness(cells, at, wide, boundaries(at, wide, cells)).white
    jacobian, weighted = (part[large, :, ::_EVERY] for part in (rest.jacobian, rest.weighted))
    # Of fewer pixels the normal matrix is as much smaller.
    tried = jacobian, weighted, _EVERY * rest.inverse[large]
    change = rest.look.white[some] - soft
    share[large] = share_explained(change, tried, rest.weights[some], rest.left[some])
    return share


def bend_of(rest: Rest) -> tuple[float, Array]:
    """How bent the tone curve of an image is, 0 if it may be straight; and that (m,) of each print.

    Parameters
    ----------
    rest : Rest
        Of a fit with a straight one.

    Notes
    -----
    One linear step of one more unknown: its derivative without what all others explain.
    """
    white = np.clip(rest.look.white, 0.0, 1.0)
    change = (rest.state.contrast[:, None] / 2).astype(white.dtype) * white * (1 - white)
    own = left_over(change, (rest.jacobian, rest.weighted, rest.inverse))
    said = rest.weights * own
    information = (said * own).sum(1, dtype=float)
    score = (said * rest.left).sum(1, dtype=float)
    variance = variances(rest)
    total = float((information / variance).sum()) + BEND_INFORMATION
    found = float((score / variance).sum()) / total
    if not abs(found) * np.sqrt(total) > _BENT:
        return 0.0, np.zeros(len(score))
    each = score / np.maximum(information + BEND_INFORMATION, 1e-9)
    return found, np.clip(each, -MOST_BEND, MOST_BEND)


def stretches(rest: Rest) -> tuple[Array, Array]:
    """Whether blur is wider one way than the other, as motion makes it.

    Parameters
    ----------
    rest : Rest
        Of a fit with round blur.

    Returns
    -------
    share : (m,) array
        Of what is left, how much it explains.
    stretch : (m, 2) array
        By how much the variance of the blur is larger, square pixels, times cosine and sine of
        twice the direction (from x towards y). Where the blur has a shape, in a plane in which it
        is round.

    Notes
    -----
    One linear step of two more unknowns. Blur of variance more along u makes a boundary with the
    normal n wider by (n . u)^2 of it, and what a wider blur changes there is known. Outliers are
    held back little, as weights would hide it.
    """
    m = len(rest.rows)
    share, stretch = np.zeros(m), np.zeros((m, 2))
    large = np.sqrt(variances(rest)) > HALO_FROM * rest.state.contrast
    if not large.any():
        return share, stretch
    some = np.s_[large, ::_EVERY]
    cosine, sine = _normals(rest, large)
    contrast = rest.state.contrast[large, None].astype(cosine.dtype)
    wider = contrast * rest.look.by_blur[some] / (4 * rest.state.blur[large, None])
    jacobian, weighted = (part[large, :, ::_EVERY] for part in (rest.jacobian, rest.weighted))
    step = jacobian, weighted, _EVERY * rest.inverse[large]
    told = rest.told[some]
    own = np.stack([left_over(wider * one, step) for one in (cosine, sine)], axis=1)
    left = np.clip(rest.left[some], -_MOST_LEFT * contrast, _MOST_LEFT * contrast) * told
    normal = (own * told[:, None]) @ np.swapaxes(own, 1, 2) + 1e-9 * np.eye(2)
    score = (own @ left[..., None]).astype(float)
    found = np.linalg.solve(normal.astype(float), score)
    total = np.maximum((left**2).sum(1, dtype=float), 1e-9)
    share[large] = (score * found).sum((1, 2)) / total
    stretch[large] = found[..., 0]
    return share, stretch


def _normals(rest: Rest, large: Mask) -> tuple[Floats, Floats]:
    """Cosine and sine (k, n) of twice the direction of the grey levels' gradient in the image.

    Where the blur has a shape, in a plane in which it is round.
    """
    H = rest.state.H[large]
    x, y = (rest.lit[large, k, ::_EVERY] for k in (1, 2))
    ahead = H[:, 2, 0, None] * x + H[:, 2, 1, None] * y + H[:, 2, 2, None]
    u, v = (
        (H[:, k, 0, None] * x + H[:, k, 1, None] * y + H[:, k, 2, None]) / ahead for k in (0, 1)
    )
    by_x, by_y = (look[large, ::_EVERY] for look in (rest.look.by_x, rest.look.by_y))
    # Of the slopes by the print's axes, those by the image's: with the inverse of the Jacobian.
    u_x, u_y = (H[:, 0, k, None] - u * H[:, 2, k, None] for k in (0, 1))
    v_x, v_y = (H[:, 1, k, None] - v * H[:, 2, k, None] for k in (0, 1))
    across = by_x * v_y - by_y * v_x
    down = by_y * u_x - by_x * u_y
    if rest.state.shape is not None:
        (a, b), (c, d) = rest.state.shape[large].transpose(1, 2, 0)[..., None]
        across, down = across * a + down * c, across * b + down * d
    size = np.maximum(across * across + down * down, 1e-30)
    return (across * across - down * down) / size, 2 * across * down / size


def wider_shapes(blur: Array, stretch: Array, shape: Array | None = None) -> Array:
    """(m, 2, 2) what makes the ellipses of blurs (m,) that are stretched (m, 2) of circles.

    The narrower axis is 1, and the other at most `MOST_STRETCHED`. Of the shape (m, 2, 2) that a
    stretch was found with, if any.
    """
    size = np.hypot(*stretch.T)
    (cosine, sine) = stretch.T / np.maximum(size, 1e-12)
    mean = blur**2
    half = np.minimum(size / 2, (1 - _NARROWEST) * mean)
    turned = np.array([[cosine, sine], [sine, -cosine]]).transpose(2, 0, 1)
    square = mean[:, None, None] * np.eye(2) + half[:, None, None] * turned
    if shape is not None:
        square = shape @ square @ np.swapaxes(shape, 1, 2)
    squares, axes = np.linalg.eigh(square)
    widths = np.sqrt(squares / squares[:, :1]).clip(1, MOST_STRETCHED)
    return np.asarray(axes * widths[:, None] @ np.swapaxes(axes, 1, 2))
