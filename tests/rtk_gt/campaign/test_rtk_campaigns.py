"""Campaigns from files to results: a synthetic one, and the Malaga fragment."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rtk_samples import FRAGMENT, MALAGA, needs_fragment

from data_samples.drives.drive import ANTENNAS, OFFSETS, DriveSettings, simulate_drive
from data_samples.drives.files import write_drive
from rtk_gt.campaign.solve import solve_campaign
from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.receivers.formats.rawlog import read_rawlog
from rtk_gt.receivers.steps import common_steps
from rtk_gt.system import SYSTEM, result_of
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError, InputError
from validation.poses.pose_table import SPATIAL, from_csv, pose_difference
from validation.statistics.consistency import nees

MALAGA_TOML = """
name = "Malaga fragment"
[rtk]
up = "{up}"
origin = {{ latitude = 36.714459075, longitude = -4.478958828333333, height = 38.8887 }}
[[rtk.receivers]]
name = "rear"
file = "rtk/fragment.rawlog"
label = "GPS_RTK_REAR"
height = 0.132
[[rtk.receivers]]
name = "left"
file = "rtk/fragment.rawlog"
label = "GPS_RTK_FRONT_L"
height = 0.115
[[rtk.receivers]]
name = "right"
file = "rtk/fragment.rawlog"
label = "GPS_RTK_FRONT_R"
height = 0.128
"""
KNOWN = """
[rtk.known_offsets]
up = "geocentric"
sigma = 0.005

