"""Repeated days: which system on which day, what changed, and what could not be read."""

import datetime as dt
import json
import re
import shutil
from importlib.resources import files
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner

from validation.campaign.folder import load_campaign
from validation.campaign.stored import stored_tables
from validation.cli import main
from validation.days import running
from validation.days.order import campaign_folders, in_order, moment_of
from validation.days.reading import DayErrors, read_day
from validation.days.summary import summarise_campaigns
from validation.errors import InputError
from validation.poses.pose_table import PLANAR
from validation.statistics.evaluation import evaluate
from validation.systems import no_progress
from validation.whole_run import run_and_write

SCHEMA = json.loads((files("validation.report") / "schema.json").read_text())
STOPS = 20
NOISE = 0.002
"""Of single errors, metres and radians."""


def write_day(folder, biases, rng, *, date="", scale=1.0):
    """A campaign whose results are statistics of errors with these biases, by system."""
    results = folder / "results"
    results.mkdir(parents=True)
    stated = f'date = "{date}"\n' if date else ""
    (folder / "campaign.toml").write_text(f'name = "{folder.name}"\n{stated}')
    rows = ["system,component,n,mean,std,ci95_low,ci95_high"]
    for system, bias in biases.items():
        for name, value in zip(("x", "y", "theta"), bias, strict=True):
            errors = rng.normal(value, scale * NOISE, STOPS)
            mean, std = errors.mean(), errors.std(ddof=1)
            half = 2.093 * std / np.sqrt(STOPS)  # Student, 19 degrees of freedom
            rows.append(f"{system},{name},{STOPS},{mean},{std},{mean - half},{mean + half}")
    (results / "statistics.csv").write_text("\n".join(rows) + "\n")
    return folder


def write_season(
    root, days=14, seed=1, drift=0.002, systems=("vision",), until=10**9, apart=1, **day
):
    """Days whose bias in x drifts from the tenth on, and scatters by a millimetre."""
    rng = np.random.default_rng(seed)
    for number in range(1, days + 1):
        moved = np.array([drift * max(min(number, until) - 9, 0), 0.0, 0.0])
        biases = {system: moved + rng.normal(0, 0.001, 3) for system in systems}
        folder = root / f"day_{number}"
        date = f"2026-03-{number:02d}"
        if apart != 1:
            date = str(dt.date(2026, 1, 1) + dt.timedelta(days=apart * number))
        write_day(folder, biases, rng, date=date, **day)
    return root


def write_tables(folder, name="rig"):
    """A campaign of eight stops that can be run: both tables are taken over."""
    rng = np.random.default_rng(11)
    truth = np.column_stack([rng.uniform(0, 8, (8, 2)), rng.uniform(-3, 3, 8)])
    (folder / "survey").mkdir(parents=True)
    for file, poses in (
        ("survey/published_poses.csv", truth),
        (f"{name}.csv", truth + rng.normal(0, NOISE, (8, 3))),
    ):
        rows = [f"{stop},{x},{y},{theta}" for stop, (x, y, theta) in enumerate(poses)]
        (folder / file).write_text("pose,x,y,theta\n" + "\n".join(rows) + "\n")
    (folder / "campaign.toml").write_text(
        f'name = "{folder.name}"\n[[published]]\nsystem = "{name}"\nfile = "{name}.csv"\n'
        f"sigmas = [{NOISE}, {NOISE}, {NOISE}]\n"
    )
    return folder


@pytest.fixture(scope="module")
def day_that_was_run(tmp_path_factory):
    folder = write_tables(tmp_path_factory.mktemp("days") / "day")
    run_and_write(folder, no_progress, report=False)
    return folder


def told(*arguments):
    done = CliRunner().invoke(main, [*map(str, arguments), "--json"])
    found = json.loads(done.stdout)
    jsonschema.validate(found, SCHEMA)
    return done.exit_code, found


def codes(summary):
    return [(one.code, one.subject) for one in summary.findings]


@pytest.mark.parametrize("systems", [("vision",), ("laser", "vision", "rig")])
def test_a_drift_is_noticed_before_long(tmp_path, systems):
    summary = summarise_campaigns([write_season(tmp_path, systems=systems, seed=2)])
    assert summary.systems == systems
    changed = {
        (one.system, one.component.name, one.of)
        for one in summary.series
        if any(9 <= day <= 13 for day in one.chart.noticed)
    }
    assert changed == {(system, "x", "bias") for system in systems}
    for system in systems:
        finding = next(one for one in summary.findings if one.subject == system)
        assert (finding.code, finding.severity) == ("bias_changed", "warning")
        assert "drifts since about 2026-03-" in finding.text
        (size,) = finding.sizes
        assert 0 < size.low < size.value < size.high < 0.02


