"""What the documentation says of commands, options, keys and files is so."""

import re
import shlex

import click
import pytest
from blocks import PAGES, REPOSITORY, blocks_of

from laser_gt.settings import DriveSettings, LaserSettings
from rtk_gt.settings import RtkSettings
from survey.settings import PlanSettings, SurveySettings
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError
from validation.explain.settings import ExplainSettings
from validation.trajectories.settings import TimeSettings
from vision_gt.settings import VisionSettings

TABLES = {
    "survey": SurveySettings,
    "plan": PlanSettings,
    "laser": LaserSettings,
    "laser_drive": DriveSettings,
    "vision": VisionSettings,
    "rtk": RtkSettings,
    "explain": ExplainSettings,
    "time": TimeSettings,
}
NAMES = [page.relative_to(REPOSITORY).as_posix() for page in PAGES]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_tables_of_campaign_toml_that_are_shown_have_these_keys(page, tmp_path):
    for block in blocks_of(page):
        path = block.mark("file") or block.mark("append") or "campaign.toml"
        if block.language != "toml" or not path.endswith("campaign.toml"):
            continue
        named = block.text if block.text.startswith("name") else f'name = "x"\n{block.text}'
        (tmp_path / "campaign.toml").write_text(named, encoding="utf-8")
        campaign = load_campaign(tmp_path)
        for table, settings in TABLES.items():
            campaign.section(table, settings)


def test_a_key_that_does_not_exist_is_seen(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "x"\n[laser]\nrefrence = ["6"]\n')
    with pytest.raises(GtvalError):
        load_campaign(tmp_path).section("laser", LaserSettings)


def command_of(words: list[str]) -> tuple[click.Command | None, list[str]]:
    """The command that the first words name, and the words that are left."""
    found, context = main, main.make_context("gtval", ["demo"])
    left = list(words)
    while isinstance(found, click.Group) and left and re.fullmatch("[a-z][a-z-]*", left[0]):
        inner = found.get_command(context, left[0])
        if inner is None:
            return (None if found is main else found), left
        found, context = inner, click.Context(inner, parent=context)
        left = left[1:]
    return found, left


def options_of(command: click.Command) -> set[str]:
    """All its options; those of its commands, too, where it is a group."""
    names = {
        name
        for parameter in command.params
        for name in (*parameter.opts, *parameter.secondary_opts)
    }
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            names |= options_of(command.get_command(context, name))
    return names | {"--help", "--version"}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_in_the_text_exist_with_their_options(page):
    if page.name == "CHANGELOG.md":
        return
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for shown in re.findall(r"`gtval ([^`]+)`", text):
        command, left = command_of(shlex.split(shown.replace("|", " ").replace("\n", " ")))
        assert command is not None, f"gtval {shown}"
        options = {word for word in left if word.startswith("--")}
        assert options <= options_of(command), f"gtval {shown}"


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_file_that_is_linked_exists(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\((?!http)([^)#]+)", text)
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


def test_the_options_of_simulate_that_are_shown_exist():
    known = {"--seed"}
    for name in ("simulate", "simulate-motion"):
        known |= options_of(command_of([name])[0])
    shown = re.findall(r"`(--[a-z-]+)", (REPOSITORY / "docs" / "samples.md").read_text())
    assert shown
    assert set(shown) <= known


def test_files_of_the_sources_that_are_named_exist():
    places = (REPOSITORY, REPOSITORY / "examples" / "my_system")
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"`((?:benchmarks|tests|docs|examples)/[\w/.]+)", text):
            assert any((place / name).exists() for place in places), f"{page.name}: {name}"
