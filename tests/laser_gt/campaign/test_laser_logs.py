"""The same campaign from the logs of a robot as from gtval's own files."""

from dataclasses import replace

import numpy as np
import pytest
from laser_rooms import write_campaign

from data_samples.rooms.scanners import SICK_FRONT, SICK_REAR
from laser_gt.campaign.inputs import load_inputs
from laser_gt.logs.scan_csv import read_scan_csv
from laser_gt.scans.planar import compose, inverse
from laser_gt.settings import LaserSettings
from laser_gt.system import SYSTEM
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError
from validation.poses.pose_table import from_csv

SCANNERS = tuple(replace(one, beams=181) for one in (SICK_FRONT, SICK_REAR))


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path, seed=4, stops=3, scanners=SCANNERS)
    return tmp_path


def _inputs(folder):
    loaded = load_campaign(folder)
    return load_inputs(loaded, loaded.section("laser", LaserSettings))


def _use(folder, text):
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("[laser]\n", f"[laser]\n{text}\n"))


def _use_for(folder, scanner, text):
    toml = folder / "campaign.toml"
    table = f"[laser.scanners.{scanner}]\n"
    toml.write_text(toml.read_text().replace(table, f"{table}{text}\n"))


def _times(folder):
    """Each stop at its own time, ten seconds apart, and odometry as written."""
    odometry = from_csv(folder / "laser" / "odometry.csv", "odometry")
    times = {stop: 100.0 + 10 * number for number, stop in enumerate(odometry.ids)}
    rows = "".join(f"{stop},{time}\n" for stop, time in times.items())
    (folder / "laser" / "stops.csv").write_text(f"pose,time\n{rows}")
    return times, dict(zip(odometry.ids, odometry.poses, strict=True))


def _rawseeds(folder, clock=0.0):
    """Front and rear SICK files and odometry, as RAWSEEDS names them."""
    times, odometry = _times(folder)
    lines = {"front": [], "rear": []}
    for record in read_scan_csv(folder / "laser" / "scans.csv"):
        late = clock if record.scan.sensor == "rear" else 0.0
        ranges = ", ".join(
            f"{r:.4f}" for r in np.where(record.scan.returned, record.scan.ranges, 0)
        )
        lines[record.scan.sensor].append(f"{times[record.stop] + late}, 181, 0, {ranges}")
    for name, text in lines.items():
        (folder / "laser" / f"SICK_{name.upper()}.csv").write_text("\n".join(text) + "\n")
        _use_for(folder, name, f'scans = "laser/SICK_{name.upper()}.csv"')
    poses = "".join(
        f"{times[stop]}, 1, 10, 20, {x}, {y}, {theta}\n" for stop, (x, y, theta) in odometry.items()
    )
    (folder / "laser" / "ODOMETRY_XYT.csv").write_text(poses)
    (folder / "laser" / "scans.csv").unlink()
    _use(folder, 'format = "rawseeds_sick"\nodometry_format = "rawseeds"\n'
                 'odometry = "laser/ODOMETRY_XYT.csv"')  # fmt: skip


def _assert_same(one, other):
    assert one.stops == other.stops
    assert np.allclose(one.odometry, other.odometry, atol=1e-6)
    for a, b in zip(one.sweeps, other.sweeps, strict=True):
        assert len(a.sweep.views) == len(b.sweep.views) == 2
        assert np.allclose(a.sweep.points, b.sweep.points, atol=1e-3)


def test_two_rawseeds_scanners_and_their_odometry_are_one_campaign(campaign):
    own = _inputs(campaign)
    _rawseeds(campaign)
    assert SYSTEM.has_data(load_campaign(campaign))
    _assert_same(own, _inputs(campaign))


def test_scanners_on_different_clocks_are_named_and_not_dropped(campaign):
    _rawseeds(campaign, clock=2.5)
    with pytest.raises(InputError, match=r"no scan of 'rear' within .* 2\.500 s off") as caught:
        _inputs(campaign)
    assert [problem.line for problem in caught.value.problems] == [2, 3, 4]


