"""One receiver: positions, quality, the clock of its computer, and logs as AD2.3's system wrote."""

import gzip
import json
import re
from collections import Counter
from functools import reduce

import numpy as np
import pytest
from click.testing import CliRunner
from rtk_samples import REAL

from rtk_gt.positions.result import fixed_table, fixed_trajectory, positions_result
from rtk_gt.positions.solve import solve_positions
from rtk_gt.receivers.formats.nmea import read_nmea
from rtk_gt.receivers.host_clock import host_clock
from rtk_gt.receivers.quality import inside
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError
from validation.poses.earth_frames import LocalFrame

BOVISA = REAL / "rtk" / "rawseeds_bovisa"
needs_bovisa = pytest.mark.skipif(not BOVISA.exists(), reason=f"no logs at {BOVISA}")
SITE = LocalFrame.from_degrees(45.5, 9.16, 177.0)
MIDNIGHT = 1_700_006_400.0
SIGMAS = {4: (0.02, 0.01, 0.03), 5: (0.5, 0.3, 0.9), 2: (1.2, 1.0, 2.0), 1: (4.0, 3.0, 7.0)}
TOML = """
name = "One"
[rtk]
origin = { latitude = 45.5, longitude = 9.16, height = 177.0 }
[[rtk.receivers]]
name = "roof"
file = "rtk/log.csv.gz"
"""


def sentence(body, digits=1):
    """With its checksum, of which only the first digits are written."""
    value = reduce(lambda a, b: a ^ ord(b), body, 0)
    return f"${body}*{f'{value:02X}'[:digits]}"


def angle(degrees, width):
    whole = int(abs(degrees))
    return f"{whole:0{width}d}{60 * (abs(degrees) - whole):011.8f}"


def log_of(seed, kinds, ahead=-1.7, drift=2e-4, digits=1):
    """Lines of a log with a fix of each kind in turn, 5 a second, and the true positions."""
    generator = np.random.default_rng(seed)
    times = MIDNIGHT - 60.0 + 0.2 * np.arange(len(kinds))
    places = np.column_stack([3.0 * np.arange(len(kinds)) / 5, np.zeros(len(kinds)), 0 * times])
    lines = []
    for time, place, kind in zip(times, places, kinds, strict=True):
        host = time + ahead + drift * (time - times.mean()) + generator.exponential(0.005)
        clock = np.round(time % 86400.0, 2)
        stamp = f"{clock // 3600:02.0f}{clock % 3600 // 60:02.0f}{clock % 60:05.2f}"
        if kind == 0:
            gga = "GPGGA,000000.00,0000.00000000,N,00000.00000000,E,0,0,0.0,0.000,M,-0.000,M,,"
            gst = "GPGST,000000.00,0.000,0.000,0.000,0.0,0.000,0.000,0.000"
        else:
            major, minor, up = SIGMAS[kind]
            noise = generator.standard_normal(3) * [major, minor, up]
            latitude, longitude, height = SITE.to_geodetic(place + noise)
            north, east = angle(np.degrees(latitude), 2), angle(np.degrees(longitude), 3)
            gga = f"GPGGA,{stamp},{north},N,{east},E,{kind},6,1.5,{height - 48:.4f},M,48.0,M,,"
            gst = f"GPGST,{stamp},0.02,{major},{minor},90.0,{minor},{major},{up}"
        lines += [f"{host:.6f}, {sentence(one, digits)}" for one in (gga, gst)]
    return lines, times, places


def campaign_of(folder, lines):
    (folder / "rtk").mkdir()
    with gzip.open(folder / "rtk" / "log.csv.gz", "wt") as file:
        file.write("\n".join(lines) + "\n")
    (folder / "campaign.toml").write_text(TOML)
    return load_campaign(folder)


KINDS = [0] * 50 + [1] * 30 + [4] * 400 + [5] * 60 + [0] * 30 + [4] * 200 + [2] * 30


