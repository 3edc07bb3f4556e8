"""Poses taken over from elsewhere, as the [[published]] tables of campaign.toml name them."""

from dataclasses import replace
from pathlib import Path

from validation.campaign.folder import Campaign, Published, line_of
from validation.campaign.stored import components_of, refuse_degrees
from validation.errors import InputError, Problem
from validation.poses.pose_table import PoseTable, from_csv
from validation.results import VALIDATION_SYSTEM, Finding, SystemResult


def published_systems(
    campaign: Campaign, validation: PoseTable | None = None
) -> dict[str, SystemResult]:
    """What each [[published]] entry gives, by its name, the validation poses first.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings.
    validation : PoseTable, optional
        Surveyed stops, whose names the standstills of a trajectory get.

    Raises
    ------
    InputError
        Naming every bad place of every file, and systems that are named twice.
    """
    entries = campaign.settings.published
    names = [entry.system for entry in entries]
    problems = [
        Problem(campaign.toml, "this system is published twice", field="published", value=name)
        for name in sorted({name for name in names if names.count(name) > 1})
    ]
    found: dict[str, SystemResult] = {}
    for entry in sorted(entries, key=lambda entry: entry.system != VALIDATION_SYSTEM):
        try:
            found[entry.system] = _published(campaign, entry, validation)
        except InputError as error:
            problems.extend(error.problems)
            continue
        if entry.system == VALIDATION_SYSTEM and found[entry.system].tables:
            validation = found[entry.system].tables[0]
    if problems:
        raise InputError(problems)
    return {name: found[name] for name in names}


def published_tables(campaign: Campaign) -> list[PoseTable]:
    """The tables of all [[published]] entries, in the order of campaign.toml.

    Raises
    ------
    InputError
        As for `published_systems`.
    """
    return [table for result in published_systems(campaign).values() for table in result.tables]


def _published(campaign: Campaign, entry: Published, validation: PoseTable | None) -> SystemResult:
    """A table of stops, or a trajectory at the stops."""
    from validation.published.moving import moving_result  # noqa: PLC0415  (scipy.spatial is slow)
    from validation.trajectories.formats import is_trajectory  # noqa: PLC0415  (the same)

    path = campaign.folder / entry.file
    if not path.exists():
        place = line_of(campaign.toml, ("published", "file"))
        said = f"there is no such file for '{entry.system}'; put it there, or correct the key"
        raise InputError([Problem(campaign.toml, said, place, "published.file", entry.file)])
    if entry.stops or entry.format or not entry.judged or is_trajectory(path):
        return moving_result(campaign.folder, entry, validation)
    table = published_table(campaign.folder, entry)
    return SystemResult([table], findings=assumed_sigmas(table))


def published_table(folder: Path, entry: Published) -> PoseTable:
    """The poses of one entry.

    Parameters
    ----------
    folder : Path
        Campaign folder; the file's path is relative to it.
    entry : Published
        The entry. The file's columns are those of `validation.poses.pose_table.from_csv`.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    path = folder / entry.file
    refuse_degrees(path)
    components = components_of(path)
    if entry.sigmas is not None and len(entry.sigmas) != len(components):
        expected = f"poses of {len(components)} components need as many sigmas"
        raise InputError([Problem(path, expected, field="sigmas", value=str(entry.sigmas))])
    table = from_csv(path, system=entry.system, sigmas=entry.sigmas, components=components)
    provenance = {"published": entry.source, "file": entry.file, "assumed_sigmas": entry.sigmas}
    return replace(table, provenance=provenance)


def assumed_sigmas(table: PoseTable) -> list[Finding]:
    """What has to be said of standard deviations that the file does not state itself."""
    sigmas = table.provenance.get("assumed_sigmas")
    if not isinstance(sigmas, tuple):
        return []
    listed = ", ".join(
        f"{component.name} {1000 * sigma:g} m{component.unit}"
        for component, sigma in zip(table.components, sigmas, strict=True)
    )
    text = f"Where its file states no covariance, those of campaign.toml are used: {listed}."
    return [Finding("note", text, table.system, "assumed_sigmas")]
