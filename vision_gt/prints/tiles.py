"""How uncertain corners are where a fit leaves the same misfit side by side."""

import itertools

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
    normal = inverses(inverse)
    tile = TILE if rest.state.radius is None else TILE_SHARPENED
    numbers, along = _quarters(rest.lit, cells, tile / 2)
    found = np.ones(len(slopes))
    for i, number in enumerate(numbers):
        own, pulls = _of_quarters(rest, i, number, along)
        more = 0.0
        for place in (0, 1):
            own_tiles, pull = _joined(own, place), _joined(pulls, place)
            moves, spread = _without(normal[i] - own_tiles, pull)
            noise = spread.sum(0) - len(spread) * inverse[i, :BLUR, :BLUR]
            more += float(((moves @ square[i]) * moves).sum()) / variance[i]
            more -= float((square[i] * noise).sum())
        # A tile without which nothing holds the fit (no number) tells nothing of the others.
        found[i] = np.fmax(1 + more / 2 / single[i], 1.0)
    return found


def _quarters(lit: Floats, cells: int, side: float) -> tuple[Ints, int]:
    """Number (m, n) of the quarter of a tile in which pixels are, and how many a row has.

    Rims are included. ``lit`` (m, 3, n) is 1 and the places of pixels in the prints, ``side`` how
    many cells a quarter has along each side.
    """
    along = int(np.ceil((cells + 2) / side))
    inside = np.clip(lit[:, 1:] * (cells / 2) + (cells / 2 + 1), 0, cells + 2 - 1e-4)
    column, row = (inside * (1 / side)).astype(np.uint16).transpose(1, 0, 2)
    return row * along + column, along


def _of_quarters(rest: Rest, one: int, number: Ints, along: int) -> tuple[Array, Array]:
    """Normal matrices (s, s, u, u) and pulls (s, s, u) of the quarters of a print's tiles."""
    counted = np.flatnonzero(rest.weights[one])
    number = number[counted]
    order = np.argsort(number, kind="stable")
    counted, number = counted[order], number[order]
    jacobian, weighted = (part[one].take(counted, 1) for part in (rest.jacobian, rest.weighted))
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    unknowns = len(jacobian)
    own = np.zeros((along * along, unknowns, unknowns))
    pulls = np.zeros((along * along, unknowns))
    if len(starts):
        says = weighted * rest.left[one].take(counted)
        pulls[number[starts]] = np.add.reduceat(says, starts, axis=1).T
        for first, end in itertools.pairwise([*starts.tolist(), len(number)]):
            own[number[first]] = weighted[:, first:end] @ jacobian[:, first:end].T
    return own.reshape(along, along, unknowns, unknowns), pulls.reshape(along, along, unknowns)


def _joined(quarters: Array, place: int) -> Array:
    """(t, ...) sums over tiles of four of the quarters (s, s, ...), the first ``place`` cut off."""
    s = len(quarters)
    after = (s + place) % 2
    rest = quarters.shape[2:]
    wide = np.zeros((s + place + after, s + place + after, *rest))
    wide[place : place + s, place : place + s] = quarters
    half = len(wide) // 2
    return np.asarray(wide.reshape(half, 2, half, 2, *rest).sum((1, 3)).reshape(-1, *rest))


def _without(normal: Array, pulls: Array) -> tuple[Array, Array]:
    """Moves (t, 8) of the homography by pulls (t, u), and its covariances (t, 8, 8).

    By normal matrices (t, u, u); NaN where one holds nothing. Of the unknowns in the other order,
    with the pull as one more, the factor of Cholesky ends in the homography's own part.
    """
    t, u = pulls.shape
    turned = np.zeros((t, u + 1, u + 1))
    turned[:, :u, :u] = normal[:, ::-1, ::-1]
    turned[:, u, :u] = pulls[:, ::-1]
    turned[:, u, u] = _MORE_THAN_ANY
    try:
        factor = np.linalg.cholesky(turned)[:, u - BLUR :, u - BLUR :]
    except np.linalg.LinAlgError:
        return np.full((t, BLUR), np.nan), np.full((t, BLUR, BLUR), np.nan)
    inverse = np.linalg.inv(factor[:, :BLUR, :BLUR])
    moves = (factor[:, BLUR:, :BLUR] @ inverse)[:, 0, ::-1]
    return moves, (np.swapaxes(inverse, 1, 2) @ inverse)[:, ::-1, ::-1]
