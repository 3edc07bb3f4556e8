"""W*, Jacobians and antenna positions against print, simulation and finite differences."""

import time

import numpy as np
import pytest
from printed_formulas import rotated_covariance
from rtk_samples import DISTANCES
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import ANTENNAS
from rtk_gt.offsets.noise import PUBLISHED_NOISE
from rtk_gt.path.alignment import align
from rtk_gt.path.antennas import antenna_positions, check_antennas
from rtk_gt.path.covariance import (
    noise_covariance,
    pose_jacobian,
    reference_covariance,
    simulated_covariance,
    systematic_jacobian,
)
from rtk_gt.path.orientation import angles_of, matrix_of, pose_of, rotation_rates, transform_of
from validation.errors import GtvalError

PRINTED_DIAGONAL = np.array([1.4472e-5, 3.6903e-5, 1.0407e-4, 1.5434e-5, 5.2093e-5, 1.5840e-4])
"""Blanco 2009, Eq. 23."""


def test_reference_covariance_is_the_printed_one():
    found = np.diagonal(reference_covariance(ANTENNAS, PUBLISHED_NOISE))
    np.testing.assert_allclose(found, PRINTED_DIAGONAL, rtol=0.003)


def test_the_eta_of_the_text_does_not_give_the_printed_matrix():
    from rtk_gt.offsets.noise import GpsNoise

    found = np.diagonal(reference_covariance(ANTENNAS, GpsNoise(0.0064, 1.75)))
    assert found[2] / PRINTED_DIAGONAL[2] > 1.2


def test_first_order_takes_under_5_ms():
    reference_covariance(ANTENNAS, PUBLISHED_NOISE)
    start = time.process_time()
    for _ in range(20):
        reference_covariance(ANTENNAS, PUBLISHED_NOISE)
    assert (time.process_time() - start) / 20 < 0.005


def test_simulation_agrees_with_first_order():
    samples = 200_000
    found = simulated_covariance(ANTENNAS, PUBLISHED_NOISE, samples, np.random.default_rng(1))
    expected = reference_covariance(ANTENNAS, PUBLISHED_NOISE)
    # A variance from n samples has the relative error sqrt(2 / n).
    np.testing.assert_allclose(
        np.diagonal(found), np.diagonal(expected), rtol=4.5 * np.sqrt(2 / samples) + 0.001
    )


def test_the_number_of_threads_changes_nothing():
    runs = [
        simulated_covariance(ANTENNAS, PUBLISHED_NOISE, 30_000, np.random.default_rng(2), workers)
        for workers in (1, 2)
    ]
    np.testing.assert_array_equal(*runs)


@pytest.mark.full
def test_ten_million_samples_are_the_printed_matrix():
    found = simulated_covariance(ANTENNAS, PUBLISHED_NOISE, 10**7, np.random.default_rng(0))
    np.testing.assert_allclose(np.diagonal(found), PRINTED_DIAGONAL, rtol=0.003)


def test_receiver_positions_of_table_1_from_the_mean_distances_of_table_3():
    mean = np.array([[1.8226, 1.8255, 1.1444], [1.8208, 1.8247, 1.1457]]).mean(0)
    found = antenna_positions(mean, ANTENNAS[:, 2])
    np.testing.assert_allclose(found.positions, ANTENNAS, atol=0.0005)


def test_antenna_derivatives():
    found = antenna_positions(DISTANCES, ANTENNAS[:, 2])
    for pair in range(3):
        moved = DISTANCES + 1e-6 * np.eye(3)[pair]
        change = antenna_positions(moved, ANTENNAS[:, 2]).positions - found.positions
        np.testing.assert_allclose(change.ravel() / 1e-6, found.by_distance[:, pair], atol=1e-4)


def test_distances_that_make_no_triangle():
    with pytest.raises(GtvalError, match="no triangle"):
        antenna_positions(np.array([1.0, 1.0, 3.0]), np.zeros(3))


def test_antennas_in_one_line():
    with pytest.raises(GtvalError, match="in one line"):
        check_antennas(np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]))


def turns(count, seed=0):
    return Rotation.random(count, np.random.default_rng(seed)).as_matrix()


