"""Tables of the poses, from what the vision system made of a campaign."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.poses.joint import LARGEST_WHOLE
from validation.poses.pose_table import PoseTable
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.optics.transforms import mean_transform, planar_pose
from vision_gt.robot.robot_pose import joint_covariance, joint_factor

SYSTEM_NAME = "vision"
PUBLISHED_NAME = "vision_as_published"


def pose_tables(outcome: VisionOutcome) -> list[PoseTable]:
    """The sure poses with their joint covariance, and those by the document's way.

    A table without poses is left out. By the document's way, what cameras say of the same stop
    is averaged.
    """
    tables = []
    known = [(stop.pose, stop.chosen) for stop in outcome.stops if stop.chosen is not None]
    if known:
        poses = [pose for _, pose in known]
        planar = [pose.planar for pose in poses]
        shared = (poses, outcome.network.network, outcome.layout.layout)
        large = 3 * len(poses) > LARGEST_WHOLE
        tables.append(
            PoseTable(
                SYSTEM_NAME,
                tuple(name for name, _ in known),
                np.array([pose for pose, _ in planar]),
                np.array([covariance for _, covariance in planar]),
                sources=tuple(_source(pose.cameras) for pose in poses),
                joint=None if large else joint_covariance(*shared),
                factor=joint_factor(*shared) if large else None,
            )
        )
    if outcome.published:
        stacks = [
            RigidTransform.concatenate([T for _, T in seen]) for seen in outcome.published.values()
        ]
        tables.append(
            PoseTable(
                PUBLISHED_NAME,
                tuple(outcome.published),
                np.array([planar_pose(mean_transform(stack)) for stack in stacks]),
                sources=tuple(_source([c for c, _ in s]) for s in outcome.published.values()),
            )
        )
    return tables


def _source(cameras: Sequence[str]) -> str:
    return "camera " + "+".join(cameras)
