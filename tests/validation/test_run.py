"""A whole run: what it collects, what it writes, and that it writes all or nothing."""

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from small_campaigns import FixedSystem, three_stops

from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError, Problem
from validation.results import Finding, SystemResult
from validation.run import run_campaign
from validation.run_files import result_files, write_results


def survey(**changes) -> FixedSystem:
    return FixedSystem("survey", SystemResult(tables=[three_stops("survey")], **changes))


def rig(name="rig", **changes) -> FixedSystem:
    table = three_stops(name, shift=np.array([[0.01], [0.02], [0.04]]))
    return FixedSystem(name, SystemResult(tables=[table], **changes))


def run(folder, **settings):
    return run_campaign(load_campaign(folder), **settings)


def test_every_system_is_compared_with_the_survey(campaign_folder, with_systems):
    with_systems(survey(landmarks={"W1": (0.0, 1.0)}), rig(landmarks={"tag": (2.0, 3.0)}))
    done = run(campaign_folder)
    assert [table.system for table in done.tables] == ["survey", "rig"]
    [evaluation] = done.evaluations
    assert evaluation.comparison.errors[:, 0] == pytest.approx([-0.01, -0.02, -0.04])
    assert done.landmarks == {"W1": (0.0, 1.0), "tag": (2.0, 3.0)}
    assert list(done.inputs) == ["campaign.toml"]


def test_a_system_gets_what_was_solved_before_it_and_nothing_is_kept(campaign_folder, with_systems):
    seen = []

    class Follower(FixedSystem):
        def solve(self, campaign, progress):
            seen.append(dict(campaign.solved))
            return super().solve(campaign, progress)

    first = survey()
    with_systems(first, Follower("rig", rig().result))
    done = run(campaign_folder)
    assert seen == [{"survey": first.result}]
    assert done.campaign.solved == {}


def test_progress_rises_from_0_to_1(campaign_folder, with_systems):
    with_systems(survey(), rig())
    shares: list[float] = []
    run(campaign_folder, progress=lambda _what, share: shares.append(share))
    assert shares == sorted(shares)
    assert shares[0] == 0
    assert shares[-1] == 1


def test_published_tables_are_systems_too(campaign_folder, with_systems):
    with_systems(survey())
    (campaign_folder / "campaign.toml").write_text(
        'name = "x"\n[[published]]\nsystem = "book"\nfile = "b.csv"\n'
    )
    (campaign_folder / "b.csv").write_text("pose,x,y,theta\n1,0,0,0.1\n")
    done = run(campaign_folder)
    assert [evaluation.system for evaluation in done.evaluations] == ["book"]
    assert "b.csv" in done.inputs


def test_faults_of_all_systems_are_told_at_once(campaign_folder, with_systems):
    shared = Problem("shared.csv", "bad")
    with_systems(
        FixedSystem("survey", fails_with=InputError([shared, Problem("a.csv", "bad")])),
        FixedSystem("rig", fails_with=InputError([shared, Problem("b.csv", "worse")])),
    )
    with pytest.raises(InputError) as caught:
        run(campaign_folder)
    assert str(caught.value).splitlines() == ["shared.csv: bad", "a.csv: bad", "b.csv: worse"]


def test_faults_of_different_kinds_are_told_at_once_too(campaign_folder, with_systems):
    with_systems(
        FixedSystem("survey", fails_with=InputError([Problem("a.csv", "bad")])),
        FixedSystem("rig", fails_with=GtvalError("the rig sees nothing")),
    )
    with pytest.raises(GtvalError, match=r"a.csv: bad\nthe rig sees nothing"):
        run(campaign_folder)


def test_a_bug_in_one_system_does_not_take_the_others(campaign_folder, with_systems):
    with_systems(survey(), rig(), FixedSystem("other", fails_with=ZeroDivisionError("a bug")))
    done = run(campaign_folder)
    assert done.failed
    assert [one.system for one in done.evaluations] == ["rig"]
    (finding,) = [one for one in done.findings if one.code == "unexpected"]
    assert (finding.severity, finding.subject) == ("error", "other")
    assert "results/tracebacks/other.txt" in finding.text
    write_results(done)
    trace = (campaign_folder / "results/tracebacks/other.txt").read_text()
    assert trace.endswith("ZeroDivisionError: a bug\n")


