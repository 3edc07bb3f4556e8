"""Poses of a source by nodes, and what a fit to a path says of them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array, wrap
from validation.statistics.robust import sigma_from_median

NODE = 0.4
"""Seconds that share one frame. An odometer that wanders by 5 mm in a second adds 3 mm within."""
NODE_TURN = 0.15
"""Radians that share one frame. Wheels that slip by 20 mrad in turning a radian add 8 mrad within:
what counts as noise of single poses beside that is little enough to tell the two apart."""
DELAY, DRIFT = 3, 4
"""Places of the two in the parameters: mount's x and y, its heading, delay, drift, and the
reference's scale, turn scale and turn bias."""


@dataclass(frozen=True)
class Variances:
    """Of one residual and of the frame's wandering.

    Parameters
    ----------
    position, heading : float
        Of one coordinate, m^2, and of the heading, rad^2.
    walk, turn_walk : float
        Of the frame's wandering per unit of motion, m^2 and rad^2.
    jitter : float
        Of the stamps, s^2.
    """

    position: float
    heading: float
    walk: float
    turn_walk: float
    jitter: float = 0.0


@dataclass(frozen=True)
class Rows:
    """Poses of a source, by nodes.

    Parameters
    ----------
    times : (n,) array
        Stamps, seconds.
    positions : (n, 2) array
        Metres.
    headings : (n,) array or None
        Radians.
    starts : (k,) array of int
        First row of each node.
    node : (n,) array of int
        Of each row.
    by_turn : bool
        Whether nodes end where a turn is long, too.
    """

    times: Array
    positions: Array
    headings: Array | None
    starts: npt.NDArray[np.intp]
    node: npt.NDArray[np.intp]
    by_turn: bool = False

    @classmethod
    def of(
        cls, times: Array, positions: Array, headings: Array | None, *, by_turn: bool = False
    ) -> "Rows":
        """Rows with nodes of `NODE` seconds; or of less, in which `NODE_TURN` is turned."""
        place = (times - times[0]) / NODE
        if by_turn and headings is not None:
            turned = np.abs(wrap(np.diff(headings, prepend=headings[0])))
            place = place + np.cumsum(turned) / NODE_TURN
        place = np.floor(place)
        starts = np.flatnonzero(np.diff(place, prepend=-1.0))
        node = np.repeat(np.arange(len(starts)), np.diff([*starts, len(times)]))
        return cls(times, positions, headings, starts, node, by_turn)

    def __len__(self) -> int:
        return len(self.times)

    def select(self, which: npt.NDArray[np.bool_]) -> "Rows":
        """Some of the rows."""
        headings = None if self.headings is None else self.headings[which]
        times, positions = self.times[which], self.positions[which]
        return Rows.of(times, positions, headings, by_turn=self.by_turn)


@dataclass(frozen=True)
class State:
    """All that is estimated.

    Parameters
    ----------
    parameters : (8,) array
        See `DELAY`.
    angles : (k,) array
        Rotation of each node's frame.
    places : (k, 2) array
        Where each node's first position comes to lie, in the path's frame.
    """

    parameters: Array
    angles: Array
    places: Array


@dataclass(frozen=True)
class Residuals:
    """Residuals at a state, and what changes them.

    Parameters
    ----------
    rows : (n, 3, 9) array
        Change with the parameters, and the residuals: x, y, heading.
    frames : (n, 3, 3) array
        Change with the node's frame.
    rates : (n, 3) array
        Change with time.
    links : tuple of arrays
        See `Links`: back and errors.
    """

    rows: Array
    frames: Array
    rates: Array
    back: Array
    errors: Array

    @property
    def values(self) -> Array:
        """(n, 3) residuals."""
        return self.rows[:, :, -1]


def first_variances(values: Residuals, *, with_heading: bool) -> Variances:
    """Variances from the residuals of neighbours, which share their frame's wandering."""
    r = values.values
    step = np.diff(r, axis=0)
    position = float(sigma_from_median(step[:, :2])) ** 2 / 2 + 1e-10
    heading = float(sigma_from_median(step[:, 2])) ** 2 / 2 + 1e-10 if with_heading else 1e-4
    return Variances(position, heading, 1e-4, 1e-4)


def link_variances(activity: Array, variances: Variances) -> Array:
    """(k-1, 3) of the frame's wandering between neighbouring nodes."""
    unit = np.array([variances.walk, variances.walk, variances.turn_walk])
    return np.asarray(activity * unit)


def rotated(vectors: Array, c: Array, s: Array) -> Array:
    """(n, 2) vectors turned by angles with these cosines and sines."""
    return np.column_stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]]
    )


def node_medians(values: Array, rows: Rows) -> Array:
    """(k, 2) medians over the rows of each node; of an even number the upper of the two."""
    counts = np.diff([*rows.starts, len(rows)])
    middle = rows.starts + counts // 2
    columns = [column[np.lexsort((column, rows.node))][middle] for column in values.T]
    return np.column_stack(columns)
