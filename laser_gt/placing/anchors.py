"""Surveyed stops: what places the laser frame, and what the mount is checked with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.matching.verdicts import Match
from laser_gt.placing.graph import Edge
from validation.poses.angles import Array
from validation.poses.factored import Factored


@dataclass(frozen=True)
class Surveyed:
    """Surveyed poses of some stops, in the GTV frame.

    Parameters
    ----------
    stops : tuple of str
        Their names.
    poses : (p, 3) array
        Robot poses.
    covariance : Factored
        Of all together.
    assumed : tuple of str
        Stops whose covariance was not stated but assumed.
    """

    stops: tuple[str, ...]
    poses: Array
    covariance: Factored
    assumed: tuple[str, ...] = ()

    def select(self, stops: Sequence[str]) -> "Surveyed":
        """Some of the stops, in that order."""
        where = {stop: row for row, stop in enumerate(self.stops)}
        rows = np.array([where[stop] for stop in stops], dtype=np.intp)
        assumed = tuple(stop for stop in stops if stop in self.assumed)
        return Surveyed(tuple(stops), self.poses[rows], self.covariance.select(rows), assumed)


def edges_of(stops: Sequence[str], matches: Sequence[Match]) -> list[Edge]:
    """Matches between some stops that are used, as edges of a graph: what the scans say alone."""
    where = {stop: number for number, stop in enumerate(stops)}
    return [
        edge_of(where, one)
        for one in matches
        if one.used and one.reference in where and one.moving in where
    ]


def edge_of(where: Mapping[str, int], one: Match) -> Edge:
    """A match as an edge between stops by their numbers."""
    pose, covariance = one.by_scans
    return Edge(where[one.reference], where[one.moving], pose, covariance, one.covariance)
