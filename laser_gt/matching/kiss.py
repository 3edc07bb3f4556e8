"""kiss-icp on planar scans: registration of two, and odometry along a series.

The library works on points in space; scans are padded to z = 0. Its defaults are made for cars:
the voxel must be 0.1 to 0.3 m indoors. It does not report that two scans hardly overlap; that is
checked here. Nor does it report bad points, but a scan holds only finite ones.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from laser_gt.matching.search import SearchSettings, global_match
from laser_gt.scans.evidence import Prepared, evidence
from laser_gt.scans.planar import compose, rotation
from validation.poses.angles import Array

VOXEL = 0.1
"""Edge of a cell of the library's map in metres: the finest of what it takes indoors, where walls
are seen from near."""
RECOVERY_WINDOW = 8.0
"""Half width of the search in metres where the track is lost: how far apart two stops in a row may
be. A judgement: the length of a room."""
LOST = 0.4
"""Less explained share than this, violations taken off, between two scans in a row means that the
track is lost. A judgement: a little less than the 0.45 from which on a match is accepted."""


def _spatial(points: Array) -> Array:
    """(n, 3) points at z = 0, from (n, 2)."""
    return np.column_stack([points, np.zeros(len(points))])


def _matrix(pose: Array) -> Array:
    """(4, 4) homogeneous matrix of a planar pose, the form the library takes."""
    matrix = np.eye(4)
    matrix[:2, :2] = rotation(pose[2])
    matrix[:2, 3] = pose[:2]
    return matrix


def _planar(matrix: Array) -> Array:
    """(3,) planar pose of a homogeneous matrix."""
    return np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])


def register(
    reference: Prepared, moving: Prepared, guess: npt.ArrayLike, reach: float = 0.5
) -> Array:
    """Pose of a sweep in the frame of another by kiss-icp's point-to-point registration.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array_like
        Start.
    reach : float
        Largest distance of a correspondence, metres.

    Returns
    -------
    (3,) array
        Moving frame in the reference frame. Whether it is right must be judged.
    """
    from kiss_icp.config.parser import load_config  # noqa: PLC0415  (loaded when used)
    from kiss_icp.mapping import get_voxel_hash_map  # noqa: PLC0415
    from kiss_icp.registration import get_registration  # noqa: PLC0415

    config = load_config(None)
    config.mapping.voxel_size = VOXEL
    config.registration.max_num_threads = 1
    grid = get_voxel_hash_map(config)
    grid.add_points(_spatial(reference.sweep.points))
    pose = get_registration(config).align_points_to_map(
        _spatial(moving.sweep.points),
        grid,
        _matrix(np.asarray(guess, dtype=float)),
        reach,
        reach / 3,
    )
    return _planar(pose)


def chain(sweeps: Sequence[Prepared]) -> tuple[Array, list[int]]:
    """The trajectory of a series of sweeps, each matched to the one before.

    Parameters
    ----------
    sweeps : sequence of Prepared
        In the order taken. Between stops metres and half turns apart, kiss-icp loses the track;
        the evidence shows it, and a global search finds the way on.

    Returns
    -------
    poses : (n, 3) array
        Sweep frames in the frame of the first.
    doubtful : list of int
        Sweeps that neither could place with confidence.
    """
    poses, doubtful = [np.zeros(3)], []
    step = np.zeros(3)
    for number, (before, after) in enumerate(pairwise(sweeps), 1):
        expected = step
        step = found = register(before, after, expected)
        seen = evidence(before, after, found)
        if seen.explained[0] - seen.violating[0] < LOST:
            wide = global_match(before, after, expected, SearchSettings(window=RECOVERY_WINDOW))
            if wide.evidence.score[wide.order[0]] > seen.score[0]:
                found, step = wide.pose, np.zeros(3)
            seen = evidence(before, after, found)
            if seen.explained[0] - seen.violating[0] < LOST:
                doubtful.append(number)
        poses.append(compose(poses[-1], found))
    return np.array(poses), doubtful
