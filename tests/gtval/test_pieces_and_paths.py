"""What is kept is of the files that it was made of, however the campaign is named."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from gtval.testing import make_room
from validation.campaign.folder import load_campaign
from validation.campaign.provenance import relative
from validation.cli import main
from validation.systems import inputs_of, installed_systems


def run(*given):
    done = CliRunner().invoke(main, ["run", *given])
    assert done.exit_code == 0, done.output


def worst(folder):
    """The first reading typed as nine metres."""
    path = folder / "survey" / "readings.csv"
    lines = path.read_text().splitlines()
    cells, at = lines[29].split(","), lines[0].split(",").index("distance")
    cells[at] = "9.000"
    path.write_text("\n".join([*lines[:29], ",".join(cells), *lines[30:]]) + "\n")


def test_a_report_after_a_reading_changed_is_that_of_a_first_run(tmp_path, monkeypatch):
    make_room(tmp_path / "room", seed=3, stops=4)
    monkeypatch.chdir(tmp_path)
    run("room")
    worst(tmp_path / "room")
    run("room")
    shutil.copytree(tmp_path / "room", tmp_path / "new" / "room")
    for name in ("kept", "results", "report"):
        shutil.rmtree(tmp_path / "new" / "room" / name)
    monkeypatch.chdir(tmp_path / "new")
    run("room")
    assert (tmp_path / "room/report/report.html").read_text() == (
        tmp_path / "new/room/report/report.html"
    ).read_text()


def test_sources_are_told_from_the_campaign_folder(tmp_path, monkeypatch):
    make_room(tmp_path / "room", seed=3, stops=4)
    monkeypatch.chdir(tmp_path)
    run("room", "--no-report")
    made = json.loads((tmp_path / "room/results/run.json").read_text())["steps"]["survey"]
    assert "survey/readings.csv" in made["sources"]
    here, whole = (load_campaign(folder) for folder in (Path("room"), tmp_path / "room"))
    for system in installed_systems():
        told = [
            [relative(path, one.folder) for path in inputs_of(system, one)] for one in (here, whole)
        ]
        assert told[0] == told[1]
        assert not any(name.startswith(("room", "/")) for name in told[0])


OPENED = """
import sys
from dataclasses import replace
from pathlib import Path
from validation.campaign.folder import load_campaign
from validation.solving import solve_system
from validation.systems import inputs_of, installed_systems

folder = Path(sys.argv[1]).resolve()
opened = set()

def seen(event, given):
    if event == "open" and isinstance(given[0], str) and not given[2] & 3:
        path = Path(given[0]).resolve()
        if path.is_file() and path.is_relative_to(folder):
            opened.add(path)

sys.addaudithook(seen)
campaign = load_campaign(folder)
for system in installed_systems():
    if not system.has_data(campaign):
        continue
    opened.clear()
    solved = solve_system(campaign, system)
    campaign = replace(campaign, solved={**campaign.solved, system.name: solved.result})
    given = inputs_of(system, campaign)
    for path in sorted(opened):
        made = path.relative_to(folder).parts[0] in {"kept", "results", "report"}
        if not made and not any(path == one or one in path.parents for one in given):
            print(system.name, path.relative_to(folder))
    print("solved", system.name)
"""


@pytest.mark.parametrize(
    "room",
    [["--laser"], pytest.param(["--vision", "--drive", "4"], marks=pytest.mark.full)],
)
def test_a_system_opens_no_file_that_it_does_not_tell(tmp_path, room):
    asked = ["simulate", str(tmp_path / "room"), "--seed", "4", "--stops", "4", *room]
    assert CliRunner().invoke(main, asked).exit_code == 0
    done = subprocess.run(
        [sys.executable, "-c", OPENED, str(tmp_path / "room")],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert [line for line in lines if not line.startswith("solved")] == []
    assert len(lines) > 1
