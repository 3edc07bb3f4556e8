import json
import os
import re
import shutil
import stat

import numpy as np
import pytest
from click.testing import CliRunner
from surveys import AD23, simulated

from data_samples.rooms.campaign_files import write_campaign
from survey.commands.solve import survey
from validation.cli import main
from validation.poses.pose_table import from_csv


@pytest.fixture
def folder(tmp_path):
    copy = tmp_path / "ad23"
    shutil.copytree(AD23, copy)
    return copy


@pytest.fixture
def room(tmp_path):
    _, made = simulated(11, 3)
    write_campaign(tmp_path / "room", made, 11)
    return tmp_path / "room"


def run(*arguments):
    return CliRunner().invoke(main, ["survey", *map(str, arguments)])


def test_ad23_gives_points_poses_and_findings(folder):
    done = run(folder, "--json")
    assert done.exit_code == 0
    said = json.loads(done.stdout)
    assert said["published_inconsistent"] == ["15"]
    assert said["labelling"]["status"] == "confirmed"
    assert len(said["world_points"]) == 16
    names = {path.name for path in (folder / "results").iterdir()}
    assert {"world_points.csv", "poses_survey.csv", "readings_checked.csv"} <= names
    assert len(from_csv(folder / "results" / "poses_survey.csv")) == 26


def test_a_simulated_campaign_gives_its_poses_back(room):
    assert run(room).exit_code == 0
    table = from_csv(room / "results" / "poses_survey.csv")
    truth = from_csv(room / "truth" / "poses.csv").select(table.ids)
    sigma = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))
    off = table.poses - truth.poses
    off[:, 2] = np.angle(np.exp(1j * off[:, 2]))
    assert np.abs(off / sigma).max() < 4.5


def test_labels_as_printed_are_refused_and_nothing_is_written(folder):
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace('\nX = "Y"\nY = "X"\n', "\n"))
    done = run(folder)
    assert done.exit_code == 2
    assert "exchanged" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "results").exists()


def test_a_possible_mirror_image_is_never_presented_as_good(folder):
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace('\nX = "Y"\nY = "X"\n', "\n"))
    (folder / "survey" / "published_world_points.csv").unlink()
    done = run(folder, "--json")
    said = json.loads(done.stdout)
    assert said["labelling"]["status"] == "unconfirmed"
    (finding,) = [f for f in said["findings"] if f["severity"] == "error"]
    assert "mirror image" in finding["text"]
    rows = (folder / "results" / "world_points.csv").read_text().splitlines()[1:]
    assert all(row.endswith("mirror image possible") for row in rows)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("survey/readings.csv", "from,to,distance\nO,1,x\n"),
        ("survey/published_world_points.csv", "world_point,x,y\n1,nan,2\n"),
        ("survey/published_world_points.csv", "world_point,x,y\n99,1,2\n"),
        ("survey/initial_guesses.csv", "pose,x,y\n1,1,2\n"),
        ("survey/published_poses.csv", "pose,x,y,theta\n1,1,2,99\n"),
        ("survey/hand_points.csv", "world_point,x,y\n1,1,2\n1,1,2\n"),
        ("campaign.toml", 'name = "a"\n[survey]\nworld_point = ["1"]\n'),
        ("campaign.toml", 'name = "a"\n[survey]\nworld_points = ["1"]\nlabels = {X = "Q"}\n'),
        ("campaign.toml", 'name = "a"\n[surveys]\n'),
        ("campaign.toml", "name = "),
    ],
)
def test_a_bad_file_ends_in_a_plain_error_and_leaves_old_results_alone(folder, file, text):
    assert run(folder).exit_code == 0
    before = {p: p.read_bytes() for p in (folder / "results").iterdir()}
    (folder / file).write_text(text)
    done = run(folder)
    assert done.exit_code == 2, done.output
    assert file.split("/")[-1] in done.stderr
    assert "Traceback" not in done.stderr
    assert {p: p.read_bytes() for p in (folder / "results").iterdir()} == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_a_plain_error(folder):
    folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    done = run(folder)
    folder.chmod(stat.S_IRWXU)
    assert done.exit_code == 2
    assert "cannot write" in done.stderr


def test_results_that_are_in_the_way_of_a_folder_are_a_plain_error(folder):
    (folder / "results").write_text("a file where a folder should be")
    done = run(folder)
    assert done.exit_code == 2
    assert "cannot write" in done.stderr


def test_a_folder_without_a_survey_says_so(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "empty"\n')
    done = run(tmp_path)
    assert done.exit_code == 2
    assert "no survey" in done.stderr


def test_hardware_that_is_not_stated_is_asked_for_all_at_once(room):
    toml = room / "campaign.toml"
    without = re.sub(
        r"^(tolerance|pole_length|points) = .*\n", "", toml.read_text(), flags=re.MULTILINE
    )
    toml.write_text(without)
    done = run(room, "--dry-run")
    assert done.exit_code == 2
    for key, example in (
        ("instrument.tolerance", "tolerance = 0.0015"),
        ("vframe.points", "pole_length = 2.5"),
        ("robot_frame.points", "points = {"),
    ):
        assert key in done.stderr
        assert example in done.stderr


def test_assumed_standard_deviations_are_told(room):
    toml = room / "campaign.toml"
    for key in ("sigma", "marking_sigma"):
        toml.write_text(re.sub(rf"^{key} = .*\n", "", toml.read_text(), flags=re.MULTILINE))
    said = json.loads(run(room, "--json", "--dry-run").stdout)
    (told,) = [f for f in said["findings"] if f["code"] == "assumed_sigmas"]
    assert told["severity"] == "note"
    assert "vframe.sigma = 0.002 m, robot_frame.marking_sigma = 0.001 m" in told["text"]


def test_the_listings_as_printed_can_be_compared(room):
    done = run(room, "--as-published", "--dry-run")
    assert done.exit_code == 0
    assert "by the document's listing" in done.stdout
    assert not (room / "results").exists()
    assert "by the document's listing" not in run(room, "--dry-run").stdout


def test_robust_adjustment_is_an_option(room):
    assert run(room, "--robust", "--dry-run").exit_code == 0


def test_a_command_has_help():
    assert "readings" in CliRunner().invoke(survey, ["--help"]).output


def units_told(folder):
    found = json.loads(run(folder, "--json").stdout)["findings"]
    return [one for one in found if one["code"] == "unit"]


@pytest.mark.parametrize(("unit", "per_metre"), [("millimetres", 1000.0), ("feet", 1 / 0.3048)])
@pytest.mark.parametrize(
    ("file", "option"),
    [("hand_points.csv", ["--hand-points", "4"]), ("initial_guesses.csv", ["--initial-guesses"])],
)
def test_rough_coordinates_in_another_unit_are_told(tmp_path, file, option, unit, per_metre):
    folder = tmp_path / "room"
    made = CliRunner().invoke(main, ["simulate", str(folder), "--stops", "5", *option])
    assert made.exit_code == 0
    assert units_told(folder) == []
    path = folder / "survey" / file
    head, *rows = (line.split(",") for line in path.read_text().splitlines())
    for row in rows:
        row[1:3] = [repr(float(cell) * per_metre) for cell in row[1:3]]
    path.write_text("".join(",".join(row) + "\n" for row in (head, *rows)))
    told = units_told(folder)
    assert [one["severity"] for one in told] == ["warning"]
    assert f"Write metres in survey/{file}: its coordinates are in {unit}" in told[0]["text"]
