"""What the AD2.3 campaign says of the printed numbers, in a run."""

import csv

import pytest
from click.testing import CliRunner

from data_samples.demo import copy_demo
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.report.document import build_document
from validation.run import run_campaign
from validation.run_files import write_results


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ad23") / "demo"
    copy_demo(folder)
    return folder


@pytest.fixture(scope="module")
def run(folder):
    found = run_campaign(load_campaign(folder))
    write_results(found)
    return found


@pytest.fixture(scope="module")
def written(run):
    """The folder, after the run."""
    return run.campaign.folder


def rows(folder, name):
    with (folder / "results" / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def findings(run, code):
    return {one.subject: one for one in run.findings if one.code == code}


def test_the_report_has_a_chapter_for_everything_that_was_printed(run):
    titles = [section.title for section in build_document(run).sections]
    for title in (
        "The document's filters, as printed",
        "Convergence of the filters",
        "Accuracy experiment",
        "Plan against what was reached",
        "Vision: marker detection",
        "Vision: board and marker on a table, as printed",
        "Does one system err less than another?",
        "Printed statistics",
        "Do the data support the conclusions?",
    ):
        assert title in titles
    assert titles[-2:] == ["Appendix: all readings", "Inputs"]


def test_every_printed_statistic_of_the_systems_follows_to_the_last_digit(written):
    judged = rows(written, "printed_statistics.csv")
    assert len(judged) == 3 * 3 * 2 + 3
    assert {row["verdict"] for row in judged} <= {"equal", "cut"}


def test_every_printed_error_follows_but_two_in_their_last_digit(run):
    found = {subject: one.text for subject, one in findings(run, "printed_errors").items()}
    counts = {subject: text.partition(" printed")[0] for subject, text in found.items()}
    assert counts == {
        "vision": "58 of 60",
        "laser_genetic": "77 of 77",  # y of pose 25 cannot be read
        "laser_scanmatch": "39 of 39",
        "table_chessboard": "18 of 18",
        "table_marker": "12 of 12",
    }
    assert "In the last digit are off: x at pose 7, theta at pose 7" in found["vision"]


def test_the_printed_interval_used_22_poses(run):
    assert (
        "with n = 22, but the table has n = 20" in findings(run, "printed_interval")["vision"].text
    )


def test_the_printed_statistics_of_the_chessboard_are_those_of_seven_cells(run):
    found = findings(run, "printed_statistics")
    text = found["table_chessboard"].text
    assert "9 of 9" in text
    assert "x: x2 x5; y: y2 y5; z: x23 z2 z5" in text
    assert found["table_chessboard_again"].severity == "good"
    assert found["table_marker"].severity == "good"


def test_at_pose_21_two_cameras_recognised_a_marker_and_one_is_named(run):
    text = findings(run, "recognised_not_used")["vision"].text
    assert text.count("at pose") == 1
    assert "at pose 21 a marker was recognised by cameras 1 and 2" in text
    assert "names camera 2" in text


def test_23_of_40_images_and_20_of_26_stops_have_a_marker(run):
    text = findings(run, "success_rate")["vision"].text
    assert "23 of 40 images" in text
    assert "20 of 26 stops" in text


def test_that_the_laser_errs_less_than_vision_is_not_shown(written):
    row = next(
        row
        for row in rows(written, "paired.csv")
        if (row["first"], row["second"]) == ("vision", "laser_genetic")
        and row["component"] == "x"
        and not row["without"]
    )
    numbers = [round(1e3 * float(row[key])) for key in ("mean", "low", "high")]
    assert numbers == [6, -28, 40]
    assert row["errs_less"] == ""


def test_every_conclusion_of_the_document_has_a_verdict(written):
    verdicts = {row["conclusion"]: row["verdict"] for row in rows(written, "conclusions.csv")}
    assert len(verdicts) == 13
    chosen = {start: v for says, v in verdicts.items() for start in [says[:40]]}
    assert chosen["The laser-based system is more accurate "] == "open"
    assert chosen["The laser may simply have reached its in"] == "contradicted"
    assert chosen["The localization of a marker is quite wo"] == "supported"
    assert chosen["The validation system is capable to appr"] == "supported"


def test_printed_tables_and_published_poses_of_one_name_are_one_system(run):
    assert [one.name for one in run.systems].count("vision") == 1
    assert {"poses_vision.csv", "vision_success.csv", "vision_printed_table.csv"} <= {
        name for one in run.systems if one.name == "vision" for name in one.files
    }


def test_the_commands_show_what_was_printed_and_keep_what_was_published(written):
    done = CliRunner().invoke(main, ["vision", "check-table", str(written)])
    assert done.exit_code == 0
    assert "table_chessboard" in done.output
    done = CliRunner().invoke(main, ["vision", "solve", str(written)])
    assert done.exit_code == 0
    assert (written / "results" / "poses_vision.csv").exists()
    assert len(rows(written, "vision_printed_table.csv")) == 12


def test_a_bad_printed_table_names_its_line(tmp_path):
    copy_demo(tmp_path / "demo")
    path = tmp_path / "demo" / "vision" / "table_marker.csv"
    path.write_text(path.read_text() + "99,1.0,2.0\n")
    done = CliRunner().invoke(main, ["run", str(tmp_path / "demo"), "--no-report"])
    assert done.exit_code == 2
    assert "line 8" in done.output
    assert "no validation pose" in done.output
