"""How badly each reading fits where most of them agree, and how it would fit elsewhere."""

import numpy as np

from survey.causes.lead import Log
from survey.causes.linear import Linear
from survey.causes.trial import Rows, Trial
from survey.readings.point_names import robot_point
from validation.poses.angles import Array

WORTH = 15.0
"""Decrease of the misfit from which exchanged names are tried: less than any exchange costs."""
MOST_OF_A_KIND = 6
"""Hypotheses of one kind that are solved: the linearised survey orders them well enough."""
FAR = 4.0
"""Standardised misfit from which a single reading may have been exchanged with another."""
CAPPED = 1e8
"""Squared misfit beyond which a reading is no worse: 20 m at a sigma of 2 mm."""


class Look:
    """Distances between all points at the robust solution, and how badly the readings fit them."""

    def __init__(self, trial: Trial, linear: Linear, log: Log) -> None:
        self.trial, self.log = trial, log
        self.net, self.at = trial.network, linear.fit.at
        n = len(self.net.distance)
        # The true misfit of a reading is what the others say of it.
        self.misfit = linear.at_start[:n] * trial.used[:n]
        self.stations = log.groups(log.station)
        self.station_of = [(robot_point(name) or (name,))[0] for name in self.net.points]

    def rows_of_marks(self) -> list[Rows]:
        """Distances that end at each mark, in the order read."""
        order, net = self.log.order, self.net
        ends = np.concatenate([net.first[order], net.second[order]])
        once = np.tile(order, 2)
        rank = np.tile(np.arange(len(order)), 2)
        sort = np.lexsort([rank, ends])
        first = np.searchsorted(ends[sort], net.mark, "left")
        last = np.searchsorted(ends[sort], net.mark, "right")
        return [once[sort[a:b]] for a, b in zip(first, last, strict=True)]

    def cost_of(self, rows: Rows, first: Array, second: Array) -> Array:
        """(r,) squared standardised misfit of distances, were they between these places (r, 2)."""
        off = self.net.distance[rows] - np.linalg.norm(first - second, axis=-1)
        return np.asarray((off / self.net.sigma[rows]) ** 2)

    def here_and_there(self, station: str, rows: Rows) -> tuple[Rows, Rows]:
        """Ends of readings at a station, and their targets."""
        a, b = self.net.first[rows], self.net.second[rows]
        own = np.array([self.station_of[i] == station for i in a])
        return np.where(own, a, b), np.where(own, b, a)
