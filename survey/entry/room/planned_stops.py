"""Stops for a campaign that plans none: which lines of campaign.toml list them."""

import tomllib

from survey.entry.room.targets import load_names
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign, load_campaign
from validation.errors import GtvalError
from validation.text_files.writing import write_files

EXAMPLE = ("1", "2", "3")


def lacks_stops(campaign: Campaign) -> bool:
    """Whether no stop is planned, so that only Vframe and world points could be entered."""
    return not load_names(campaign).stops


def stop_lines(stops: tuple[str, ...] = EXAMPLE) -> str:
    """The lines of campaign.toml that list stops."""
    listed = ", ".join(f'"{name}"' for name in stops)
    return f"[survey.entry]\nposes = [{listed}]\n"


def lines_to_write(campaign: Campaign) -> str:
    """What is missing, and the lines to write, for a person."""
    guesses = campaign.section("survey", SurveySettings).initial_guesses
    return (
        f"No stops are planned, so only Vframe and world points can be entered. List the stops in "
        f"{campaign.toml} (or give rough poses of them in {guesses}):\n\n{stop_lines()}\n"
        "With --stops 26 they are written there, named 1 to 26. A further stop is begun in the "
        "room by its name: p 27."
    )


def write_stops(campaign: Campaign, count: int) -> Campaign:
    """The campaign with stops named 1 to ``count``, written to campaign.toml.

    Raises
    ------
    GtvalError
        If stops are planned already, or the lines cannot be put into the file.
    """
    if not lacks_stops(campaign):
        raise GtvalError(f"{campaign.toml}: stops are planned already; change them there")
    names = tuple(str(number) for number in range(1, count + 1))
    header, listed = stop_lines(names).splitlines()
    text = campaign.toml.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    at = next((i for i, line in enumerate(lines) if line.strip().startswith(header)), None)
    if at is None:
        changed = f"{text.rstrip()}\n\n{header}\n{listed}\n"
    else:
        lines.insert(at + 1, f"{listed}\n")
        changed = "".join(lines)
    try:
        found = tomllib.loads(changed)["survey"]["entry"]["poses"]
    except (tomllib.TOMLDecodeError, KeyError, TypeError):
        found = []
    if found != list(names):
        raise GtvalError(f"{campaign.toml}: write the stops there by hand:\n\n{stop_lines(names)}")
    write_files(campaign.folder, {campaign.toml.name: changed})
    return load_campaign(campaign.folder)
