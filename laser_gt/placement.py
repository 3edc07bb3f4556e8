"""The laser frame put into the GTV frame by surveyed stops."""

from dataclasses import dataclass

import numpy as np

from laser_gt.graph import GraphSolution
from laser_gt.planar import between, compose, compose_jacobians
from validation.angles import Array, wrap


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
    Weighted least squares in the three numbers of the motion T, with the anchors' own variances
    as weights: errors that all surveyed poses share are errors of the GTV frame itself, and
    weights that try to make use of the correlations move the trajectory away from the survey's
    middle. The covariance comes from the whole joint one: with the estimator
    T = G (survey - graph), the poses T L have the covariance
    (J_T G) S (J_T G)' + (J_L - J_T G J_L) C (J_L - J_T G J_L)'.
    """
    n = len(solution.poses)
    flat = (3 * np.array(anchors)[:, None] + np.arange(3)).ravel()
    graph_covariance = solution.covariance[: 3 * n, : 3 * n]
    frame = compose(surveyed[0], between(solution.poses[anchors[0]], np.zeros(3)))
    for _ in range(10):
        by_frame, by_pose = compose_jacobians(np.broadcast_to(frame, (n, 3)), solution.poses)
        lever = by_frame.reshape(3 * n, 3)
        turned = _block_diagonal(by_pose)
        difference = surveyed - compose(frame, solution.poses[anchors])
        difference[:, 2] = wrap(difference[:, 2])
        weighted = lever[flat].T / np.diagonal(covariance)
        gain = np.linalg.solve(weighted @ lever[flat], weighted)
        step = gain @ difference.ravel()
        frame = frame + step
        if np.abs(step).max() < 1e-12:
            break
    from_survey = lever @ gain
    from_graph = turned - from_survey @ turned[flat]
    joint = from_survey @ covariance @ from_survey.T + from_graph @ graph_covariance @ from_graph.T
    return Placement(compose(frame, solution.poses), (joint + joint.T) / 2, frame)


def _block_diagonal(blocks: Array) -> Array:
    """(3n, 3n) matrix of (n, 3, 3) blocks."""
    n = len(blocks)
    result = np.zeros((n, 3, n, 3))
    result[np.arange(n), :, np.arange(n), :] = blocks
    return result.reshape(3 * n, 3 * n)
