"""Things at known places in rendered images: seen where they are, and judged where they are not."""

import csv
import json
import shutil

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import chi2

from validation.cli import main
from vision_gt.campaign.check_sections import (
    check_files,
    check_sections,
    readings_csv,
    statistics_table,
)
from vision_gt.campaign.findings import vision_findings

pytestmark = pytest.mark.xdist_group("vision checks")  # one rendered room for all


def test_things_on_a_table_and_on_the_floor_are_seen_where_they_are(outcome):
    """All within what is stated; the sum of their chi-squared neither too large nor too small."""
    checks = outcome.checks
    assert {one.kind for one in checks.table} == {"board", "marker"}
    assert {one.pose for one in checks.survey} >= {"O"}
    readings = [*checks.table, *checks.survey]
    total = sum(
        float(one.difference @ np.linalg.solve(one.covariance, one.difference)) for one in readings
    )
    # They share cameras, so the sum scatters more than that of independent ones: factor 2.
    k = 4 * len(readings)
    assert chi2.ppf(1e-4, k) / 2 < total < 2 * chi2.ppf(1 - 1e-4, k)
    assert all(one.agrees for one in readings)
    assert all(abs(one.difference[2]) < 0.02 for one in checks.table)


def test_a_known_displacement_is_measured_by_each_camera(outcome):
    moved = outcome.checks.displacement
    assert {one.camera for one in moved} == {"1", "2"}
    for one in moved:
        assert one.agrees
        assert abs(one.off) < 4 * one.off_sigma < 0.01


def test_the_checks_are_chapters_files_and_findings(outcome):
    titles = [section.title for section in check_sections(outcome.checks)]
    assert titles == [
        "Vision: cross-check of the survey",
        "Vision: known displacement",
        "Vision: things on a table",
    ]
    files = check_files(outcome.checks)
    assert set(files) == {
        "vision_table_check.csv",
        "vision_survey_check.csv",
        "vision_displacement.csv",
    }
    rows = list(csv.DictReader(files["vision_table_check.csv"].splitlines()))
    assert len(rows) == len(outcome.checks.table)
    first = outcome.checks.table[0]
    assert float(rows[0]["difference_x"]) == first.difference[0]
    codes = {one.code for one in vision_findings(outcome)}
    assert {"table_agrees", "survey_check_agrees", "displacement_agrees"} <= codes
    assert not codes & {"not_checked", "check_not_found", "image"}


def test_statistics_are_by_camera_and_by_kind(outcome):
    readings = outcome.checks.table
    rows = {(row[0], row[1], row[2]): row for row in statistics_table(readings).rows}
    off = np.array([one.difference for one in readings if one.kind == "board"])
    assert rows["board", "all", "x [mm]"][4] == pytest.approx(1e3 * off[:, 0].mean())
    assert rows["board", "all", "z [mm]"][6] == pytest.approx(1e3 * np.abs(off[:, 2]).max())
    assert readings_csv(readings).startswith("place,camera,kind,known_x")


@pytest.fixture(scope="module")
def solved(rendered, tmp_path_factory):
    """A campaign with its results."""
    folder = tmp_path_factory.mktemp("checks") / "campaign"
    shutil.copytree(rendered, folder)
    done = CliRunner().invoke(main, ["run", str(folder), "--no-report", "--json"])
    assert done.exit_code == 0, done.output
    return folder


def asked(command, folder, *options):
    arguments = ["vision", command, str(folder), "--workers", "1", *options]
    done = CliRunner().invoke(main, arguments)
    return done.exit_code, done.output


def changed(folder, old, new):
    text = (folder / "campaign.toml").read_text()
    assert old in text
    (folder / "campaign.toml").write_text(text.replace(old, new))


@pytest.fixture
def own(solved, tmp_path):
    """A copy of it that a test may spoil."""
    folder = tmp_path / "own"
    shutil.copytree(solved, folder)
    return folder


def test_the_commands_read_the_results_of_a_run(solved):
    for command, title in (
        ("check-table", "Differences on the table"),
        ("check-survey", "A board at known places"),
    ):
        status, said = asked(command, solved)
        assert status == 0, said
        assert title in said
        told = json.loads(asked(command, solved, "--json")[1])
        assert {one["severity"] for one in told["findings"]} == {"good"}
        assert all(len(one["difference"]) == 4 for one in told["readings"])


