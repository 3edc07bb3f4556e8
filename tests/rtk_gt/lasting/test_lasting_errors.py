"""Errors that begin with a jump, and slow ones: found, taken out, and in the covariance."""

import numpy as np
import pytest
from trials.lasting_errors import ETA, Errors, made_drive

from rtk_gt.lasting.causes import UNSURE, USUAL
from rtk_gt.lasting.continuity import gain_over_motion, unexpected_ways
from rtk_gt.lasting.contrasts import step_weights
from rtk_gt.lasting.drive_sums import DriveSums
from rtk_gt.lasting.jumps import GAIN_OVER_MOTION
from rtk_gt.lasting.lacking_fixes import filled, spaced_rows
from rtk_gt.lasting.settled import settle
from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.offsets.memory import error_model
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.offsets.slow_errors import ErrorModel, mean_memory, summed_covariance
from rtk_gt.path.antennas import antenna_positions
from rtk_gt.path.clocks import right_clocks
from rtk_gt.path.vehicle_path import vehicle_path
from validation.poses.pose_table import SPATIAL, pose_difference

WHITE = Errors(0.003)
SLOW = Errors(0.003, 0.005, 30.0)


def rows_from(made, second, last=None):
    times = made.steps.times - made.steps.times[0]
    return np.flatnonzero((times > second - 1e-3) & (times < (last or np.inf) - 1e-3))


def squares_of(made, steps, jumps):
    """Squared normalised errors of the poses, over six."""
    offsets = estimate_offsets(steps, eta=ETA)
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    antennas = antenna_positions(offsets.distances, made.antennas[:, 2])
    path = vehicle_path(steps.select(rows), offsets, antennas, jumps=jumps)
    error = pose_difference(path.poses, made.poses[rows], SPATIAL)
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(path.covariances), error) / 6, error


@pytest.mark.parametrize("side", [2, 4, 8])
def test_a_jump_is_seen_whole_beside_any_speed_and_acceleration(side):
    place = np.arange(2.0 * side) - side + 0.5
    moves = np.diff(3.0 + 2.0 * place + 0.7 * place**2 + 0.1 * (place > 0))
    assert step_weights(side) @ moves == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize(
    ("who", "size"),
    [
        ((1, 2), (0.03, -0.035, 0.02)),
        ((0, 1, 2), (0.06, -0.07, 0.04)),
        # On a slope of a few percent it is centimetres above the road.
        ((0, 1, 2), (-0.9, 0.6, 0.2)),
    ],
)
def test_a_jump_that_stays_is_found_and_taken_out(who, size):
    made = made_drive(11, WHITE, seconds=300.0)
    bad = made.jumped(list(who), rows_from(made, 150.0), np.array(size))
    steps, errors, jumps = settle(bad.steps)
    assert [one.receivers for one in errors] == [who]
    assert errors[0].stays
    assert abs(errors[0].start - made.steps.times[0] - 150.0) < 0.41
    off = errors[0].size - size
    # 99.9 % of three normal numbers.
    assert off @ np.linalg.solve(errors[0].covariance, off) < 16.3
    squares, error = squares_of(made, steps, jumps)
    assert np.abs(error[:, :3]).max() < 0.03
    # One jump's error is shared by all poses that follow: a wide bound.
    assert 0.7 < squares.mean() < 2.0


@pytest.mark.parametrize("size", [(0.08, 0.0, 0.0), (0.0, 0.0, 0.15)])
def test_a_false_fix_that_lasts_is_left_out(size):
    made = made_drive(12, WHITE, seconds=240.0)
    bad = made.jumped([1], rows_from(made, 100.0, 120.0), np.array(size))
    steps, errors, _ = settle(bad.steps)
    assert [one.receivers for one in errors] == [(1,)]
    np.testing.assert_allclose(
        np.array([errors[0].start, errors[0].end]) - made.steps.times[0], [100.0, 120.0], atol=0.41
    )
    assert not steps.complete[rows_from(made, 100.0, 120.0)].any()
    # Two or three epochs beside each jump, which noise could put on its other side.
    assert (~steps.complete).sum() <= len(rows_from(made, 100.0, 120.0)) + 12


@pytest.mark.parametrize("errors", [WHITE, SLOW])
def test_a_clean_drive_has_no_jump(errors):
    for seed in (21, 22):
        made = made_drive(seed, errors, seconds=300.0)
        steps, found, jumps = settle(made.steps)
        assert (found, jumps) == ([], None)
        assert steps is made.steps