def test_the_slope_of_a_drift_is_told_by_all_days_since_it_began(tmp_path):
    summary = summarise_campaigns([write_season(tmp_path, days=28, seed=2)])
    (finding,) = [one for one in summary.findings if one.subject == "vision"]
    found = re.search(
        r"by all days it drifts by x \+(\S+) mm a day \(\+(\S+) to \+(\S+)\) since 2026-03-(\d+)",
        finding.text,
    )
    value, low, high, began = map(float, found.groups())
    assert low <= 2.0 <= high
    # 19 days of 1 mm: the slope has a sigma of sqrt(12 / 19^3) = 0.042 mm a day, its interval
    # Student's with 17 degrees of freedom is four of these wide, and the scatter is known to 17 %.
    assert value == pytest.approx(2.0, abs=4 * 0.042)
    assert high - low < 4.2 * 0.042 * 1.5
    assert began == pytest.approx(10, abs=1)


def test_a_drift_that_has_ended_is_told_as_such(tmp_path):
    folder = write_season(tmp_path, days=28, seed=5, until=15)
    (finding,) = [one for one in summarise_campaigns([folder]).findings if one.subject == "vision"]
    assert "drifts since about 2026-03-" in finding.text
    assert "it has not gone on like that to the last day" in finding.text
    assert "by all days it drifts" not in finding.text


def test_a_drift_over_weeks_is_told_for_each_campaign(tmp_path):
    folder = write_season(tmp_path, days=20, seed=3, apart=7)
    summary = summarise_campaigns([folder])
    assert summary.step == "campaign"
    (finding,) = [one for one in summary.findings if one.subject == "vision"]
    assert "mm a campaign" in finding.text
    assert "mm a day" not in finding.text


def test_days_without_a_change_are_good(tmp_path):
    summary = summarise_campaigns([write_season(tmp_path, drift=0.0)])
    assert codes(summary) == [("no_change", "vision")]
    assert [one.chart.changes for one in summary.series] == [()] * 6


def test_a_spread_that_doubles_is_noticed(tmp_path):
    rng = np.random.default_rng(3)
    for number in range(12):
        scale = 2.5 if number >= 9 else 1.0
        write_day(tmp_path / f"day_{number}", {"rig": rng.normal(0, 1e-3, 3)}, rng, scale=scale)
    summary = summarise_campaigns([tmp_path])
    finding = next(one for one in summary.findings if one.code == "spread_changed")
    assert finding.severity == "warning"
    assert {one.code for one in summary.findings} == {"spread_changed", "order_by_name"}
    of_x = next(one for one in summary.series if one.of == "spread")
    # Known is the drawn spread: 19 degrees of freedom tell it to a sixth.
    assert of_x.values[:9] == pytest.approx(np.full(9, NOISE), rel=0.5)


def test_what_all_systems_share_is_the_survey(tmp_path):
    rng = np.random.default_rng(4)
    for number in range(12):
        moved = np.array([0.0, 0.012 if number >= 8 else 0.0, 0.0])
        biases = {name: moved + rng.normal(0, 1e-3, 3) for name in ("laser", "vision")}
        write_day(tmp_path / f"day_{number}", biases, rng)
    summary = summarise_campaigns([tmp_path])
    shared = next(one for one in summary.findings if one.code == "changed_alike")
    assert "'laser' and 'vision' changed alike in y at about day_8" in shared.text


def test_days_are_in_the_order_of_their_dates_or_names(tmp_path):
    rng = np.random.default_rng(5)
    for name, date in (("b", "2026-03-10"), ("a", "2026-03-11"), ("c", "9 March, 2026-03-09")):
        write_day(tmp_path / name, {"rig": [0, 0, 0]}, rng, date=date)
    by_date = summarise_campaigns([tmp_path])
    assert [day.folder.name for day in by_date.days] == ["c", "b", "a"]
    assert by_date.dated
    write_day(tmp_path / "b10", {"rig": [0, 0, 0]}, rng)
    write_day(tmp_path / "b9", {"rig": [0, 0, 0]}, rng)
    by_name = summarise_campaigns([tmp_path])
    assert [day.folder.name for day in by_name.days] == ["a", "b", "b9", "b10", "c"]
    order = next(one for one in by_name.findings if one.code == "order_by_name")
    assert order.severity == "warning"
    assert "stated by b9, b10" in order.text


