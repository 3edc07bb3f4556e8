"""Every key of campaign.toml is on the page of the campaign folder, under its table."""

import re
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

from blocks import REPOSITORY
from pydantic import BaseModel
from test_documentation import TABLES

from validation.campaign.folder import CampaignSettings

PAGE = REPOSITORY / "docs" / "campaign.md"
SHARED = {"BoardSettings": "key of a board", "Placement": "key of a place"}
"""Settings that stand in many tables, and how the page calls their keys."""


def inner_models(annotation: object) -> list[type[BaseModel]]:
    """Settings inside of a type: in lists, mappings and unions, too."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in {Union, UnionType, Annotated, list, dict, tuple}:
        return [model for part in get_args(annotation) for model in inner_models(part)]
    return []


def tables_of(model: type[BaseModel], name: str) -> dict[str, set[str]]:
    """Keys of a table and of all tables below it, by the tables' headings."""
    if model.__name__ in SHARED:
        return {SHARED[model.__name__]: set(model.model_fields)}
    found = {name: set(model.model_fields)}
    for key, field in model.model_fields.items():
        for inner in inner_models(field.annotation):
            below = f"{name}.{key}" if name else key
            found |= tables_of(inner, f"{below}.NAME" if key == "scanners" else below)
    return found


def expected() -> dict[str, set[str]]:
    """All tables with their keys. Tables of the campaign itself have headings, not rows."""
    found = tables_of(CampaignSettings, "")
    for name, model in TABLES.items():
        found |= tables_of(model, name)
    found[""] -= set(found)
    return found


def shown() -> dict[str, set[str]]:
    """Keys in the first column of each table of the page, by the heading above."""
    page = PAGE.read_text(encoding="utf-8")
    text = page[page.index("## All keys") : page.index("## Computed files")]
    found: dict[str, set[str]] = {}
    heading = ""
    for line in text.splitlines():
        if line.startswith("### "):
            heading = line.removeprefix("### ").strip("`[] ").replace("The campaign", "")
            found.setdefault(heading, set())
        elif line.startswith("| key of"):
            heading = line.split("|")[1].strip()
            found.setdefault(heading, set())
        elif line.startswith("| `"):
            found[heading] |= set(re.findall(r"`([^`]+)`", line.split("|")[1]))
    return found


def test_the_page_has_every_key_and_no_other():
    assert shown() == expected()
