"""The robot's pose from its six markers: medians of the position's error, and what was asked.

The camera looks down at 45 degrees; corners have normal noise. Camera and layout are exact, so
what is seen is what the corners allow.

    python benchmarks/vision_poses.py [poses each]
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from vision_scenes import camera_at, exact_network, random_robot, seen_robot

from data_samples.rooms.cameras import robot_layout
from vision_gt.optics.transforms import change_between
from vision_gt.robot.robot_pose import Floor, robot_pose

CASES = ((2.0, 0.3, 4.0), (5.0, 0.3, 13.0), (2.0, 0.1, 1.4), (5.0, 0.1, 4.0))
FIRST_SEED = 1000


def main(count: int) -> None:
    for distance, noise, asked in CASES:
        T_camera, layout = camera_at(distance), robot_layout()
        network = exact_network(T_camera)
        errors, normalised = [], []
        for seed in range(FIRST_SEED, FIRST_SEED + count):
            rng = np.random.default_rng(seed)
            true = random_robot(rng)
            pose = robot_pose(
                [seen_robot(T_camera, true, noise, rng)], network, layout, Floor(0.003, 0.005)
            )
            assert pose is not None
            off = change_between(pose.T_gtv_robot, true)
            errors.append(1e3 * np.linalg.norm(off[:3]))
            normalised.append(off @ np.linalg.solve(pose.covariance, off) / 6)
        print(
            f"{distance:g} m, corner noise {noise:g} px: median {np.median(errors):5.2f} mm "
            f"(at most {asked:g} asked), 95 % below {np.quantile(errors, 0.95):5.2f} mm, NEES "
            f"a number {np.mean(normalised):.2f}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