def test_what_states_a_day():
    assert moment_of("2026-03-11").isoformat() == "2026-03-11T00:00:00+00:00"
    assert moment_of("on 20260311") == moment_of("2026-03-11")
    assert moment_of("2026-03-11T14:05").hour == 14
    assert moment_of("2008").month == 1
    assert moment_of("2026-13-41") is moment_of("in spring") is moment_of("") is None
    assert in_order(["x2", "x10"], [moment_of("2026-03-11")] * 2) == [0, 1]


def test_a_system_that_is_not_there_every_day_is_told(tmp_path):
    rng = np.random.default_rng(6)
    for number in range(1, 8):
        biases = {"rig": [0, 0, 0]} | ({"laser": [0, 0, 0]} if number % 2 else {})
        write_day(tmp_path / f"day_{number}", biases, rng)
    summary = summarise_campaigns([tmp_path])
    missing = next(one for one in summary.findings if one.code == "system_missing")
    assert missing.subject == "laser"
    assert "3 of 7 days: day_2, day_4, day_6." in missing.text
    assert ("too_few_days", "laser") in codes(summary)
    assert ("no_change", "rig") in codes(summary)


def test_campaigns_that_cannot_be_read_are_named_and_the_others_shown(tmp_path):
    write_season(tmp_path, days=3)
    (tmp_path / "never_run").mkdir()
    (tmp_path / "never_run" / "campaign.toml").write_text('name = "never run"\n')
    (tmp_path / "spoilt").mkdir()
    (tmp_path / "spoilt" / "campaign.toml").write_text("name = \n")
    (tmp_path / "day_3" / "results" / "statistics.csv").write_bytes(b"\x00\xff" * 99)
    nothing = tmp_path / "day_2" / "results" / "statistics.csv"
    nothing.write_text(nothing.read_text().splitlines()[0] + "\n")
    status, found = told("summary", tmp_path, tmp_path / "nowhere", "--no-page")
    assert status == 0
    assert [day["label"] for day in found["days"]] == ["2026-03-01"]
    named = {Path(one["subject"]).name: one["code"] for one in found["findings"]}
    assert named == {
        "never_run": "day_without_results",
        "day_2": "day_without_results",
        "spoilt": "day_unreadable",
        "day_3": "day_unreadable",
        "nowhere": "day_unreadable",
        "vision": "too_few_days",
    }
    assert told("summary", tmp_path, "--no-page", "--strict")[0] == 3


def test_nothing_readable_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        summarise_campaigns([tmp_path / "nowhere"])
    status, found = told("summary", tmp_path)
    assert status == 2
    assert found["error"]["problems"]
    assert not (tmp_path / "summary.html").exists()


