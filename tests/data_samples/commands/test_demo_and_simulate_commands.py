import json

import pytest
from click.testing import CliRunner

from data_samples.demo import copy_demo, demo_files
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError


def gtval(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


pytestmark = pytest.mark.xdist_group("demo")  # one run for all


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "copy"
    return folder, gtval("demo", folder)


def test_the_demo_computes_the_published_campaign(computed):
    folder, result = computed
    assert result.exit_code == 0, result.output
    assert (folder / "report" / "report.html").stat().st_size > 10_000
    assert (folder / "results" / "statistics.csv").exists()
    assert str(folder) in result.output
    assert "0.08037" in result.output  # the printed mean of the vision errors in x is 0.0804
    assert "report.html" in result.output


def test_the_demo_copies_every_file_as_it_is(computed):
    folder, _ = computed
    copied = contents(folder)
    assert {name: copied[name] for name in demo_files()} == demo_files()
    assert {"campaign.toml", "README.md", "survey/readings.csv"} <= set(demo_files())


def test_the_demo_runs_again_on_its_own_copy_and_prints_json(computed):
    folder, _ = computed
    result = gtval("demo", folder, "--json")
    assert result.exit_code == 0
    systems = {one["system"] for one in json.loads(result.stdout)["comparisons"]}
    assert systems == {"vision", "laser_genetic", "laser_scanmatch"}


def test_a_lost_file_of_the_demo_is_put_back(tmp_path):
    copy_demo(tmp_path / "copy")
    lost = tmp_path / "copy" / "survey" / "readings.csv"
    lost.unlink()
    copy_demo(tmp_path / "copy")
    assert lost.read_bytes() == demo_files()["survey/readings.csv"]


def test_the_demo_touches_no_folder_that_holds_something_else(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    result = gtval("demo", tmp_path)
    assert result.exit_code == 2
    assert "not empty" in result.output
    assert list(contents(tmp_path)) == ["thesis.tex"]


def test_the_demo_touches_no_other_campaign(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "mine"\n')
    result = gtval("demo", tmp_path)
    assert result.exit_code == 2
    assert "campaign.toml" in result.output
    assert contents(tmp_path) == {"campaign.toml": b'name = "mine"\n'}


def test_the_demo_touches_no_copy_that_was_changed(tmp_path):
    copy_demo(tmp_path)
    readings = tmp_path / "survey" / "readings.csv"
    readings.write_text(readings.read_text() + ",O,XY,3.536,\n")
    before = contents(tmp_path)
    with pytest.raises(GtvalError, match=r"survey/readings\.csv"):
        copy_demo(tmp_path)
    assert contents(tmp_path) == before


def test_a_file_is_no_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for command in ("demo", "simulate"):
        result = gtval(command, file)
        assert result.exit_code == 2
        assert "is a file" in result.output


def test_simulate_writes_a_campaign_that_can_be_read(tmp_path):
    result = gtval("simulate", tmp_path / "room", "--stops", 3, "--world-points", 5, "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert (said["stops"], said["world_points"], said["wrong_readings"]) == (3, 5, 0)
    campaign = load_campaign(tmp_path / "room")
    readings = load_readings(campaign, campaign.section("survey", SurveySettings)).used
    assert len(readings) == said["readings"]
    assert readings.poses == ["1", "2", "3"]


def test_a_simulated_campaign_runs_and_its_blunder_is_found(tmp_path):
    arguments = ("--stops", 2, "--world-points", 8, "--blunders", 1, "--blunder-size", 0.2)
    assert gtval("simulate", tmp_path, *arguments).exit_code == 0
    line = (tmp_path / "truth" / "blunders.csv").read_text().splitlines()[1].split(",")[0]
    result = gtval("run", tmp_path, "--no-report")
    assert result.exit_code == 0, result.output
    assert f"(line {line})" in result.output


def test_the_same_seed_gives_the_same_files_and_another_other_ones(tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        options = ("--seed", seed, "--stops", 2, "--blunders", 1, "--typos", 1)
        assert gtval("simulate", tmp_path / name, *options).exit_code == 0
    a, b, c = (contents(tmp_path / name) for name in "abc")
    assert a == b
    assert a["survey/readings.csv"] != c["survey/readings.csv"]


def test_simulate_refuses_a_folder_that_is_not_empty_unless_forced(tmp_path):
    options = ("--stops", 2, "--hand-points", 2, "--initial-guesses")
    assert gtval("simulate", tmp_path, *options).exit_code == 0
    before = contents(tmp_path)
    refused = gtval("simulate", tmp_path, "--stops", 3)
    assert refused.exit_code == 2
    assert "not empty" in refused.output
    assert contents(tmp_path) == before
    (tmp_path / "notes.txt").write_text("mine")
    assert gtval("simulate", tmp_path, "--stops", 3, "--force").exit_code == 0
    after = contents(tmp_path)
    assert after["notes.txt"] == b"mine"
    assert after["survey/readings.csv"] != before["survey/readings.csv"]
    assert "survey/hand_points.csv" not in after


@pytest.mark.parametrize(
    "wrong", [("--stops", 0), ("--blunders", -1), ("--blunder-size", 0), ("--seed", "x")]
)
def test_impossible_options_are_refused(tmp_path, wrong):
    result = gtval("simulate", tmp_path / "room", *wrong)
    assert result.exit_code == 2
    assert not (tmp_path / "room").exists()


def test_a_room_that_cannot_hold_it_is_a_plain_error(tmp_path):
    result = gtval("simulate", tmp_path / "room", "--stops", 2, "--blunders", 5000)
    assert result.exit_code == 2
    assert "too few" in result.output
    assert not (tmp_path / "room").exists()


def test_both_commands_explain_themselves():
    for command in ("demo", "simulate"):
        assert "FOLDER" in gtval(command, "--help").output


def test_a_small_room_with_a_laser_is_simulated_and_run(tmp_path):
    room = tmp_path / "room"
    assert gtval("simulate", room, "--laser", "--stops", 3, "--seed", 2).exit_code == 0
    done = gtval("run", room, "--no-report", "--json")
    assert done.exit_code == 0, done.output
    compared = {one["system"]: one for one in json.loads(done.output)["comparisons"]}
    assert {"laser_scanmatch", "example_gt"} <= set(compared)