def test_positions_quality_and_clock_of_a_log_through_midnight(tmp_path):
    lines, times, places = log_of(1, KINDS)
    outcome = solve_positions(campaign_of(tmp_path, lines))
    assert outcome.record.epochs == len(KINDS)
    assert outcome.fixed_share == KINDS.count(4) / len(KINDS)
    assert {one.kind: one.epochs for one in outcome.kinds} == {
        "RTK fixed": 600, "RTK float": 60, "DGPS": 30, "autonomous": 30, "no fix": 80,
    }  # fmt: skip
    # The date is the computer's; midnight passes once, whatever stands in lines without a fix.
    fixed = np.array(KINDS) == 4
    np.testing.assert_allclose(outcome.record.times, times[np.array(KINDS) > 0], atol=0.006)
    table = fixed_table(outcome)
    errors = table.poses - places[fixed]
    squares = np.einsum("ti,tij,tj->t", errors, np.linalg.inv(table.covariances), errors)
    # Mean of 600 chi-squared numbers of 3: 3 +- 0.1.
    assert squares.mean() == pytest.approx(3, abs=0.4)
    trajectory = fixed_trajectory(outcome)
    assert trajectory.kind == "points_space"
    assert trajectory.epoch + trajectory.times[0] == pytest.approx(times[fixed][0], abs=0.006)
    # Two gaps at the ends, one of 90 epochs in the middle.
    assert len(outcome.coverage.gaps) == 3
    assert outcome.kinds[0].horizontal == pytest.approx((0.02, 0.02), rel=1e-6)


def test_the_clock_of_the_computer_is_found_with_its_drift(tmp_path):
    """Six logs of five minutes: the median wait of 3.5 ms belongs to what is found."""
    sizes = []
    for seed in range(6):
        (tmp_path / str(seed)).mkdir()
        lines, _, _ = log_of(seed, [4] * 1500, ahead=2.0, drift=1e-4)
        path = tmp_path / str(seed) / "log.csv.gz"
        with gzip.open(path, "wt") as file:
            file.write("\n".join(lines) + "\n")
        clock = host_clock(read_nmea(path, "roof"))
        assert clock.ahead == pytest.approx(2.0 + 0.005 * np.log(2), abs=0.001)
        sizes.append((clock.drift - 1e-4) / clock.drift_sigma)
    # Five minutes leave 3 degrees of freedom: Student's t of 3 has a standard deviation of 1.7.
    assert 0.3 < np.std(sizes) < 5
    assert abs(np.median(sizes)) < 2


