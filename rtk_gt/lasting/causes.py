"""What contrasts say of a jump of some receivers: its size, and how well it explains them."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.ndimage import maximum_filter1d

from rtk_gt.lasting.contrasts import Contrasts
from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array

GAIN = 40.0
"""Twice the log likelihood ratio of a jump against none at which there is one: chance makes that of
three normal numbers in one of 10^8 intervals."""
GAIN_OF_MOTION = 50.0
"""The same where only the motion tells, as of all receivers: it has longer tails than noise."""
SMALLEST = 0.03
"""Metres of the smallest jump that is told: a judgement, below the 5 cm of a base station whose
coordinates are averaged anew, above what multipath does within a second."""
SMALLEST_IN_MOTION = 0.06
"""The same where only the motion tells."""
TELLING = 16.0
"""Squared sigmas by which a jump changes the distances, from which on they must have changed."""
USUAL = 0.3
"""Metres of a usual jump, as a standard deviation, where nothing tells: over a pause heights change
no distance."""
UNSURE = 2
"""Epochs beside a jump that may be on its other side: noise moves its place by so many."""


def causes_of(count: int) -> list[tuple[int, ...]]:
    """All sets of receivers that may jump together: one alone, those of one base station, all."""
    return [some for size in range(1, count + 1) for some in combinations(range(count), size)]


def gains_of(
    seen: Contrasts, causes: Sequence[tuple[int, ...]]
) -> tuple[Array, Array, Array, Bools]:
    """Gains (n, c) above the least, sizes (n, c, 3) and covariances (n, c, 3, 3) of each cause.

    And whether (n, c) only the motion tells it.
    Where a jump changes distances they must have changed; where it does not, only the motion tells,
    and more is asked.
    """
    n, p = seen.rods.shape[1:3]
    along = (seen.values @ seen.axes) / seen.sigmas
    gains = np.full((n, len(causes)), -np.inf)
    sizes = np.zeros((n, len(causes), 3))
    spreads = np.zeros((n, len(causes), 3, 3))
    only_motion = np.zeros((n, len(causes)), dtype=bool)
    # No cause explains more than there is, nor lies far from the interval that shows most.
    some = maximum_filter1d(np.square(along).sum(1), 4 * UNSURE + 1) > GAIN
    rows = np.flatnonzero(some)
    for k, cause in enumerate(causes):
        for ends in (False, True):
            gain, size, spread = fit_of(seen, cause, rows, ends)
            designs = seen.designs(cause, ends)[rows]
            design = np.einsum("ji,nja->nia", seen.axes[:, -p:], designs)
            change = np.einsum("npa,na->np", design / seen.sigmas[rows, -p:, None], size)
            told = np.square(change).sum(1)
            agrees = 2 * (change * along[rows, -p:]).sum(1) > told
            length = np.linalg.norm(size, axis=1)
            by_distance = (told > TELLING) & agrees & (length > SMALLEST)
            by_motion = (told <= TELLING) & (length > SMALLEST_IN_MOTION)
            gain = np.select(
                [by_distance, by_motion], [gain - GAIN, gain - GAIN_OF_MOTION], -np.inf
            )
            better = gain > gains[rows, k] if ends else np.ones(len(rows), dtype=bool)
            some = rows[better]
            gains[some, k], sizes[some, k] = gain[better], size[better]
            spreads[some, k], only_motion[some, k] = spread[better], by_motion[better]
    return gains, sizes, spreads, only_motion


def fit_of(
    seen: Contrasts, cause: tuple[int, ...], rows: Ints, ends: bool = False
) -> tuple[Array, Array, Array]:
    """Gains (m,), sizes (m, 3) and covariances (m, 3, 3) of a cause at some intervals.

    Generalised least squares; sizes are along and across the baseline and up.
    """
    right, information = evidence(seen, cause, rows, ends)
    spreads = np.asarray(np.linalg.inv(information + np.eye(3) * USUAL**-2), dtype=float)
    sizes = np.einsum("nab,nb->na", spreads, right)
    return tempered((sizes * right).sum(1), seen.freedom), sizes, spreads


def evidence(
    seen: Contrasts, cause: tuple[int, ...], rows: Ints, ends: bool = False
) -> tuple[Array, Array]:
    """Information (m, 3, 3) on the size of a jump at some intervals, and (m, 3) times the size."""
    along = (seen.values[rows] @ seen.axes) / seen.sigmas[rows]
    designs = np.einsum("ji,nja->nia", seen.axes, seen.designs(cause, ends)[rows])
    weighed = designs / seen.sigmas[rows, :, None]
    right = np.einsum("nka,nk->na", weighed, along)
    return right, np.einsum("nka,nkb->nab", weighed, weighed)


def told_at(
    seen: Contrasts, headings: Array, row: int, causes: Sequence[tuple[int, ...]]
) -> tuple[Array, Array]:
    """Evidence for all causes at an interval, (2, c, 3) and (2, c, 3, 3), east, north and up."""
    east = turned(headings[row : row + 2])
    both = [
        [evidence(seen, cause, np.array([row]), ends) for cause in causes] for ends in (False, True)
    ]
    right = np.array([[east @ one[0][0] for one in some] for some in both])
    return right, np.array([[east @ one[1][0] @ east.T for one in some] for some in both])


def tempered(gains: Array, freedom: float) -> Array:
    """Gains for sigmas that are known from ``freedom`` numbers only: Student's for normal ones."""
    return np.asarray(freedom * np.log1p(gains / freedom))


def turned(headings: Array) -> Array:
    """(3, 3) rotation from the vehicle's baseline to east, north, up, within an interval."""
    angle = headings[0] + np.angle(np.exp(1j * (headings[-1] - headings[0]))) / 2
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
