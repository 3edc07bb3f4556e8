"""Every command on a narrow terminal in ASCII, through a pipe, and for scripts."""

import io
import json
import re
import shutil
import sys
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
from every_command import BOARD, FORMS, USES, commands

from validation.cli import main

pytestmark = pytest.mark.xdist_group("every command")  # one set of samples for all

COLUMNS = 80
SLOW = {"rtk scanner", "vision check-survey", "vision check-table"}
QUICK = [*sorted(set(USES) - SLOW), *FORMS]
"""A scanner needs a drive of minutes, tables and known places the results of a whole run: tests of
their packages have these."""
NUMBER = re.compile(r"[+-]?\d+\.\d+(?:e[+-]\d+)?")
SCHEMA = json.loads((files("validation.report") / "schema.json").read_text())


class Screen(io.TextIOWrapper):
    """What a command prints: a terminal, or a pipe."""

    def __init__(self, encoding: str, *, terminal: bool) -> None:
        super().__init__(io.BytesIO(), encoding=encoding, write_through=True)
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal

    @property
    def text(self) -> str:
        return self.buffer.getvalue().decode("ascii" if "ascii" in self.encoding else self.encoding)


@pytest.fixture
def shown(request, monkeypatch, tmp_path, samples):
    """Runs a use of a command on a screen; its status and what stdout showed."""
    number = 0

    def show(name, *options, encoding="utf-8", terminal=False):
        nonlocal number
        number += 1
        values = dict(samples)
        use, command = (USES | FORMS)[name], name.partition(":")[0]
        if "{vision}" in use:
            values["vision"] = str(request.getfixturevalue("vision_sample"))
        if name == "laser decide":
            values["decided"] = str(tmp_path / f"decided{number}")
            shutil.copytree(samples["decided"], values["decided"])
        values["board"] = BOARD
        values["out"] = str(tmp_path / f"out{number}")
        arguments = [*command.split(), *use.format(**values).split(), *options]
        out, err = Screen(encoding, terminal=terminal), Screen(encoding, terminal=False)
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", out)
            patch.setattr(sys, "stderr", err)
            patch.setenv("COLUMNS", str(COLUMNS))
            patch.setenv("TERM", "xterm")
            patch.setenv("NO_COLOR", "1")
            patch.chdir(tmp_path)
            status = main.main(arguments, "gtval", standalone_mode=False)
        assert "Error" not in err.text, err.text
        return status or 0, out.text

    return show


def test_the_uses_are_of_all_commands_there_are():
    assert sorted(USES) == sorted(name for name, _ in commands())


def without_paths(text: str) -> str:
    return re.sub(r"\S*/\S*", "PATH", text)


LONG = (
    *("demo", "run", "report", "fuse: with odometry", "sync: a drive"),
    *("laser drive", "laser inspect", "laser solve", "laser check-mount", "vision plan"),
    *("vision calibrate", "vision solve", "vision check-displacement", "vision decide"),
)
"""Commands of seconds: their two runs on two screens are left to the full tests."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.full if name in LONG else ()) for name in QUICK]
)
def test_no_terminal_breaks_a_number_and_no_pipe_pads_or_folds(shown, name):
    """A number that a pipe shows, a terminal of 80 columns in ASCII shows too."""
    status, piped = shown(name, encoding="cp1252")
    assert status == 0, piped
    assert [line for line in piped.splitlines() if line != line.rstrip()] == []
    status, narrow = shown(name, encoding="ascii", terminal=True)
    assert status == 0
    narrow = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", narrow)
    for line in narrow.splitlines():
        assert len(line) <= COLUMNS or "/" in line, line
    piped, narrow = without_paths(piped.replace("±", "+-")), without_paths(narrow)
    assert set(NUMBER.findall(piped)) == set(NUMBER.findall(narrow))


@pytest.mark.parametrize("name", QUICK)
def test_every_command_prints_one_object_of_the_schema(shown, name):
    status, text = shown(name, "--json", encoding="ascii")
    assert status == 0, text
    told = json.loads(text)
    assert told["command"] == name.partition(":")[0]
    assert told["schema"] == "gtval/1"
    assert "error" not in told
    jsonschema.validate(told, SCHEMA)


def test_the_schema_is_one_and_does_not_take_everything():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    validator = jsonschema.Draft202012Validator(SCHEMA)
    good = {"schema": "gtval/1", "command": "compare", "comparisons": [], "findings": []}
    assert validator.is_valid(good)
    for spoilt in (
        {"schema": "gtval/2"},
        {"comparisons": None},
        {"findings": [{"severity": "bad", "code": "", "subject": "", "text": ""}]},
        {"error": {"message": "no problems listed"}},
    ):
        assert not validator.is_valid(good | spoilt)


@pytest.mark.parametrize("name", USES)
def test_an_error_is_an_object_too(capsys, name):
    command = name.split()
    with pytest.raises(SystemExit) as ended:
        main.main([*command, "--no-such-option", "--json"], "gtval")
    assert ended.value.code == 2
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    assert told["command"] == command[0]
    assert told["error"]["message"]


def test_bad_files_are_told_with_every_bad_place(capsys, tmp_path):
    bad = tmp_path / "bad.csv"
    bad.write_text("pose,x,y,theta\n1,a,0,0\n2,0,b,0\n")
    with pytest.raises(SystemExit) as ended:
        main.main(["compare", str(bad), str(bad), "--json"], "gtval")
    assert ended.value.code == 2
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    places = {(one["line"], one["field"], one["value"]) for one in told["error"]["problems"]}
    assert places == {(2, "x", "a"), (3, "y", "b")}
    assert {Path(one["file"]) for one in told["error"]["problems"]} == {bad}
