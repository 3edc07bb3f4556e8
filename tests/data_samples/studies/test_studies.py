"""A study says how often what is claimed is true; what is kept of it is not done again."""

import csv
import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from data_samples.studies.plan import TrialSettings, read_plan
from data_samples.studies.study import Ranged, _of_rooms, _share_inside, proportion, run_study
from data_samples.studies.trial import KeptTrials, TrialJob, run_trial
from validation.cli import main
from validation.errors import InputError
from validation.pieces.store import counted

PLAN = """
name = "wrong readings"
seeds = 3

[room]
stops = 4
world_points = 8

[vary]
"survey.blunders" = [0, 2]
"""


def plan_of(folder, text=PLAN):
    path = folder / "plan.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    plan = read_plan(plan_of(folder))
    return plan, folder, run_study(plan, folder, workers=1)


def test_every_combination_is_a_setting(tmp_path):
    text = PLAN + '"room.stops" = [3, 5]\n"survey.tail_freedom" = [4.0]\n'
    plan = read_plan(plan_of(tmp_path, text))
    assert list(plan.settings) == [
        f"survey.blunders = {wrong}, room.stops = {stops}, survey.tail_freedom = 4.0"
        for wrong in (0, 2)
        for stops in (3, 5)
    ]
    rooms = [(one.room.stops, one.survey.blunders) for one in plan.settings.values()]
    assert rooms == [(3, 0), (5, 0), (3, 2), (5, 2)]
    assert list(plan.seeds) == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "line", "key", "said"),
    [
        ("seeds = 1", 1, "seeds", "2"),
        ("[room]\nstop = 3", 2, "room.stop", "did you mean 'stops'"),
        ('[vary]\n"survey.blunder" = [1]', 2, "vary.survey.blunder", "did you mean 'blunders'"),
        ('[vary]\n"stops" = [1]', 2, "vary.stops", "expected a table and its key"),
        ('[vary]\n"room.stops" = [0, 3]', 2, "vary.room.stops", "1"),
        ('[vary]\n"room.stops" = []', 2, "vary.room.stops", "1"),
        ('[vary]\n"room.stops" = [3, 4, 3]', 2, "vary.room.stops", "it comes twice"),
    ],
)
def test_what_is_wrong_in_a_plan_is_told_with_its_place(tmp_path, text, line, key, said):
    path = plan_of(tmp_path, text)
    with pytest.raises(InputError) as told:
        read_plan(path)
    (problem,) = told.value.problems
    assert (problem.line, problem.field) == (line, key)
    assert said in problem.expected


def test_a_plan_of_too_many_combinations_is_refused(tmp_path):
    ten = list(range(10))
    text = f'[vary]\n"room.stops" = {list(range(1, 12))}\n'
    text += f'"survey.blunders" = {ten}\n"room.pillars" = {ten}\n'
    with pytest.raises(InputError, match="1,100 combinations"):
        read_plan(plan_of(tmp_path, text))


def test_the_survey_of_a_trial_is_held_against_the_truth(made):
    _, _, study = made
    clean, spoilt = study.honesty
    assert (clean.system, clean.trials, clean.poses, clean.stops) == ("survey", 3, 12, 12)
    assert (clean.rms[:2] < 0.005).all()  # metres: readings are good to 2 mm
    assert clean.nees.value < spoilt.nees.value
    found = {(one.setting, one.code): one.found for one in study.power}
    assert found.get(("survey.blunders = 0", "m0"), 0) == 0
    assert found["survey.blunders = 2", "m0"] == 3


def test_a_trial_that_is_kept_is_the_same_to_the_last_bit(made):
    plan, folder, study = made
    label, settings = next(iter(plan.settings.items()))
    job = TrialJob(settings, 1)
    again, own = run_trial(job), study.trials[label][0]
    kept = KeptTrials(folder / "kept" / "trials.jsonl")
    read = kept.read(kept.get(job.key), job)
    for one in (again, read):
        np.testing.assert_array_equal(one.systems["survey"].errors, own.systems["survey"].errors)
        np.testing.assert_array_equal(one.systems["survey"].nees, own.systems["survey"].nees)
        assert (one.findings, one.stops, one.refused) == (own.findings, own.stops, own.refused)


