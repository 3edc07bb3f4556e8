"""The camera network as an earlier run left it under results/."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.text_files.csv_tables import Column, read_csv
from vision_gt.campaign.result_files import PLACED
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera_files import read_cameras


def read_network(results: Path) -> Network:
    """Cameras and their poses from vision_cameras.csv and vision_camera_NAME.yaml.

    The covariances between cameras are not stored: each camera's own standard deviations are
    all that the result has.

    Raises
    ------
    InputError
        If the files are missing or bad.
    """
    columns = [
        Column("camera"),
        *(Column(name, "number") for name in PLACED),
        *(Column(f"sigma_{name}", "number", low=0) for name in PLACED),
    ]
    table = read_csv(results / "vision_cameras.csv", columns)
    table.flag_duplicates(["camera"])
    table.raise_problems()
    names = table.text["camera"]
    values = np.column_stack([table.numbers[name] for name in PLACED])
    sigmas = np.column_stack([table.numbers[f"sigma_{name}"] for name in PLACED])
    cameras = [read_cameras(results / f"vision_camera_{name}.yaml")[0] for name in names]
    covariance = np.zeros((15 * len(names), 15 * len(names)))
    for i, sigma in enumerate(sigmas):
        rows = np.arange(15 * i, 15 * i + 6)
        covariance[rows, rows] = sigma**2
    return Network(
        tuple(cameras),
        RigidTransform.from_components(values[:, :3], Rotation.from_rotvec(values[:, 3:])),
        covariance,
        RigidTransform.identity(),
        np.zeros((6, 6)),
        0.0,
    )
