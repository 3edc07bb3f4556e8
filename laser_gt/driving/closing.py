"""The keyframes of a way with links and loops between them, solved as one graph."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from laser_gt.driving.graph import Anchor, DriveGraph, DrivePoses, solve_drive
from laser_gt.driving.links import Asked, Link, matched_links
from laser_gt.driving.log import Report
from laser_gt.driving.places import loop_candidates, uncertainty
from laser_gt.driving.tracking import GUESS_SIGMAS
from laser_gt.driving.way import Way
from laser_gt.scans.planar import between, compose, compose_jacobians, inverse
from laser_gt.scans.scan import Flags, Sweep
from validation.poses.angles import Array

BACK = (1, 2, 4)
"""Keyframes back that each is matched with. A judgement: each link is there twice over, once by
others that are its sum, so that the noise of links can be told from that of scans."""
ROUNDS = 4
"""Bound on the rounds of loops; each is sought from the poses that the loops before it leave."""


def closed(tracked: Way, workers: int, report: Report) -> tuple[DriveGraph, DrivePoses]:
    """The keyframes with their links and loops, solved."""
    found, keys = tracked.track, tracked.track.keyframes
    sweeps = [tracked.sweeps[number] for number in keys]
    poses = found.poses[keys]
    chain = [
        Asked(number - back, number, between(poses[number - back], poses[number]))
        for number in range(1, len(keys))
        for back in BACK
        if back <= number
    ]
    links = matched_links(
        sweeps, chain, workers, lambda share: report("links", 0.4 + 0.15 * share), judged=False
    )
    graph = DriveGraph(
        initial=poses,
        mount=tracked.mount,
        mount_covariance=np.diag(tracked.inputs.mount_sigmas**2),
        links=links,
        steps=_guessed(tracked),
        anchors=_anchors(tracked),
        motions=_motions(tracked),
    )
    graph = replace(graph, initial=_first_poses(graph))
    solved = solve_drive(graph)
    have: set[tuple[int, int]] = set()
    widest = max(_field(sweep) for sweep in sweeps[:20])
    for turn in range(ROUNDS):
        believed = [
            one for one, good in zip(graph.links, solved.weights > 0.5, strict=True) if good
        ]
        sigmas = uncertainty(len(keys), believed, [*graph.steps, *graph.motions])
        asked = loop_candidates(solved.poses, sigmas, have, widest, most=2)
        if turn == 0:
            asked = [one for one in asked if one.end % 3 == 0]
        if not asked:
            break
        have |= {(one.start, one.end) for one in asked}
        more = matched_links(sweeps, asked, workers, _part(report, turn), judged=True)
        graph = replace(graph, links=[*graph.links, *more], initial=solved.poses)
        solved = solve_drive(graph)
    return replace(graph, initial=solved.poses), solved


def _part(report: Report, turn: int) -> Callable[[float], None]:
    """Progress of a round of loops."""
    return lambda share: report("loops", 0.55 + 0.2 * (turn + share) / ROUNDS)


def _field(sweep: Sweep) -> float:
    """Field of view of a sweep in radians, all of its scanners together."""
    total = sum(float(np.ptp(view.scan.angles)) for view in sweep.views)
    return min(total, 2 * np.pi)


def _by_odometry(tracked: Way) -> Flags:
    """(k-1,) whether odometry knows the motion from each keyframe to the next."""
    times = tracked.times[tracked.track.keyframes]
    if tracked.odometer is None:
        return np.zeros(len(times) - 1, dtype=bool)
    known = tracked.odometer.known(times)
    return np.asarray(known[:-1] & known[1:])


def _guessed(tracked: Way) -> list[Link]:
    """Motions of the laser frame as they were tracked, where there is no odometry."""
    keys = tracked.track.poses[tracked.track.keyframes]
    information = np.diag(1 / GUESS_SIGMAS**2)
    return [
        Link(number, number + 1, between(keys[number], keys[number + 1]), information, sure=True)
        for number in np.flatnonzero(~_by_odometry(tracked)).tolist()
    ]


def _motions(tracked: Way) -> list[Link]:
    """Motions of the robot from keyframe to keyframe by odometry."""
    if tracked.odometer is None:
        return []
    robot = tracked.odometer.at(tracked.times[tracked.track.keyframes])
    steps = between(robot[:-1], robot[1:])
    information = np.linalg.inv(tracked.odometer.covariance(steps))
    return [
        Link(number, number + 1, steps[number], information[number])
        for number in np.flatnonzero(_by_odometry(tracked)).tolist()
    ]


def through_mount(steps: Array, mount: Array, covariances: Array) -> Array:
    """(m, 3, 3) covariances of motions of the laser frame from those of the robot."""
    back = inverse(mount)
    _, by_step = compose_jacobians(np.broadcast_to(back, steps.shape), steps)
    by_first, _ = compose_jacobians(compose(back, steps), np.broadcast_to(mount, steps.shape))
    jacobian = by_first @ by_step
    return np.asarray(jacobian @ covariances @ np.swapaxes(jacobian, -1, -2))


def _anchors(tracked: Way) -> list[Anchor]:
    """Surveyed stops as anchors of keyframes."""
    place = {number: node for node, number in enumerate(tracked.track.keyframes.tolist())}
    return [
        Anchor(place[tracked.nodes[stop.name]], stop.pose, stop.covariance)
        for stop in tracked.inputs.stops
        if stop.name in tracked.nodes
    ]


def _first_poses(graph: DriveGraph) -> Array:
    """The tracked poses, moved to where the first surveyed stop, or the origin, is."""
    if not graph.anchors:
        return compose(graph.mount, between(graph.initial[0], graph.initial))
    anchor = graph.anchors[0]
    there = compose(anchor.pose, graph.mount)
    return compose(there, between(graph.initial[anchor.node], graph.initial))
