"""Poses of the stops: which is chosen, and the tables of them."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from vision_gt.campaign.outcome import StopPose
from vision_gt.network.adjustment import Network
from vision_gt.optics.transforms import mean_transform, planar_pose
from vision_gt.robot.layout import Layout
from vision_gt.robot.robot_pose import (
    Floor,
    RobotPose,
    Sighting,
    best_of,
    joint_covariance,
    robot_pose,
)

SYSTEM_NAME = "vision"
PUBLISHED_NAME = "vision_as_published"


def counting(name: str) -> tuple[int, str]:
    """Sort key by which '10' comes after '9'."""
    return (int(name), "") if name.isdigit() else (1 << 60, name)


def chosen_pose(
    sightings: Sequence[Sighting],
    by_camera: Mapping[str, RobotPose],
    merge: bool,
    network: Network,
    layout: Layout,
    floor: Floor | None,
) -> RobotPose | None:
    """The pose of a stop: all cameras merged, or the best camera's."""
    if merge and len(by_camera) > 1:
        merged = robot_pose(sightings, network, layout, floor)
        return None if merged is None or merged.ambiguous else merged
    best = best_of(by_camera)
    return None if best is None else by_camera[best]


def pose_table(stops: Sequence[StopPose], network: Network, layout: Layout) -> PoseTable | None:
    """The sure poses, with their joint covariance."""
    known = [(stop.pose, stop.chosen) for stop in stops if stop.chosen is not None]
    if not known:
        return None
    poses = [pose for _, pose in known]
    planar = [pose.planar for pose in poses]
    return PoseTable(
        SYSTEM_NAME,
        tuple(name for name, _ in known),
        np.array([pose for pose, _ in planar]),
        np.array([covariance for _, covariance in planar]),
        sources=tuple("camera " + "+".join(pose.cameras) for pose in poses),
        joint=joint_covariance(poses, network, layout),
    )


def published_table(
    by_pose: Mapping[str, Sequence[tuple[str, RigidTransform]]],
) -> PoseTable | None:
    """Poses the document's way; cameras that saw the same stop averaged as it did."""
    if not by_pose:
        return None
    names = sorted(by_pose, key=counting)
    poses: list[Array] = [
        planar_pose(mean_transform(RigidTransform.concatenate([T for _, T in by_pose[name]])))
        for name in names
    ]
    return PoseTable(
        PUBLISHED_NAME,
        tuple(names),
        np.array(poses),
        sources=tuple("camera " + "+".join(c for c, _ in by_pose[name]) for name in names),
    )