def test_a_system_that_exits_does_not_end_the_run(campaign_folder, with_systems):
    with_systems(survey(), rig(), FixedSystem("other", fails_with=SystemExit(7)))
    done = run(campaign_folder)
    assert done.failed
    assert [one.system for one in done.evaluations] == ["rig"]


def test_a_stated_system_without_files_is_bad_input(campaign_folder, with_systems):
    class Absent(FixedSystem):
        def has_data(self, _campaign):
            return False

    with_systems(survey(), rig(), Absent("laser"))
    with (campaign_folder / "campaign.toml").open("a") as file:
        file.write("\n[laser]\nseed = 1\n")
    with pytest.raises(InputError, match=r"a table \[laser\], but the files") as error:
        run(campaign_folder)
    assert "campaign.toml, line" in str(error.value)


@dataclass
class OfFiles(FixedSystem):
    """A system that starts from one file and also reads another."""

    file: str = ""
    also: str = ""

    def has_data(self, campaign):
        return (campaign.folder / self.file).exists()

    def inputs(self, campaign):
        return [campaign.folder / self.file, *([campaign.folder / self.also] if self.also else [])]


def test_results_of_a_stated_system_whose_files_are_gone_stay(campaign_folder, with_systems):
    with_systems(survey(), rig(), OfFiles("laser", rig("laser").result, file="scans.csv"))
    with (campaign_folder / "campaign.toml").open("a") as file:
        file.write("\n[laser]\nseed = 1\n")
    (campaign_folder / "scans.csv").write_text("1")
    write_results(run(campaign_folder))
    poses = campaign_folder / "results/poses_laser.csv"
    before = poses.read_bytes()
    (campaign_folder / "scans.csv").unlink()
    with pytest.raises(InputError, match=r"missing \(scans.csv\); put them there"):
        run(campaign_folder)
    assert poses.read_bytes() == before
    (campaign_folder / "campaign.toml").write_text('name = "x"\n')  # no longer stated
    write_results(run(campaign_folder))
    assert not poses.exists()


def test_a_file_that_is_read_and_missing_is_told_unless_it_is_optional(
    campaign_folder, with_systems
):
    (campaign_folder / "scans.csv").write_text("1")
    laser = OfFiles("laser", rig("laser").result, file="scans.csv", also="odometry.csv")
    with_systems(survey(), laser)
    (told,) = [one for one in run(campaign_folder).findings if one.code == "input_missing"]
    assert (told.severity, told.subject) == ("warning", "laser")
    assert "odometry.csv" in told.text
    assert "scans.csv" not in told.text
    laser.optional_inputs = lambda campaign: [campaign.folder / "odometry.csv"]
    assert not [one for one in run(campaign_folder).findings if one.code == "input_missing"]


def test_a_finding_has_one_of_four_severities():
    with pytest.raises(ValueError, match="good, note, warning, error, not 'catastrophe'"):
        Finding("catastrophe", "text")


def test_a_campaign_without_data_is_an_error(campaign_folder, with_systems):
    with_systems(OfFiles("laser", file="laser/scans.csv"), OfFiles("rig", file="rig.csv"))
    said = "holds no data for any installed system; looked for laser/scans.csv, rig.csv. "
    with pytest.raises(InputError, match=said):
        run(campaign_folder)


def test_published_poses_of_the_name_of_a_system_are_bad_input(campaign_folder, with_systems):
    with_systems(survey(), rig("book"))
    (campaign_folder / "campaign.toml").write_text(
        'name = "x"\n[[published]]\nsystem = "book"\nfile = "b.csv"\n'
    )
    (campaign_folder / "b.csv").write_text("pose,x,y,theta\n1,0,0,0.1\n")
    with pytest.raises(InputError, match="'book' — poses of this system come twice"):
        run(campaign_folder)


def test_without_survey_nothing_is_compared_and_that_is_said(campaign_folder, with_systems):
    with_systems(rig())
    done = run(campaign_folder)
    assert done.evaluations == ()
    assert done.validation is None
    assert [finding.code for finding in done.findings] == ["no_validation"]
    assert set(result_files(done)["rig"]) == {"poses_rig.csv", "poses_rig.tum"}


def test_a_system_without_common_stops_is_an_error_in_the_findings(campaign_folder, with_systems):
    other = FixedSystem("rig", SystemResult(tables=[three_stops("rig", ids=("a", "b", "c"))]))
    with_systems(survey(), other)
    done = run(campaign_folder)
    assert done.evaluations == ()
    assert [(finding.severity, finding.code) for finding in done.findings] == [
        ("error", "not_comparable")
    ]