[rtk.known_offsets.values]
rear = [0, 0, 0]
left = [-145.2875, 28.6745, 2.3344]
right = [-145.2914, 28.6712, 1.2915]
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A drive of two loops as a campaign folder, and the drive."""
    folder = tmp_path_factory.mktemp("drive")
    drive = simulate_drive(5, DriveSettings(false_fixes=0.01))
    write_drive(folder, drive)
    return folder, drive


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_a_drive_written_as_nmea_gives_its_path_back(campaign):
    folder, drive = campaign
    outcome = solve_campaign(load_campaign(folder))
    errors = pose_difference(outcome.path.poses, drive.poses(outcome.path.times), SPATIAL)
    assert np.abs(errors[:, :3]).max() < 0.08
    # The robust weights leave out every step with a fix off by 30 cm along a rod.
    assert (outcome.offsets.weights == 0).sum() > 0
    scaled = (outcome.offsets.offsets.values - OFFSETS)[1:] / outcome.offsets.offset_sigmas[1:]
    assert np.abs(scaled).max() < 4.5
    np.testing.assert_allclose(outcome.antennas.positions, ANTENNAS, atol=0.01)
    assert set(outcome.sensors) == {"left_camera", "left_scanner", "right_scanner"}
    assert 0.5 < outcome.coverage.share_of_time < 0.95
    shares = outcome.coverage.receivers[0].shares
    assert sum(shares.values()) == pytest.approx(1)


def test_the_run_writes_poses_files_and_a_report(campaign):
    folder, drive = campaign
    done = run("run", folder)
    assert done.exit_code == 0, done.output
    table = from_csv(folder / "results" / "poses_rtk.csv", components=SPATIAL)
    times = np.array([float(name) for name in table.ids])
    values = nees(pose_difference(table.poses, drive.poses(times), SPATIAL), table.covariances)
    assert np.median(values) < 12
    page = (folder / "report" / "report.html").read_text()
    for words in ("what has ground truth", "offsets and antennas", "Consistency of the antenna"):
        assert words in page
    assert "Survey the stops" not in page
    assert "hand-held laser" not in page
    record = json.loads((folder / "results" / "run.json").read_text())
    assert record["systems"]["rtk"]["poses"] == len(table)
    assert (folder / "results" / "poses_rtk.tum").exists()


def test_the_commands_of_the_group(campaign, tmp_path):
    folder, drive = campaign
    done = run("rtk", "run", folder, "--json", "--dry-run")
    assert json.loads(done.output)["poses"] > 50
    covered = json.loads(run("rtk", "coverage", folder, "--json").output)
    assert covered["poses"] > 50
    assert "Longest gaps" in run("rtk", "coverage", folder).output
    times = tmp_path / "times.csv"
    start = float(drive.records[0].times[0])
    times.write_text("time\n" + "".join(f"{start + 1.0 + 0.25 * k!r}\n" for k in range(20)))
    out = tmp_path / "camera.csv"
    done = run("rtk", "sensor-path", folder, "left_camera", times, "-o", out)
    assert done.exit_code == 0, done.output
    table = from_csv(out, components=SPATIAL)
    assert len(table) > 5
    printed = json.loads(run("rtk", "sensor-path", folder, "left_camera", times, "--json").stdout)
    assert np.array_equal(printed["poses"], table.poses)
    assert len(printed["times"]) + len(printed["times_in_gaps"]) == 20
    assert run("rtk", "sensor-path", folder, "vehicle", times).output.startswith("pose,x,y,z")
    wrong = run("rtk", "sensor-path", folder, "nose", times)
    assert wrong.exit_code == 2
    assert "no sensor 'nose'" in wrong.output


SURVEYED = """
[[published]]
system = "survey"
file = "truth/poses_truth.csv"
sigmas = {sigmas}
"""


def with_reference(folder, to, sigmas="[1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4]"):
    shutil.copytree(folder, to, ignore=shutil.ignore_patterns("results", "report"))
    toml = to / "campaign.toml"
    toml.write_text(toml.read_text() + SURVEYED.format(sigmas=sigmas))
    return to


def test_a_path_is_compared_with_spatial_reference_poses(campaign, tmp_path):
    folder, _ = campaign
    there = with_reference(folder, tmp_path / "compared")
    done = run("run", there, "--all")
    assert done.exit_code == 0, done.output
    statistics = (there / "results" / "statistics.csv").read_text()
    for component in ("x", "y", "z", "yaw", "pitch", "roll"):
        assert f"rtk,{component}," in statistics
    # The path of a camera is no path of the vehicle: it is written, but not compared.
    assert "left_camera" not in statistics
    assert (there / "results" / "sensor_path_left_camera.csv").exists()
    assert (there / "results" / "sensor_path_left_camera.tum").exists()
    errors = from_csv(there / "results" / "poses_rtk.csv", components=SPATIAL)
    assert len(errors.ids) > 50
    assert "mean NEES" in done.output
    assert "joint NEES" in done.output  # with the error of the offsets that all poses share


def test_five_receivers_from_files(tmp_path):
    drive = simulate_drive(3, DriveSettings(receivers=5, false_fixes=0.01))
    write_drive(tmp_path, drive)
    outcome = solve_campaign(load_campaign(tmp_path))
    # Their rough positions in campaign.toml are rounded to 10 cm.
    np.testing.assert_allclose(outcome.antennas.positions[:, :2], drive.antennas[:, :2], atol=0.01)
    errors = pose_difference(outcome.path.poses, drive.poses(outcome.path.times), SPATIAL)
    assert np.median(nees(errors, outcome.path.covariances)) < 12
    text = " ".join(finding.text for finding in result_of(outcome).findings)
    assert "(0.132, 0.115, 0.128 m)" in text


def test_sigmas_of_a_spatial_reference_are_six(campaign, tmp_path):
    folder, _ = campaign
    there = with_reference(folder, tmp_path / "three", "[0.001, 0.001, 0.001]")
    done = run("run", there)
    assert done.exit_code == 2
    assert "6 components need as many sigmas" in done.output


def test_mixed_frames_are_refused(campaign, tmp_path):
    folder, _ = campaign
    shutil.copytree(folder, tmp_path / "mixed")
    toml = tmp_path / "mixed" / "campaign.toml"
    toml.write_text(
        toml.read_text()
        + '\n[rtk.known_offsets]\nup = "geocentric"\nsigma = 0.01\n'
        + "values = { front_left = [-145.0, 28.0, 2.0] }\n"
    )
    with pytest.raises(GtvalError, match="offsets of one frame"):
        solve_campaign(load_campaign(tmp_path / "mixed"))


def test_settings_that_cannot_be(tmp_path):
    toml = tmp_path / "campaign.toml"
    two = 'name = "x"\n' + '[[rtk.receivers]]\nname = "a"\nfile = "a.nmea"\n' * 2
    toml.write_text(two)
    with pytest.raises(InputError, match="two receivers have the same name"):
        SYSTEM.has_data(load_campaign(tmp_path))
    toml.write_text('name = "x"\n')
    assert not SYSTEM.has_data(load_campaign(tmp_path))
    with pytest.raises(GtvalError, match="names no"):
        solve_campaign(load_campaign(tmp_path))


def test_places_of_antennas_are_never_taken_for_granted(tmp_path):
    """Heights of the first three and positions of the others: all missing keys at once."""
    write_drive(tmp_path, simulate_drive(3, DriveSettings(receivers=5)))
    toml = tmp_path / "campaign.toml"
    kept = [
        line
        for line in toml.read_text().splitlines()
        if not line.startswith(("position", "height = 0.115"))
    ]
    toml.write_text("\n".join(kept) + "\n")
    done = run("rtk", tmp_path)
    assert done.exit_code == 2
    keys = re.findall(r"rtk\.receivers\.(\w+\.\w+)", done.output)
    assert len(keys) == 3
    assert [key.split(".")[1] for key in keys] == ["height", "position", "position"]
    said = " ".join(done.output.split())
    assert "`height = 0.132`" in said
    assert "`position = [0.9, 0.6, 0.1]`" in said
    assert run("rtk", "coverage", tmp_path).exit_code == 0


def test_what_is_assumed_is_said(campaign, tmp_path):
    folder, _ = campaign
    stated = result_of(solve_campaign(load_campaign(folder))).findings
    assert "assumed_sigmas" not in {finding.code for finding in stated}
    shutil.copytree(folder, tmp_path / "open", ignore=shutil.ignore_patterns("results", "report"))
    toml = tmp_path / "open" / "campaign.toml"
    lines = toml.read_text().splitlines()
    toml.write_text("\n".join(x for x in lines if not x.startswith(("eta", "sigmas"))) + "\n")
    findings = result_of(solve_campaign(load_campaign(toml.parent))).findings
    (said,) = [finding for finding in findings if finding.code == "assumed_sigmas"]
    assert said.severity == "note"
    for words in ("1.75", "left_camera, left_scanner", "2 mm and 0.1 degrees"):
        assert words in said.text


def test_the_largest_sigma_of_distances_is_that_of_the_campaign(campaign, tmp_path):
    folder, _ = campaign
    shutil.copytree(folder, tmp_path / "strict", ignore=shutil.ignore_patterns("results", "report"))
    toml = tmp_path / "strict" / "campaign.toml"
    toml.write_text(toml.read_text().replace("[rtk]\n", "[rtk]\nlargest_distance_sigma = 1e-5\n"))
    with pytest.raises(GtvalError, match="largest_distance_sigma = 1e-05"):
        solve_campaign(load_campaign(toml.parent))


def test_a_distance_stated_in_both_directions_is_refused(campaign, tmp_path):
    folder, _ = campaign
    shutil.copytree(folder, tmp_path / "twice", ignore=shutil.ignore_patterns("results", "report"))
    toml = tmp_path / "twice" / "campaign.toml"
    both = '{ "rear - front_left" = 1.79, "front_left - rear" = 1.82 }'
    toml.write_text(toml.read_text() + f"\n[rtk.known_distances]\nvalues = {both}\n")
    with pytest.raises(InputError, match="both directions"):
        solve_campaign(load_campaign(toml.parent))


def test_the_group_takes_a_campaign_as_the_other_systems_do(campaign):
    folder, _ = campaign
    outputs = [
        run("rtk", *words, folder, "--json", "--dry-run") for words in ((), ("solve",), ("run",))
    ]
    assert [done.exit_code for done in outputs] == [0, 0, 0]
    first, *others = (json.loads(done.output) for done in outputs)
    for other in others:
        assert {**other, "command": first["command"]} == first


@needs_fragment
def test_the_fragment_is_decoded_as_its_header_says():
    log = read_rawlog(FRAGMENT)
    assert {name: len(one) for name, one in log.fixes.items()} == {
        "GPS_RTK_REAR": 77,
        "GPS_RTK_FRONT_R": 307,
        "GPS_RTK_FRONT_L": 307,
    }
    assert np.allclose(log.sensor_positions["GPS_RTK_FRONT_R"], ANTENNAS[2])
    origin = log.comment.partition("[GPS_ORIGIN]")[2]
    assert re.search(r"height\s*=\s*38\.8887\b", origin)
    # The sigma of sensor poses that the paper prints as 0.02 mm is 2 mm here.
    errors = log.comment.partition("[ERROR_SENSOR_POSES]")[2]
    assert float(re.search(r"std_x\s*=\s*(\S+)", errors)[1]) == 0.002
    assert log.fixes["GPS_RTK_REAR"].times[0] == 1226225355.0  # 2008-11-09 10:09:15


def fragment_campaign(folder, up="geocentric", known=KNOWN):
    (folder / "rtk").mkdir()
    shutil.copy(FRAGMENT, folder / "rtk" / "fragment.rawlog")
    (folder / "campaign.toml").write_text(MALAGA_TOML.format(up=up) + known)
    return load_campaign(folder)


@needs_fragment
def test_the_fragment_end_to_end(tmp_path):
    outcome = solve_campaign(fragment_campaign(tmp_path))
    assert len(outcome.path) == 42
    assert outcome.coverage.share_of_time == pytest.approx(0.56, abs=0.02)
    assert outcome.consistency.share_beyond < 0.1
    codes = {finding.code for finding in result_of(outcome).findings}
    # It says what it cannot determine, and that the published height offset does not fit.
    assert {"offsets_from_prior", "coverage", "heights_stated", "nose_off_motion"} <= codes
    text = " ".join(finding.text for finding in result_of(outcome).findings)
    assert "the headings span 4 degrees" in text


@needs_fragment
def test_the_fragment_alone_does_not_determine_its_offsets(tmp_path):
    with pytest.raises(GtvalError, match="does not determine the offsets"):
        solve_campaign(fragment_campaign(tmp_path, known=""))
    log = read_rawlog(FRAGMENT)
    records = [log.fixes[f"GPS_RTK_{name}"] for name in ("REAR", "FRONT_L", "FRONT_R")]
    found = estimate_offsets(common_steps(records, MALAGA))
    assert found.offset_sigmas.max() > 1
    assert np.abs(found.offsets.values).max() < 200  # not 5e5 m


@needs_fragment
def test_a_tape_measure_gives_the_fragment_a_path(tmp_path):
    distances = """