def test_a_receiver_that_is_never_fixed_covers_nothing_and_is_no_error(tmp_path):
    lines, _, _ = log_of(2, [0] * 10 + [5] * 40 + [2] * 50)
    campaign_of(tmp_path, lines)
    done = CliRunner().invoke(main, ["rtk", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    assert found["fixed"] == found["share_of_epochs"] == found["share_of_time"] == 0
    done = CliRunner().invoke(main, ["run", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "0 of 100 epochs are RTK-fixed" in " ".join(done.output.split())
    assert not (tmp_path / "results" / "poses_rtk.csv").exists()
    rows = (tmp_path / "results" / "rtk_positions.csv").read_text().splitlines()
    assert len(rows) == 91
    assert rows[1].split(",")[10] == "RTK float"


def test_figures_and_findings_of_one_receiver(tmp_path):
    lines, _, _ = log_of(3, KINDS)
    result = positions_result(solve_positions(campaign_of(tmp_path, lines)))
    codes = {finding.code: finding for finding in result.findings}
    assert {"positions_fixed", "host_clock", "errors_stated", "tolerated"} <= set(codes)
    assert codes["host_clock"].severity == "warning"
    assert "behind the satellites' time" in codes["host_clock"].text
    (section,) = result.sections
    figures = [block for block in section.blocks if hasattr(block, "draw")]
    assert len(figures) == 5
    for figure in figures:
        assert figure.draw().axes


def test_one_digit_of_a_checksum_is_still_tested(tmp_path):
    lines, _, _ = log_of(4, [4] * 8)
    path = tmp_path / "log.csv.gz"
    digit = lines[4][-1]
    lines[4] = lines[4][:-1] + ("0" if digit != "0" else "1")
    path.write_bytes(gzip.compress("\n".join(lines).encode()))
    with pytest.raises(GtvalError, match=r"line 5.*checksum"):
        read_nmea(path, "roof")
    kept = read_nmea(path, "roof", skip_damaged=True)
    assert len(kept) == 7
    assert kept.tolerated["checksum of one digit"] == 15


def test_quality_by_named_areas(tmp_path):
    """The receiver drives along x at 3 m/s: its kinds change at places that are known."""
    lines, _, _ = log_of(6, [4] * 100 + [5] * 100 + [4] * 100)
    campaign_of(tmp_path, lines)
    outline = "[[-9, -9], [89.7, -9], [89.7, 9], [-9, 9]]"
    yard = f'[[rtk.areas]]\nname = "yard"\ncorners = {outline}\n'
    empty = '[[rtk.areas]]\nname = "roof"\ncorners = [[0, 50], [9, 50], [9, 60]]\n'
    (tmp_path / "campaign.toml").write_text(TOML + yard + empty)
    outcome = solve_positions(load_campaign(tmp_path))
    first, second = outcome.areas
    assert {one.kind: one.epochs for one in first.kinds}["RTK fixed"] == 100
    # Noise of 0.5 m moves float fixes over the edge at 89.7 m, 0.6 m between two fixes.
    assert {one.kind: one.epochs for one in first.kinds}["RTK float"] == pytest.approx(50, abs=3)
    assert second.kinds == ()
    titles = [table.title for table in positions_result(outcome).overview]
    assert "Quality by area" in titles


def test_points_in_an_outline_with_a_notch():
    notch = np.array([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]], dtype=float)
    points = np.array([[1, 1], [2, 2], [3.5, 3], [-1, 1], [2, 0.5], [5, 1]], dtype=float)
    assert inside(notch, points).tolist() == [True, False, True, False, True, False]


def test_commands_that_need_a_vehicle_say_so(tmp_path):
    lines, _, _ = log_of(5, [4] * 50)
    campaign_of(tmp_path, lines)
    done = CliRunner().invoke(main, ["rtk", "reference-covariance", str(tmp_path)])
    assert done.exit_code == 2
    assert "names one receiver" in done.output


@needs_bovisa
@pytest.mark.parametrize(("name", "share"), [("2008-09-01", 0.297), ("2008-10-07", 0.0)])
def test_logs_of_the_outdoor_system_of_ad23(tmp_path, name, share):
    """Kinds as counted by another program: a regular expression over the lines."""
    log = BOVISA / f"{name}.csv.gz"
    text = gzip.decompress(log.read_bytes()).decode()
    kinds = Counter(re.findall(r"\$GPGGA,(?:[^,]*,){5}(\d)", text))
    (tmp_path / "rtk").mkdir()
    (tmp_path / "rtk" / "log.csv.gz").write_bytes(log.read_bytes())
    (tmp_path / "campaign.toml").write_text(re.sub(r"origin = .*\n", "", TOML))
    outcome = solve_positions(load_campaign(tmp_path))
    assert outcome.record.epochs == kinds.total()
    assert outcome.fixed.sum() == kinds["4"]
    assert outcome.fixed_share == pytest.approx(share, abs=0.001)
    day = np.datetime64(int(outcome.record.times[0]), "s").astype("datetime64[D]")
    assert str(day) == name
    # Both computers gain some 20 s a day; that of September is 87 minutes ahead.
    assert outcome.clock.drift == pytest.approx(2.3e-4, abs=0.2e-4)
    assert outcome.clock.ahead == pytest.approx(5192.6 if share else 2.3, abs=0.2)