def test_white_errors_have_no_memory_and_slow_ones_theirs():
    made = made_drive(31, WHITE, seconds=300.0)
    assert error_model(made.steps, estimate_offsets(made.steps, bent="never")) is None
    made = made_drive(31, SLOW, seconds=600.0)
    found = error_model(made.steps, estimate_offsets(made.steps, bent="never"))
    # Twenty memories, of three distances: the slow variance is known to a factor of 1.5.
    assert 0.003 < found.slow_sigma < 0.0075
    assert 12.0 < found.lasting < 75.0
    assert found.white == pytest.approx(0.003, rel=0.1)


def test_a_sum_of_slow_errors_varies_as_simulated():
    generator = np.random.default_rng(0)
    times = np.arange(0.0, 60.0, 0.5)
    scores = np.cos(times / 9)[:, None, None]
    model = ErrorModel(0.0, np.array([2.0]), np.array([20.0]), np.array([1.0]))
    covariance = 4.0 * np.exp(-np.abs(times[:, None] - times) / 20.0)
    draws = generator.multivariate_normal(np.zeros(len(times)), covariance, 20_000)
    found = summed_covariance(times, scores, model)[0, 0]
    # A variance of 20,000 draws is off by 1 % (one standard deviation).
    assert found == pytest.approx((draws @ scores[:, 0, 0]).var(), rel=0.04)


def test_the_mean_over_a_block_loses_what_is_quick():
    length, memory, fine = 3.0, 5.0, 1500
    places = (np.arange(2 * fine) + 0.5) * length / fine
    kept = np.exp(-np.abs(places[:, None] - places) / memory)
    same, other = mean_memory(length, memory)
    assert same == pytest.approx(kept[:fine, :fine].mean(), rel=1e-3)
    assert other * np.exp(-length / memory) == pytest.approx(kept[:fine, fine:].mean(), rel=1e-3)


def drives_with(errors, seconds, seeds):
    """Root mean square of the offsets' z, and mean NEES of a pose over 6."""
    scores, squares = [], []
    for seed in seeds:
        made = made_drive(seed, errors, seconds=seconds, every=(0.5, 0.5, 0.5))
        model = error_model(made.steps, estimate_offsets(made.steps, bent="never"))
        offsets = estimate_offsets(made.steps, eta=ETA, model=model)
        scores.append((offsets.offsets.values - made.offsets)[1:] / offsets.offset_sigmas[1:])
        antennas = antenna_positions(offsets.distances, made.antennas[:, 2])
        rows = np.flatnonzero(made.steps.complete)[offsets.weights > 0]
        path = vehicle_path(made.steps.select(rows), offsets, antennas, model=model)
        error = pose_difference(path.poses, made.poses[rows], SPATIAL)
        whole = np.einsum("ni,nij,nj->n", error, np.linalg.inv(path.covariances), error)
        squares.append(whole.mean() / 6)
    return np.sqrt(np.mean(np.square(scores))), np.mean(squares)


def test_offsets_under_slow_errors_fit_their_covariance_in_a_few_drives():
    """Six drives with some three independent numbers each: 1 within a third, three sigmas."""
    rms, _ = drives_with(Errors(0.0, 0.010, 30.0), 300.0, range(600, 604))
    # Taken as white, with the correlation of the residuals, it is 1.6 to 3.8.
    assert 0.4 < rms < 1.6


@pytest.mark.full
@pytest.mark.parametrize("white", [0.0, 0.004])
@pytest.mark.parametrize(("slow", "memory"), [(0.003, 30.0), (0.010, 30.0), (0.010, 60.0)])
def test_offsets_and_poses_under_slow_errors_fit_their_covariance(white, slow, memory):
    rms, nees = drives_with(Errors(white, slow, memory), 10 * memory, range(700, 740))
    assert 0.8 < rms < 1.3
    assert 0.75 < nees < 1.3


def test_clocks_that_are_off_are_found_to_a_millisecond():
    made = made_drive(41, WHITE, seconds=200.0, delays=(0.0, -0.3, 0.4))
    steps, found = right_clocks(made.steps, ETA)
    np.testing.assert_allclose(found.late, [0.0, 0.3, -0.4], atol=1e-3)
    off = estimate_offsets(steps).offsets.values - made.offsets
    assert np.abs(off[:, :2]).max() < 0.005


def test_right_clocks_are_left_alone():
    made = made_drive(42, SLOW, seconds=200.0)
    steps, found = right_clocks(made.steps, ETA)
    assert found is None
    assert steps is made.steps


