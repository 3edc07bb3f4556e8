import csv
import json
from pathlib import Path

import numpy as np
import pytest

from data_samples.rooms.campaign_files import SETTINGS_FILE, campaign_files, write_campaign
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import ExampleSystem, SimulationSettings, simulate_survey
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.poses.pose_table import from_csv
from validation.published.systems import published_tables

REPOSITORY = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def simulated():
    rng = np.random.default_rng(11)
    room = make_room(RoomSettings(stops=4, world_points=6, pillars=1), rng)
    settings = SimulationSettings(
        systems=(ExampleSystem(),),
        blunders=2,
        typos=1,
        hand_points=2,
        missing=0.05,
        guess_sigmas=(0.1, 0.1, 0.1),
    )
    return simulate_survey(room, settings, rng)


@pytest.fixture(scope="module")
def campaign(simulated, tmp_path_factory):
    folder = tmp_path_factory.mktemp("simulated")
    write_campaign(folder, simulated, seed=11)
    return load_campaign(folder, frozenset({"survey"}))


def rows(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_readings_come_back_to_the_last_bit(campaign, simulated):
    settings = campaign.section("survey", SurveySettings)
    readings = load_readings(campaign, settings).used
    assert readings.start == simulated.readings.start
    assert readings.end == simulated.readings.end
    assert np.array_equal(readings.distance, simulated.readings.distance)
    assert np.array_equal(readings.sigma, simulated.readings.sigma)


def test_the_settings_state_what_the_truth_was_drawn_from(campaign, simulated):
    assert campaign.settings.instrument == simulated.settings.instrument
    assert campaign.settings.vframe == simulated.room.vframe
    assert campaign.settings.robot_frame == simulated.robot_frame
    world_points = campaign.section("survey", SurveySettings).world_points
    assert tuple(world_points) == simulated.room.world_names


def test_the_walls_are_those_of_the_room_to_the_centimetre(campaign, simulated):
    outline, *obstacles = campaign.settings.room.walls
    half_a_centimetre = 0.005 + 1e-9
    assert np.abs(np.array(outline[:-1]) - simulated.room.outline).max() <= half_a_centimetre
    assert len(obstacles) == len(simulated.room.obstacles)
    assert all(wall[0] == wall[-1] for wall in campaign.settings.room.walls)


def test_the_example_system_comes_back_with_its_covariances(campaign, simulated):
    (table,) = published_tables(campaign)
    assert table.system == "example_gt"
    assert np.array_equal(table.poses, simulated.systems[0].poses)
    assert np.array_equal(table.covariances, simulated.systems[0].covariances)


def test_the_truth_comes_back_to_the_last_bit(campaign, simulated):
    truth = campaign.folder / "truth"
    assert np.array_equal(from_csv(truth / "poses.csv").poses, simulated.room.stops)
    for name, expected in [
        ("world_points", simulated.room.world_points),
        ("vframe_points", simulated.truth.vframe_points),
        ("rig_points", simulated.truth.rig_points),
        ("marks", simulated.truth.marks.reshape(-1, 2)),
    ]:
        read = [[float(row["x"]), float(row["y"])] for row in rows(truth / f"{name}.csv")]
        assert np.array_equal(read, expected)


def test_wrong_readings_are_named_by_their_line(campaign, simulated):
    lines = (campaign.folder / "survey" / "readings.csv").read_text().splitlines()
    recorded = rows(campaign.folder / "truth" / "blunders.csv")
    assert [row["kind"] for row in recorded].count("blunder") == 2
    assert [row["kind"] for row in recorded].count("typo") == 1
    for row, fault in zip(recorded, simulated.truth.faults, strict=True):
        assert f",{row['from']},{row['to']}," in lines[int(row["line"]) - 1]
        assert float(row["size"]) == fault.size


def test_the_settings_are_noted_with_the_seed(campaign):
    noted = json.loads((campaign.folder / SETTINGS_FILE).read_text())
    assert noted["seed"] == 11
    assert noted["room"]["stops"] == 4
    assert noted["survey"]["blunders"] == 2


def test_initial_guesses_are_a_pose_table(campaign, simulated):
    guesses = from_csv(campaign.folder / "survey" / "initial_guesses.csv", system="hand")
    half_a_millimetre = 0.0005 + 1e-9
    gap = np.abs(guesses.poses - simulated.initial_guesses.poses)
    assert gap.max() <= half_a_millimetre


def test_files_of_an_earlier_simulation_that_are_not_written_again_go(simulated, tmp_path):
    write_campaign(tmp_path, simulated)
    optional = [tmp_path / "survey" / f"{n}.csv" for n in ("hand_points", "initial_guesses")]
    assert all(path.exists() for path in optional)
    room = simulated.room
    write_campaign(tmp_path, simulate_survey(room, SimulationSettings(), np.random.default_rng(0)))
    assert not any(path.exists() for path in optional)


def test_a_campaign_states_nothing_of_the_truth(simulated):
    """The files outside truth/ are the same whatever the truth/ files would say."""
    files = campaign_files(simulated)
    outside = "".join(text for name, text in files.items() if not name.startswith("truth/"))
    for value in [*simulated.room.stops.ravel(), *simulated.truth.vframe_points.ravel()]:
        assert repr(float(value)) not in outside


def test_no_estimator_reads_the_truth():
    for package in ("validation", "survey", "vision_gt", "laser_gt"):
        for module in (REPOSITORY / package).rglob("*.py"):
            text = module.read_text()
            assert "data_samples" not in text.replace("data_samples.commands.rooms", ""), module
            assert '"truth' not in text, module
