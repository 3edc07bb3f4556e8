"""Chapters of the report on instrument, walls, filters, plan and known motions."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from survey.campaign.solve import solve_campaign
from survey.chapters.gathered import survey_chapters
from survey.chapters.motions import published_motions
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import InputError

AD23 = Path(__file__).parents[3] / "data_samples" / "ad23"
ROOM = """name = "room"
[instrument]
tolerance = 0.0015
setup_sigma = 0.001
[vframe]
pole_length = 2.5
[robot_frame]
points = { "O" = [0.0, 0.0], "X" = [0.6, 0.0], "Y" = [0.0, 0.4] }
"""


@pytest.fixture(scope="module")
def ad23():
    return survey_chapters(solve_campaign(load_campaign(AD23)))


def rows(text):
    return list(csv.DictReader(text.splitlines()))


def test_the_document_s_campaign_has_the_chapters_that_its_data_allow(ad23):
    assert [section.title for section in ad23.sections] == [
        "Convergence of the filters",
        "Accuracy experiment",
        "Plan against what was reached",
    ]
    assert set(ad23.files) == {"convergence.csv", "motions.csv", "plan_reached.csv"}


def test_every_start_of_the_document_s_world_points_leads_to_the_solution(ad23):
    found = rows(ad23.files["convergence.csv"])
    assert len(found) == 16
    assert all(row["elsewhere"] == row["nowhere"] == "0" for row in found)
    assert all(float(row["radius"]) == 5.0 for row in found)


def test_the_printed_motion_has_the_printed_errors_to_the_last_digit(ad23):
    (row,) = rows(ad23.files["motions.csv"])
    assert (row["start"], row["end"], row["source"]) == ("18", "18'", "published")
    error = [float(row[f"error_{part}"]) for part in ("dx", "dy", "dtheta")]
    assert [round(error[0], 6), round(error[1], 6)] == [0.003192, 0.000923]
    assert round(float(np.degrees(error[2])), 6) == 0.013083


def test_the_motion_s_predicted_uncertainty_is_that_of_the_plan(ad23):
    (row,) = rows(ad23.files["motions.csv"])
    # Three marks of 1 mm twice are sqrt(2/3) = 0.8 mm at the middle of the rig; readings of
    # 2.4 mm to 16 points from three marks add sqrt(2 / 24) 2.4 = 0.7 mm.
    assert 0.8e-3 < float(row["sigma_dx"]) < 1.6e-3


def test_the_plan_names_every_stop_and_leaves_open_what_was_not_surveyed(ad23):
    found = rows(ad23.files["plan_reached.csv"])
    assert sum(row["kind"] == "world point" for row in found) == 16
    stops = [row for row in found if row["kind"] == "stop"]
    assert len(stops) == 26
    assert all(row["reached_position"] == "" for row in stops)
    assert all(float(row["planned_position"]) > 0 for row in stops)


def test_a_plan_that_is_carried_out_is_reached(tmp_path):
    """Readings of every planned pair give what was planned: the covariance is of places alone."""
    simulated = CliRunner().invoke(
        main, ["simulate", str(tmp_path / "a"), "--stops", "4", "--initial-guesses"]
    )
    assert simulated.exit_code == 0
    folder = tmp_path / "a"
    places = (folder / "truth" / "world_points.csv").read_text()
    (folder / "survey" / "planned_points.csv").write_text(places)
    found = rows(survey_chapters(solve_campaign(load_campaign(folder))).files["plan_reached.csv"])
    ratios = [float(r["reached_position"]) / float(r["planned_position"]) for r in found]
    # The guessed stops are 0.1 m off and the walls hide some pairs.
    assert all(0.9 < ratio < 1.5 for ratio in ratios)


def test_known_lengths_and_walls_become_chapters(tmp_path):
    (tmp_path / "survey").mkdir()
    (tmp_path / "campaign.toml").write_text(ROOM)
    (tmp_path / "survey" / "published_poses.csv").write_text("pose,x,y,theta\n1,0,0,0\n2,1,0,0\n")
    lengths = "".join(f"{d},{d + 0.0017}\n" for d in np.linspace(1, 9, 12))
    (tmp_path / "survey" / "known_lengths.csv").write_text("true,reading\n" + lengths)
    walls = "wall_a,wall_b,position,distance\nN,S,0,8.0\nN,S,3,8.021\n"
    (tmp_path / "survey" / "walls.csv").write_text(walls)
    done = CliRunner().invoke(main, ["run", str(tmp_path), "--no-report", "--json"])
    assert done.exit_code == 0, done.output
    codes = {finding["code"] for finding in json.loads(done.stdout)["findings"]}
    assert {"offset", "not_parallel"} <= codes
    walls_found = rows((tmp_path / "results" / "walls.csv").read_text())[0]
    assert np.degrees(float(walls_found["angle"])) == pytest.approx(0.401, abs=5e-4)
    assert (tmp_path / "results" / "instrument_check.csv").exists()


def test_motions_of_the_settings_are_checked_and_unknown_stops_told(tmp_path):
    folder = tmp_path / "room"
    assert CliRunner().invoke(main, ["simulate", str(folder), "--stops", "3"]).exit_code == 0
    truth = {r["pose"]: r for r in rows((folder / "truth" / "poses.csv").read_text())}
    dx, dy, dtheta = (
        float(truth["2"][part]) - float(truth["1"][part]) for part in ("x", "y", "theta")
    )
    with (folder / "campaign.toml").open("a") as stream:
        for end in ("2", "9"):
            stream.write(
                f'[[survey.motions]]\nstart = "1"\nend = "{end}"\ndx = {dx}\ndy = {dy}\n'
                f"dtheta = {dtheta}\n"
            )
    result = survey_chapters(solve_campaign(load_campaign(folder)))
    codes = [one.code for one in result.findings]
    assert "motion" in codes
    assert "motion_open" in codes
    assert float(rows(result.files["motions.csv"])[0]["p_value"]) > 1e-4


def test_a_bad_file_of_motions_names_its_line(tmp_path):
    (tmp_path / "campaign.toml").write_text(ROOM)
    (tmp_path / "survey").mkdir()
    path = tmp_path / "survey" / "published_motions.csv"
    header = "start,end,real_dx,real_dy,real_dtheta_degrees,found_dx,found_dy,found_dtheta_degrees"
    path.write_text(f"{header}\n18,18',0.01,x,1,0.01,0.01,1\n")
    with pytest.raises(InputError, match="line 2"):
        published_motions(load_campaign(tmp_path), SurveySettings(), {})


def test_the_accuracy_command_shows_the_published_experiment():
    done = CliRunner().invoke(main, ["accuracy", str(AD23)])
    assert done.exit_code == 0
    assert "+0.003192" in done.output
    assert "a shift in any direction is seen from" in done.output.lower()


def test_starts_can_be_left_out():
    outcome = solve_campaign(load_campaign(AD23))
    settings = outcome.inputs.settings.model_copy(update={"convergence_starts": 0})
    inputs = outcome.inputs.__class__(**{**vars(outcome.inputs), "settings": settings})
    without = survey_chapters(outcome.__class__(**{**vars(outcome), "inputs": inputs}))
    assert "convergence.csv" not in without.files


def test_a_frame_read_once_is_tested_once():
    solution = solve_campaign(load_campaign(AD23)).solution
    assert len(solution.vframe.checks) == 3
    (only,) = solution.vframe.tests
    assert only.name == "length X–Y"
    assert only.measured == 3.536


def test_from_the_origin_the_listing_loses_point_9_alone():
    literal = solve_campaign(load_campaign(AD23)).as_published
    lost = {name for name, off in literal.lost_from_origin.items() if off > 1e-3}
    assert lost == {"9"}
    assert literal.lost_from_origin["9"] == pytest.approx(3.4e8, rel=0.02)
    assert max(literal.own_from_origin.values()) < 1e-9


def test_the_flag_overrules_the_settings():
    campaign = load_campaign(AD23)
    assert solve_campaign(campaign).as_published is not None
    assert solve_campaign(campaign, as_published=False).as_published is None
