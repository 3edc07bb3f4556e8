"""What a person is told: one line for one cause, whatever many readings show of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from surveys import simulated

from data_samples.rooms.campaign_files import write_campaign
from survey.campaign.facts import survey_facts
from survey.campaign.findings import survey_findings
from survey.campaign.solve import solve_campaign
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError


def told(folder, survey, change):
    """Findings and facts of a campaign whose file was changed."""
    shown, start, end = survey.shown.copy(), [*survey.readings.start], [*survey.readings.end]
    change(shown, start, end)
    readings = replace(survey.readings, start=tuple(start), end=tuple(end))
    write_campaign(folder, replace(survey, shown=shown, readings=readings), 1)
    outcome = solve_campaign(load_campaign(folder))
    return survey_findings(outcome), survey_facts(outcome)


def rows_of(survey, stop):
    return [i for i, name in enumerate(survey.readings.start) if name.startswith(f"{stop}/")]


def test_the_other_edge_at_one_stop_is_one_line(tmp_path):
    _, survey = simulated(3)

    def change(shown, *_):
        shown[rows_of(survey, 2)] -= 0.1

    findings, facts = told(tmp_path, survey, change)
    (error,) = [one for one in findings if one.severity == "error"]
    assert error.code == "cause"
    assert error.subject == "pose 2"
    assert "of stop 2 are too short by" in error.text
    assert "other edge of the instrument" in error.text
    assert "independent blunders" in error.text
    assert "It spoils the poses" in error.text
    assert "To confirm it" in error.text
    assert not [one for one in findings if one.severity == "warning"]
    causes = json.loads(json.dumps(facts["causes"]))
    assert causes["others"]
    best = causes["hypotheses"][0]
    assert (best["kind"], best["extent"], best["subject"]) == ("offset", "station", ["2"])
    assert best["sizes"][0]["low"] < -0.1 < best["sizes"][0]["high"]
    assert "2" in causes["poses_spoilt"]
    assert causes["m0"] > 3
    # 99.9 % of m0 with some two hundred degrees of freedom.
    assert 0.84 < causes["m0_without"] < 1.17


def test_exchanged_rig_points_are_named_although_the_stop_has_no_pose(tmp_path):
    _, survey = simulated(4)

    def change(_, start, __):
        swap = {"2/X": "2/Y", "2/Y": "2/X"}
        start[:] = [swap.get(name, name) for name in start]

    findings, _ = told(tmp_path, survey, change)
    (error,) = [one for one in findings if one.severity == "error"]
    assert error.code == "cause"
    assert "rig points X and Y are exchanged at stop 2" in error.text


def test_a_blunder_beside_a_cause_keeps_its_own_line(tmp_path):
    _, survey = simulated(6)
    bad = rows_of(survey, 3)[5]

    def change(shown, *_):
        shown[rows_of(survey, 2)] += 0.05
        shown[bad] += 0.3

    findings, _ = told(tmp_path, survey, change)
    errors = [one for one in findings if one.severity == "error"]
    assert [one.code for one in errors] == ["cause", "blunder"]
    assert f"(line {bad + 2})" in errors[1].text


def test_independent_blunders_are_not_one_cause(tmp_path):
    _, survey = simulated(7)
    bad = np.random.default_rng(7).choice(np.arange(10, len(survey.shown)), 3, replace=False)

    def change(shown, *_):
        shown[bad] += [0.1, -0.07, 0.05]

    findings, facts = told(tmp_path, survey, change)
    assert {one.code for one in findings if one.severity == "error"} == {"blunder"}
    best = facts["causes"]["hypotheses"][0]
    assert best["kind"] == "blunders"
    assert {row + 2 for row in bad} == set(best["lines"])


def test_a_survey_that_cannot_be_solved_names_its_cause(tmp_path):
    _, survey = simulated(8)
    frame = set(survey.room.vframe.points)

    def change(shown, start, _):
        far = [i for i, name in enumerate(start) if name in frame][6:]
        shown[far[::2]] *= 1 / 0.3048

    with pytest.raises(GtvalError):
        told(tmp_path, survey, change)


def test_names_exchanged_at_a_vframe_point_are_told_with_rows_exchanged(tmp_path):
    # One reading of each: both are the same readings, and no program can tell them apart.
    _, survey = simulated(4)

    def change(_, start, end):
        rows = [i for i, pair in enumerate(zip(start, end, strict=True)) if pair[0] == "O"]
        swap = {"3": "5", "5": "3"}
        for i in rows:
            end[i] = swap.get(end[i], end[i])

    findings, facts = told(tmp_path, survey, change)
    (error,) = [one for one in findings if one.code == "cause"]
    assert "stand in each other's row, or the names of their targets are exchanged" in error.text
    (found,) = json.loads(json.dumps(facts["causes"]))["found"]
    assert found["kind"] == "exchanged_rows"
    ties = [(tie["kind"], tie["subject"], tie["odds_against"]) for tie in found["ties"]]
    assert ("exchanged_targets", ["O", "3", "5"], 1.0) in ties