def test_more_seeds_or_settings_work_out_only_what_is_new(made):
    plan, folder, study = made
    more = replace(
        plan,
        seeds=range(1, 5),
        settings={**plan.settings, "another": TrialSettings.model_validate({"room": {"stops": 3}})},
    )
    with counted() as pieces:
        again = run_study(more, folder, workers=1)
    assert (pieces.of("trials").taken, pieces.of("trials").done) == (6, 6)
    for label, trials in study.trials.items():
        for one, other in zip(trials, again.trials[label], strict=False):
            assert one.findings == other.findings


def test_a_room_that_cannot_be_worked_out_is_counted(tmp_path):
    text = "seeds = 2\n[room]\nstops = 2\nworld_points = 2\n[survey]\nmissing = 0.9\n"
    study = run_study(read_plan(plan_of(tmp_path, text)), tmp_path, workers=1)
    assert study.refused("") == 2
    assert study.honesty == ()
    assert all(one.refused for one in study.trials[""])


def test_the_interval_of_rooms_holds_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(400):
        own = rng.normal(0, 1, 15)  # of each room, shared by its poses
        rooms = [one + rng.normal(0, 0.3, rng.integers(3, 9)) for one in own]
        found = _of_rooms(rooms, 0.9, -np.inf, np.inf)
        hits += found.low <= 0 <= found.high
    assert 0.9 - 3 * np.sqrt(0.09 / 400) <= hits / 400 <= 0.9 + 3 * np.sqrt(0.09 / 400)


@pytest.mark.parametrize(("found", "of"), [(0, 40), (3, 40), (40, 40), (1, 2)])
def test_proportions_have_the_interval_of_clopper_and_pearson(found, of):
    known = stats.binomtest(found, of).proportion_ci(0.95, "exact")
    np.testing.assert_allclose(proportion(found, of, 0.95), [found / of, known.low, known.high])
    assert np.isnan(proportion(0, 0, 0.95)).all()
    assert isinstance(proportion(found, of, 0.95), Ranged)


