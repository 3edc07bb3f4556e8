"""A run takes over what an earlier one made, and does again only what depends on a change."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from data_samples.drives.drive import DriveSettings, simulate_drive
from data_samples.drives.files import write_drive
from gtval.testing import make_room
from validation.campaign.folder import load_campaign
from validation.pieces import results as kept_results
from validation.pieces.store import counted
from validation.run import run_campaign

RUN = (sys.executable, "-m", "gtval", "run")


def run(folder, *more):
    """The JSON of a run."""
    done = subprocess.run(
        [*RUN, str(folder), "--json", *more], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def results(folder):
    """What the results and the report hold."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for name in ("results", "report")
        for path in sorted((folder / name).rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pieces") / "room"
    make_room(folder, seed=6, stops=4, laser=True)
    first = run(folder)
    return folder, first, results(folder)


def edited(folder, name, line):
    """campaign.toml with a line more in a table."""
    path = folder / "campaign.toml"
    text = path.read_text()
    if f"[{name}]" in text:
        path.write_text(re.sub(rf"(?m)^\[{name}\]$", f"[{name}]\n{line}", text))
    else:
        path.write_text(f"{text}\n[{name}]\n{line}\n")
    return text


def test_a_second_run_does_no_piece_again_and_gives_the_same_bytes(room):
    folder, first, before = room
    assert first["pieces"]["matches of scans"]["taken"] == 0
    (folder / "results" / "laser_matching_scanmatch.json").unlink()
    again = run(folder)
    for kind, pieces in again["pieces"].items():
        assert pieces["done"] == 0, kind
    assert again["pieces"]["figures"]["taken"] == first["pieces"]["figures"]["done"]
    assert results(folder) == before


@pytest.mark.full
@pytest.mark.parametrize(
    ("table", "line", "matches", "figures"),
    [
        ("explain", "false_alarm = 0.02", (0, 0), "some"),
        ("laser", "genetic_pairs = 2", "some", "some"),
        ("laser", "seed = 9", "genetic", "some"),
        ("comparison", "confidence = 0.9", (0, 0), "all"),
    ],
)
def test_a_setting_changes_only_what_depends_on_it(room, table, line, matches, figures):
    folder, first, _ = room
    run(folder)
    text = edited(folder, table, line)
    try:
        found = run(folder)["pieces"]
    finally:
        (folder / "campaign.toml").write_text(text)
    made = first["pieces"]["matches of scans"]["done"]
    done = found.get("matches of scans", {"done": 0})["done"]
    assert {"some": 0 <= done < made / 2, "genetic": 0 < done <= made / 2}.get(matches, done == 0)
    drawn, count = found["figures"]["done"], first["pieces"]["figures"]["done"]
    assert drawn == count if figures == "all" else 0 < drawn < count


@pytest.mark.full
def test_a_run_killed_at_random_moments_goes_on_and_repeats_little(tmp_path):
    folder = tmp_path / "room"
    make_room(folder, seed=7, stops=10, laser=True)
    whole = run(folder)["pieces"]
    expected = results(folder)
    rng = np.random.default_rng()
    for _ in range(4):
        for name in ("kept", "results", "report"):
            subprocess.run(["rm", "-rf", str(folder / name)], check=True)
        killed = subprocess.Popen(
            [*RUN, str(folder)], stdout=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(rng.uniform(2, 12))
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
        lines = {path.name: path.read_bytes().count(b"}\n") for path in (folder / "kept").glob("*")}
        then = run(folder)["pieces"]
        kept = lines.get("laser_pairs.jsonl", 0)
        matches = then.get("matches of scans", {"taken": kept, "done": 0})
        # What was being matched when it was killed is matched again, and nothing else.
        assert kept + matches["done"] == whole["matches of scans"]["done"]
        assert results(folder) == expected


class NeverRaisedError(Exception):
    """Stands where what cannot be told is caught."""


def steps_of(folder, monkeypatch):
    """How many steps of each package a run keeps, none of them of a kind that cannot be told."""
    monkeypatch.setattr(kept_results, "UnknownKindError", NeverRaisedError)
    with counted() as pieces:
        done = run_campaign(load_campaign(folder))
    assert not done.failed
    return {kind: one.done for kind, one in pieces.kinds.items() if kind.startswith("steps of ")}


def test_every_step_of_a_drive_of_receivers_can_be_kept(tmp_path, monkeypatch):
    write_drive(tmp_path, simulate_drive(1, DriveSettings(loops=1)))
    steps = steps_of(tmp_path, monkeypatch)
    assert steps["steps of rtk"] > 5
    assert steps_of(tmp_path, monkeypatch) == {"steps of rtk": 0}


@pytest.mark.full
def test_every_step_of_a_room_with_cameras_can_be_kept(tmp_path, monkeypatch):
    room = ("simulate", "--seed", "6", "--stops", "4", "--vision", "--drive", "3")
    subprocess.run(
        [sys.executable, "-m", "gtval", *room, str(tmp_path / "room")],
        check=True,
        capture_output=True,
    )
    steps = steps_of(tmp_path / "room", monkeypatch)
    assert steps["steps of survey"] == 1
    assert steps["steps of vision"] > 5
    assert set(steps_of(tmp_path / "room", monkeypatch).values()) == {0}
