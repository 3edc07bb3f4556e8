"""A campaign that plans no stops: what `gtval enter` says and writes."""

import io
import sys

import pytest
from click.testing import CliRunner

from survey.commands.enter import _with_stops
from survey.entry.room.planned_stops import lacks_stops, write_stops
from survey.entry.room.targets import find_target, load_names, stations
from survey.settings import EntrySettings
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError

TOML = """name = "lab"
[instrument]
tolerance = 0.0015
[vframe]
pole_length = 2.5
[robot_frame]
points = { "O" = [0.0, 0.0], "X" = [0.6, 0.0], "Y" = [0.0, 0.4] }
[survey]
world_points = ["1", "2", "3", "4"]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "campaign.toml").write_text(TOML)
    return tmp_path


def test_without_stops_it_says_which_lines_to_write(folder):
    done = CliRunner().invoke(main, ["enter", str(folder)], input="3.5\n")
    assert done.exit_code == 0, done.output
    assert '[survey.entry]\nposes = ["1", "2", "3"]' in done.output
    assert "--stops" in done.output
    assert (folder / "campaign.toml").read_text() == TOML


@pytest.mark.parametrize("more", ["", '[survey.entry]\norder = "listed"\n', "[room]\nwalls = []\n"])
def test_the_stops_are_written_where_they_belong(folder, more):
    (folder / "campaign.toml").write_text(TOML + more)
    done = CliRunner().invoke(main, ["enter", str(folder), "--stops", "3", "--status"])
    assert done.exit_code == 0, done.output
    written = load_campaign(folder)
    assert load_names(written).stops == ("1", "2", "3")
    assert not lacks_stops(written)
    for line in (TOML + more).splitlines():
        assert line in (folder / "campaign.toml").read_text()


def test_stops_that_are_there_are_not_written_over(folder):
    written = write_stops(load_campaign(folder), 2)
    before = written.toml.read_text()
    with pytest.raises(GtvalError, match="planned already"):
        write_stops(written, 5)
    assert written.toml.read_text() == before


def test_a_file_that_cannot_take_the_lines_is_left_alone(folder):
    (folder / "campaign.toml").write_text(TOML + 'entry = { order = "listed" }\n')
    before = (folder / "campaign.toml").read_text()
    with pytest.raises(GtvalError, match="by hand"):
        write_stops(load_campaign(folder), 2)
    assert (folder / "campaign.toml").read_text() == before


def test_what_is_not_in_the_plan_names_the_setting(folder):
    plan = stations(load_names(load_campaign(folder)), EntrySettings())
    with pytest.raises(GtvalError, match=r"\[survey.entry\] poses"):
        find_target("9/O 1", plan)


def test_stops_and_world_points_that_are_missing_are_named_at_once(folder):
    (folder / "campaign.toml").write_text(TOML[: TOML.index("[survey]")])
    with pytest.raises(GtvalError) as said:
        load_names(load_campaign(folder))
    assert "field 'survey.world_points'" in str(said.value)
    assert "field 'survey.entry.poses'" in str(said.value)


@pytest.mark.parametrize(("answer", "stops"), [("y", ("1", "2")), ("n", ())])
def test_at_a_terminal_it_asks_before_it_writes_the_stops(folder, monkeypatch, answer, stops):
    class Keyboard(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", Keyboard(f"2\n{answer}\n"))
    monkeypatch.setattr("click.termui.visible_prompt_func", lambda _: sys.stdin.readline().strip())
    written = _with_stops(load_campaign(folder), None, ask=True)
    assert load_names(written).stops == stops
