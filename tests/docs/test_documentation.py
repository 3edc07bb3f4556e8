"""What the documentation shows can be used as it stands."""

import re
import textwrap
from pathlib import Path

import pytest
from click.testing import CliRunner

from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.cli import main

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted([REPOSITORY / "README.md", *(REPOSITORY / "docs").glob("*.md")])


def test_the_smallest_campaign_toml_of_the_documentation_loads(tmp_path):
    page = (REPOSITORY / "docs" / "campaign.md").read_text()
    shown = page[page.index('    name = "My lab') : page.index("`gtval simulate DIR` writes")]
    (tmp_path / "campaign.toml").write_text(textwrap.dedent(shown))
    campaign = load_campaign(tmp_path)
    assert campaign.settings.robot_frame.sides["X-Y"] == 0.721
    assert len(campaign.section("survey", SurveySettings).world_points) == 8


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_shown_exists(page):
    shown = set(re.findall(r"(?:`| {4})gtval ([a-z-]+)", page.read_text()))
    commands = main.list_commands(main.make_context("gtval", ["demo"]))
    assert shown <= set(commands)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_is_linked_exists(page):
    targets = re.findall(r"\]\((?!http)([^)#]+)", page.read_text())
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


def test_the_options_of_simulate_that_are_shown_exist():
    text = CliRunner().invoke(main, ["simulate", "--help"]).output
    shown = re.findall(r"`(--[a-z-]+)", (REPOSITORY / "docs" / "samples.md").read_text())
    assert shown
    assert all(option in text for option in shown)
