"""Offsets and distances: right without a start, sure of what they are sure of, robust."""

from dataclasses import replace

import numpy as np
import pytest
from rtk_samples import DISTANCES, NOISE, steps_of
from scipy import stats
from trials.nested_offsets import nested_offsets

from data_samples.drives.drive import ANTENNAS, OFFSETS
from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.offsets.robust import (
    autocorrelation_time,
    expected_weighted_square,
    redescending_weights,
)
from rtk_gt.path.alignment import align
from validation.errors import GtvalError
from validation.poses.earth_frames import LocalFrame


def errors_of(found):
    return np.concatenate(
        [(found.offsets.values - OFFSETS)[1:].ravel(), found.distances - DISTANCES]
    )


def test_data_without_noise_give_the_truth():
    found = estimate_offsets(steps_of(0, noise=GpsNoise(0.0)))
    np.testing.assert_allclose(found.offsets.values, OFFSETS, atol=1e-7)
    np.testing.assert_allclose(found.distances, DISTANCES, atol=1e-7)


def test_errors_fit_their_covariance():
    """NEES over drives, and each component's own: 9 degrees of freedom, 60 drives."""
    runs = [estimate_offsets(steps_of(seed)) for seed in range(60)]
    errors = np.array([errors_of(run) for run in runs])
    covariances = np.array([run.covariance for run in runs])
    total = np.einsum("si,sij,sj->", errors, np.linalg.inv(covariances), errors)
    low, high = stats.chi2(60 * 9).ppf([0.0005, 0.9995])
    assert low < total < high
    scaled = np.square(errors / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))).sum(0)
    low, high = stats.chi2(60).ppf([0.0005 / 9, 1 - 0.0005 / 9])
    assert ((low < scaled) & (scaled < high)).all()


def test_sigma_is_recovered_without_bias():
    sigmas = np.array([estimate_offsets(steps_of(seed)).sigma for seed in range(40)])
    # Relative standard error of one: 1 / sqrt(2 * 600 * 3).
    assert abs(sigmas.mean() / NOISE.sigma - 1) < 4 / np.sqrt(2 * 600 * 3 * 40)


@pytest.mark.parametrize("seed", range(3))
def test_hundreds_of_metres_of_offset_change_nothing(seed):
    far = OFFSETS + np.random.default_rng(seed).normal(size=(3, 3)) * 300
    far[0] = 0
    near = estimate_offsets(steps_of(7))
    moved = estimate_offsets(steps_of(7, offsets=far))
    np.testing.assert_allclose(moved.offsets.values - far, near.offsets.values - OFFSETS, atol=1e-5)


def test_the_nested_optimisation_agrees_within_the_sigmas():
    steps = steps_of(3)
    direct = estimate_offsets(steps, robust=False)
    nested = nested_offsets(steps, np.array([1.79, 1.79, 1.15]))
    assert (
        np.abs(nested.offsets.values - direct.offsets.values)[1:] < 2 * direct.offset_sigmas[1:]
    ).all()
    assert np.abs(nested.distances - direct.distances).max() < 1e-3


def test_flat_ground_leaves_the_vertical_offsets_open_and_says_so():
    found = estimate_offsets(steps_of(1, slope=0.0))
    assert (found.offset_sigmas[1:, 2] > 1.0).all()
    assert (found.offset_sigmas[1:, :2] < 0.01).all()
    assert (found.signal == 0).sum() >= 1
    assert np.abs(found.offsets.values - OFFSETS).max() < 10


def test_noise_does_not_pass_for_slopes():
    """On flat ground the drive must (nearly) never claim to know the vertical offsets."""
    claimed = 0
    for seed in range(30):
        found = estimate_offsets(steps_of(seed, slope=0.0, count=300))
        error = np.abs(found.offsets.values - OFFSETS)[1:, 2]
        claimed += (error > 4 * found.offset_sigmas[1:, 2]).any()
    assert claimed == 0


def test_little_turning_leaves_the_horizontal_offsets_open():
    found = estimate_offsets(steps_of(1, turn=np.radians(5.0)))
    assert found.offset_sigmas[1:, :2].max() > 1.0
    assert np.abs(found.offsets.values - OFFSETS).max() < 10


