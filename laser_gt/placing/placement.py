"""The laser frame put into the GTV frame by surveyed stops."""

from dataclasses import dataclass

import numpy as np

from laser_gt.placing.graph import GraphSolution
from laser_gt.scans.planar import CONTRADICTION, compose, compose_jacobians, inverse, wrapped
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array
from validation.poses.factored import Factored

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
    covariance : Factored
        Of all poses together.
    frames : (g, 3) array
        Frame of each part of the graph in the GTV frame.
    by : (3n, 3g + 3) array
        How the poses follow the frames and the error of the mount.
    of : (3g + 3, 3p) array
        How these follow the anchors' surveyed poses.
    """

    poses: Array
    covariance: Factored
    frames: Array
    by: Array
    of: Array

    @property
    def joint(self) -> Array:
        """(3n, 3n) covariance of all poses together: of few poses, it is a matrix of all."""
        return self.covariance.matrix()

    @property
    def sigmas(self) -> Array:
        """(n, 3) standard deviations."""
        return np.sqrt(np.diagonal(self.covariance.blocks, axis1=1, axis2=2))


def place(
    solution: GraphSolution,
    anchors: list[int],
    surveyed: Array,
    covariance: Factored,
    parts: Indices | None = None,
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
    covariance : Factored
        Of those poses.
    parts : (n,) int array, optional
        The part of the graph, from 0 on, that each stop belongs to. Each has a surveyed stop, and a
        frame of its own; the mount and the survey are common to all. One if not given.

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
    (B G) S (B G)' + (J - B G J) C (J - B G J)', C being that of the graph with its mount: what
    each stop has alone, a sparse inverse, and few columns (`Factored`).
    """
    mount_information: Array = np.asarray(np.linalg.inv(solution.spread.mount))
    parts = np.zeros(len(solution.poses), dtype=np.intp) if parts is None else parts
    known = (solution, anchors, surveyed, covariance, parts)
    placement, mount = _fitted(*known, mount_information)
    if mount @ mount_information @ mount > CONTRADICTION:
        held = mount_information * HELD
        placement, _ = _fitted(*known, held)
    return placement


def _fitted(
    solution: GraphSolution,
    anchors: list[int],
    surveyed: Array,
    covariance: Factored,
    parts: Indices,
    known: Array,
) -> tuple[Placement, Array]:
    """The placement and the error of the mount, (3,), with the information on it that is known."""
    n = len(solution.poses)
    flat = (3 * np.array(anchors)[:, None] + np.arange(3)).ravel()
    by_mount = solution.spread.by_mount
    variances = np.diagonal(covariance.blocks, axis1=1, axis2=2).ravel()
    count = int(parts.max()) + 1
    first = [int(np.flatnonzero(parts[anchors] == part)[0]) for part in range(count)]
    prior = np.zeros((3 * count + 3, 3 * count + 3))
    prior[-3:, -3:] = known
    origins = solution.poses[np.array(anchors)[first]]
    frames = compose(surveyed[first], inverse(origins))
    mount = np.zeros(3)
    for _ in range(10):
        shape = solution.poses + (by_mount @ mount).reshape(n, 3)
        by_frame, by_pose = compose_jacobians(frames[parts], shape)
        turned = (by_pose @ by_mount.reshape(n, 3, 3)).reshape(3 * n, 3)
        by_frames = np.zeros((n, 3, count, 3))
        by_frames[np.arange(n), :, parts] = by_frame
        lever = np.hstack([by_frames.reshape(3 * n, 3 * count), turned])
        difference = wrapped(surveyed - compose(frames[parts], shape)[anchors])
        weighted = lever[flat].T / variances
        solver = np.linalg.inv(weighted @ lever[flat] + prior)
        step = solver @ (weighted @ difference.ravel() - prior[:, -3:] @ mount)
        frames, mount = frames + step[:-3].reshape(count, 3), mount + step[-3:]
        if np.abs(step).max() < 1e-12:
            break
    shape = solution.poses + (by_mount @ mount).reshape(n, 3)
    of = solver @ weighted
    of_mount = np.linalg.cholesky(solution.spread.mount)
    of_graph = solution.spread.for_known_mount(by_pose).with_columns(turned @ of_mount)
    joint = of_graph.without(lever, of, flat, n).more(lever, of, covariance)
    return Placement(compose(frames[parts], shape), joint, frames, lever, of), mount