def test_stops_without_odometry_in_time_are_named(campaign):
    _rawseeds(campaign)
    path = campaign / "laser" / "ODOMETRY_XYT.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(InputError, match=r"ODOMETRY_XYT.*no odometry within"):
        _inputs(campaign)


def test_front_and_rear_of_an_old_carmen_log_are_one_campaign(campaign):
    own = _inputs(campaign)
    times, odometry = _times(campaign)
    text = ""
    for record in read_scan_csv(campaign / "laser" / "scans.csv"):
        kind = {"front": "FLASER", "rear": "RLASER"}[record.scan.sensor]
        ranges = np.where(record.scan.returned, record.scan.ranges, 81.91)
        pose = " ".join(map(str, odometry[record.stop]))
        text += f"{kind} 181 {' '.join(f'{r:.4f}' for r in ranges)} {pose} {pose} "
        text += f"{times[record.stop]} host 0.0\n"
    (campaign / "laser" / "robot.log").write_text(text)
    (campaign / "laser" / "odometry.csv").unlink()
    _use(campaign, 'format = "carmen"\nscans = "laser/robot.log"')
    _assert_same(own, _inputs(campaign))


def test_a_log_of_a_moving_robot_is_corrected_where_the_timing_is_stated(campaign):
    _times(campaign)
    text = ""
    for second in range(6):
        turning = np.array([0.02 * second, 0.0, 0.5 * second])
        ranges = np.full(181, 3.0)
        pose = " ".join(map(str, turning))
        text += f"FLASER 181 {' '.join(map(str, ranges))} {pose} {pose} {100 + second} host 0.0\n"
    (campaign / "laser" / "robot.log").write_text(text)
    (campaign / "laser" / "odometry.csv").unlink()
    (campaign / "laser" / "stops.csv").write_text("pose,time\n1,101\n2,103\n")
    toml = campaign / "campaign.toml"
    _use(campaign, 'format = "carmen"\nscans = "laser/robot.log"')
    toml.write_text(toml.read_text().split("\n[laser.scanners.rear]")[0])
    plain = _inputs(campaign)
    _use_for(campaign, "front", "turn_time = 0.01333\ninterlaced = 2")
    corrected = _inputs(campaign)
    one, other = (inputs.sweeps[0].sweep.views[0].scan for inputs in (plain, corrected))
    # odd beams were fired a turn of the mirror after the even ones: 0.5 rad/s times 13.3 ms
    shifts = np.sort(other.angles) - one.angles
    assert np.ptp(shifts) > 0.006
    assert np.abs(shifts).max() < 0.5 * 0.01333
    assert plain.odometry is not None


def test_a_missing_file_of_one_scanner_is_an_error(campaign):
    _rawseeds(campaign)
    (campaign / "laser" / "SICK_REAR.csv").unlink()
    with pytest.raises(GtvalError, match=r"SICK_REAR\.csv: there is no such file"):
        _inputs(campaign)


def test_odometry_is_interpolated_along_the_shorter_turn():
    from laser_gt.logs.read import with_odometry
    from laser_gt.logs.records import ScanRecord
    from laser_gt.scans.scan import Scan

    records = [ScanRecord(Scan(np.ones(20), np.linspace(-1, 1, 20), time=t)) for t in (0.5, 7.0)]
    times, poses = np.array([1.0, 0.0]), np.array([[1.0, 0.0, -3.1], [0.0, 0.0, 3.1]])
    near, far = with_odometry(records, times, poses, 0.6)
    assert np.allclose(np.abs(near.odometry), [0.5, 0.0, np.pi])
    assert far.odometry is None
    assert np.allclose(compose(near.odometry, inverse(near.odometry)), 0, atol=1e-12)
