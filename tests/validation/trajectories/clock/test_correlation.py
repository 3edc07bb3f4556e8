"""Delays by the maximum of the correlation of headings, and what is known to be wrong with it."""

from dataclasses import replace

import numpy as np
import pytest

from data_samples.motion.drive import motion_drive
from data_samples.motion.files import write_motion
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError
from validation.in_time import time_parts
from validation.poses.angles import wrap
from validation.poses.trajectory import Trajectory
from validation.results import Figure, Table
from validation.trajectories.clock.correlation import STEP, WINDOW, correlate_headings
from validation.trajectories.correlation_telling import correlation_section

HALF_STEP = STEP / 2


def heading(times):
    """A robot that turns to and fro at rates that never repeat in the record."""
    slow = np.sin(0.31 * times) + 0.8 * np.sin(0.173 * times + 1.0) + 0.5 * np.sin(0.71 * times)
    return slow + 0.3 * np.sin(1.37 * times + 0.4)


def trajectory(name, times, angles, epoch=0):
    poses = np.column_stack([np.zeros((len(times), 2)), wrap(angles)])
    return Trajectory(name, times, poses, epoch=epoch)


def odometry(way=heading, seconds=120.0):
    times = np.arange(0, seconds, 0.02)
    return trajectory("odometry", times, way(times))


def camera(way=heading, delay=0.0, rate=10.0, seconds=120.0, noise=0.0):
    """Its stamps are the true times less the delay."""
    times = np.arange(5.0, seconds - 5.0, 1 / rate)
    errors = noise * np.random.default_rng(4).normal(size=len(times))
    return trajectory("camera", times - delay, way(times) + 0.7 + errors)


def rounded(delay):
    return pytest.approx(delay, abs=HALF_STEP + 1e-9)


@pytest.mark.parametrize("delay", [-1.5, -0.34, -0.1, 0.0, 0.02, 0.14, 1.8])
def test_a_known_delay_is_found_but_for_the_repeated_images(delay):
    found = correlate_headings(odometry(), camera(delay=delay))
    # Stamps are on samples here, so that ages are 0, 20, 40, 60, 80 ms: 40 ms on average.
    assert found.repeats == 5
    assert found.before.delay_s == rounded(delay - 0.04)
    assert found.without_repeats(found.after) == rounded(delay)
    assert found.faults(found.after) == ("repeats",)
    assert found.before.height > 0.999
    assert not found.spurious.any()


@pytest.mark.parametrize(("rate", "repeats"), [(5.0, 10), (10.0, 5), (25.0, 2), (50.0, 1)])
def test_an_image_repeated_m_times_delays_by_half_of_m_less_one_samples(rate, repeats):
    found = correlate_headings(odometry(), camera(rate=rate))
    assert found.repeats == repeats
    assert found.held_s == pytest.approx((repeats - 1) / 2 * STEP)
    assert found.before.delay_s == rounded(-found.held_s)
    assert ("repeats" in found.faults(found.before)) == (repeats > 1)


def test_a_camera_faster_than_the_samples_is_found():
    found = correlate_headings(odometry(), camera(rate=100.0, delay=-0.2))
    assert found.repeats == 1
    assert found.after.delay_s == rounded(-0.2 - HALF_STEP / 2)


def test_the_epochs_of_the_two_may_differ():
    wheels, seen = odometry(), camera(delay=0.3)
    later = replace(seen, times=seen.times - 7, epoch=7)
    a, b = correlate_headings(wheels, seen), correlate_headings(wheels, later)
    assert a.after.delay_s == b.after.delay_s == rounded(0.26)


def test_where_the_robot_turns_evenly_the_maximum_means_nothing_and_is_said_to():
    def evenly(times):
        return 0.3 * times

    found = correlate_headings(odometry(evenly), camera(evenly, noise=0.005))
    # Any delay makes the same shape: what fits as well is the whole window.
    assert (found.before.low_s, found.before.high_s) == (-WINDOW, WINDOW)
    assert "edge" in found.faults(found.before)
    assert all("edge" in found.faults(part) for part in found.parts)


