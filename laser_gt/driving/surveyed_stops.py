"""Surveyed stops of a drive against the shape that scans and odometry give without them."""

from dataclasses import replace

import numpy as np

from laser_gt.driving.closing import closed
from laser_gt.driving.graph import DriveGraph, DrivePoses, joint_covariance, solve_drive
from laser_gt.driving.log import Report
from laser_gt.driving.way import Way
from laser_gt.placing.survey_check import (
    Shape,
    SurveyDoubt,
    contradiction,
    survey_doubt,
    with_mount,
)
from laser_gt.scans.planar import compose, compose_jacobians, inverse
from validation.poses.angles import Array
from validation.poses.factored import Factored

TOO_MANY = 0.1
"""Share of the matches that odometry contradicts, from which on the shape itself is doubted: of
right drives one in a hundred is switched off, with a mount off by 5 cm 40 of a hundred."""
STIFF = 1e-12
"""Covariance of a mount that is taken as known: a micrometre and a microradian squared."""


def held_by_stops(
    tracked: Way, graph: DriveGraph, solved: DrivePoses, workers: int, report: Report
) -> tuple[Way, DriveGraph, DrivePoses, SurveyDoubt | None]:
    """The solved drive held by its surveyed stops, without those that the others contradict.

    Stops that are off bend the drive until matches seem wrong. Where they contradict the shape of
    the drive, it is solved with the first of them alone, and what is wrong is looked for in that.
    A stop that is off, or two that are exchanged, are then left out if another one is left.
    """
    if len(graph.anchors) < 2:
        return tracked, graph, solved, None
    shape, surveyed, covariance = _shape(graph, replace(graph, anchors=()))
    if not contradiction(shape, surveyed, covariance)[2]:
        return tracked, graph, solved, None
    names = [stop.name for stop in tracked.inputs.stops if stop.name in tracked.nodes]
    alone, by_first = closed(_without(tracked, names[1:]), workers, report)
    free = replace(alone, anchors=())
    shape, surveyed, covariance = _shape(replace(graph, initial=alone.initial), free)
    doubt = survey_doubt(names, shape, surveyed, covariance)
    if doubt is not None and (by_first.weights < 0.5).mean() > TOO_MANY:
        doubt = with_mount(doubt)
    if doubt is not None:
        doubt = replace(doubt, assumed=any(stop.assumed for stop in tracked.inputs.stops))
    if doubt is None or doubt.kind not in {"stop", "exchanged"}:
        return tracked, graph, solved, doubt
    if len(doubt.stops) == len(names):
        return tracked, graph, solved, doubt
    fewer = _without(tracked, doubt.stops)
    return fewer, *closed(fewer, workers, report), doubt


def _without(tracked: Way, stops: tuple[str, ...] | list[str]) -> Way:
    """The way without some surveyed stops."""
    nodes = {name: node for name, node in tracked.nodes.items() if name not in stops}
    return replace(tracked, nodes=nodes)


def _shape(graph: DriveGraph, free: DriveGraph) -> tuple[Shape, Array, Factored]:
    """The robot at the anchors of a graph as a free one has it, and its surveyed poses there."""
    stiff = replace(free, mount_covariance=STIFF * np.eye(3))
    solved = solve_drive(stiff)
    nodes = np.array([one.node for one in graph.anchors], dtype=np.intp)
    mount, poses = solved.mount, solved.poses[nodes]
    back = np.broadcast_to(inverse(mount), poses.shape)
    by_laser, _ = compose_jacobians(poses, back)
    laser = joint_covariance(stiff, solved, max(solved.misfit, 1.0), nodes)
    spread = Factored.of_matrix(laser, 3).turned(by_laser)
    shape = Shape(compose(poses, back), spread, mount, graph.mount_covariance)
    surveyed = np.array([one.pose for one in graph.anchors])
    own = Factored.alone(np.array([one.covariance for one in graph.anchors]))
    return shape, surveyed, own