@pytest.mark.parametrize(("severity", "faulty"), [("error", True), ("warning", False)])
def test_errors_of_the_survey_make_the_run_unusable(
    campaign_folder, with_systems, severity, faulty
):
    with_systems(survey(findings=[Finding(severity, "blunder")]), rig())
    assert run(campaign_folder).validation_is_faulty is faulty


def read_rows(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_errors_and_statistics_are_written_with_all_digits(campaign_folder, with_systems):
    with_systems(survey(), rig())
    done = run(campaign_folder)
    write_results(done)
    errors = read_rows(campaign_folder / "results/errors.csv")
    [evaluation] = done.evaluations
    assert [row["pose"] for row in errors] == ["1", "2", "3"]
    assert [float(row["dx"]) for row in errors] == evaluation.comparison.errors[:, 0].tolist()
    assert [float(row["nees"]) for row in errors] == evaluation.comparison.nees.tolist()
    assert list(errors[0])[:5] == ["system", "pose", "dx", "dy", "dtheta"]
    statistics = read_rows(campaign_folder / "results/statistics.csv")
    assert [row["component"] for row in statistics] == ["x", "y", "theta"]
    assert float(statistics[0]["ci95_low"]) == evaluation.statistics[0].ci_low
    assert statistics[0]["interval"] == "student"


def test_what_is_not_available_is_blank_and_explained(campaign_folder, with_systems):
    silent = three_stops("rig", covariances=np.full((3, 3, 3), np.nan))
    with_systems(survey(), FixedSystem("rig", SystemResult(tables=[silent.select(["2"])])))
    write_results(run(campaign_folder))
    [error] = read_rows(campaign_folder / "results/errors.csv")
    assert (error["nees"], error["nx"], error["nees_low"]) == ("", "", "")
    assert error["not_available"] == "'rig' states no covariance"
    statistics = read_rows(campaign_folder / "results/statistics.csv")
    assert {row["std"] for row in statistics} == {""}
    assert {row["reason"] for row in statistics} == {"a single error has no spread"}


def test_the_record_tells_where_numbers_came_from(campaign_folder, with_systems):
    with_systems(survey(facts={"seed": 7}), rig())
    write_results(run(campaign_folder))
    record = json.loads((campaign_folder / "results/run.json").read_text())
    assert record["systems"]["survey"] == {"seed": 7}
    assert set(record["inputs"]) == {"campaign.toml"}
    assert record["libraries"]["numpy"] == np.__version__
    assert record["settings"]["name"] == "three stops"
    assert record["comparisons"]["rig"]["nees_test"]["poses"] == 3
    assert "errors.csv" in record["outputs"]


def all_files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_same_inputs_give_the_same_bytes(campaign_folder, with_systems):
    with_systems(survey(), rig())
    write_results(run(campaign_folder))
    first = all_files(campaign_folder)
    write_results(run(campaign_folder))
    assert all_files(campaign_folder) == first


def test_stale_files_of_the_run_before_are_removed_and_no_other(campaign_folder, with_systems):
    with_systems(survey(), rig("old_rig", files={"old/evidence.csv": "x\n"}))
    write_results(run(campaign_folder))
    results = campaign_folder / "results"
    (results / "mine.csv").write_text("mine")
    with_systems(survey(), rig("new_rig"))
    write_results(run(campaign_folder))
    names = set(all_files(results))
    assert {"mine.csv", "poses_new_rig.csv", "run.json"} <= names
    assert not any("old" in name for name in names)


@pytest.mark.parametrize(
    "outputs",
    ['["../campaign.toml", "/etc/none", "a\\u0000b", 3, ".", ""]', '"run.json"', "null", "{}"],
)
def test_a_forged_record_removes_nothing_outside(campaign_folder, with_systems, outputs):
    with_systems(survey(), rig())
    results = campaign_folder / "results"
    results.mkdir()
    (results / "run.json").write_text(f'{{"outputs": {outputs}}}')
    write_results(run(campaign_folder))
    assert (campaign_folder / "campaign.toml").exists()


FAULTY = {
    "outside": ({"../evil": "x"}, "wants to write outside results/: '../evil'"),
    "from the root": ({"/evil": "x"}, "outside results/"),
    "a way round": ({"a/../../evil": "x"}, "outside results/"),
    "a backslash": ({"a\\b": "x"}, "outside results/"),
    "nothing": ({"": "x"}, "outside results/"),
    "300 letters": ({"a" * 300: "x"}, "too long a name"),
    "a file of the survey": ({"poses_survey.csv": "x"}, "both write results/poses_survey.csv"),
    "the record": ({"run.json": "{}"}, "results/run.json, which is written already"),
    "the comparison's": ({"errors.csv": "x"}, "written already"),
    "its own poses": ({"poses_rig.csv": "x"}, "written already"),
}


def not_finite(system):
    return three_stops(system, poses=np.full((3, 3), np.nan))


def of_itself():
    facts = {}
    facts["more"] = facts
    return facts


@dataclass
class Making(FixedSystem):
    """A system that makes its result only when it is asked."""

    make: Callable[[], SystemResult] = SystemResult

    def solve(self, _campaign, _progress):
        return self.make()


BAD = {
    "poses that are not finite": (lambda: SystemResult([not_finite("rig")]), "is not finite"),
    "the poses of the survey": (
        lambda: SystemResult([three_stops("survey")]),
        "both write results/poses_survey.csv",
    ),
    "two tables of one name": (
        lambda: SystemResult([three_stops("rig")] * 2),
        "two tables are called 'rig'",
    ),
    "a name that leads out": (
        lambda: SystemResult([three_stops("../rig")]),
        "cannot be part of a file name",
    ),
    "a name of 300 letters": (
        lambda: SystemResult([three_stops("a" * 300)]),
        "cannot be part of a file name",
    ),
    "facts that hold themselves": (lambda: SystemResult(facts=of_itself()), "RecursionError"),
    "facts that cannot be sorted": (lambda: SystemResult(facts={"a": {1, "b"}}), "TypeError"),
    "facts that are none": (lambda: SystemResult(facts=None), "TypeError"),
    "a finding without words": (lambda: SystemResult(findings=[Finding("note", 3)]), "TypeError"),
}
BAD |= {
    name: (partial(SystemResult, files=files), said)
    for name, (files, said) in FAULTY.items()
    if name != "its own poses"
}
BAD["its own poses"] = (
    lambda: SystemResult([three_stops("rig")], files=FAULTY["its own poses"][0]),
    FAULTY["its own poses"][1],
)


@pytest.mark.parametrize("fault", BAD)
def test_what_a_plug_in_gives_wrongly_is_told_of_it_and_takes_nothing_along(
    campaign_folder, with_systems, fault
):
    make, said = BAD[fault]
    with_systems(survey(), Making("rig", make=make), rig("tower"))
    done = run(campaign_folder)
    assert done.failed
    assert [one.system for one in done.evaluations] == ["tower"]
    (finding,) = [one for one in done.findings if one.severity == "error"]
    assert (finding.subject, finding.code) == ("rig", "unexpected")
    assert said in finding.text
    write_results(done)
    assert {"errors.csv", "tracebacks/rig.txt"} <= set(all_files(campaign_folder / "results"))
    assert not list(campaign_folder.parent.rglob("*evil*"))


def test_a_failed_write_leaves_the_old_results(campaign_folder, with_systems):
    with_systems(survey(), rig())
    write_results(run(campaign_folder))
    before = all_files(campaign_folder)
    with_systems(survey(), rig("new_rig"))
    # A folder stands where a file should go.
    (campaign_folder / "results/poses_new_rig.csv").mkdir()
    with pytest.raises(GtvalError, match=r"cannot write to .*/results/poses_new_rig.csv: .*; move"):
        write_results(run(campaign_folder))
    assert all_files(campaign_folder) == before


@pytest.mark.parametrize("name", ["results", "report"])
def test_a_file_in_the_place_of_a_folder_is_named_and_nothing_is_left(
    campaign_folder, with_systems, name
):
    with_systems(survey(), rig())
    (campaign_folder / name).write_text("mine")
    before = all_files(campaign_folder)
    with pytest.raises(GtvalError, match=rf"cannot write to .*/{name}: File exists; move away"):
        write_results(run(campaign_folder), {"report.html": "x"})
    assert all_files(campaign_folder) == before
    assert sorted(path.name for path in campaign_folder.iterdir()) == sorted(
        ["campaign.toml", name]
    )