def test_a_delay_beyond_the_window_stands_at_its_edge():
    found = correlate_headings(odometry(), camera(delay=2.6))
    assert found.after.delay_s == pytest.approx(WINDOW)
    assert "edge" in found.faults(found.after)


def test_half_turns_spoil_the_whole_signal_until_they_are_taken_out():
    seen = camera(delay=0.1, noise=0.005)
    flipped = np.zeros(len(seen), dtype=bool)
    flipped[np.random.default_rng(2).random(len(seen)) < 0.1] = True
    flipped[200:230] = True
    poses = seen.poses.copy()
    poses[flipped, 2] = wrap(poses[flipped, 2] + np.pi)
    found = correlate_headings(odometry(), replace(seen, poses=poses))
    assert (found.spurious == flipped).all()
    assert found.flips == flipped.sum()
    assert found.before.height < 0.9
    assert found.before.high_s - found.before.low_s > 0.1
    assert "flips" in found.faults(found.before)
    assert "flips" not in found.faults(found.after)
    assert found.without_repeats(found.after) == rounded(0.1)


def test_a_large_delay_makes_no_image_of_a_turning_robot_spurious():
    def seldom(times):
        # Stands most of the time, so that the spread of what it does then is small.
        return 1.5 * np.tanh(2.0 * (np.mod(times, 30.0) - 15.0)) * (-1.0) ** (times // 30.0)

    found = correlate_headings(odometry(seldom), camera(seldom, delay=0.9, noise=0.003))
    assert not found.spurious.any()
    assert found.without_repeats(found.after) == rounded(0.9)


def test_drifting_odometry_moves_the_maximum_of_the_whole_signal_not_that_of_parts():
    def drifting(times):
        return heading(times) + 0.02 * times

    seen = camera(delay=0.1)
    # The camera sees the robot in three parts.
    parts = np.flatnonzero(np.mod(seen.times, 40.0) > 15.0)
    found = correlate_headings(odometry(drifting), seen.select(parts))
    assert found.drift == pytest.approx(0.02 * 80.0, rel=0.25)
    assert "drift" in found.faults(found.after)
    assert len(found.parts) == 3
    assert not any("drift" in found.faults(part) for part in found.parts)
    off = [abs(found.without_repeats(peak) - 0.1) for peak in found.parts]
    assert found.after.height < min(peak.height for peak in found.parts)
    assert np.median(off) < abs(found.without_repeats(found.after) - 0.1) + STEP


def test_images_in_a_gap_of_the_odometry_are_left_out():
    wheels, seen = odometry(), camera(delay=0.1)
    gap = (wheels.times > 50.0) & (wheels.times < 60.0)
    found = correlate_headings(wheels.select(~gap), seen)
    assert len(seen) - len(found.times) == pytest.approx(100, abs=1)
    assert not found.spurious.any()
    assert found.without_repeats(found.after) == rounded(0.1)
    assert max(np.ptp([part.first_s, part.last_s]) for part in found.parts) < 61.0


def test_a_robot_that_stands_has_no_delay():
    found = correlate_headings(odometry(np.zeros_like), camera(np.zeros_like, noise=0.005))
    assert np.isnan(found.before.delay_s)
    assert found.parts == ()


def test_what_cannot_be_correlated_is_refused_and_named_in_the_section():
    seen = camera()
    points = Trajectory("points", seen.times, seen.poses[:, :2], kind="points_plane")
    with pytest.raises(GtvalError, match="no orientation"):
        correlate_headings(odometry(), points)
    late = replace(seen, epoch=1000)
    with pytest.raises(GtvalError, match="'camera' has 0 images while 'odometry' was logged"):
        correlate_headings(odometry(), late)
    section = correlation_section(odometry(), [points, late])
    assert "positions only" in section.blocks[1].text
    assert "camera" in section.blocks[2].text


@pytest.mark.parametrize("level", [1, 2])
def test_drives_of_a_robot_past_four_cameras(level):
    for seed in range(3):
        drive = motion_drive(seed, level=level, minutes=8.0)
        for name, seen in drive.cameras.items():
            found = correlate_headings(drive.odometry, seen)
            # Half a step of the maximum and half a step of where images stand between samples;
            # the noise over 0.2 rad/s and the root of 150 images is 0.4 s/rad: five of these.
            within = STEP + 2 * drive.level.angle
            error = found.without_repeats(found.after) - drive.clocks[name].delay_s
            assert abs(error) < within, (seed, name)
            errors = [found.without_repeats(p) - drive.clocks[name].delay_s for p in found.parts]
            assert abs(np.median(errors)) < within, (seed, name)
            # Wrong images are drawn at a share each; some that are placed at random are near.
            share = drive.level.outliers
            assert found.spurious.mean() < share + 4 * np.sqrt(share / len(seen))
            assert found.before.height < found.after.height


@pytest.fixture(scope="module")
def drive():
    return motion_drive(1, level=3, minutes=4.0)


def test_the_maximum_of_a_spoiled_whole_signal_is_worse_than_that_of_a_clean_one():
    errors = []
    for seed in range(4):
        drive = motion_drive(seed, level=3, minutes=8.0)
        for name, seen in drive.cameras.items():
            found = correlate_headings(drive.odometry, seen)
            true = drive.clocks[name].delay_s
            both = (found.before, found.after)
            errors.append([abs(found.without_repeats(peak) - true) for peak in both])
    before, after = np.sqrt(np.mean(np.square(errors), axis=0))
    assert before > 3 * after


def test_the_section_has_every_whole_and_every_part_and_its_figures_draw(drive):
    section = correlation_section(drive.odometry, list(drive.cameras.values()))
    (table,) = [block for block in section.blocks if isinstance(block, Table)]
    found = [correlate_headings(drive.odometry, seen) for seen in drive.cameras.values()]
    assert len(table.rows) == sum(2 + len(one.parts) for one in found)
    delays = [row[2] for row in table.rows]
    whole = [found[0].before.delay_s, found[0].after.delay_s]
    assert delays[:2] == pytest.approx(1000 * np.array(whole))
    figures = [block for block in section.blocks if isinstance(block, Figure)]
    names = ["correlated_signals", "correlated_parts", "correlated_closer"]
    assert [figure.name for figure in figures] == names
    drawn = [figure.draw() for figure in figures]
    above, below = drawn[0].axes
    images = [sum(len(line.get_xdata()) for line in axes.lines[:4]) for axes in (above, below)]
    assert images[0] - images[1] == sum(int(one.spurious.sum()) for one in found)
    told = [text.get_text() for axes in drawn[1].axes for text in axes.texts]
    assert len(told) == sum(len(one.parts) for one in found)
    largest = max(abs(part.delay_s) for one in found for part in one.parts)
    assert f"{1000 * largest:.0f} ms" in drawn[2].axes[0].get_title()


def test_a_campaign_that_names_its_odometry_has_the_section(tmp_path):
    drive = motion_drive(1, level=1, minutes=1.5)
    write_motion(tmp_path, drive)
    toml = tmp_path / "campaign.toml"
    # A clock takes a while: one camera has it, and all that follows, too.
    moving = [drive.reference, drive.odometry, drive.cameras["camera_1"]]
    parts = time_parts(load_campaign(tmp_path), moving)
    # The clocks by the estimator follow it.
    titles = [section.title for section in parts.sections[:2]]
    assert titles == ["Headings correlated with odometry", "Clocks"]
    (table,) = [block for block in parts.sections[0].blocks if isinstance(block, Table)]
    assert {row[0] for row in table.rows} == {"camera_1"}
    toml.write_text(toml.read_text().replace('reference = "mocap"', ""))
    parts = time_parts(load_campaign(tmp_path), moving)
    assert [section.title for section in parts.sections] == titles[:1]
    assert [finding.code for finding in parts.findings] == ["no_time_reference"]
    toml.write_text(toml.read_text().replace('odometry = "odometry"', 'odometry = "wheels"'))
    with pytest.raises(InputError, match="no system of that name has a trajectory"):
        time_parts(load_campaign(tmp_path), moving)