[rtk.known_distances]
sigma = 0.01
values = { "rear - left" = 1.79, "right - rear" = 1.79, "left - right" = 1.15 }
"""
    outcome = solve_campaign(fragment_campaign(tmp_path, known=distances))
    assert 0.01 < outcome.offsets.offset_sigmas.max() < 0.5
    codes = {finding.code for finding in result_of(outcome).findings}
    assert "offsets_undetermined" in codes


@needs_fragment
def test_the_fragments_offsets_belong_to_the_geocentric_frame(tmp_path):
    with pytest.raises(GtvalError, match="offsets of one frame"):
        solve_campaign(fragment_campaign(tmp_path, up="ellipsoid"))


def test_the_campaign_of_the_guide_is_one(tmp_path):
    """What stands in docs/outdoor.md runs on a simulated drive, which has its offsets."""
    page = (Path(__file__).parents[3] / "docs" / "outdoor.md").read_text(encoding="utf-8")
    block = page.split("## The campaign\n\n```toml\n")[1].split("```")[0]
    folder = tmp_path / "drive"
    write_drive(folder, simulate_drive(64))
    (folder / "campaign.toml").write_text(block)
    outcome = solve_campaign(load_campaign(folder))
    codes = {finding.code for finding in result_of(outcome).findings}
    assert not codes & {"offsets_differ", "distance_differs"}
    assert outcome.settings.known_offsets is not None
    assert list(outcome.sensors) == ["left_camera"]
