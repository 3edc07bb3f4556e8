"""Matching is done once, and kept for the commands that follow, whether or not stops are placed."""

from dataclasses import fields

import numpy as np
import pytest
from click.testing import CliRunner
from laser_rooms import solved, write_campaign

from laser_gt.campaign.kept import kept_file, matching_text, read_matching
from laser_gt.campaign.result_files import kept_files
from laser_gt.commands.group import laser
from laser_gt.logs.decision_file import append_decision
from laser_gt.logs.decisions import Decision
from laser_gt.matching.verdicts import JudgementSettings, Match
from laser_gt.settings import JudgementTable

STOPS = ("1", "2", "3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("kept")
    write_campaign(path, seed=4, stops=3)
    return path


@pytest.fixture(scope="module")
def outcome(folder):
    return solved(folder)


def test_kept_matches_are_those_that_were_made(outcome, tmp_path):
    made = outcome.matchings["scanmatch"]
    key = outcome.keys["scanmatch"]
    path = tmp_path / kept_file("scanmatch")
    assert read_matching(path, key, "scanmatch") is None
    path.write_text(matching_text(made, key))
    again = read_matching(path, key, "scanmatch")
    for one, other in zip(made.matches, again.matches, strict=True):
        for field in fields(Match):
            before, after = getattr(one, field.name), getattr(other, field.name)
            assert np.array_equal(before, after, equal_nan=isinstance(before, float))
    assert again.loops == made.loops
    assert read_matching(path, key[::-1], "scanmatch") is None
    path.write_text(path.read_text()[:100])
    assert read_matching(path, key, "scanmatch") is None


def test_matches_are_made_once_and_anew_where_anything_is_changed(folder, outcome, monkeypatch):
    (folder / "results").mkdir(exist_ok=True)
    for name, text in kept_files(outcome).items():
        (folder / "results" / name).write_text(text)
    monkeypatch.setattr("laser_gt.campaign.solve.match_pairs", _never)
    assert solved(folder).matchings["scanmatch"].counts == outcome.matchings["scanmatch"].counts
    append_decision(folder / "laser" / "decisions.csv", Decision("1", "2", "reject"), STOPS, "")
    with pytest.raises(AssertionError, match="matched again"):
        solved(folder)
    (folder / "laser" / "decisions.csv").unlink()


def _never(*_):
    raise AssertionError("matched again")


def test_a_campaign_that_places_no_stop_still_writes_its_matches_and_fails(tmp_path):
    write_campaign(tmp_path, seed=4, stops=3)
    for pair in (("1", "2"), ("1", "3"), ("2", "3")):
        made = Decision(*pair, "reject")
        append_decision(tmp_path / "laser" / "decisions.csv", made, STOPS, "2026-01-01T00:00")
    done = CliRunner().invoke(laser, ["solve", str(tmp_path), "--engine", "scanmatch"])
    assert done.exit_code != 0
    assert "no match that can be used reaches a surveyed stop" in done.output
    head, *rows = (tmp_path / "results" / "laser_matches_scanmatch.csv").read_text().splitlines()
    assert "verdict" in head
    assert all(",refuted," in row for row in rows)
    assert rows


def test_the_limits_of_the_settings_are_those_of_the_judgement():
    assert JudgementSettings(**JudgementTable().model_dump()) == JudgementSettings()
