"""How uncertain corners are where a fit leaves the same misfit side by side."""

import itertools

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.prints.print_steps import BLUR, Rest

Ints = npt.NDArray[np.intp]

TILE, TILE_SHARPENED = 3, 4
"""Cells along the side of a tile. Misfit of wide blur, of motion and of sharpening is alike over a
cell or two, and that of a print's background along its rim. On 240 corners of rendered markers,
with tiles of 2, 3 and 4 cells, mean squared errors over variances were 1.1, 1.0, 1.1 without
misfit, 1.3, 0.9, 0.7 with a blur of 1.5 pixels, and 2.3, 1.4, 1.2 with motion over 9 pixels. The
halo of sharpening is wider: with 3 and 4 cells 1.7 and 1.5 where 1.5 of it was added."""
PLACES = (0.0, 0.5)
"""Sides by which tiles are moved: of two ways to lay them, the mean depends less on where edges
are."""


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
    """
    found = np.ones(len(slopes))
    tile = TILE if rest.state.radius is None else TILE_SHARPENED
    for i, own in enumerate(slopes):
        by_corner = own.reshape(-1, BLUR)
        single = float(np.square(by_corner @ _root(rest.inverse[i, :BLUR, :BLUR])).sum())
        more = 0.0
        for place in PLACES:
            moves, noise = _left_out(rest, i, _tiles(rest.lit[i], cells, tile, place))
            more += float(np.square(moves @ by_corner.T).sum()) / variance[i]
            more -= float(((by_corner @ noise) * by_corner).sum())
        found[i] = max(1 + more / len(PLACES) / single, 1.0)
    return found


def _root(covariance: Array) -> Array:
    """(u, u) columns whose squares sum to a covariance."""
    return np.asarray(np.linalg.cholesky(covariance))


def _tiles(lit: Array, cells: int, tile: int, place: float) -> Ints:
    """Number (n,) of the tile in which pixels are, rims included.

    ``lit`` (3, n) is 1 and their places in the print.
    """
    along = int((cells + 2) / tile + place) + 1
    column, row = (
        np.clip((lit[k] + 1) * (cells / 2) + 1, 0, cells + 2 - 1e-9) / tile + place for k in (1, 2)
    )
    return np.asarray(row.astype(np.intp) * along + column.astype(np.intp))


def _left_out(rest: Rest, one: int, tile: Ints) -> tuple[Array, Array]:
    """(t, 8) moves of a homography without each tile, and (8, 8) their squares by noise of one."""
    order = np.argsort(tile, kind="stable")
    ends = [*np.flatnonzero(np.diff(tile[order], prepend=-1)), len(tile)]
    jacobian, weighted = (np.take(part[one], order, 1) for part in (rest.jacobian, rest.weighted))
    says = weighted * rest.left[one, order]
    parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
    own = np.array([weighted[:, part] @ jacobian[:, part].T for part in parts])
    pulls = np.add.reduceat(says, ends[:-1], axis=1).T
    inverse = rest.inverse[one]
    try:
        without = np.linalg.inv(np.linalg.inv(inverse) - own)
    except np.linalg.LinAlgError:
        # A tile without which nothing holds the fit: it tells nothing of the others.
        return np.zeros((1, BLUR)), np.zeros((BLUR, BLUR))
    moves = (without[:, :BLUR] @ pulls[:, :, None])[..., 0]
    noise = (without[:, :BLUR] @ own).sum(0) @ inverse
    return moves, np.asarray(noise[:, :BLUR])
