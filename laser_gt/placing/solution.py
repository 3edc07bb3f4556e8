"""Robot poses in the GTV frame, from accepted matches and surveyed stops."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.placing.anchors import Surveyed, edges_of
from laser_gt.placing.engines import Matching
from laser_gt.placing.graph import Edge, Graph, GraphSolution, ends_of, solve_graph
from laser_gt.placing.pairs import connected_stops
from laser_gt.placing.placement import Placement, place
from laser_gt.scans.planar import between, compose, inverse
from laser_gt.scans.scan import Flags
from validation.errors import GtvalError
from validation.poses.angles import Array

GAUGE = 1e-12
"""Variance with which a graph is held at its first anchor: a micrometre and a microradian, a
thousandth of any error that counts, and far enough from zero for the equations to be solved."""


@dataclass(frozen=True)
class LaserSolution:
    """Robot poses by one engine.

    Parameters
    ----------
    matching : Matching
        The matches.
    graph : GraphSolution
        Shape of the trajectory.
    placement : Placement
        Poses in the GTV frame of the stops in ``stops``.
    stops : tuple of str
        Stops with a pose: connected with an anchor.
    lost : tuple of str
        Stops without.
    anchors : tuple of str
        Surveyed stops that placed the laser frame.
    """

    matching: Matching
    graph: GraphSolution
    placement: Placement
    stops: tuple[str, ...]
    lost: tuple[str, ...]
    anchors: tuple[str, ...]


def solve(
    stops: Sequence[str],
    mount: Array,
    mount_sigmas: Array,
    trajectory: Array,
    matching: Matching,
    surveyed: Surveyed,
) -> LaserSolution:
    """Robot poses in the GTV frame.

    Parameters
    ----------
    stops : sequence of str
        All that were scanned.
    mount, mount_sigmas : (3,) arrays
        Laser frame in the robot frame, and how well it was measured.
    trajectory : (n, 3) array
        Initial guess of the laser frames.
    matching : Matching
        What was matched.
    surveyed : Surveyed
        Poses of the reference stops.

    Raises
    ------
    GtvalError
        If no accepted match reaches a reference stop.
    """
    root, reached = _reached(stops, edges_of(stops, matching.matches), surveyed.stops)
    kept = [stop for stop, there in zip(stops, reached, strict=True) if there]
    edges = edges_of(kept, matching.matches)
    start = kept.index(stops[root])
    robot = compose(compose(mount, trajectory[reached]), inverse(mount))
    solution = solve_graph(
        Graph(
            initial=_spanning(between(robot[start], robot), edges, start, mount),
            mount=mount,
            edges=edges,
            prior_stops=[start],
            prior_poses=np.zeros((1, 3)),
            prior_covariance=np.eye(3) * GAUGE,
            mount_covariance=np.diag(mount_sigmas**2),
        )
    )
    known = surveyed.select([stop for stop in surveyed.stops if stop in kept])
    placement = place(
        solution, [kept.index(stop) for stop in known.stops], known.poses, known.joint
    )
    lost = tuple(stop for stop in stops if stop not in kept)
    return LaserSolution(matching, solution, placement, tuple(kept), lost, known.stops)


def _reached(
    stops: Sequence[str], edges: Sequence[Edge], anchors: Sequence[str]
) -> tuple[int, Flags]:
    """The anchor whose connected part of the graph is the largest, and that part."""
    parts = {
        root: connected_stops(len(stops), ends_of(edges), [root])
        for root in (stops.index(anchor) for anchor in anchors if anchor in stops)
    }
    root = max(parts, key=lambda stop: int(parts[stop].sum()), default=None)
    if root is None or parts[root].sum() < 2:
        raise GtvalError(
            "no accepted match reaches a surveyed stop; look at the matches with "
            "`gtval laser inspect` and decide on some, or survey more stops"
        )
    return root, parts[root]


def _spanning(robot: Array, edges: Sequence[Edge], start: int, mount: Array) -> Array:
    """First poses by following the most certain matches out from the start."""
    poses = robot.copy()
    poses[start] = 0.0
    known = {start}
    waiting = sorted(edges, key=lambda edge: float(np.trace(edge.covariance)))
    while True:
        for edge in waiting:
            if (edge.start in known) != (edge.end in known):
                step = compose(compose(mount, edge.pose), inverse(mount))
                if edge.start in known:
                    poses[edge.end] = compose(poses[edge.start], step)
                else:
                    poses[edge.start] = compose(poses[edge.end], inverse(step))
                known |= {edge.start, edge.end}
                break
        else:
            return poses