def test_one_braking_of_a_calm_drive_is_no_jump_and_ten_centimetres_of_all_are():
    """At 5 Hz; who brakes changes the acceleration within tenths of a second, and only once."""
    times = np.arange(0.0, 8.0, 0.2)
    begin = 4.03
    ramp = np.clip(times - begin, 0.0, 0.6)
    late = np.clip(times - begin - 0.6, 0.0, None)
    jerk = -4.0
    way = 10.0 * times + jerk * (ramp**3 / 6 + ramp**2 / 2 * late + ramp * late**2 / 2)
    row = int(np.searchsorted(times, begin)) - 1
    calm, jumped = [], []
    for seed in range(40):
        noise = np.random.default_rng(seed).normal(size=(len(times), 3)) * 0.004
        places = np.column_stack([way, 0 * way, 0 * way]) + noise
        calm.append(max(gain_over_motion(times, places, row + k) for k in (-1, 0, 1)))
        places[row + 1 :, 1] += 0.1
        jumped.append(gain_over_motion(times, places, row))
    assert max(calm) < GAIN_OVER_MOTION < min(jumped)


def test_a_restart_on_level_ground_is_found_where_heights_are_stated():
    made = made_drive(5, Errors(0.006), seconds=300.0, slopes=0.3)
    bad = made.jumped([1, 2], rows_from(made, 150.0), np.array([0.1, 0.0, 0.0]))
    prior = OffsetPrior(heights=made.antennas[:, 2])
    _, errors, _ = settle(bad.steps, prior=prior)
    assert [one.receivers for one in errors] == [(1, 2)]
    off = errors[0].size - [0.1, 0.0, 0.0]
    assert off @ np.linalg.solve(errors[0].covariance, off) < 16.3
    assert settle(made.steps, prior=prior)[1] == []


MIXED = (1.0, 0.2, 0.2)


def test_a_false_fix_upwards_shows_under_slow_errors():
    """Three antennas have no height to spare: only that no vehicle leans at once tells it."""
    made = made_drive(71, Errors(0.003, 0.010, 30.0), seconds=300.0)
    bad = made.jumped([1], rows_from(made, 150.0, 180.0), np.array([0.0, 0.0, 0.15]))
    (error,) = settle(bad.steps)[1]
    assert error.receivers == (1,)
    off = np.array([error.start, error.end]) - made.steps.times[0] - [150.0, 180.0]
    assert np.abs(off).max() < 0.41
    away = error.size - [0.0, 0.0, 0.15]
    assert away @ np.linalg.solve(error.covariance, away) < 16.3  # 99.9 % of three normal numbers


@pytest.mark.parametrize(("who", "every"), [(0, MIXED), (1, (0.2, 0.2, 0.2))])
def test_what_goes_beyond_the_guess_is_a_jump_however_often_one_writes(who, every):
    made = made_drive(72, WHITE, seconds=300.0, every=every)
    positions = made.steps.positions + made.offsets
    times, row, size = made.steps.times, 750, np.array([0.0, 0.0, 0.3])
    headings = np.zeros(len(times))
    jumped = positions.copy()
    jumped[row:, who] += size
    clean, bad = (
        unexpected_ways(times, some, filled(times, some, headings), headings, 5)
        for some in (positions, jumped)
    )
    assert clean.told[row - 1]
    expected = clean.effects[row - 1].reshape(3, 3, 3, 3)[:, :, who] @ size
    # So large a jump is left out of what is usual, which some windows less change by noise.
    np.testing.assert_allclose(
        bad.values[row - 1] - clean.values[row - 1], expected, atol=0.03 * size[2]
    )


@pytest.mark.parametrize(
    ("who", "size", "last"),
    [((1, 2), (0.03, 0.04, 0.0), None), ((0,), (0.08, 0.0, 0.0), 180.0), ((2,), (0, 0, 0.15), 165)],
)
def test_receivers_of_unequal_rates_show_who_it_was(who, size, last):
    """The reference writes once a second, the two others five times."""
    made = made_drive(14, WHITE, seconds=300.0, every=MIXED)
    bad = made.jumped(list(who), rows_from(made, 150.4, last), np.array(size))
    _, (error,), _ = settle(bad.steps)
    assert who in (error.receivers, *error.alike)
    off = error.size - size
    # 99.9 % of three normal numbers.
    assert who != error.receivers or off @ np.linalg.solve(error.covariance, off) < 16.3
    # As often as the receivers write that have it.
    first = 150.4 if 0 not in who else 151.0
    assert abs(error.start - made.steps.times[0] - first) < 0.41 + (0 in who)
    assert error.stays == (last is None)


@pytest.mark.parametrize(
    ("who", "size"), [((0, 1, 2), (0.07, -0.10, 0.03)), ((1, 2), (0.05, -0.06, 0.02))]
)
def test_receivers_of_three_rates_show_a_jump(who, size):
    made = made_drive(21, WHITE, seconds=300.0, every=(1.0, 0.2, 0.1))
    bad = made.jumped(list(who), rows_from(made, 150.0), np.array(size))
    (found,) = settle(bad.steps)[1]
    assert found.receivers == who
    assert abs(found.start - made.steps.times[0] - 150.0) < 0.41
    off = found.size - size
    assert off @ np.linalg.solve(found.covariance, off) < 16.3  # 99.9 % of three normal numbers
    assert settle(made.steps)[1] == []


