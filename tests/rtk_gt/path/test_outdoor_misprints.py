"""The misprints named in docs/outdoor.md, each by the numbers that stand there."""

from pathlib import Path

import numpy as np
import pytest
from printed_formulas import published_squared_distance_covariance
from rtk_samples import DISTANCES, NOISE
from scipy.spatial.transform import Rotation
from scipy.special import chdtri

from data_samples.drives.drive import ANTENNAS, LEFT_CAMERA
from rtk_gt.offsets.noise import (
    PUBLISHED_NOISE,
    GpsNoise,
    squared_distance_covariance,
)
from rtk_gt.path.composition import compose, published_composition, published_jacobian
from rtk_gt.path.covariance import reference_covariance
from rtk_gt.path.orientation import transform_of
from rtk_gt.sensors.camera_pose import Lens
from validation.poses.earth_frames import LocalFrame

PAGE = (Path(__file__).parents[3] / "docs" / "outdoor.md").read_text(encoding="utf-8")
A, FLATTENING = 6378137.0, 1 / 298.257223563


def said(*numbers):
    """Whether all these stand in one row of the table of misprints."""
    rows = [row for row in PAGE.splitlines() if row.startswith("|")]
    return any(all(number in row for number in numbers) for row in rows)


def test_f14_of_equation_33():
    vehicle, sensor = np.array([0, 0, 0, 0.9, 0.2, 0]), np.array([2.2, 0, 0, 0, 0, 0])
    step = 1e-6 * np.eye(6)[3]
    x = [transform_of(pose).apply(sensor[:3])[0] for pose in (vehicle + step, vehicle - step)]
    slope = (x[0] - x[1]) / 2e-6
    right = -2.2 * np.sin(0.9) * np.cos(0.2)
    wrong = -2.2 * np.sin(0.9) * np.cos(0.9)
    assert slope == pytest.approx(right, abs=1e-8)
    assert published_jacobian(vehicle, sensor)[0, 3] == pytest.approx(wrong, abs=1e-12)
    assert said("F14", f"{right:.3f}", f"{wrong:.3f}")


def test_added_angles_of_equation_30():
    found = []
    for pitch in (2.0, 5.0, 10.0):
        vehicle = np.array([[0, 0, 0, 0, np.radians(pitch), 0]])
        W = np.eye(6)[None] * 1e-6
        exact = compose(vehicle, W, LEFT_CAMERA, np.eye(6) * 1e-6).poses[0]
        added = published_composition(vehicle, W, LEFT_CAMERA, np.eye(6) * 1e-6).poses[0]
        turn = transform_of(exact).rotation.inv() * transform_of(added).rotation
        found.append(f"{np.degrees(turn.magnitude()):.1f}")
    assert said("Eq. 30", ", ".join(found))


def squared_distances(generator, samples):
    """(n, 3) of noisy antennas, in the order 12, 13, 23."""
    world = ANTENNAS + generator.standard_normal((samples, 3, 3)) * 0.0064 * [1, 1, 1.75]
    pairs = ((0, 1), (0, 2), (1, 2))
    return np.stack([np.square(world[:, i] - world[:, j]).sum(1) for i, j in pairs], axis=1)


def test_the_sign_after_equation_27():
    generator = np.random.default_rng(0)
    squares = np.concatenate([squared_distances(generator, 300_000) for _ in range(10)])
    simulated = np.cov(squares.T)
    printed = published_squared_distance_covariance(DISTANCES, 0.0064)
    # Of n samples a covariance has the variance (s1^2 s2^2 + c^2) / n.
    spread = np.hypot(np.sqrt(simulated[0, 0] * simulated[2, 2]), simulated[0, 2])
    assert simulated[0, 2] == pytest.approx(1.07e-4, abs=4 * spread / np.sqrt(len(squares)))
    assert f"{printed[0, 2]:.2e}" == "-1.06e-04"
    assert said("+1.07e-4", "-1.06e-4")
    error = squares - squares.mean(0)
    beyond = [
        np.mean((error @ np.linalg.inv(C) * error).sum(1) > chdtri(3, 0.01))
        for C in (squared_distance_covariance(ANTENNAS, NOISE), printed)
    ]
    assert beyond[0] == pytest.approx(0.01, abs=0.001)
    assert f"{100 * beyond[1]:.1f}" == "1.6"
    assert said("after Eq. 27", "pass the 1 % bound")


def test_sigma_z_of_equation_22():
    assert pytest.approx(1.12) == 1.75 * 0.64
    assert f"{1.02 / 0.64:.2f}" == "1.59"
    of_text = reference_covariance(ANTENNAS, GpsNoise(0.0064, 1.75))[2, 2]
    of_print = reference_covariance(ANTENNAS, PUBLISHED_NOISE)[2, 2]
    assert of_print == pytest.approx(1.0407e-4, rel=0.003)
    assert f"{100 * (of_text / of_print - 1):.0f} %" == "21 %"
    assert said("Eq. 22", "1.59", "21 %")


def test_cos_squared_of_the_latitude_in_equation_2():
    """As printed, Malaga would be 2,400 km nearer to the plane of the equator."""
    latitude, height = np.radians(36.714459075), 38.8887
    e2 = FLATTENING * (2 - FLATTENING)
    N = A / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    z = LocalFrame.from_degrees(36.714459075, -4.478958828333333, height).origin[2]
    right = (N * (1 - e2) + height) * np.sin(latitude)
    printed = (N * np.cos(latitude) ** 2 + height) * np.sin(latitude)
    assert z == pytest.approx(right, abs=1e-6)
    assert abs(printed - z) > 1e6
    assert said("Eq. 2 ", "eccentricity")


def test_distortion_is_of_normalised_coordinates():
    """Eq. 16 to 19 with the u, v of Eq. 13, in pixels, move a corner by far more than the image."""
    matrix = np.array([[923.5295, 0, 507.2222], [0, 922.2418, 383.5822], [0, 0, 1]])
    k1, k2, p1, p2 = -0.353754, 0.162014, 1.643379e-3, 3.655471e-4
    lens = Lens(matrix, np.array([k1, k2, p1, p2]))
    corner = np.array([[(1024 - 507.2222) / 923.5295, (768 - 383.5822) / 922.2418, 1.0]])
    moved = lens.project(corner)[0] - [1024, 768]
    assert np.linalg.norm(moved) < 150
    u, v = 1024.0 - 507.2222, 768.0 - 383.5822
    r = np.hypot(u, v)
    as_pixels = u * (k1 * r**2 + k2 * r**4) + 2 * p1 * u * v + p2 * (r**2 + 2 * u**2)
    assert abs(as_pixels) > 1e5
    assert said("Eq. 16-19", "normalised")


def test_the_page_names_the_other_misprints():
    """Eq. 4 and section 6.3 have their proofs with the frames and the fragment."""
    assert said("Eq. 4, 5", "32 bits")
    assert said("section 6.3", "2 mm")
    assert Rotation.from_euler("ZYX", LEFT_CAMERA[3:]).magnitude() > 1
