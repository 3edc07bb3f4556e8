"""An epoch that one receiver lacks hides no jump, and makes none."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from trials.lasting_errors import Errors, made_drive
from trials.rough_drives import rough_drive, spoilt_by

from rtk_gt.lasting.lacking_fixes import with_lost_fixes
from rtk_gt.lasting.seen_from_vehicle import baseline_headings
from rtk_gt.lasting.settled import settle
from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.offsets.first_offsets import first_offsets
from rtk_gt.receivers.fixes import RTK_FIXED

WHITE = Errors(0.003)
AT = 150.0


def rows_from(made, second, last=None):
    times = made.steps.times - made.steps.times[0]
    return np.flatnonzero((times > second - 1e-3) & (times < (last or np.inf) - 1e-3))


def floating(steps, rows, receiver):
    """The receiver is not fixed at some epochs."""
    kinds = steps.kinds.copy()
    kinds[rows, receiver] = 5
    return replace(steps, kinds=kinds)


def without(steps, row, receiver):
    kinds = steps.kinds.copy()
    kinds[row, receiver] = -1
    positions = np.where((kinds < 0)[..., None], np.nan, steps.positions)
    return replace(steps, kinds=kinds, positions=positions)


@pytest.mark.parametrize("late", [-1, 0, 1, 2])
def test_a_jump_of_all_beside_a_lost_epoch_is_found(late):
    size = np.array([0.3, -0.2, 0.05])
    made = made_drive(11, WHITE, seconds=300.0)
    rows = rows_from(made, AT)
    bad = made.jumped([0, 1, 2], rows, size)
    _, errors, _ = settle(without(bad.steps, rows[0] + late, 1))
    (one,) = errors
    assert one.receivers == (0, 1, 2)
    assert one.stays
    assert abs(one.start - made.steps.times[0] - AT) < 0.41
    off = one.size - size
    # 99.9 % of three normal numbers.
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


def test_what_stands_for_a_lost_fix_is_where_the_antenna_was():
    made = made_drive(12, WHITE, seconds=300.0, bases=False)
    rng = np.random.default_rng(5)
    lost = rng.random(made.steps.kinds.shape) < 0.05
    lost[rng.permutation(len(lost))[: len(lost) // 2]] = False
    steps = made.steps
    for receiver in range(3):
        steps = without(steps, lost[:, receiver], receiver)
    filled = with_lost_fixes(steps)
    known = lost & (filled.kinds == RTK_FIXED)
    assert known.sum() > 0.95 * lost.sum()
    off = (filled.positions - made.steps.positions)[known]
    # Noise of the fix itself, of two others and of two arms, and how the vehicle leans meanwhile.
    assert np.sqrt(np.square(off[:, :2]).mean()) < 3 * WHITE.white
    assert np.abs(off).max() < 0.05
    assert np.array_equal(filled.positions[~lost], made.steps.positions[~lost])


def test_a_receiver_that_writes_less_often_gets_no_fixes():
    made = made_drive(12, WHITE, seconds=60.0, every=(1, 1, 5))
    assert np.array_equal(with_lost_fixes(made.steps).kinds, made.steps.kinds)


@pytest.mark.parametrize("size", [(0.4, 0.07, 0.0), (-0.5, 0.8, 0.05), (0.0, 0.0, -1.0)])
def test_a_large_false_fix_has_its_size(size):
    made = made_drive(13, WHITE, seconds=400.0)
    bad = made.jumped([1], rows_from(made, AT, AT + 40.0), np.array(size))
    _, errors, _ = settle(bad.steps)
    (one,) = errors
    assert one.receivers == (1,)
    assert abs(one.start - made.steps.times[0] - AT) < 0.41
    assert abs(one.end - made.steps.times[0] - AT - 40.0) < 0.61
    off = one.size - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


@pytest.mark.parametrize("seed", [14, 16])
def test_who_restarts_is_told_where_one_receiver_writes_less_often(seed):
    size = np.array([0.12, -0.07, 0.05])
    made = made_drive(seed, WHITE, seconds=400.0, every=(1.0, 0.2, 0.2))
    _, errors, _ = settle(made.jumped([1, 2], rows_from(made, AT), size).steps)
    (one,) = errors
    assert one.receivers == (1, 2)
    off = one.size - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


def test_a_jump_that_hides_the_offsets_is_one_jump_of_its_receivers():
    """30 cm for two thirds of the drive, one receiver in three at 5 Hz."""
    size = np.array([-0.05, 0.28, 0.09])
    made = made_drive(39, Errors(0.006), seconds=300.0, every=(1.0, 0.2, 1.0))
    bad = made.jumped([0], rows_from(made, 95.0), size).steps
    _, (one,), _ = settle(bad)
    assert (0,) in (one.receivers, *one.alike)
    off = one.size * (1 if one.receivers == (0,) else -1) - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


def test_a_part_without_the_jump_tells_the_offsets():
    made = made_drive(39, Errors(0.006), seconds=300.0, every=(1.0, 0.2, 1.0))
    bad = made.jumped([0], rows_from(made, 95.0), np.array([-0.05, 0.28, 0.09])).steps
    quick = partial(estimate_offsets, bent="never")
    assert not quick(bad).known
    found = first_offsets(bad, quick)
    assert found.known
    # Those after the jump: the two others seem to be off by as much.
    off = found.offsets.values - made.offsets - [[0, 0, 0], *[[-0.05, 0.28, 0.09]] * 2]
    off = (off - off[0])[1:].ravel()
    # Chi-squared of six; one in a thousand is larger.
    assert off @ np.linalg.solve(found.offset_covariance, off) < 22.5
    assert ((found.weights > 0) == (bad.times[bad.complete] - bad.times[0] > 95.0)).mean() > 0.95
    straight = made_drive(40, WHITE, seconds=30.0, every=(1.0, 1.0, 1.0)).steps
    assert first_offsets(straight, quick).steps == quick(straight).steps


def test_a_restart_while_one_of_its_receivers_has_no_fix_is_placed_by_the_other():
    size = np.array([0.01, -0.04, 0.03])
    made = made_drive(17, WHITE, seconds=300.0)
    bad = made.jumped([1, 2], rows_from(made, AT), size).steps
    _, (one,), _ = settle(floating(bad, rows_from(made, AT - 12.0, AT + 8.0), 1))
    assert one.receivers == (1, 2)
    assert abs(one.start - made.steps.times[0] - AT) < 0.41
    off = one.size - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


def test_a_false_fix_that_a_receiver_loses_ends_with_its_next_fix():
    """Upwards no distance changes to the first order."""
    made = made_drive(17, WHITE, seconds=300.0)
    bad = made.jumped([0], rows_from(made, AT, AT + 25.0), np.array([0.0, 0.0, 0.15])).steps
    _, (one,), _ = settle(floating(bad, rows_from(made, AT + 9.0, AT + 29.0), 0))
    assert one.receivers == (0,)
    found = np.array([one.start, one.end]) - made.steps.times[0]
    np.testing.assert_allclose(found, [AT, AT + 29.0], atol=0.41)


def test_a_jump_at_a_lost_fix_of_its_receiver_is_whole():
    size = np.array([0.0, 0.0, 0.1])
    made = made_drive(12, Errors(0.004), seconds=300.0)
    rows = rows_from(made, AT, AT + 30.0)
    _, (one,), _ = settle(without(made.jumped([1], rows, size).steps, rows[0], 1))
    assert one.receivers == (1,)
    assert abs(one.start - made.steps.times[0] - AT) < 0.41
    off = one.size - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


def moved_up(steps, at, height, for_epochs):
    """The second antenna is higher for some epochs from each of some on."""
    positions = steps.positions.copy()
    for row in at:
        positions[row : row + for_epochs, 1, 2] += height
    return replace(steps, positions=positions)


@pytest.mark.parametrize(("elsewhere", "share"), [(20, 0.5), (0, 0.0)])
def test_over_a_lost_fix_an_antenna_leans_as_elsewhere_or_jumps(elsewhere, share):
    made = made_drive(12, WHITE, seconds=300.0, bases=False)
    at = 20 * np.random.default_rng(3).choice(70, elsewhere, replace=False) + 60
    rough = moved_up(moved_up(made.steps, at, 0.2, 5), [41], 0.2, 2000)
    told = with_lost_fixes(without(rough, 40, 1)).positions[40, 1, 2]
    true = made.steps.positions[40, 1, 2]
    # Noise of three fixes of 5 mm up, and what the vehicle leans meanwhile.
    assert told - true == pytest.approx(0.2 * share, abs=0.05)


@pytest.mark.parametrize("seed", [2116, pytest.param(2008, marks=pytest.mark.full)])
def test_a_clean_hour_on_a_rough_road_has_no_jump(seed):
    # Alarmed once by a lost fix in a pothole, and by a turn of 30 degrees a second.
    made = rough_drive(seed, Errors(0.004), seconds=3600.0, every=(1.0, 0.2, 0.2))
    assert settle(made.steps)[1] == []


def assert_false_fix_upwards_is_found(made, seed):
    bad, put = spoilt_by(made, seed, "false up")
    (one,) = settle(bad.steps)[1]
    assert one.receivers == put.receivers
    np.testing.assert_allclose([one.start, one.end], [put.start, put.end], atol=0.41)


@pytest.mark.parametrize("seed", [6000, 6001])
def test_speed_bumps_of_a_smooth_road_are_no_jumps(seed):
    made = rough_drive(seed, WHITE, bumps=5)
    assert settle(made.steps)[1] == []
    # A false fix that begins elsewhere is found as before.
    assert_false_fix_upwards_is_found(made, seed)


@pytest.mark.full
def test_a_clean_hour_under_slow_errors_on_a_rough_road_has_no_jump():
    # Slow errors go on east and north: along a baseline that turns they change within seconds.
    made = rough_drive(859, Errors(0.004, 0.007, 120.0), seconds=3600.0, every=(1.0, 0.2, 0.2))
    assert settle(made.steps)[1] == []


def test_a_false_fix_upwards_ends_with_the_fix_that_its_receiver_finds_again():
    made = rough_drive(2513, Errors(0.003, 0.010, 30.0), every=(1.0, 0.2, 0.2))
    assert_false_fix_upwards_is_found(made, 2513)


def test_a_jump_of_those_that_write_often_and_of_the_other_is_one_of_all():
    errors, every = Errors(0.003, 0.005, 60.0), (1.0, 0.2, 0.1)
    bad, put = spoilt_by(rough_drive(2614, errors, every=every), 2614, "all up")
    (one,) = settle(bad.steps)[1]
    assert one.receivers == (0, 1, 2)
    assert one.stays
    assert abs(one.start - put.start) < 0.41


def test_what_the_whole_drive_shows_takes_no_end_of_a_clearer_error():
    made = rough_drive(2514, Errors(0.003, 0.005, 60.0), every=(1.0, 0.2, 0.2))
    assert_false_fix_upwards_is_found(made, 2514)


def test_the_heading_goes_on_while_an_end_of_the_longest_baseline_has_no_fix():
    made = made_drive(12, WHITE, seconds=120.0, bases=False)
    positions = made.steps.positions.copy()
    away = rows_from(made, 50.0, 70.0)
    positions[away, 0] = np.nan
    whole = baseline_headings(made.steps.times, made.steps.positions)
    found = baseline_headings(made.steps.times, positions)
    # White noise of 3 mm on 1.14 m, 5 sigmas, and how a leaning vehicle turns the two apart.
    assert np.abs(found - whole)[away].max() < 5 * 0.003 * 2**0.5 / 1.14 + 0.02
    np.testing.assert_allclose(np.delete(found, away), np.delete(whole, away))


def test_a_jump_of_two_while_the_third_has_no_fix_is_one_of_two():
    """Their motion alone looks like one of all, and the third comes back where it was."""
    made = made_drive(31, WHITE, seconds=300.0)
    size = np.array([0.08, -0.12, 0.03])
    bad = made.jumped([0, 1], rows_from(made, AT), size)
    (found,) = settle(floating(bad.steps, rows_from(made, 130.0, 155.0), 2))[1]
    assert found.receivers == (0, 1)
    assert abs(found.start - made.steps.times[0] - AT) < 0.41
    off = found.size - size
    assert off @ np.linalg.solve(found.covariance, off) < 16.3  # 99.9 % of three normal numbers


@pytest.mark.parametrize("size", [(0.08, -0.07, 0.0), (0.0, 0.0, 0.14)])
def test_a_jump_of_all_while_one_of_those_that_write_often_has_no_fix_is_found(size):
    made = made_drive(11, WHITE, seconds=300.0, every=(1.0, 0.2, 0.2))
    bad = made.jumped([0, 1, 2], rows_from(made, AT), np.array(size)).steps
    _, (one,), _ = settle(floating(bad, rows_from(made, AT - 7.0, AT + 8.0), 1))
    assert one.receivers == (0, 1, 2)
    assert abs(one.start - made.steps.times[0] - AT) < 0.41
    off = one.size - size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3


@pytest.mark.parametrize("seed", [508, 520])
def test_a_false_fix_upwards_has_its_level_part_beside_the_offsets_that_it_bends(seed):
    """15 cm up for half a minute made heights 8 cm wrong, and these a level part of 9 mm."""
    made = rough_drive(seed, Errors(0.004), every=(1.0, 0.2, 0.2))
    bad, put = spoilt_by(made, seed, "false up")
    _, (one,), _ = settle(bad.steps)
    assert put.receivers in (one.receivers, *one.alike)
    off = one.size - put.size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3
    assert np.linalg.norm(off[:2]) < 0.004


def test_a_jump_of_all_that_the_distances_show_of_none_is_of_all():
    """Two of three that write often seem to jump, or all; the whole drive shows nothing of two."""
    made = rough_drive(520, Errors(0.004), every=(1.0, 0.2, 0.2))
    bad, put = spoilt_by(made, 520, "all up")
    _, (one,), _ = settle(bad.steps)
    assert one.receivers == put.receivers
    off = one.size - put.size
    assert off @ np.linalg.solve(one.covariance, off) < 16.3
