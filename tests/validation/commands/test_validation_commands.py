"""gtval run, compare and report, as typed."""

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from small_campaigns import AD23, FixedSystem, three_stops

from validation.cli import main
from validation.poses.pose_table import SPATIAL, PoseTable, to_csv
from validation.results import Finding, SystemResult


def gtval(*arguments: object):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def campaign(campaign_folder, with_systems):
    table = three_stops("rig", shift=0.01)
    with_systems(
        FixedSystem("survey", SystemResult(tables=[three_stops("survey")])),
        FixedSystem("rig", SystemResult(tables=[table], facts={"seed": 3})),
    )
    return campaign_folder


def test_run_prints_tables_and_findings_and_where_the_report_is(campaign):
    result = gtval("run", campaign)
    assert result.exit_code == 0, result.output
    assert "Errors of all systems (validation minus GT)" in result.stdout
    assert "Statistics of the errors of rig" not in result.stdout
    assert "Statistics of the errors of rig" in gtval("run", campaign, "--all").stdout
    assert "all errors are the same number" in result.stdout
    assert f"Report: {campaign / 'report' / 'report.html'}" in result.stdout
    assert (campaign / "report/report.html").is_file()
    assert (campaign / "results/errors.csv").is_file()
    assert result.stderr == ""


def test_run_prints_json_for_scripts(campaign):
    result = gtval("run", campaign, "--json", "--no-report")
    told = json.loads(result.stdout)
    [comparison] = told["comparisons"]
    assert told["report"] is None
    assert told["systems"]["rig"] == {"seed": 3}
    assert comparison["statistics"]["x"]["mean"] == pytest.approx(-0.01)
    assert comparison["statistics"]["x"]["ci_low"] is None
    assert comparison["errors"]["2"]["theta"] == pytest.approx(-0.01)
    assert comparison["nees_test"]["verdict"] in {"below", "inside", "above"}
    assert not (campaign / "report").exists()


def test_faults_of_the_survey_are_told_with_the_numbers(campaign_folder, with_systems):
    faulty = SystemResult(tables=[three_stops("survey")], findings=[Finding("error", "blunder")])
    rig = SystemResult(tables=[three_stops("rig", shift=0.01)])
    with_systems(FixedSystem("survey", faulty), FixedSystem("rig", rig))
    assert "Do not use these numbers yet" in gtval("run", campaign_folder, "--no-report").stdout
    told = json.loads(gtval("run", campaign_folder, "--no-report", "--json").stdout)
    assert told["validation_is_faulty"] is True


def test_report_writes_page_and_tables(campaign):
    result = gtval("report", campaign)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (campaign / "report").iterdir()) == [
        "report.html",
        "tables.md",
        "tables.tex",
        "tables_paper.md",
        "tables_paper.tex",
        "to_do.json",
    ]
    told = json.loads(gtval("report", campaign, "--json").stdout)
    assert [path.rsplit("/", 1)[1] for path in told["report"]] == [
        "report.html",
        "tables.md",
        "tables.tex",
        "tables_paper.md",
        "tables_paper.tex",
    ]


def test_a_bad_campaign_ends_in_plain_words_and_writes_nothing(campaign):
    (campaign / "campaign.toml").write_text("nme = 1\n")
    for command in ("run", "report", "compare"):
        result = gtval(command, campaign)
        assert result.exit_code == 2
        assert "field 'name': the key is missing; add it" in result.stderr
        assert "Traceback" not in result.stderr
    assert not (campaign / "results").exists()


@pytest.fixture
def files(tmp_path):
    paths = []
    for name, shift in (("survey", 0.0), ("rig", 0.01), ("other", 0.02)):
        path = tmp_path / f"poses_{name}.csv"
        path.write_text(to_csv(three_stops(name, shift=shift)))
        paths.append(path)
    return paths


def test_compare_takes_pose_files(files):
    result = gtval("compare", *files, "--all")
    assert result.exit_code == 0, result.output
    for title in ("Poses of rig", "Errors of other by magnitude", "Errors of all systems"):
        assert title in result.stdout
    told = json.loads(gtval("compare", *files, "--json").stdout)
    assert [one["system"] for one in told["comparisons"]] == ["rig", "other"]


def test_compare_takes_poses_in_space(tmp_path, files):
    paths = []
    for name, shift in (("survey", 0.0), ("rig", 0.02)):
        poses = np.array([[1, 2, 3, 0.1, 0.2, 0.3], [2, 3, 4, 0.2, 0.3, 0.4]]) + shift
        paths.append(tmp_path / f"{name}.csv")
        paths[-1].write_text(to_csv(PoseTable(name, ("1", "2"), poses, components=SPATIAL)))
    told = json.loads(gtval("compare", *paths, "--json").stdout)
    statistics = told["comparisons"][0]["statistics"]
    assert list(statistics) == ["x", "y", "z", "yaw", "pitch", "roll"]
    assert statistics["z"]["mean"] == pytest.approx(-0.02)
    mixed = json.loads(gtval("compare", paths[0], files[1], "--json").stdout)
    assert list(mixed["comparisons"][0]["statistics"]) == ["x", "y", "theta"]


