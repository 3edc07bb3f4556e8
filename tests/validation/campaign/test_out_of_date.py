"""What no longer belongs together under results/ is marked everywhere, and nothing else is."""

import hashlib
import json
import shutil
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from small_campaigns import FixedSystem, three_stops

from validation.campaign.banner import marked_report
from validation.campaign.folder import load_campaign
from validation.campaign.provenance import earlier_record, earlier_steps, out_of_date, sources_of
from validation.campaign.stored import stored_tables
from validation.cli import main
from validation.results import SystemResult
from validation.solving import system_output
from validation.systems import no_progress


@dataclass
class FileSystem(FixedSystem):
    """A system whose poses lie as far off as a number in a file says."""

    file: str = ""
    starts_from_survey: bool = False

    def inputs(self, campaign):
        return [campaign.folder / self.file]

    def solve(self, campaign, progress):
        shift = float((campaign.folder / self.file).read_text())
        if self.starts_from_survey:
            shift += campaign.solved["survey"].tables[0].poses[0, 0]
        progress(self.name, 1.0)
        turn = np.array([[0.01], [0.02], [0.04]])
        return SystemResult([three_stops(self.name, shift + (self.name != "survey") * turn)])


pytestmark = pytest.mark.xdist_group("out of date")  # one run for all


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the run of the first test is kept for the others."""
    return tmp_path_factory.mktemp("kept") / "campaign"


@pytest.fixture
def folder(campaign_folder: Path, kept: Path, with_systems) -> Path:
    """A campaign of three systems, run; 'rig' starts from the survey and 'other' does not."""
    for name in ("survey", "rig", "other"):
        (campaign_folder / f"{name}.txt").write_text("0.0")
    with_systems(
        FileSystem("survey", file="survey.txt"),
        FileSystem("rig", file="rig.txt", starts_from_survey=True),
        FileSystem("other", file="other.txt"),
    )
    if not kept.exists():
        run(campaign_folder)
        shutil.copytree(campaign_folder, kept)
    return shutil.copytree(kept, campaign_folder, dirs_exist_ok=True)


def run(folder: Path) -> None:
    done = CliRunner().invoke(main, ["run", str(folder)])
    assert done.exit_code == 0, done.output


def solve(folder: Path, name: str) -> list[str]:
    """Solve one system by itself, as its command does; the codes of its findings."""
    _, findings, _ = system_output(folder, name, no_progress, {}, write=True)
    return [finding.text for finding in findings if finding.code == "out_of_date"]


def marked(folder: Path) -> list[str]:
    """The files that are out of date now, without what each system writes beside its poses."""
    campaign = load_campaign(folder)
    found = out_of_date(campaign, earlier_steps(earlier_record(campaign)))
    return [one.file for one in found if not one.file.endswith((".tum", ".json", "flagged.csv"))]


def page(folder: Path) -> str:
    return (folder / "report/report.html").read_text()


EVERYTHING_AFTER_THE_SURVEY = [
    "results/poses_rig.csv",
    "results/errors.csv",
    "results/statistics.csv",
    "results/explain/explanation.json",
    "report/report.html",
    "report/tables.md",
    "report/tables.tex",
]


def test_after_a_run_nothing_is_marked(folder):
    assert marked(folder) == []
    assert json.loads((folder / "results/run.json").read_text())["out_of_date"] == []
    assert "out of date." not in page(folder)
    assert stored_tables(load_campaign(folder)).findings == ()


def test_the_first_step_of_a_folder_marks_nothing(folder):
    shutil.rmtree(folder / "results")
    assert solve(folder, "rig") == []  # it started from a survey that no step has written yet
    assert marked(folder) == []
    assert solve(folder, "survey") == []
    (folder / "survey.txt").write_text("0.5")
    assert "results/poses_rig.csv" in solve(folder, "survey")[0]


def test_a_survey_solved_again_marks_what_was_made_from_the_old_one(folder):
    (folder / "survey.txt").write_text("0.5")
    (said,) = solve(folder, "survey")
    record = json.loads((folder / "results/run.json").read_text())
    noted = [one["file"] for one in record["out_of_date"]]
    for file in EVERYTHING_AFTER_THE_SURVEY:
        assert file in said
        assert file in noted
    assert not [file for file in noted if "other" in file or "poses_survey" in file]
    assert "This report is out of date" in page(folder)
    run(folder)
    assert marked(folder) == []
    assert "This report is out of date" not in page(folder)


def test_a_system_solved_again_to_the_same_numbers_marks_nothing(folder):
    assert solve(folder, "survey") == []
    assert marked(folder) == []
    assert "This report is out of date" not in page(folder)


def test_a_mark_goes_when_the_results_are_again_what_the_report_was_made_from(folder):
    before = page(folder)
    (folder / "survey.txt").write_text("0.5")
    solve(folder, "survey")
    assert page(folder) != before
    (folder / "survey.txt").write_text("0.0")
    assert solve(folder, "survey") == []
    assert page(folder) == before


def test_a_changed_input_marks_its_system_and_what_follows_before_anything_is_solved(folder):
    (folder / "other.txt").write_text("0.5")
    files = marked(folder)
    assert "results/poses_other.csv" in files
    assert "results/errors.csv" in files
    assert "results/poses_survey.csv" not in files
    assert "results/poses_rig.csv" not in files


def test_added_and_removed_inputs_are_noticed(folder):
    (folder / "notes.txt").write_text("new")  # read by no system, but perhaps by a comparison
    assert "report/report.html" in marked(folder)
    (folder / "notes.txt").unlink()
    assert marked(folder) == []
    (folder / "rig.txt").unlink()
    assert "results/poses_rig.csv" in marked(folder)


def test_results_that_were_edited_by_hand_are_noticed(folder):
    poses = folder / "results/poses_rig.csv"
    poses.write_text(poses.read_text().replace("2,", "2,1", 1))
    campaign = load_campaign(folder)
    found = {
        one.file: one.reason
        for one in out_of_date(campaign, earlier_steps(earlier_record(campaign)))
    }
    assert found["results/poses_rig.csv"] == "it is not as the step 'rig' left it"
    assert "results/poses_rig.csv" in found["results/errors.csv"]
    assert "results/poses_survey.csv" not in found


@pytest.mark.parametrize("command", ["compare", "explain"])
def test_compare_and_explain_tell_what_is_out_of_date(folder, command):
    (folder / "other.txt").write_text("0.5")
    done = CliRunner().invoke(main, [command, str(folder), "--json"])
    findings = json.loads(done.stdout)["findings"]
    late = [one for one in findings if one["code"] == "out_of_date"]
    assert late[0]["subject"] == "other"
    assert "changed after the step 'other': other.txt" in late[0]["text"]
    assert "`gtval run`" in late[0]["text"]


@pytest.mark.parametrize("command", ["compare", "explain"])
@pytest.mark.parametrize("record", [None, "{", "[]", '{"steps": {"rig": 3}}', '{"steps": []}'])
def test_results_of_which_nobody_knows_the_origin_are_not_trusted_silently(folder, command, record):
    file = folder / "results/run.json"
    file.unlink()
    if record is not None:
        file.write_text(record)
    done = CliRunner().invoke(main, [command, str(folder), "--json"])
    assert done.exit_code == 0, done.output
    findings = json.loads(done.stdout)["findings"]
    late = [one["subject"] for one in findings if one["code"] == "no_provenance"]
    assert late == ["other", "rig", "survey"]


def test_a_table_that_somebody_put_there_is_named(folder):
    text = (folder / "results/poses_rig.csv").read_text()
    (folder / "results/poses_stranger.csv").write_text(text)
    (finding,) = stored_tables(load_campaign(folder)).findings
    assert (finding.severity, finding.code) == ("warning", "no_provenance")
    assert "results/poses_stranger.csv: results/run.json does not say" in finding.text


def test_explaining_again_keeps_the_record_true(folder):
    before = (folder / "results/run.json").read_bytes()
    done = CliRunner().invoke(main, ["explain", str(folder)])
    assert done.exit_code == 0, done.output
    # Nothing has changed, so neither have the numbers nor what is said of them.
    after = json.loads((folder / "results/run.json").read_bytes())
    assert after["steps"] == json.loads(before)["steps"]
    assert marked(folder) == []


def test_a_record_of_an_older_version_is_written_anew_by_the_next_step(folder):
    (folder / "results/run.json").write_text('{"outputs": ["errors.csv"], "systems": []}')
    solve(folder, "survey")
    record = json.loads((folder / "results/run.json").read_text())
    assert list(record["steps"]) == ["survey"]
    assert list(record["systems"]) == ["survey"]
    assert "errors.csv" in record["outputs"]


def test_a_forged_record_reads_nothing_outside_of_the_campaign(folder):
    record = json.loads((folder / "results/run.json").read_text())
    record["steps"]["rig"]["sources"] = ["/", "../..", "a\0b", ".", "rig.txt"]
    steps = earlier_steps(record)
    found = sources_of(load_campaign(folder), [steps["rig"]])
    assert found == [folder, folder / "rig.txt"]


def test_every_input_is_hashed_once(folder, monkeypatch):
    read = []
    digest = hashlib.file_digest

    def counted(stream, name):
        read.append(Path(stream.name).relative_to(folder).as_posix())
        return digest(stream, name)

    monkeypatch.setattr(hashlib, "file_digest", counted)
    run(folder)
    assert sorted(read) == ["campaign.toml", "other.txt", "rig.txt", "survey.txt"]
    read.clear()
    solve(folder, "rig")
    assert len(read) == len(set(read))


class Tags(HTMLParser):
    """Reads a page and keeps which elements are still open."""

    EMPTY = frozenset({"meta", "link", "br", "use", "path", "image", "input"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.alarms = 0
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.alarms += ("role", "alert") in attrs
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.EMPTY:
            assert self.open.pop() == tag


def test_the_marked_report_is_well_formed_and_marked_once(folder):
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("three stops", "<b>three & more</b>"))
    for number in (0.5, 0.7):
        (folder / "survey.txt").write_text(str(number))
        solve(folder, "survey")
        tags = Tags(page(folder))
        assert tags.open == []
        assert tags.alarms == 1


@pytest.mark.parametrize("content", [None, b"\xff\xfe", b"<p>another page</p>"])
def test_a_page_that_is_no_report_of_ours_is_left_alone(folder, content):
    report = folder / "report/report.html"
    report.unlink()
    if content is not None:
        report.write_bytes(content)
    assert marked_report(load_campaign(folder)) == {}
    (folder / "survey.txt").write_text("0.5")
    solve(folder, "survey")
    assert report.exists() == (content is not None)
    assert content is None or report.read_bytes() == content


def test_a_real_survey_solved_again_after_a_change_is_told(room_run, tmp_path):
    folder = tmp_path / "room"
    shutil.copytree(room_run[0], folder)
    readings = folder / "survey/readings.csv"
    lines = readings.read_text().splitlines()
    column = lines[0].split(",").index("distance")
    cells = lines[5].split(",")
    cells[column] = f"{float(cells[column]) + 0.001:.3f}"
    lines[5] = ",".join(cells)
    readings.write_text("\n".join(lines) + "\n")
    done = CliRunner().invoke(main, ["survey", str(folder)])
    assert done.exit_code == 0, done.output
    assert "Out of date now:" in done.output
    assert "example_gt.csv" not in done.output.split("Out of date now:")[1].split("errors")[0]
    assert "This report is out of date" in page(folder)


def test_a_system_solved_again_leaves_no_file_that_it_writes_no_longer(folder, with_systems):
    results = folder / "results"
    solo = FixedSystem("rig", SystemResult([three_stops("rig")], files={"rig_old.csv": "a\n"}))
    with_systems(solo)
    system_output(folder, "rig", no_progress, {}, write=True)
    assert (results / "rig_old.csv").exists()
    (results / "by_hand.csv").write_text("mine\n")
    with_systems(FixedSystem("rig", SystemResult([three_stops("rig")])))
    system_output(folder, "rig", no_progress, {}, write=True)
    assert not (results / "rig_old.csv").exists()
    assert (results / "by_hand.csv").exists()
    assert "rig_old.csv" not in json.loads((results / "run.json").read_text())["outputs"]


def test_what_is_wrong_with_an_edited_result_is_told_with_the_next_step(folder):
    errors = folder / "results/errors.csv"
    errors.write_text(errors.read_text() + "\n")
    done = CliRunner().invoke(main, ["compare", str(folder)])
    assert "Out of date now: results/errors.csv, report/report.html" in done.stdout
    assert done.stdout.count("`gtval run` makes them anew") == 1
    poses = folder / "results/poses_rig.csv"
    poses.write_text(poses.read_text().replace("2,", "2,1", 1))
    done = CliRunner().invoke(main, ["compare", str(folder)])
    assert "it is not as the step 'rig' left it; `gtval run` makes it anew" in done.stdout


def test_a_run_without_report_tells_of_the_old_one_where_it_no_longer_belongs(folder):
    same = CliRunner().invoke(main, ["run", str(folder), "--no-report"])
    assert "Out of date" not in same.stdout
    assert "report/report.html" not in marked(folder)
    (folder / "survey.txt").write_text("0.5")
    done = CliRunner().invoke(main, ["run", str(folder), "--no-report"])
    assert "Out of date now: report/report.html, report/tables.md" in done.stdout
    assert "This report is out of date" in page(folder)
    tables = [f"report/{name}" for name in ("tables.md", "tables.tex")]
    paper = [f"report/tables_paper.{ending}" for ending in ("md", "tex")]
    assert sorted(marked(folder)) == sorted(["report/report.html", *tables, *paper])
