"""Hashes of all that a step of a run depends on: so figures and the like are made once."""

from collections.abc import Mapping
from pathlib import Path

from validation.campaign.folder import Campaign
from validation.campaign.provenance import below, relative
from validation.pieces.store import code_of, key_of
from validation.results import VALIDATION_SYSTEM
from validation.run import RunResult
from validation.solving import starts_from_survey
from validation.systems import System, inputs_of, installed_systems
from validation.text_files.json_text import json_text

AFTERWARDS = ("explain", "time")
"""Tables of what is done with the poses once they are there."""
ABOUT = ("description", "place", "date", "facts", "claims", "published")
"""Of campaign.toml, what no system reads: it is told, or compared, when poses are there."""


def keys_of_steps(run: RunResult) -> dict[str, str]:
    """A hash for each system that was solved, and under '' that of the whole run.

    That of a system is of the files that it reads, of campaign.toml but for `ABOUT` and the tables
    of other packages, of its code, and of the survey where it starts from that. What it makes of
    them is then the same. Systems of plug-ins have that of the whole run.
    """
    installed = {one.name: one for one in installed_systems()}
    campaign = run.campaign
    packages = sorted({_package(one) for one in installed.values()})
    tables = {name: _package(one) for name, one in installed.items()}
    choices = [[one.name, dict(one.choices)] for one in run.systems]
    settings = campaign.settings.model_dump(exclude=set(campaign.extra))
    whole = [settings, dict(campaign.extra), run.inputs, run.method, choices]
    found = {"": key_of(code_of(*packages, "validation"), json_text(whole).encode())}
    for solved in run.systems:
        system = installed.get(solved.name)
        if system is None or getattr(system, "inputs", None) is None:
            continue
        own = _package(system)
        extra = {
            name: table
            for name, table in campaign.extra.items()
            if tables.get(name, own) == own and name not in AFTERWARDS
        }
        shared = {name: one for name, one in settings.items() if name not in ABOUT}
        told: list[object] = [solved.name, shared, extra, dict(solved.choices)]
        told.append(_hashes(campaign, system, run.inputs))
        if starts_from_survey(system):  # which was solved before
            told.append(found.get(VALIDATION_SYSTEM, found[""]))
        found[solved.name] = key_of(code_of(own, "validation"), json_text(told).encode())
    return found


def _package(system: System) -> str:
    """Top package of the code of a system."""
    return type(system).__module__.partition(".")[0]


def _hashes(campaign: Campaign, system: System, hashes: Mapping[str, str]) -> dict[str, str]:
    """Of the files that a system reads but for campaign.toml."""
    paths: list[Path] = [one for one in inputs_of(system, campaign) if one != campaign.toml]
    return dict(below(hashes, [relative(one, campaign.folder) for one in paths]))
