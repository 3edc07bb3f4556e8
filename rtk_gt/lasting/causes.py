"""What contrasts say of a jump of some receivers: its size, and how well it explains them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special
from scipy.ndimage import maximum_filter1d

from rtk_gt.lasting.contrasts import Contrasts
from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array

GAIN = 46.0
"""Twice the log likelihood ratio of a jump against none at which there is one. Of three normal
numbers chance makes that in one of 10^9 intervals; of 75 clean hours one came to 43."""
GAIN_OF_MOTION = 50.0
"""The same where only the motion tells, as of all receivers: it has longer tails than noise."""
LOOKED_AT = 30.0
"""From which on such a jump is told where it is clearer against motions of any roughness."""
SMALLEST = 0.03
"""Metres of the smallest jump that is told: a judgement, below the 5 cm of a base station whose
coordinates are averaged anew, above what multipath does within a second."""
SMALLEST_IN_MOTION, SMALLEST_OF_ALL = 0.045, 0.06
"""The same where only the motion tells, of some receivers and of all: a jolt moves all."""
TELLING = 16.0
"""Squared sigmas by which a jump changes the distances, from which on they must have changed."""
USUAL = 0.3
"""Metres of a usual jump, as a standard deviation, where nothing tells: over a pause heights change
no distance."""
USUALLY_LEFT = 0.01
"""Share of the jumps that leave more of the motion than is taken for usual."""
UNSURE = 2
"""Epochs beside a jump that may be on its other side: noise moves its place by so many."""


def causes_of(count: int) -> list[tuple[int, ...]]:
    """All sets of receivers that may jump together: one alone, those of one base station, all."""
    return [some for size in range(1, count + 1) for some in combinations(range(count), size)]


@dataclass(frozen=True)
class Jumped:
    """What n intervals say of c causes.

    Parameters
    ----------
    gains : (n, c) array
        Above the least that a jump must have; minus infinity where none was looked for.
    allowed : (n, c) bool array
        Whether it would be told: where it changes distances they must have changed, and it must be
        large enough.
    sizes : (n, c, 3) array
        Along and across the baseline and up, metres.
    spreads : (n, c, 3, 3) array
        Their covariances, m^2.
    by_motion : (n, c) bool array
        Whether only the motion tells it.
    """

    gains: Array
    allowed: Bools
    sizes: Array
    spreads: Array
    by_motion: Bools


def jumped(seen: Contrasts, causes: Sequence[tuple[int, ...]]) -> Jumped:
    """What all intervals say of some causes."""
    n, p = seen.rods.shape[1:3]
    c, count, motion = len(causes), max(map(len, causes)), seen.values.shape[1] - p
    along = (seen.values @ seen.axes) / seen.sigmas
    found = Jumped(
        np.full((n, c), -np.inf), np.zeros((n, c), dtype=bool), np.zeros((n, c, 3)),
        np.zeros((n, c, 3, 3)), np.zeros((n, c), dtype=bool),
    )  # fmt: skip
    # No cause explains more than there is, nor lies far from the interval that shows most.
    rows = np.flatnonzero(maximum_filter1d(np.square(along).sum(1), 4 * UNSURE + 1) > GAIN)
    for k, cause in enumerate(causes):
        for ends in (False, True):
            gain, size, spread = fit_of(seen, cause, rows, ends)
            designs = seen.designs(cause, ends, rows)
            gain = gain / _unlike(seen, along[rows], designs, size, rows)
            design = np.einsum("ji,nja->nia", seen.axes[:, motion:], designs)
            change = np.einsum("npa,na->np", design / seen.sigmas[rows, motion:, None], size)
            told = np.square(change).sum(1)
            by_motion = told <= TELLING
            agrees = by_motion | (2 * (change * along[rows, motion:]).sum(1) > told)
            smallest = SMALLEST_OF_ALL if len(cause) == count else SMALLEST_IN_MOTION
            # What neighbours guess has the longer tails of motion whatever else tells.
            least = np.where(by_motion | seen.guessed, smallest, SMALLEST)
            gain = gain - np.where(by_motion | seen.guessed, GAIN_OF_MOTION, GAIN)
            better = gain > found.gains[rows, k]
            at = rows[better]
            found.gains[at, k], found.by_motion[at, k] = gain[better], by_motion[better]
            found.sizes[at, k], found.spreads[at, k] = size[better], spread[better]
            found.allowed[at, k] = (agrees & (np.linalg.norm(size, axis=1) > least))[better]
    return found


def gains_of(seen: Contrasts, cause: tuple[int, ...], rows: Ints) -> tuple[Array, Array]:
    """Gains (m,) of a cause at some intervals beside what is usual there, and sizes (m, 3)."""
    gains, sizes, _ = fit_of(seen, cause, rows)
    along = (seen.values[rows] @ seen.axes) / seen.sigmas[rows]
    return gains / _unlike(seen, along, seen.designs(cause, rows=rows), sizes, rows), sizes


def _unlike(seen: Contrasts, along: Array, designs: Array, sizes: Array, rows: Ints) -> Array:
    """(m,) times that the motion at some intervals is rougher than it usually is.

    By what a jump leaves of it: three numbers explain no turn that bends as no other of the drive.
    """
    motion = seen.values.shape[1] - seen.rods.shape[2]
    left = along[:, :motion] - np.einsum(
        "nka,na->nk",
        np.einsum("ji,nja->nia", seen.axes[:, :motion], designs) / seen.sigmas[rows, :motion, None],
        sizes,
    )
    if motion <= 3:
        return np.ones(len(left))
    usual = special.chdtri(motion - 3, USUALLY_LEFT)
    return np.asarray(np.maximum(np.square(left).sum(1) / usual, 1.0))


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
    designs = np.einsum("ji,nja->nia", seen.axes, seen.designs(cause, ends, rows))
    weighed = designs / seen.sigmas[rows, :, None]
    right = np.einsum("nka,nk->na", weighed, along)
    return right, np.einsum("nka,nkb->nab", weighed, weighed)


def told_at(
    seen: Contrasts, headings: Array, row: int, causes: Sequence[tuple[int, ...]]
) -> tuple[Array, Array]:
    """Evidence for all causes at an interval, (2, c, 3) and (2, c, 3, 3), east, north and up."""
    east = rotation_within(headings[row : row + 2])
    both = [
        [evidence(seen, cause, np.array([row]), ends) for cause in causes] for ends in (False, True)
    ]
    right = np.array([[east @ one[0][0] for one in some] for some in both])
    return right, np.array([[east @ one[1][0] @ east.T for one in some] for some in both])


def tempered(gains: Array, freedom: float) -> Array:
    """Gains for sigmas that are known from ``freedom`` numbers only: Student's for normal ones."""
    return np.asarray(freedom * np.log1p(gains / freedom))


def rotation_within(headings: Array) -> Array:
    """(3, 3) rotation from the vehicle's baseline to east, north, up, within an interval."""
    return np.asarray(rotations_within(headings[[0, -1]], np.zeros(1, dtype=np.intp))[0])


def rotations_within(headings: Array, rows: Ints) -> Array:
    """(n, 3, 3) the same within the intervals that begin at some rows."""
    first, last = headings[rows], headings[rows + 1]
    angle = first + np.angle(np.exp(1j * (last - first))) / 2
    turns = np.zeros((len(rows), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angle)
    turns[:, 1, 0] = np.sin(angle)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns
