"""Simulated campaigns whose causes of error are known."""

import numpy as np

from validation.poses.pose_table import PoseTable

FRAME = np.array([0.04, 0.05, -0.01])
MOUNT = np.array([0.06, -0.04, 0.01])
SCALE = 0.01
SURVEY_NOISE = np.array([0.008, 0.008, 0.006])
GT_NOISE = np.array([0.01, 0.01, 0.006])


def matrix(pose):
    """3x3 homogeneous matrices of poses: an oracle apart from the code's complex numbers."""
    pose = np.asarray(pose, dtype=float)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, -s, pose[..., 0]], [s, c, pose[..., 1]], [zero, zero, one]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def pose(matrices):
    """Poses of homogeneous matrices."""
    theta = np.arctan2(matrices[..., 1, 0], matrices[..., 0, 0])
    return np.stack([matrices[..., 0, 2], matrices[..., 1, 2], theta], -1)


def random_stops(rng, n):
    """Stops all over a room, at all headings."""
    return np.column_stack(
        [rng.uniform(-2, 3, n), rng.uniform(-2, 5, n), rng.uniform(-np.pi, np.pi, n)]
    )


def spoiled(kind, truth, survey):
    """GT poses of a system with the named fault: correcting it with FRAME, MOUNT, SCALE heals."""
    true, inverse = matrix(truth), np.linalg.inv
    frame, mount = matrix(FRAME), matrix(MOUNT)
    if kind == "none":
        return truth.copy()
    if kind == "frame":
        return pose(inverse(frame) @ true)
    if kind == "mount":
        return pose(true @ mount)
    if kind == "frame_mount":
        return pose(inverse(frame) @ true @ mount)
    if kind == "scale":
        return np.column_stack([truth[:, :2] / (1 + SCALE), truth[:, 2]])
    # The scans are aligned to stop 6's; its surveyed pose ties them to the GTV frame.
    reference = matrix(survey[5])
    wrong = mount if kind == "reference_mount" else np.eye(3)
    return pose(reference @ inverse(wrong) @ inverse(true[5]) @ true @ wrong)


def table(system, poses, noise=None):
    """A pose table with the ids 1, 2, ..."""
    n = len(poses)
    covariances = np.empty(0) if noise is None else np.tile(np.diag(noise**2), (n, 1, 1))
    return PoseTable(system, tuple(str(i + 1) for i in range(n)), poses, covariances)


def simulate(kind, seed, n=26, stated=True, stops=None, noise=1.0):
    """Validation and GT tables of one campaign; 'tied' and 'reference_mount' use stop 6.

    ``noise`` multiplies SURVEY_NOISE and GT_NOISE.
    """
    rng = np.random.default_rng(seed)
    truth = random_stops(rng, n) if stops is None else stops
    survey_noise, gt_noise = noise * SURVEY_NOISE, noise * GT_NOISE
    survey = truth + rng.normal(size=(n, 3)) * survey_noise
    gt = spoiled(kind, truth, survey) + rng.normal(size=(n, 3)) * gt_noise
    if kind in {"tied", "reference_mount"}:
        gt[5] = survey[5]
    return (
        table("survey", survey, survey_noise if stated else None),
        table("rig", gt, gt_noise if stated else None),
    )