def test_a_folder_stands_for_the_campaigns_in_it(tmp_path):
    for name in ("day_10", "day_9"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.toml").touch()
    (tmp_path / "notes").mkdir()
    both = [tmp_path / "day_9", tmp_path / "day_10"]
    assert campaign_folders([tmp_path]) == both
    assert campaign_folders([both[1], tmp_path, both[1] / "campaign.toml"]) == both[::-1]
    assert campaign_folders([tmp_path / "notes"]) == [tmp_path / "notes"]


def test_a_run_is_read_as_its_statistics_say(day_that_was_run):
    day = read_day(day_that_was_run)
    assert day.systems == ("rig",)
    assert day.findings == ()
    known = {table.system: table for table in stored_tables(load_campaign(day_that_was_run)).tables}
    for read, one in zip(
        day.errors, evaluate(known["survey"], known["rig"]).statistics, strict=True
    ):
        assert (read.n, read.component) == (one.n, one.component)
        numbers = (read.mean, read.low, read.high, read.std)
        assert numbers == pytest.approx((one.mean, one.ci_low, one.ci_high, one.std))
        assert read.sigma == pytest.approx(one.std / np.sqrt(8))  # Student's interval


def test_poses_that_no_run_has_compared_are_compared_here(tmp_path, day_that_was_run):
    copy = tmp_path / "copy"
    (copy / "results").mkdir(parents=True)
    (copy / "campaign.toml").write_text('name = "copy"\n')
    for name in ("poses_survey.csv", "poses_rig.csv"):
        shutil.copy(day_that_was_run / "results" / name, copy / "results")
    day = read_day(copy)
    known = read_day(day_that_was_run)
    assert [one.mean for one in day.errors] == pytest.approx([one.mean for one in known.errors])
    assert {one.code for one in day.findings} == {"out_of_date"}


def test_what_the_run_of_a_day_found_wrong_is_told(tmp_path, day_that_was_run):
    copy = tmp_path / "copy"
    shutil.copytree(day_that_was_run, copy)
    record = copy / "results" / "run.json"
    held = json.loads(record.read_text())
    said = {"severity": "error", "subject": "vframe", "sentence": "A mark is off."}
    record.write_text(json.dumps(held | {"findings": [said]}))
    (found,) = read_day(copy).findings
    assert (found.code, found.severity) == ("day_with_errors", "warning")
    assert "vframe: A mark is off." in found.text


def test_errors_in_time_have_the_intervals_of_a_series(tmp_path):
    rng = np.random.default_rng(7)
    results = tmp_path / "results"
    results.mkdir()
    (tmp_path / "campaign.toml").write_text('name = "drive"\n')
    slow = np.cumsum(rng.normal(0, 1e-4, 2000))
    rows = [f"{number},{0.01 + value},{value}" for number, value in enumerate(slow)]
    (results / "errors_in_time_mocap.csv").write_text("time,dx,dy\n" + "\n".join(rows) + "\n")
    day = read_day(tmp_path)
    assert [(one.system, one.component.name) for one in day.errors] == [
        ("mocap", "x"),
        ("mocap", "y"),
    ]
    # A walk: its mean is known far worse than that of as many independent errors.
    assert not day.errors[0].sigma < 5 * day.errors[0].std / np.sqrt(2000)


def test_the_interval_of_a_spread_is_that_of_chi_squared():
    one = DayErrors("rig", PLANAR[0], 11, 0.0, 0.0, 0.0, 2.0, 0.95, 0.0)
    # 10 degrees of freedom: 3.247 and 20.483 (Abramowitz and Stegun, table 26.8).
    assert one.std_interval == pytest.approx(
        (2 * (10 / 20.483) ** 0.5, 2 * (10 / 3.247) ** 0.5), rel=1e-4
    )


def test_the_page_holds_all_and_needs_nothing(tmp_path):
    write_season(tmp_path / "season")
    page = tmp_path / "told.html"
    status, found = told("summary", tmp_path / "season", "--page", page)
    assert status == 0
    assert found["page"] == str(page)
    text = page.read_text()
    assert text.count("<svg") == 2
    assert "drift since 2026-03-" in text
    assert "src=" not in text.replace('src="data:', "")
    again = tmp_path / "again.html"
    told("summary", tmp_path / "season", "--page", again)
    assert again.read_bytes() == page.read_bytes()


@pytest.mark.full
def test_drifts_are_noticed_and_clean_days_are_not(tmp_path):
    """The whole of it, with the noise of 20 stops beside the scatter of the days."""
    noticed = alarms = 0
    for seed in range(40):
        for drift in (0.002, 0.0):
            root = tmp_path / f"{seed}_{drift}"
            summary = summarise_campaigns([write_season(root, days=20, seed=seed, drift=drift)])
            days = [day for one in summary.series for day in one.chart.noticed]
            if drift:
                noticed += any(9 <= day <= 13 for day in days)
            else:
                alarms += len(days)
    assert noticed >= 36
    assert alarms <= 3  # 0.9 are expected of 640 days at risk


def test_a_broken_campaign_does_not_stop_a_run_of_several(tmp_path):
    good, bad = write_tables(tmp_path / "good"), tmp_path / "bad"
    bad.mkdir()
    (bad / "campaign.toml").write_text('name = "bad"\nvframe = 3\n')
    status, found = told("run", bad, good, "--no-report")
    assert status == 2
    first, second = found["campaigns"]
    assert first["error"]["problems"][0]["field"] == "vframe"
    assert [one["system"] for one in second["comparisons"]] == ["rig"]
    assert (good / "results" / "statistics.csv").is_file()
    printed = CliRunner().invoke(main, ["run", str(tmp_path), "--no-report"])
    assert printed.exit_code == 2
    assert f"1 of 2 campaigns are done; without results: {bad}" in printed.stdout


def test_a_campaign_that_fails_unexpectedly_does_not_stop_the_others(tmp_path, monkeypatch):
    for name in ("a", "b"):
        write_tables(tmp_path / name)
    whole = running.run_and_write

    def run(folder, *arguments, **choices):
        if folder.name == "a":
            raise RuntimeError("on purpose")
        return whole(folder, *arguments, **choices)

    monkeypatch.setattr(running, "run_and_write", run)
    status, found = told("run", tmp_path, "--no-report")
    assert status == 1
    assert "RuntimeError: on purpose" in found["campaigns"][0]["error"]["message"]
    assert found["campaigns"][1]["comparisons"]