def test_tape_measured_distances_settle_what_little_turning_leaves_open():
    steps = steps_of(1, turn=np.radians(5.0))
    prior = OffsetPrior(distances=DISTANCES, distance_sigmas=np.full(3, 0.01))
    found = estimate_offsets(steps, prior=prior)
    assert found.offset_sigmas.max() < 0.03
    scaled = errors_of(found) / np.sqrt(np.diagonal(found.covariance))
    assert np.abs(scaled).max() < 4


def test_known_offsets_count_as_far_as_their_sigma_goes():
    steps = steps_of(1, slope=0.0)
    prior = OffsetPrior(OFFSETS, np.full((3, 3), 0.005))
    found = estimate_offsets(steps, prior=prior)
    np.testing.assert_allclose(found.offset_sigmas[1:, 2], 0.005, rtol=0.05)
    assert np.abs(found.offsets.values - OFFSETS).max() < 0.005


def test_false_fixes_cost_least_squares_five_times_more_than_the_robust_estimate():
    """2 % of the fixes off by 30 cm."""
    plain, robust = [], []
    for seed in range(12):
        steps = steps_of(seed, false_share=0.02)
        plain.append(errors_of(estimate_offsets(steps, robust=False)))
        robust.append(errors_of(estimate_offsets(steps)))
    clean = [errors_of(estimate_offsets(steps_of(seed))) for seed in range(12)]
    rms = [float(np.sqrt(np.mean(np.square(one)))) for one in (plain, robust, clean)]
    assert rms[0] > 5 * rms[1]
    assert rms[1] < 1.3 * rms[2]


def test_four_receivers():
    steps = steps_of(5)
    extra = np.array([0.9, 0.0, 0.6])
    exact = steps_of(5, noise=GpsNoise(0.0))
    rotation, translation = align(ANTENNAS, exact.positions + OFFSETS)
    fourth = (rotation @ extra + translation)[:, None] - [[12.0, -40.0, 3.0]]
    fourth += np.random.default_rng(5).standard_normal(fourth.shape) * 0.0064 * [1, 1, 1.75]
    both = replace(
        steps,
        receivers=(*steps.receivers, "roof"),
        positions=np.concatenate([steps.positions, fourth], axis=1),
        kinds=np.full((len(steps), 4), 4),
    )
    found = estimate_offsets(both)
    error = (found.offsets.values - np.vstack([OFFSETS, [12.0, -40.0, 3.0]]))[1:]
    assert len(found.distances) == 6
    assert np.abs(error / found.offset_sigmas[1:]).max() < 4
    assert found.offset_sigmas.max() < 0.02


def test_ten_complete_steps_are_needed():
    with pytest.raises(GtvalError, match="at 9 times only"):
        estimate_offsets(steps_of(0, count=9))


def test_offsets_of_another_frame_are_refused():
    steps = steps_of(0)
    found = estimate_offsets(steps)
    other = LocalFrame(steps.frame.latitude, steps.frame.longitude, steps.frame.height)
    with pytest.raises(GtvalError, match="offsets of one frame"):
        replace(steps, frame=other).corrected(found.offsets)


def test_correlation_times_of_known_processes():
    generator = np.random.default_rng(0)
    white = generator.standard_normal((20000, 3))
    assert autocorrelation_time(white) == pytest.approx(1, abs=0.05)
    phi = 0.8
    series = np.zeros((20000, 3))
    for t in range(1, len(series)):
        series[t] = phi * series[t - 1] + white[t]
    # (1 + phi) / (1 - phi) for a first-order process.
    assert autocorrelation_time(series) == pytest.approx(9, rel=0.15)


def test_good_steps_keep_their_weight():
    squares = np.random.default_rng(0).chisquare(3, 100000)
    weights = redescending_weights(squares, 3)
    assert np.mean(weights == 1) == pytest.approx(0.99, abs=0.002)
    assert weights @ squares / weights.sum() / 3 == pytest.approx(
        expected_weighted_square(3), abs=0.01
    )
    assert redescending_weights(np.array([4.1 * 11.345]), 3) == 0
