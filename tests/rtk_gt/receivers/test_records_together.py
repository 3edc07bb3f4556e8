"""Records that do not belong together are told apart from drives that determine little."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from data_samples.drives.drive import OFFSETS, DriveSettings, simulate_drive
from rtk_gt.offsets.checks import check_prior
from rtk_gt.offsets.minima import all_minima
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.receivers.fixes import RTK_FLOAT
from rtk_gt.receivers.steps import common_steps
from rtk_gt.receivers.together import check_together
from validation.errors import GtvalError


@pytest.fixture(scope="module")
def drive():
    return simulate_drive(61, DriveSettings(loops=3))


def judged(drive, second):
    records = (drive.records[0], second, drive.records[2])
    check_together(records, common_steps(records, drive.frame), 0.005)


def test_one_vehicle_is_accepted(drive):
    judged(drive, drive.records[1])


@pytest.mark.parametrize("ahead", [18.0, -18.0])
def test_gps_time_beside_utc_is_named(drive, ahead):
    second = drive.records[1]
    with pytest.raises(GtvalError, match="do not move together") as raised:
        judged(drive, replace(second, times=second.times + ahead))
    late = "front_left" if ahead > 0 else "rear"
    said = re.search(r"With the clock of (\w+) set back by about (\d+) s", str(raised.value))
    assert said is not None
    assert said[1] == late
    # The antennas are 1.7 m apart, which the vehicle drives in 0.6 s.
    assert int(said[2]) == pytest.approx(18, abs=1)


def test_another_vehicle_is_named(drive):
    other = simulate_drive(62, DriveSettings(loops=3, route="eight")).records[1]
    with pytest.raises(GtvalError, match="Are both files of this vehicle"):
        judged(drive, other)


def test_what_keeps_receivers_from_common_times_is_said(drive):
    second = drive.records[1]
    floats = replace(second, kinds=np.full(len(second), RTK_FLOAT))
    with pytest.raises(GtvalError, match=r"front_left is never RTK-fixed in .*are RTK float"):
        judged(drive, floats)
    with pytest.raises(GtvalError, match=r"0\.070 s apart at best"):
        judged(drive, replace(second, times=second.times + 0.07))
    with pytest.raises(GtvalError, match=r"from 1970-01-01 .*needs `date"):
        judged(drive, replace(second, times=second.times - second.times[0] // 86400 * 86400))


@pytest.mark.parametrize("row", [0, 1])
def test_heights_in_feet_that_are_called_metres_are_named(row):
    """Told by how they change; a drive on level ground does not tell."""
    hilly = simulate_drive(63, DriveSettings(loops=3))
    records = list(hilly.records)
    for k, one in enumerate(records):
        places = one.geodetic.copy()
        places[:, 2] += 0.5 * np.sin(one.times / 20)
        places[:, 2] /= 0.3048 if k == row else 1.0
        records[k] = replace(one, geodetic=places)
    words = rf"heights of {records[row].receiver} .* change 3\.2\d times .* in feet.*0\.3048"
    with pytest.raises(GtvalError, match=words):
        check_together(records, common_steps(records, hilly.frame), 0.005)


def prior(offsets):
    return OffsetPrior(offsets=offsets, offset_sigmas=np.full(offsets.shape, 0.005))


def checked(steps, known):
    find = partial(all_minima, steps, eta=1.75, robust=True)
    return check_prior(find, known, find(prior=known).best, steps)


def test_stated_offsets_that_are_right_agree():
    """The probability is that of chance: uniform over drives, so seldom below 0.1 %."""
    found = []
    for seed in range(300, 320):
        made = simulate_drive(seed, DriveSettings(loops=3))
        steps = common_steps(made.records, made.frame)
        stated = OFFSETS + 0.005 * np.random.default_rng(seed).standard_normal(OFFSETS.shape)
        stated[0] = 0.0
        found.append(checked(steps, prior(stated)).probability)
    # Of 20 uniform numbers, all are above 0.0005 in 99 of 100 cases; their mean has sigma 0.065.
    assert min(found) > 0.0005
    assert abs(np.mean(found) - 0.5) < 4 * 0.065


def test_stated_offsets_of_exchanged_receivers_are_refused(drive):
    steps = common_steps(drive.records, drive.frame)
    with pytest.raises(GtvalError, match="contradict the drive") as raised:
        checked(steps, prior(OFFSETS[[0, 2, 1]]))
    assert "Exchanged, those of front_left and front_right fit" in str(raised.value)
    assert checked(steps, OffsetPrior()) is None


def test_stated_offsets_that_the_drive_leaves_open_are_not_doubted():
    """On flat ground a vertical offset that is wrong by a metre cannot be seen."""
    flat = simulate_drive(63, DriveSettings(steepest=0.0))
    steps = common_steps(flat.records, flat.frame)
    lifted = OFFSETS + np.array([[0, 0, 0], [0, 0, 0.3], [0, 0, 0.3]])
    assert checked(steps, prior(lifted)).probability > 0.001
