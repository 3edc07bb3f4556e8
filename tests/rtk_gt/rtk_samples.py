"""Drives and steps made in code, and where the real data are."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import ANTENNAS, OFFSETS
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.receivers.steps import Steps
from validation.poses.earth_frames import LocalFrame

REPOSITORY = Path(__file__).parents[2]
REAL = Path(os.environ.get("GTVAL_REAL_DATA", REPOSITORY.parent / "shared" / "real"))
FRAGMENT = REAL / "rtk" / "malaga_fragment" / "test_rtk_path.rawlog"
needs_fragment = pytest.mark.skipif(
    not FRAGMENT.exists(), reason=f"the Malaga fragment is not at {FRAGMENT} (GTVAL_REAL_DATA)"
)
NOISE = GpsNoise(0.0064, 1.75)
MALAGA = LocalFrame.from_degrees(36.714459075, -4.47895882833333, 38.8887, "geocentric")
DISTANCES = np.array(
    [np.linalg.norm(ANTENNAS[i] - ANTENNAS[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
)


def steps_of(
    seed, count=600, slope=5.0, noise=NOISE, false_share=0.0, turn=2 * np.pi, offsets=OFFSETS
):
    """Steps of a drive that turns by ``turn`` and tilts by ``slope`` degrees, and the poses."""
    generator = np.random.default_rng(seed)
    s = np.linspace(0, 1, count)
    yaw = turn / 2 * np.sin(2 * np.pi * s) + turn / 20 * np.sin(11 * s)
    pitch = np.radians(slope) * np.sin(2 * np.pi * 3.3 * s)
    roll = np.radians(slope) / 2 * np.cos(2 * np.pi * 5 * s)
    R = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])).as_matrix()
    place = np.column_stack([100 * np.cos(6 * s), 100 * np.sin(6 * s), s])
    positions = place[:, None] + np.einsum("tij,rj->tri", R, ANTENNAS) - offsets
    sigmas = np.sqrt(np.diagonal(noise.covariance))
    positions = positions + generator.standard_normal(positions.shape) * sigmas
    false = generator.random((count, 3)) < false_share
    direction = generator.standard_normal((count, 3, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    positions = positions + 0.3 * false[..., None] * direction
    names = ("rear", "front_left", "front_right")
    return Steps(names, np.arange(float(count)), positions, np.full((count, 3), 4), MALAGA)