def test_compare_takes_the_results_of_a_run(campaign):
    missing = gtval("compare", campaign)
    assert missing.exit_code == 2
    assert "no poses_survey.csv yet; `gtval run` makes them" in missing.stderr
    gtval("run", campaign, "--no-report")
    told = json.loads(gtval("compare", campaign, "--json").stdout)
    assert [one["system"] for one in told["comparisons"]] == ["rig"]


def test_compare_needs_something_to_compare(files, campaign):
    assert "give at least one GT table" in gtval("compare", files[0]).stderr
    assert "either a campaign folder alone" in gtval("compare", campaign, files[1]).stderr


def test_compare_tells_the_faults_of_all_files(files):
    files[0].write_text("pose,x,y,theta\n1,?,0,0\n")
    files[2].write_text("pose,x,y,theta\n1,0,0,0\n1,0,0,0\n")
    result = gtval("compare", *files)
    assert result.exit_code == 2
    assert "poses_survey.csv, line 2, field 'x': '?'" in result.stderr
    assert "poses_other.csv, line 3" in result.stderr


def test_the_normal_interval_is_there_for_comparison_with_print():
    told = json.loads(
        gtval(
            "compare",
            AD23 / "survey/published_poses.csv",
            AD23 / "vision/published_poses.csv",
            *("--json", "--normal-interval"),
        ).stdout
    )
    x = told["comparisons"][0]["statistics"]["x"]
    assert x["method"] == "normal"
    assert x["n"] == 20
    assert (f"{x['ci_low']:.4f}", f"{x['ci_high']:.4f}") == ("0.0643", "0.0964")


def test_the_published_campaign_runs_from_end_to_end(ad23_run):
    folder, result = ad23_run
    assert result.exit_code == 0, result.output
    assert (folder / "report/report.html").is_file()
    told = json.loads(result.stdout)
    means = {
        one["system"]: [f"{one['statistics'][c]['mean']:.4f}" for c in ("x", "y", "theta")]
        for one in told["comparisons"]
    }
    # AD2.3, "Overall conclusions for indoor validation".
    assert means["vision"] == ["0.0804", "0.0362", "0.0137"]
    assert means["laser_scanmatch"] == ["0.0423", "0.0515", "0.0044"]
    assert means["laser_genetic"] == ["-0.0654", "0.0269", "0.0329"]


@pytest.mark.parametrize("command", ["compare", "explain"])
def test_a_system_that_is_given_twice_is_refused(command):
    files = ["survey/published_poses.csv", *["laser/published_genetic.csv"] * 2]
    done = gtval(command, *(AD23 / name for name in files))
    assert done.exit_code == 2
    assert done.stderr == "Error: these systems are given twice: published_genetic\n"


@pytest.mark.parametrize("system", ["rtk", "vision", "laser"])
def test_options_may_stand_before_the_campaign_of_a_group(system, ad23_folder, tmp_path):
    folder = shutil.copytree(ad23_folder, tmp_path / "ad23")
    first, last = gtval(system, "--json", folder), gtval(system, folder, "--json")
    one, other = json.loads(first.stdout), json.loads(last.stdout)
    one.pop("pieces", None), other.pop("pieces", None)  # the second takes some over
    assert one == other
    # Of AD2.3 only vision has data of its own: what was printed of its markers.
    known = "vision solve" if system == "vision" else system
    assert json.loads(first.stdout)["command"] == known
    assert "No such option" not in first.stderr
    assert gtval(system, "--help").stdout.startswith(f"Usage: main {system} [OPTIONS] COMMAND")


def test_a_reference_of_a_system_that_is_not_there_is_told_with_its_line(room_run, tmp_path):
    folder = tmp_path / "room"
    shutil.copytree(room_run[0], folder)
    with (folder / "campaign.toml").open("a") as file:
        file.write('\n[explain.references]\nexampel_gt = "1"\n')
    line = len((folder / "campaign.toml").read_text().splitlines())
    findings = json.loads(gtval("explain", folder, "--json").stdout)["findings"]
    (told,) = [one for one in findings if one["code"] == "unknown_system"]
    assert told["severity"] == "warning"
    assert f"campaign.toml, line {line}, field 'explain.references': 'exampel_gt'" in told["text"]
    assert "correct it to one of example_gt, or take it out" in told["text"]