def test_one_board_that_is_not_found_costs_one_reading(own):
    whole = json.loads(asked("check-table", own, "--json")[1])["readings"]
    camera = whole[0]["camera"]
    (image,) = (own / "vision" / "table" / camera).iterdir()
    grey = np.full((960, 1280), 120, np.uint8)
    grey[200:400, 300:500] = 200
    cv2.imwrite(str(image), grey)
    status, said = asked("check-table", own, "--json")
    assert status == 0, said
    told = json.loads(said)
    assert len(told["readings"]) == sum(one["camera"] != camera for one in whole) > 0
    (lost,) = [one for one in told["findings"] if one["code"] == "check_not_found"]
    assert f"board in vision/table/{camera}" in lost["text"]
    assert f"marker 15 in vision/table/{camera}" in lost["text"]


def test_a_wrong_place_is_an_error_and_strict_says_so(own):
    """A board that is 5 cm beside its place, on the table and on the floor."""
    changed(own, "corner = [0.05, 0.05]", "corner = [0.10, 0.05]")
    status, said = asked("check-table", own, "--strict")
    assert status == 3
    assert "does not see things on the table where they should be" in said
    changed(own, "O = { corner = [-0.42, -0.06]", "O = { corner = [-0.37, -0.06]")
    status, said = asked("check-survey", own, "--strict")
    assert status == 3
    assert "Survey and camera do not agree" in said


@pytest.mark.parametrize(
    ("command", "old", "new", "said"),
    [
        ("check-table", "height = 0.72\n", "", "vision.table.height"),
        ("check-table", "marker_side = 0.16\n", "", "vision.table.marker_side"),
        ("check-survey", "O = {", "P = {", "has no place 'O'"),
        ("check-survey", 'stop = "1"', 'stop = "77"', "no validation pose '77'"),
    ],
)
def test_what_is_missing_is_named(own, command, old, new, said):
    text = (own / "campaign.toml").read_text()
    if old not in text:  # the stop beside which the board was laid is drawn
        old = next(f'stop = "{n}"' for n in range(1, 9) if f'stop = "{n}"' in text)
    changed(own, old, new)
    status, told = asked(command, own)
    assert status == 2
    assert said in told


def of_tables(folder, rows):
    (folder / "campaign.toml").write_text(
        'name = "printed"\n[vision.printed]\ntable_marker = "marker.csv"\n'
    )
    (folder / "marker.csv").write_text(rows)
    return asked("check-table", folder)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("", "marker.csv, line 1: the file is empty"),
        ("pose,x,y\n5,abc,1.0\n", "marker.csv, line 2, field 'x': 'abc'"),
        ("pose,x,y\n5,1.0,nan\n", "marker.csv, line 2, field 'y': 'nan'"),
        ("pose,x,y\n5,1.0,1.0\n", "`gtval run` makes it"),
    ],
)
def test_a_bad_cell_is_said_before_results_are_asked_for(tmp_path, rows, said):
    status, told = of_tables(tmp_path, rows)
    assert status == 2
    assert said in told
    assert ("gtval run" in told) == ("gtval run" in said)


def test_a_printed_table_that_is_not_there_is_named_by_its_key(tmp_path):
    of_tables(tmp_path, "")
    (tmp_path / "marker.csv").unlink()
    status, told = asked("check-table", tmp_path)
    assert status == 2
    assert "line 3, field 'vision.printed.table_marker': 'marker.csv'" in told


def test_a_campaign_without_a_board_on_the_floor_is_told_what_to_write(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "none"\n')
    status, told = asked("check-survey", tmp_path)
    assert status == 2
    assert "write in [vision.survey_check] a line such as: board = " in told
    assert "vision_cameras.csv" not in told


def test_a_marker_alone_may_lie_on_the_table(own):
    text = (own / "campaign.toml").read_text()
    table = text[text.index("[vision.table]") : text.index("[vision.survey_check]")]
    kept = [line for line in table.splitlines() if not line.startswith(("board", "corner"))]
    (own / "campaign.toml").write_text(text.replace(table, "\n".join(kept) + "\n\n"))
    status, said = asked("check-table", own, "--json")
    assert status == 0, said
    assert {one["kind"] for one in json.loads(said)["readings"]} == {"marker"}
