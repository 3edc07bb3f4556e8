"""Cameras that have each other's frames are named, others are not."""

import filmed_drives
import numpy as np
import pytest
from filmed_drives import FLOOR, true_and_known
from vision_scenes import seen_robot

from data_samples.motion.path import drive
from vision_gt.drive_campaign.exchanged import exchanges
from vision_gt.driving.stream import camera_stream
from vision_gt.optics.transforms import perturbed, planar_transform


@pytest.fixture(autouse=True)
def tilted(monkeypatch):
    """Cameras of one height that look down by 34, 39, 46 and 29 degrees."""
    aims = ((2.5, 2.0), (6.0, 1.5), (6.7, 4.8), (3.2, 3.6))
    monkeypatch.setattr(filmed_drives, "AIMS", aims)


def made(seed, moved=()):
    """Views of four cameras of a drive, and how a camera makes a stream of them."""
    rng = np.random.default_rng(seed)
    true, network, layout, known = true_and_known(rng, 4)
    path = drive(30.0, rng)
    seen = {}
    for i, T in enumerate(true):
        if str(i + 1) in moved:
            T = perturbed(T, np.array([0.0, 0.0, 0.1, 0.03, 0.03, 0.0]))  # noqa: PLW2901
        robots = [planar_transform(pose) for pose in path.at(np.arange(0.5, 30.0, 0.5))]
        near = [np.linalg.norm(T.translation - one.translation) < 7.0 for one in robots]
        seen[str(i + 1)] = [
            seen_robot(T, one, 0.2, rng, layout=layout).views if some else ()
            for one, some in zip(robots, near, strict=True)
        ]

    def pose(camera, views):
        return camera_stream(camera, np.arange(float(len(views))), views, network, known, FLOOR)

    return seen, pose


def found(seen, pose):
    return exchanges([pose(name, views) for name, views in seen.items()], seen, pose)


@pytest.mark.parametrize("seed", range(3))
def test_two_cameras_with_each_others_frames_are_named(seed):
    seen, pose = made(seed)
    assert found(seen, pose) == ()
    seen["1"], seen["3"] = seen["3"], seen["1"]
    (one,) = found(seen, pose)
    assert one.cameras == ("1", "3")
    assert sum(one.agree) > 0.9 * sum(one.tried)


def test_two_cameras_that_moved_are_not_exchanged():
    seen, pose = made(3, moved=("1", "3"))
    assert found(seen, pose) == ()