def test_the_command_tells_and_writes_the_tables(made):
    plan, folder, study = made
    done = CliRunner().invoke(main, ["study", str(plan.path), "--folder", str(folder), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["pieces"]["trials"] == {"taken": 6, "done": 0, "lost": 0}
    assert [one["intervals"] for one in told["poses"]] == [
        one.verdict(0.95) for one in study.honesty
    ]
    with (folder / "poses.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["setting"] for row in rows] == list(plan.settings)
    shown = CliRunner().invoke(main, ["study", str(plan.path), "--folder", str(folder)])
    assert "Taken over from earlier runs: 6 of 6 trials" in shown.output
    cleaned = CliRunner().invoke(main, ["clean", str(folder), "--dry-run"])
    assert "1 file, " in cleaned.output
    assert (folder / "kept" / "trials.jsonl").exists()


def test_what_failed_by_chance_is_not_kept(tmp_path, monkeypatch):
    plan = read_plan(plan_of(tmp_path, "seeds = 2\n[room]\nstops = 3\nworld_points = 6\n"))

    def failing(*_args, **_more):
        raise MemoryError

    with monkeypatch.context() as now:
        now.setattr("survey.system.solve_survey", failing, raising=False)
        now.setattr("validation.solving.solved_system", failing)
        first = run_study(plan, tmp_path, workers=1)
    assert not any(one.systems for one in first.trials[""])
    again = run_study(plan, tmp_path, workers=1)
    assert all("survey" in one.systems for one in again.trials[""])


def test_a_room_that_cannot_be_drawn_stops_no_other(tmp_path):
    text = 'seeds = 2\n[room]\nstops = 3\nworld_points = 6\n[vary]\n"room.width" = [7.0, 3.0]\n'
    study = run_study(read_plan(plan_of(tmp_path, text)), tmp_path, workers=1)
    assert [study.refused(one) for one in study.trials] == [0, 2]
    assert "too small" in study.trials["room.width = 3.0"][0].refused


@pytest.mark.parametrize(
    "spoilt", ['"systems":[]', '"findings":[["bogus","a","b"]]', '"stops":"x"']
)
def test_a_kept_trial_of_wrong_content_is_done_again(made, tmp_path, spoilt):
    plan, folder, _ = made
    job = TrialJob(next(iter(plan.settings.values())), 1)
    told = json.loads((folder / "kept" / "trials.jsonl").read_text().splitlines()[0])
    told |= json.loads("{" + spoilt + "}")
    path = tmp_path / "kept" / "trials.jsonl"
    path.parent.mkdir()
    told = {"key": job.key, **{name: one for name, one in told.items() if name != "key"}}
    path.write_text(json.dumps(told, separators=(",", ":")) + "\n")
    one = replace(plan, seeds=range(1, 3), settings={"": job.settings})
    with counted() as pieces:
        run_study(one, tmp_path, workers=1)
    assert pieces.of("trials").done == 2


def test_files_of_others_are_not_replaced(tmp_path):
    plan = plan_of(tmp_path, "seeds = 2\n[room]\nstops = 3\nworld_points = 6\n")
    folder = tmp_path / "plan"
    folder.mkdir()
    (folder / "poses.csv").write_text("mine\n")
    done = CliRunner().invoke(main, ["study", str(plan), "--workers", "1"])
    assert done.exit_code != 0
    assert "is not of a study" in done.output
    assert (folder / "poses.csv").read_text() == "mine\n"
    bare = tmp_path / "blunders"
    bare.write_bytes(plan.read_bytes())
    done = CliRunner().invoke(main, ["study", str(bare), "--workers", "1"])
    assert done.exit_code != 0
    assert "Give another place with --folder" in done.output


def test_few_rooms_without_an_error_outside_do_not_pass_for_too_careful():
    found = _share_inside([np.ones(18)] * 16, 0.999)
    # Of right intervals of 99.9 %, 16 rooms of 18 numbers have none outside in 75 of 100 studies.
    assert found.value == found.high == 1.0
    assert found.low == pytest.approx(0.0005 ** (1 / 16))


def test_a_study_that_a_scheduler_ends_leaves_no_room_behind(tmp_path):
    plan = plan_of(tmp_path, "seeds = 50\n[room]\nstops = 20\n")
    rooms = tmp_path / "rooms"
    rooms.mkdir()
    words = ["study", str(plan), "--workers", "1", "--folder", str(tmp_path / "found")]
    going = subprocess.Popen(
        [sys.executable, "-m", "gtval", *words],
        env={**os.environ, "TMPDIR": str(rooms)},
        stderr=subprocess.PIPE,
    )
    while not list(rooms.iterdir()):
        assert going.poll() is None
        time.sleep(0.02)
    going.terminate()
    _, said = going.communicate()
    assert going.returncode == 130
    assert b"Interrupted; no file is half-written." in said
    assert list(rooms.iterdir()) == []


@pytest.mark.full
def test_intervals_of_a_right_survey_hold_the_truth(tmp_path):
    # Four intervals, of which one in 250 runs would miss what it should hold.
    text = "confidence = 0.999\nseeds = 60\n[room]\nstops = 8\n"
    text += '[vary]\n"survey.setup_sigma" = [0.001, 0.004]\n'
    study = run_study(read_plan(plan_of(tmp_path, text)), tmp_path)
    for one in study.honesty:
        assert one.inside.low <= 0.999, one
        assert one.inside.value > 0.98, one  # heavy tails would show here first
        assert one.nees.low <= 1 <= one.nees.high, one
