"""`gtval simulate DIR --laser --vision` makes data for every command of the indoor part."""

import json
import subprocess
import sys

import pytest
from every_command import BOARD, commands

SIZE = ("--laser", "--vision", "--stops", "4", "--initial-guesses", "--hand-points", "2")
INDOOR = {
    "accuracy": "{room}",
    "clean": "{room} --dry-run",
    "compare": "{room}",
    "convergence": "{room} --starts 20",
    "enter": "{room} --status",
    "explain": "{room}",
    "instrument-check": "{room}/survey/known_lengths.csv --campaign {room}",
    "laser check-mount": "{room}",
    "laser decide": "{room} 1 2 accept",
    "laser inspect": "{room}",
    "laser solve": "{room} --dry-run",
    "open": "{room} --status",
    "plan": "{room}",
    "report": "{room}",
    "run": "{room}",
    "summary": "{room} --no-page",
    "survey": "{room} --dry-run",
    "vision calibrate": "{room}/vision/calibration/1 --workers 2 {board}",
    "vision check-survey": "{room} --workers 2",
    "vision check-table": "{room} --workers 2",
    "vision check-displacement": "{room}/truth/camera_1.yaml "
    "{room}/vision/displacement/1/first.png {room}/vision/displacement/1/second.png 0.6 {board}",
    "vision convert-camera": "{room}/truth/camera_1.yaml {room}/camera.yaml --format ros",
    "vision decide": "{room} vision/calibration/1/01.png use",
    "vision look": "{room} --workers 2",
    "vision plan": "{room}",
    "vision pose": "{room}/vision/calibration/1/01.png --intrinsics {room}/truth/camera_1.yaml "
    "{board}",
    "vision print-patterns": "{room}/patterns --campaign {room}",
    "vision solve": "{room} --workers 2 --dry-run",
    "walls-check": "{room}/survey/walls.csv --campaign {room}",
}
ELSEWHERE = {
    "demo": "the campaign of AD2.3 itself",
    "simulate": "what makes the room",
    "study": "rooms of its own, drawn for a plan",
    "laser drive": "a robot that drives, which `gtval simulate-motion --laser` makes",
    "journal-merge": "the journals of two writers, which `gtval enter` makes",
}
DRIVING = (
    *("convert", "fuse", "rtk", "sync"),
    *("simulate-almanac", "simulate-drive", "simulate-motion"),
)
"""Commands for robots that drive; those that simulate make their data."""


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("one") / "room"
    told("simulate", str(folder), *SIZE)
    told("run", str(folder))
    return folder


def told(*arguments):
    """What a command prints with --json."""
    command = [sys.executable, "-m", "gtval", *arguments, "--json"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_command_has_its_data_here_or_a_reason_why_not():
    names = {name for name, _ in commands() if name.split()[0] not in DRIVING}
    assert names == set(INDOOR) | set(ELSEWHERE)


@pytest.mark.full
@pytest.mark.parametrize("name", INDOOR)
def test_the_room_has_what_the_command_needs(room, name):
    use = INDOOR[name].format(room=room, board=BOARD)
    assert told(*name.split(), *use.split())["command"] == name
