"""The laser frame put into the GTV frame by surveyed stops."""

from dataclasses import dataclass

import numpy as np

from laser_gt.placing.graph import GraphSolution
from laser_gt.scans.planar import CONTRADICTION, between, compose, compose_jacobians, wrapped
from validation.poses.angles import Array

HELD = 1e6
"""Factor on the information of a mount that is held: it moves by a millionth of what the survey
would have it."""


@dataclass(frozen=True)
class Placement:
    """Robot poses in the GTV frame.

    Parameters
    ----------
    poses : (n, 3) array
        x, y, theta.
    joint : (3n, 3n) array
        Joint covariance.
    frame : (3,) array
        Frame of the graph's first anchor in the GTV frame.
    """

    poses: Array
    joint: Array
    frame: Array


def place(
    solution: GraphSolution, anchors: list[int], surveyed: Array, covariance: Array
) -> Placement:
    """The poses of a graph, moved rigidly so that its anchors fit their surveyed poses best.

    Parameters
    ----------
    solution : GraphSolution
        Poses in any frame; its own surveyed stop must have had a negligible covariance.
    anchors : list of int
        Stops with surveyed poses. One: the document's reference stop. Several share the errors
        of their survey; the shape of the trajectory remains the laser's alone.
    surveyed : (p, 3) array
        Their poses in the GTV frame.
    covariance : (3p, 3p) array
        Joint covariance of those poses.

    Notes
    -----
    Weighted least squares in the three numbers of the motion T and, with its stated covariance,
    in an error of the mount: a mount turned by half a milliradian turns every heading by that
    against the positions, and all surveyed headings together show it. The weights are the anchors'
    own variances: errors that all surveyed poses share are errors of the GTV frame itself, and
    weights that try to make use of the correlations move the trajectory away from the survey's
    middle. A mount that would have to be off by more than its stated covariance allows stays as it
    is stated: that it is wrong must show.

    The covariance comes from the whole joint ones: with B the derivatives of the poses by T and
    the mount, and the estimator G (survey - graph), it is
    (B G) S (B G)' + (J - B G J) C (J - B G J)', C being that of the graph with its mount.
    """
    mount_information: Array = np.asarray(np.linalg.inv(solution.covariance[-3:, -3:]))
    placement, mount = _fitted(solution, anchors, surveyed, covariance, mount_information)
    if mount @ mount_information @ mount > CONTRADICTION:
        held = mount_information * HELD
        placement, _ = _fitted(solution, anchors, surveyed, covariance, held)
    return placement


def _fitted(
    solution: GraphSolution, anchors: list[int], surveyed: Array, covariance: Array, known: Array
) -> tuple[Placement, Array]:
    """The placement and the error of the mount, (3,), with the information on it that is known."""
    n = len(solution.poses)
    flat = (3 * np.array(anchors)[:, None] + np.arange(3)).ravel()
    graph_covariance = solution.covariance[: 3 * n, : 3 * n]
    by_mount = solution.covariance[: 3 * n, -3:] @ np.linalg.inv(solution.covariance[-3:, -3:])
    prior = np.zeros((6, 6))
    prior[3:, 3:] = known
    frame = compose(surveyed[0], between(solution.poses[anchors[0]], np.zeros(3)))
    mount = np.zeros(3)
    for _ in range(10):
        shape = solution.poses + (by_mount @ mount).reshape(n, 3)
        by_frame, by_pose = compose_jacobians(np.broadcast_to(frame, (n, 3)), shape)
        turned = _block_diagonal(by_pose)
        lever = np.hstack([by_frame.reshape(3 * n, 3), turned @ by_mount])
        difference = wrapped(surveyed - compose(frame, shape[anchors]))
        weighted = lever[flat].T / np.diagonal(covariance)
        solver = np.linalg.inv(weighted @ lever[flat] + prior)
        step = solver @ (weighted @ difference.ravel() - prior[:, 3:] @ mount)
        frame, mount = frame + step[:3], mount + step[3:]
        if np.abs(step).max() < 1e-12:
            break
    shape = solution.poses + (by_mount @ mount).reshape(n, 3)
    from_survey = lever @ solver @ weighted
    from_graph = turned - from_survey @ turned[flat]
    joint = from_survey @ covariance @ from_survey.T + from_graph @ graph_covariance @ from_graph.T
    return Placement(compose(frame, shape), (joint + joint.T) / 2, frame), mount


def _block_diagonal(blocks: Array) -> Array:
    """(3n, 3n) matrix of (n, 3, 3) blocks."""
    n = len(blocks)
    result = np.zeros((n, 3, n, 3))
    result[np.arange(n), :, np.arange(n), :] = blocks
    return result.reshape(3 * n, 3 * n)
