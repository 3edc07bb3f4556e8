"""The front door: quick, discovering, and plain about errors."""

import os
import resource
import shlex
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from small_campaigns import AD23

from validation import cli
from validation.cli import DiscoveredGroup, main
from validation.commands.later import Later
from validation.errors import GtvalError

HEAVY = (
    "numpy",
    "scipy",
    "cv2",
    "matplotlib",
    "filterpy",
    "kiss_icp",
    "pydantic",
    "rich",
    "jinja2",
)

HELP = "import sys; from validation.cli import main; main(['--help'], standalone_mode=False)"


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )


def test_help_imports_nothing_heavy():
    code = f"{HELP}; print('LOADED', *[m for m in {HEAVY!r} if m in sys.modules])"
    assert python(code).stdout.splitlines()[-1].strip() == "LOADED"


def test_help_of_every_command_imports_nothing_heavy():
    code = (
        "import sys, click; from validation.cli import main; ctx = click.Context(main)\n"
        "for name in main.list_commands(ctx):\n"
        "    main.get_command(ctx, name).get_help(ctx)\n"
        f"print('LOADED', *[m for m in {HEAVY!r} if m in sys.modules])"
    )
    assert python(code).stdout.splitlines()[-1].strip() == "LOADED"


def cpu_seconds(code: str) -> float:
    """CPU time of a fresh interpreter, the best of five, as other work only adds to it."""
    times = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        python(code)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


def test_help_takes_little_longer_than_what_it_cannot_do_without():
    # On an idle machine of 2020 that is below 0.15 s; the ratio holds on a busy one as well.
    floor = cpu_seconds("import click, importlib.metadata, inspect")
    assert cpu_seconds(HELP) < 1.8 * floor + 0.02


def test_the_commands_are_there():
    result = CliRunner().invoke(main, ["--help"])
    assert result.exit_code == 0
    for command in ("run", "compare", "report"):
        assert f"\n  {command}" in result.output


def test_the_version_is_told():
    assert CliRunner().invoke(main, ["--version"]).output.startswith("gtval, version ")


def group_with(monkeypatch, *entries: EntryPoint) -> DiscoveredGroup:
    monkeypatch.setattr(cli, "entry_points", lambda **_: list(entries))
    return DiscoveredGroup(name="gtval")


def test_a_broken_plug_in_is_a_warning_only(monkeypatch):
    broken = EntryPoint("rig", "no_such_module:COMMANDS", "gtval.commands")
    good = EntryPoint("validation", "validation.commands:COMMANDS", "gtval.commands")
    result = CliRunner().invoke(group_with(monkeypatch, broken, good), ["--help"])
    assert result.exit_code == 0
    assert "Warning: plug-in 'rig' cannot be loaded: No module named 'no_such_module'" in (
        result.stderr
    )
    assert "compare" in result.stdout


def failing(error: Exception) -> click.Command:
    @click.command()
    def fail() -> None:
        raise error

    return fail


@pytest.mark.parametrize("text", ["a.csv, line 3: bad", "two\nlines"])
def test_a_known_error_is_told_without_traceback(monkeypatch, text):
    group = group_with(monkeypatch)
    group.add_command(failing(GtvalError(text)))
    result = CliRunner().invoke(group, ["fail"])
    assert result.exit_code == 2
    assert result.stderr == f"Error: {text}\n"
    assert result.stdout == ""


def test_an_unknown_error_is_not_hidden(monkeypatch):
    group = group_with(monkeypatch)
    group.add_command(failing(ZeroDivisionError("a bug")))
    result = CliRunner().invoke(group, ["fail"])
    assert result.exit_code == 1
    assert "Traceback" in result.stderr
    assert "unexpected: ZeroDivisionError: a bug" in result.stderr.splitlines()[-1]


def test_ctrl_c_ends_in_one_line_and_130(monkeypatch):
    group = group_with(monkeypatch)
    group.add_command(failing(KeyboardInterrupt()))
    result = CliRunner().invoke(group, ["fail"])
    assert result.exit_code == 130
    assert result.stderr.split() == ["Interrupted;", "no", "file", "is", "half-written."]


def test_an_unknown_command_is_a_usage_error():
    result = CliRunner().invoke(main, ["no-such-command"])
    assert result.exit_code == 2
    assert "No such command" in result.stderr


def failing_output(redirection: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The program with its stdout led somewhere by the shell."""
    line = f"set -o pipefail; {sys.executable} -m validation {shlex.join(arguments)} {redirection}"
    return subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, check=False, timeout=60
    )


LONG = ("compare", *[str(AD23 / name) for name in ("survey/published_poses.csv",)])
LONG = (*LONG, str(AD23 / "vision/published_poses.csv"), "--all")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    "arguments", [("--help",), LONG, (*LONG, "--json"), ("compare", "no_such_folder", "--json")]
)
@pytest.mark.parametrize("redirection", [">/dev/full", ">&-"])
def test_output_that_cannot_be_written_is_told_in_a_line(redirection, arguments):
    done = failing_output(redirection, *arguments)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("Error: the ")
    assert "output" in last
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= (2 if "no_such_folder" in arguments else 1)


@pytest.mark.skipif(os.name != "posix", reason="pipes are closed so on POSIX only")
@pytest.mark.parametrize("arguments", [("--help",), LONG, (*LONG, "--json")])
def test_a_closed_pipe_is_quiet(arguments):
    assert failing_output("| true", *arguments).stderr == ""


def test_the_list_of_commands_says_what_their_own_help_says():
    context = click.Context(main)
    for name in main.list_commands(context):
        listed, command = main.commands[name], main.get_command(context, name)
        assert not isinstance(command, Later)
        if isinstance(listed, Later):
            assert command.name == name
            first = " ".join(command.help.split("\n\n")[0].split())
            assert listed.help == first