def test_alignment_agrees_with_scipy():
    generator = np.random.default_rng(3)
    R = turns(300)
    world = np.einsum("nij,rj->nri", R, ANTENNAS) + generator.normal(size=(300, 3, 3)) * 0.05
    world += generator.normal(size=(300, 1, 3)) * 300
    found = align(ANTENNAS, world)
    centred = ANTENNAS - ANTENNAS.mean(0)
    for k in range(300):
        expected, _ = Rotation.align_vectors(world[k] - world[k].mean(0), centred)
        np.testing.assert_allclose(found.rotation[k], expected.as_matrix(), atol=1e-10)


def test_alignment_at_half_turns():
    axes = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]])
    half = Rotation.from_rotvec(np.pi * axes).as_matrix()
    world = np.einsum("nij,rj->nri", half, ANTENNAS) + np.array([5.0, -3.0, 2.0])
    found = align(ANTENNAS, world)
    np.testing.assert_allclose(found.rotation, half, atol=1e-10)
    np.testing.assert_allclose(found.translation, np.tile([5.0, -3.0, 2.0], (4, 1)), atol=1e-10)


def test_angles_and_rates():
    angles = np.random.default_rng(0).uniform(-1.3, 1.3, (50, 3))
    R = matrix_of(angles)
    np.testing.assert_allclose(angles_of(R), angles, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation_rates(angles)), -np.cos(angles[:, 1]))
    step = 1e-6
    for k in range(3):
        moved = matrix_of(angles + step * np.eye(3)[k])
        turn = Rotation.from_matrix(moved @ np.swapaxes(R, 1, 2)).as_rotvec() / step
        np.testing.assert_allclose(turn, rotation_rates(angles)[:, :, k], atol=1e-5)
    poses = np.column_stack([angles, angles])
    np.testing.assert_allclose(pose_of(transform_of(poses)), poses, atol=1e-12)


@pytest.mark.parametrize("angles", [(0, 0, 0), (0.7, 0.15, -0.1), (2.9, -0.3, 0.25)])
def test_pose_jacobian_against_finite_differences(angles):
    R = matrix_of(np.array(angles))
    world = ANTENNAS @ R.T + [10.0, 20.0, 3.0]
    J = pose_jacobian(ANTENNAS, R)
    step = 1e-6
    for k in range(9):
        poses = []
        for sign in (1, -1):
            moved = world + sign * step * np.eye(9)[k].reshape(3, 3)
            rotation, translation = align(ANTENNAS, moved[None])
            poses.append(np.hstack([translation[0], angles_of(rotation)[0]]))
        np.testing.assert_allclose((poses[0] - poses[1]) / 2 / step, J[:, k], atol=1e-6)


def test_systematic_jacobian_against_finite_differences():
    R = matrix_of(np.array([0.7, 0.15, -0.1]))
    found = antenna_positions(DISTANCES, ANTENNAS[:, 2])
    world = found.positions @ R.T
    J = systematic_jacobian(found.positions, R, found.by_distance)

    def pose(change):
        offsets = np.vstack([np.zeros(3), change[:6].reshape(2, 3)])
        body = antenna_positions(DISTANCES + change[6:], ANTENNAS[:, 2]).positions
        rotation, translation = align(body, (world + offsets)[None])
        return np.concatenate([translation[0], angles_of(rotation)[0]])

    step = 1e-5
    for k in range(9):
        change = step * np.eye(9)[k]
        difference = (pose(change) - pose(-change)) / 2 / step
        np.testing.assert_allclose(difference, J[:, k], atol=1e-5)


def test_rotating_the_reference_is_exact_on_the_level_only():
    reference = reference_covariance(ANTENNAS, PUBLISHED_NOISE)
    level, slope = matrix_of(np.array([[1.2, 0, 0], [1.2, 0.17, 0.1]]))
    exact = noise_covariance(ANTENNAS, level, PUBLISHED_NOISE)
    # The angles of W* belong to the vehicle's axes; its heading leaves them as they are.
    np.testing.assert_allclose(rotated_covariance(reference, level), exact, atol=1e-4 * 1e-4)
    steep = noise_covariance(ANTENNAS, slope, PUBLISHED_NOISE)
    off = np.diagonal(rotated_covariance(reference, slope)) / np.diagonal(steep) - 1
    assert 0.005 < np.abs(off).max() < 0.3
