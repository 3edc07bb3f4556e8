"""First guesses for a whole network, from its distances alone.

In the plane a descent from a bad guess is caught: a mark on the wrong side of a line cannot cross
it. Given a third dimension it can go around. So all points start anywhere in space, descend there,
and are then pressed into the plane more and more. Of such starts most lead to the solution, where
of starts in the plane most do not.
"""

from itertools import combinations

import numpy as np
from scipy.sparse import csr_array

from survey.estimation.geometry import rigid_alignment
from survey.estimation.whole.units import Equations, Index, Units, descend
from validation.poses.angles import Array

_SPREAD = 3.0
"""Metres, one standard deviation, over which points start: a room."""
_GROUP = 0.3
"""The same for the points of one rig about their middle."""
_SIGMA = 0.04
"""Standard deviation, in metres, that distances are given in space: so soft that a bad start does
not catch, and far below the metres between a place and its mirror image."""
_PRESSURES = (0.0, 1.0, 5.0, 20.0, 100.0)
"""What a metre out of the plane costs, one after the other, in standard deviations; in the end
4 cm out of the plane cost as much as 40 sigmas."""
_PASSES = (40, 10, 10, 10, 10)
_IN_PLANE = 30


def lifted_start(units: Units, known: Array, rng: np.random.Generator) -> Array:
    """States (n, 3) to start a descent from.

    Parameters
    ----------
    units : Units
        The network.
    known : (n, 3) array
        Fixed points, and rough values of others where there are any, else NaN.
    rng : Generator
        Draws the rest.
    """
    points = _Points(units)
    place = points.drawn(known, rng)
    for pressure, passes in zip(_PRESSURES, _PASSES, strict=True):
        place = points.descended(place, pressure, passes)
    flat = points.descended(place[:, :2], 0.0, _IN_PLANE)
    return points.states(flat, known)


class _Points:
    """Fixed points, places and the read points of every rig, with the distances among them."""

    def __init__(self, units: Units) -> None:
        self.units = units
        whole = units.fixed + units.places
        body: dict[tuple[int, float, float], int] = {}
        ends = []
        for unit, arm in ((units.first, units.first_body), (units.second, units.second_body)):
            keys = zip(unit.tolist(), arm[:, 0].tolist(), arm[:, 1].tolist(), strict=True)
            ends.append(
                [
                    key[0] if key[0] < whole else body.setdefault(key, whole + len(body))
                    for key in keys
                ]
            )
        self.body = np.array([key[1:] for key in body]).reshape(-1, 2)
        self.stop = np.array([key[0] for key in body], dtype=np.intp)
        rows = [np.flatnonzero(self.stop == s) for s in range(whole, len(units.names))]
        sides = [pair for row in rows for pair in combinations(row, 2)]
        side = np.array(sides, dtype=np.intp).reshape(-1, 2)
        self.rows = rows
        self.first: Index = np.concatenate([np.array(ends[0], dtype=np.intp), whole + side[:, 0]])
        self.second: Index = np.concatenate([np.array(ends[1], dtype=np.intp), whole + side[:, 1]])
        lengths = np.linalg.norm(self.body[side[:, 0]] - self.body[side[:, 1]], axis=1)
        self.distance = np.concatenate([units.distance, lengths])
        self.count = whole + len(body)

    def drawn(self, known: Array, rng: np.random.Generator) -> Array:
        """Places (count, 3) in space: about the known ones, elsewhere at random."""
        units = self.units
        whole = units.fixed + units.places
        middle = known[: units.fixed, :2].mean(0)
        unit = rng.normal(0, _SPREAD, (len(units.names), 3))
        unit[:, :2] += middle
        told = np.isfinite(known[:, 0])
        unit[told, :2] = known[told, :2]
        unit[told, 2] *= 0.1
        unit[: units.fixed, 2] = 0.0
        marks = unit[self.stop] + rng.normal(0, _GROUP, (len(self.stop), 3))
        return np.concatenate([unit[:whole], marks])

    def descended(self, place: Array, pressure: float, passes: int) -> Array:
        """Places (count, d) after a descent in which a metre off the plane costs ``pressure``."""
        fixed, d = self.units.fixed, place.shape[1]
        out = place.copy()
        out[fixed:] = descend(
            self._equations(place[:fixed], d, pressure), place[fixed:].ravel(), passes
        ).reshape(-1, d)
        return out

    def _equations(self, fixed: Array, d: int, pressure: float) -> Equations:
        f, free = len(fixed), (self.count - len(fixed)) * d
        m = len(self.distance)
        pair = np.column_stack([self.first, self.second]) - f
        ends = (pair[..., None] * d + np.arange(d)).ravel()
        kept = ends >= 0
        above = np.arange(2, free, d) if d > 2 and pressure else np.empty(0, dtype=np.intp)
        row = np.concatenate([np.repeat(np.arange(m), 2 * d)[kept], m + np.arange(len(above))])
        column = np.concatenate([ends[kept], above])

        def at(unknowns: Array) -> tuple[Array, csr_array]:
            place = np.concatenate([fixed, unknowns.reshape(-1, d)])
            gap = place[self.first] - place[self.second]
            length = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
            unit = gap / length[:, None]
            values = np.concatenate([unit, -unit], axis=1).ravel()[kept] / _SIGMA
            off = -pressure * unknowns[above]
            entries = np.concatenate([values, np.full(len(above), pressure)])
            residual = np.concatenate([(self.distance - length) / _SIGMA, off])
            return residual, csr_array((entries, (row, column)), shape=(m + len(above), free))

        return at

    def states(self, place: Array, known: Array) -> Array:
        """States (n, 3): every rig laid onto its points; one point alone says no heading."""
        units = self.units
        whole = units.fixed + units.places
        state = np.nan_to_num(known)
        state[:whole, :2] = place[:whole]
        for unit, rows in enumerate(self.rows, whole):
            if len(rows) > 1:
                state[unit] = rigid_alignment(self.body[rows], place[whole + rows])
            elif len(rows):
                state[unit, :2] = place[whole + rows[0]] - self.body[rows[0]]
        return state
