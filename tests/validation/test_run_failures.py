"""A part of a run that fails takes nothing else along, and is told everywhere."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from small_campaigns import FixedSystem, three_stops

from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError, InputError, Problem
from validation.results import Figure, Section, SystemResult, Table, Text
from validation.run import run_campaign
from validation.solving import system_output
from validation.systems import no_progress


class HasNoAnswer(FixedSystem):
    """Cannot even say whether a campaign holds its data."""

    def has_data(self, _campaign):
        raise RuntimeError("on purpose")


class KnowsNoInputs(FixedSystem):
    """Cannot say which files it reads."""

    def inputs(self, _campaign):
        raise RuntimeError("on purpose")


def fails(*_arguments: object) -> None:
    raise RuntimeError("on purpose")


def broken(name: str = "broken", **result) -> FixedSystem:
    return FixedSystem(name, SystemResult(**({"tables": [three_stops(name, 0.02)]} | result)))


BROKEN = {
    "has_data": HasNoAnswer("broken"),
    "solve": FixedSystem("broken", fails_with=RuntimeError("on purpose")),
    "no result": FixedSystem("broken", None),
    "a table that is none": broken(tables=["1,2,3"]),
    "a finding that is none": broken(findings=["bad"]),
    "a section that is none": broken(sections=["bad"]),
    "a file that is none": broken(files={"broken.csv": 3}),
}
DRAWN = {
    "a figure": broken(sections=[Section("Mine", [Figure("mine", "c", "a", fails), Text("left")])]),
    "a table": broken(
        sections=[Section("Mine", [Table("mine", ["x"], [["a"], [1.0]], ["wrong"]), Text("left")])]
    ),
    "a block of no known kind": broken(sections=[Section("Mine", [object(), Text("left")])]),
    "a section without blocks": broken(sections=[Section("Mine", None)]),
}


def run(folder: Path):
    """Exit status and record of `gtval run`, and its page."""
    done = CliRunner().invoke(main, ["run", str(folder)])
    record = json.loads((folder / "results/run.json").read_text())
    return done, record, (folder / "report/report.html").read_text()


def the_failure(record):
    (finding,) = [one for one in record["findings"] if one["code"] == "unexpected"]
    assert finding["severity"] == "error"
    return finding


@pytest.mark.parametrize("fault", BROKEN)
def test_a_system_that_fails_anywhere_leaves_all_others(fault, campaign_folder, with_systems):
    survey = FixedSystem("survey", SystemResult([three_stops("survey")]))
    with_systems(survey, BROKEN[fault], broken("rig"))
    done, record, page = run(campaign_folder)
    assert done.exit_code == 1
    assert list(record["comparisons"]) == ["rig"]
    finding = the_failure(record)
    assert finding["subject"] == "broken"
    assert "results/tracebacks/broken.txt" in done.output
    assert "results/tracebacks/broken.txt" in page
    trace = (campaign_folder / "results/tracebacks/broken.txt").read_text()
    assert trace.startswith("Traceback (most recent call last)")
    assert (campaign_folder / "results/errors.csv").exists()


@pytest.mark.parametrize("fault", DRAWN)
def test_a_part_of_the_report_that_fails_leaves_a_sentence(fault, campaign_folder, with_systems):
    survey = FixedSystem("survey", SystemResult([three_stops("survey")]))
    with_systems(survey, DRAWN[fault])
    done, record, page = run(campaign_folder)
    assert done.exit_code == 1
    assert the_failure(record)["subject"].startswith("report: Mine")
    assert "This part of the report could not be made" in page
    (trace,) = (campaign_folder / "results/tracebacks").iterdir()
    assert f"results/tracebacks/{trace.name}" in page
    # The figures of the comparison, and what stands beside the broken part, are there.
    assert "Poses of broken" in page
    assert ("<p>left</p>" in page) == ("without blocks" not in fault)
    # It is a finding like any other: on the first page and in the terminal.
    assert page.index(f"results/tracebacks/{trace.name}") < page.index("Poses of broken")
    assert trace.name in done.output


@pytest.mark.parametrize(
    ("name", "subject", "lost"),
    [
        ("evaluate", "comparison of rig", "errors.csv"),
        ("errors_csv", "comparison", "errors.csv"),
        ("explain_campaign", "explain", "explain/explanation.json"),
    ],
)
def test_an_analysis_that_fails_leaves_all_others(
    name, subject, lost, campaign_folder, with_systems, monkeypatch
):
    with_systems(FixedSystem("survey", SystemResult([three_stops("survey")])), broken("rig"))
    monkeypatch.setattr(f"validation.run.{name}", fails)
    done, record, page = run(campaign_folder)
    assert done.exit_code == 1
    assert the_failure(record)["subject"] == subject
    assert f"tracebacks/{subject.replace(' ', '_')}.txt" in record["outputs"]
    assert not (campaign_folder / "results" / lost).exists()
    assert (campaign_folder / "results/poses_rig.csv").exists()
    assert "on purpose" in page


def test_a_section_of_the_comparison_that_fails_leaves_a_sentence(
    campaign_folder, with_systems, monkeypatch
):
    with_systems(FixedSystem("survey", SystemResult([three_stops("survey")])), broken("rig"))
    monkeypatch.setattr("validation.report.document.pose_table", fails)
    monkeypatch.setattr("validation.report.document.overview_table", fails)
    done, record, page = run(campaign_folder)
    assert done.exit_code == 1
    subjects = [one["subject"] for one in record["findings"] if one["code"] == "unexpected"]
    assert subjects == ["report: All systems", "report: System rig"]
    assert page.count("This part of the report could not be made") == 2


def test_the_traceback_of_a_run_before_is_removed(campaign_folder, with_systems):
    survey = FixedSystem("survey", SystemResult([three_stops("survey")]))
    with_systems(survey, BROKEN["solve"])
    run(campaign_folder)
    with_systems(survey, broken())
    done, record, _ = run(campaign_folder)
    assert done.exit_code == 0
    assert not [one for one in record["findings"] if one["code"] == "unexpected"]
    assert not list((campaign_folder / "results").rglob("*.txt"))


def test_a_system_that_cannot_say_what_it_reads_is_taken_to_read_everything(
    campaign_folder, with_systems
):
    survey = FixedSystem("survey", SystemResult([three_stops("survey")]))
    with_systems(survey, KnowsNoInputs("rig", broken("rig").result))
    _, record, _ = run(campaign_folder)
    assert record["steps"]["rig"]["sources"] == ["."]
    (told,) = [one for one in record["findings"] if one["code"] == "inputs_unknown"]
    assert (told["severity"], told["subject"]) == ("warning", "rig")
    assert "RuntimeError: on purpose" in told["text"]


def test_bad_published_poses_stop_the_run_and_a_bug_in_reading_them_does_not(
    campaign_folder, with_systems, monkeypatch
):
    with_systems(FixedSystem("survey", SystemResult([three_stops("survey")])), broken("rig"))
    monkeypatch.setattr("validation.run.published_systems", fails)
    done, record, _ = run(campaign_folder)
    assert done.exit_code == 1
    assert the_failure(record)["subject"] == "published"
    assert list(record["comparisons"]) == ["rig"]


def test_a_system_that_starts_from_a_survey_which_fails_says_so(campaign_folder, with_systems):
    follower = broken("rig")
    follower.starts_from_survey = True
    with_systems(FixedSystem("survey", fails_with=RuntimeError("on purpose")), follower)
    with pytest.raises(GtvalError, match="'survey' failed unexpectedly"):
        system_output(campaign_folder, "rig", no_progress, {}, write=False)


def test_a_system_that_fails_alone_writes_its_traceback(campaign_folder, with_systems):
    with_systems(BROKEN["solve"])
    solved, findings, results = system_output(
        campaign_folder, "broken", no_progress, {}, write=True
    )
    assert solved.failed
    assert [one.code for one in findings] == ["unexpected"]
    assert (results / "tracebacks/broken.txt").exists()


def test_all_that_failed_is_known_to_the_run(campaign_folder, with_systems):
    with_systems(*BROKEN.values())
    done = run_campaign(load_campaign(campaign_folder))
    assert done.failed
    assert len(done.findings) == len(BROKEN) + 1  # and that there are no validation poses


def test_a_plug_in_that_cannot_be_imported_is_told_and_all_else_is_done(
    room_run, tmp_path, monkeypatch
):
    folder = tmp_path / "room"
    shutil.copytree(room_run[0], folder)
    lab = tmp_path / "lab_rig-1.0.dist-info"
    lab.mkdir()
    (lab / "entry_points.txt").write_text(
        "[gtval.systems]\nrig = no_such_lab:X\n[gtval.commands]\nrig = no_such_lab:COMMANDS\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    done, record, page = run(folder)
    assert done.exit_code == 1
    finding = the_failure(record)
    assert finding["subject"] == "rig"
    assert "the plug-in 'rig' (no_such_lab:X) cannot be loaded" in finding["text"]
    assert "results/tracebacks/rig.txt" in finding["text"]
    assert "No module named 'no_such_lab'" in (folder / "results/tracebacks/rig.txt").read_text()
    assert list(record["comparisons"]) == ["example_gt"]
    assert "rig.txt" in page
    told = CliRunner().invoke(main, ["survey", str(folder)])
    assert told.exit_code == 0


class NeedsStops(FixedSystem):
    """Starts from surveyed stops, and says what it lacks."""

    starts_from_survey = True

    def solve(self, campaign, _progress, **_choices):
        if "survey" not in campaign.solved or not campaign.solved["survey"].tables:
            raise GtvalError("needs at least one surveyed stop")
        return super().solve(campaign, _progress)


def test_the_failure_of_the_survey_comes_before_what_follows_from_it(campaign_folder, with_systems):
    survey = FixedSystem("survey", fails_with=RuntimeError("on purpose"))
    with_systems(survey, NeedsStops("laser", broken("laser").result), broken("rig"))
    done, record, _ = run(campaign_folder)
    assert done.exit_code == 1
    assert the_failure(record)["subject"] == "survey"
    codes = [one["code"] for one in record["findings"]]
    assert codes.index("unexpected") < codes.index("without_survey")
    assert "results/tracebacks/survey.txt" in done.output
    assert (campaign_folder / "results/tracebacks/survey.txt").exists()
    assert (campaign_folder / "results/poses_rig.csv").exists()


def test_bad_input_beside_a_failed_survey_does_not_hide_the_failure(campaign_folder, with_systems):
    survey = FixedSystem("survey", fails_with=RuntimeError("on purpose"))
    with_systems(survey, FixedSystem("rig", fails_with=InputError([Problem("a.csv", "bad", 3)])))
    done = CliRunner().invoke(main, ["run", str(campaign_folder)])
    assert done.exit_code == 2
    assert done.output.index("'survey' failed unexpectedly") < done.output.index("a.csv, line 3")
    assert "`gtval survey CAMPAIGN` alone writes it" in done.output
