"""How uncertain corners are where a fit leaves the same misfit side by side."""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.prints.grey_fits import Floats, inverses
from vision_gt.prints.print_steps import BLUR, Rest

Ints = npt.NDArray[np.intp]

TILE, TILE_SHARPENED = 3, 4
"""Cells along the side of a tile. Misfit of wide blur, of motion and of sharpening is alike over a
cell or two, and that of a print's background along its rim. On 240 corners of rendered markers,
with tiles of 2, 3 and 4 cells, mean squared errors over variances were 1.1, 1.0, 1.1 without
misfit, 1.3, 0.9, 0.7 with a blur of 1.5 pixels, and 2.3, 1.4, 1.2 with motion over 9 pixels. The
halo of sharpening is wider: with 3 and 4 cells 1.7 and 1.5 where 1.5 of it was added."""

_MORE_THAN_ANY = 1e30
"""Of a pull's square in the metric of any fit."""


def excess_of_tiles(rest: Rest, slopes: Array, variance: Array, cells: int) -> Array:
    """By how much (m,) the corners' variances are larger than noise of single pixels makes them.

    Parameters
    ----------
    rest : Rest
        Of the fits.
    slopes : (m, 4, 2, 8) array
        Derivatives of the corners by changes of the homographies.
    variance : (m,) array
        Of the grey levels.
    cells : int
        Along a side of the print.

    Notes
    -----
    What the model of the blur, the light or the print lacks is left over with the same sign by
    pixels side by side, so that whole tiles err together. How far a fit moves when one tile is left
    out, squared and summed over tiles, is the variance that goes with that (the jackknife: Bell and
    McCaffrey, Survey Methodology 28 (2002), CR3). Of that, what noise of single pixels would make
    is known and taken off, so that a fit without misfit keeps its variance.

    Tiles are laid in two ways, half a tile apart, as the mean of both depends less on where edges
    are. With A the normal matrix, O that of a tile and p its pull, a fit without the tile moves by
    (A - O)^-1 p, of which noise of one makes (A - O)^-1 O A^-1 = (A - O)^-1 - A^-1.
    """
    by_corner = slopes.reshape(len(slopes), -1, BLUR)
    square = np.swapaxes(by_corner, 1, 2) @ by_corner
    inverse = rest.inverse
    single = (square * inverse[:, :BLUR, :BLUR]).sum((1, 2))
    tile = TILE if rest.state.radius is None else TILE_SHARPENED
    quarters = _of_quarters(rest, *_quarters(rest.lit, cells, tile / 2))
    own, pulls = (
        np.concatenate([_joined(part, place) for place in (0, 1)], 1) for part in quarters
    )
    moves, spread = _without(inverses(inverse)[:, None] - own, pulls)
    noise = spread.sum(1) - own.shape[1] * inverse[:, :BLUR, :BLUR]
    more = ((moves @ square) * moves).sum((1, 2)) / variance - (square * noise).sum((1, 2))
    # A tile without which nothing holds the fit (no number) tells nothing of the others.
    return np.asarray(np.fmax(1 + more / 2 / single, 1.0))


def _quarters(lit: Floats, cells: int, side: float) -> tuple[Ints, int]:
    """Number (m, n) of the quarter of a tile in which pixels are, and how many a row has.

    Rims are included. ``lit`` (m, 3, n) is 1 and the places of pixels in the prints, ``side`` how
    many cells a quarter has along each side.
    """
    along = int(np.ceil((cells + 2) / side))
    inside = np.clip(lit[:, 1:] * (cells / 2) + (cells / 2 + 1), 0, cells + 2 - 1e-4)
    column, row = (inside * (1 / side)).astype(np.uint16).transpose(1, 0, 2)
    return row * along + column, along


def _of_quarters(rest: Rest, number: Ints, along: int) -> tuple[Floats, Floats]:
    """Normal matrices (m, s, s, u, u) and pulls (m, s, s, u) of the quarters of tiles."""
    m, u, _ = rest.jacobian.shape
    count = along * along
    number = np.where(rest.weights > 0, number, count).astype(np.uint16)
    own = np.zeros((m, count, u, u), dtype=np.float32)
    pulls = np.zeros((m, count, u), dtype=np.float32)
    for i in range(m):
        order = np.argsort(number[i], kind="stable")
        ends = number[i].take(order).searchsorted(np.arange(count + 1))
        order = order[: ends[-1]]
        jacobian, weighted = (part[i].take(order, 1) for part in (rest.jacobian, rest.weighted))
        filled = np.flatnonzero(np.diff(ends))
        if not len(filled):
            continue
        starts, says = ends[filled], weighted * rest.left[i].take(order)
        pulls[i, filled] = np.add.reduceat(says, starts, axis=1).T
        parts = zip(filled.tolist(), starts.tolist(), ends[filled + 1].tolist(), strict=True)
        for q, first, end in parts:
            np.dot(weighted[:, first:end], jacobian[:, first:end].T, out=own[i, q])
    return own.reshape(m, along, along, u, u), pulls.reshape(m, along, along, u)


def _joined(quarters: Floats, place: int) -> Floats:
    """(m, t, ...) sums over tiles of four of the quarters (m, s, s, ...), ``place`` cut off."""
    m, s = quarters.shape[:2]
    rest = quarters.shape[3:]
    size = s + 1 + (s + 1) % 2
    wide = np.zeros((m, size, size, *rest), dtype=quarters.dtype)
    wide[:, place : place + s, place : place + s] = quarters
    half = size // 2
    return np.asarray(wide.reshape(m, half, 2, half, 2, *rest).sum((2, 4))).reshape(m, -1, *rest)


def _without(normal: Array, pulls: Floats) -> tuple[Array, Array]:
    """Moves (m, t, 8) of the homography by pulls (m, t, u), and its covariances (m, t, 8, 8).

    By normal matrices (m, t, u, u); NaN where one holds nothing. Of the unknowns in the other
    order, with the pull as one more, the factor of Cholesky ends in the homography's own part.
    """
    m, t, u = pulls.shape
    turned = np.zeros((m, t, u + 1, u + 1))
    turned[..., :u, :u] = normal[..., ::-1, ::-1]
    turned[..., u, :u] = pulls[..., ::-1]
    turned[..., u, u] = _MORE_THAN_ANY
    try:
        factor = np.linalg.cholesky(turned)[..., u - BLUR :, u - BLUR :]
    except np.linalg.LinAlgError:
        if m == 1:
            return np.full((1, t, BLUR), np.nan), np.full((1, t, BLUR, BLUR), np.nan)
        alone = [_without(normal[[i]], pulls[[i]]) for i in range(m)]
        return np.concatenate([one for one, _ in alone]), np.concatenate([one for _, one in alone])
    inverse = np.linalg.inv(factor[..., :BLUR, :BLUR])
    moves = (factor[..., BLUR:, :BLUR] @ inverse)[..., 0, ::-1]
    return moves, (np.swapaxes(inverse, -1, -2) @ inverse)[..., ::-1, ::-1]
