"""How badly each reading fits where most of them agree, and how it would fit elsewhere."""

from dataclasses import replace

import numpy as np

from survey.causes.lead import Log
from survey.causes.linear import Linear
from survey.causes.trial import Fit, Rows, Trial, length
from survey.estimation.network import Network
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
    """Distances between all points at the robust solution, and how badly the readings fit them.

    The readings in ``net`` are those without the common errors that the trial allows for.
    """

    def __init__(self, trial: Trial, linear: Linear, log: Log) -> None:
        self.trial, self.log = trial, log
        self.net, self.at = _freed(linear.fit), linear.fit.at
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
        apart = first - second
        off = self.net.distance[rows] - np.sqrt(apart[..., 0] ** 2 + apart[..., 1] ** 2)
        return np.asarray((off / self.net.sigma[rows]) ** 2)

    def here_and_there(self, station: str, rows: Rows) -> tuple[Rows, Rows]:
        """Ends of readings at a station, and their targets."""
        a, b = self.net.first[rows], self.net.second[rows]
        own = np.array([self.station_of[i] == station for i in a])
        return np.where(own, a, b), np.where(own, b, a)


def _freed(fit: Fit) -> Network:
    """The network with each common error taken out of its readings, the last one first."""
    net = fit.trial.network
    distance, sigma = net.distance.copy(), net.sigma.copy()
    for effect, b in reversed(list(zip(fit.trial.effects, fit.values, strict=True))):
        rows = effect.rows
        distance[rows], slope = length(effect.law, distance[rows], float(b))
        sigma[rows] *= slope
    return replace(net, distance=distance, sigma=sigma) if fit.trial.effects else net