def test_the_size_of_a_restart_under_slow_errors_is_within_its_covariance():
    """Slow errors make the means before and after differ by a centimetre by themselves."""
    size, squares = np.array([0.10, -0.08, 0.06]), []
    for seed in range(61, 65):
        made = made_drive(seed, Errors(0.003, 0.010, 60.0), seconds=300.0)
        (found,) = settle(made.jumped([1, 2], rows_from(made, 150.0), size).steps)[1]
        assert found.receivers == (1, 2)
        squares.append((found.size - size) @ np.linalg.solve(found.covariance, found.size - size))
    # 99.9 % of twelve normal numbers, and 0.1 %.
    assert 2.2 < sum(squares) < 32.9


def test_of_dense_epochs_those_with_most_fixes_are_looked_at():
    made = made_drive(21, WHITE, seconds=60.0, every=(1.0, 0.2, 0.1))
    rows = spaced_rows(made.steps)
    np.testing.assert_allclose(np.diff(made.steps.times[rows]), 0.2, atol=1e-6)
    assert (made.steps.kinds[rows][:, :2] == 4).sum() == (made.steps.kinds[:, :2] == 4).sum()


def test_a_false_fix_too_small_for_its_motion_is_found_by_the_whole_drive():
    """At 1 Hz an antenna goes metres from fix to fix, but its distances stay."""
    made = made_drive(16, Errors(0.006), seconds=300.0, every=(1.0, 1.0, 1.0))
    bad = made.jumped([0], rows_from(made, 150.0, 175.0), np.array([0.0, 0.08, 0.0]))
    _, (error,), _ = settle(bad.steps)
    assert (error.receivers, error.stays) == ((0,), False)
    off = np.array([error.start, error.end]) - made.steps.times[0] - [150.0, 175.0]
    # Noise moves its place by as many fixes.
    assert np.abs(off).max() < UNSURE + 0.1
    away = error.size - [0.0, 0.08, 0.0]
    # 99.9 % of three normal numbers.
    assert away @ np.linalg.solve(error.covariance, away) < 16.3


def test_sums_over_the_drive_give_the_gain_of_least_squares():
    """Twice the log likelihood ratio, by two whole adjustments with numpy."""
    rng = np.random.default_rng(3)
    n, p, k = 60, 2, 4
    own, error = rng.normal(size=(n, p, k)), rng.normal(size=(n, p, 3))
    weight = np.array([[2.0, 0.3], [0.3, 1.0]])
    residuals = rng.normal(size=(n, p))
    first, last = 20, 45
    inside = ((np.arange(n) >= first) & (np.arange(n) < last))[:, None, None]
    root = np.linalg.cholesky(weight).T

    def cost(design, known):
        A, b = (root @ design).reshape(n * p, -1), (root @ residuals[..., None]).ravel()
        # What is known of a size: about nothing, with a standard deviation of 30 cm.
        A = np.vstack([A, known])
        x = np.linalg.lstsq(A, np.append(b, np.zeros(len(known))), rcond=None)[0]
        return np.square(A @ x - np.append(b, np.zeros(len(known)))).sum(), x

    without, _ = cost(own, np.zeros((0, k)))
    both = np.concatenate([own, inside * error], axis=2)
    known = np.hstack([np.zeros((3, k)), np.eye(3) / USUAL])
    least, found = cost(both, known)
    sums = DriveSums.of(own, error, residuals, weight)
    sizes, _, gains = sums.fit(np.array([first]), np.array([last]))
    np.testing.assert_allclose(sizes[0], found[k:], rtol=1e-6)
    assert gains[0] == pytest.approx(without - least, rel=1e-6)
    np.testing.assert_allclose(sums.change(first, last, sizes[0]), found[:k], rtol=1e-6)


def test_an_antenna_between_its_fixes_goes_with_the_vehicle():
    times = np.arange(0.0, 10.0, 0.2)
    headings = 0.3 * times
    R = np.array([[[np.cos(h), -np.sin(h)], [np.sin(h), np.cos(h)]] for h in headings])
    way = np.column_stack([5 * times, 2 * times])
    arms = np.array([[0.0, 0.0], [1.7, 0.5], [1.7, -0.5]])
    level = way[:, None] + np.einsum("tij,rj->tri", R, arms)
    positions = np.concatenate([level, np.full((len(times), 3, 1), 2.0)], axis=2)
    seen = positions.copy()
    seen[np.arange(len(times)) % 5 > 0, 0] = np.nan
    inside = slice(0, 46)
    np.testing.assert_allclose(filled(times, seen, headings)[inside], positions[inside], atol=1e-9)
