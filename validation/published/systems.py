"""Poses taken over from elsewhere, as the [[published]] tables of campaign.toml name them."""

from dataclasses import replace
from pathlib import Path

from validation.campaign.folder import Campaign, Published
from validation.campaign.stored import components_of, refuse_degrees
from validation.campaign.toml_files import line_of
from validation.errors import InputError, Problem
from validation.poses.common_origin import placed_by
from validation.poses.pose_table import PLANAR, PoseTable, from_csv
from validation.results import VALIDATION_SYSTEM, Finding, SystemResult, listed_ids


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
        result = moving_result(campaign.folder, entry, validation)
        tables = [_placed(campaign, entry, one, validation) for one in result.tables]
        return replace(result, tables=tables)
    table = _placed(campaign, entry, published_table(campaign.folder, entry), validation)
    return SystemResult([table], findings=assumed_sigmas(table))


def _placed(
    campaign: Campaign, entry: Published, table: PoseTable, validation: PoseTable | None
) -> PoseTable:
    """The table with what its frame, and its mount, took over from surveyed stops, as stated.

    Raises
    ------
    InputError
        Naming the stops that one of both lacks, or why that cannot be.
    """
    asked = entry.placed_by
    if not asked or validation is None or table.follows is not None:
        return table
    surveyed = set(validation.ids)
    shared = [name for name in table.ids if name in surveyed]
    stops = shared if asked == "all" else asked
    lost = [name for name in stops if name not in shared]
    said = ""
    if lost:
        said = f"poses of {listed_ids(lost)} are missing in the survey or in {entry.file}"
    elif table.components not in {PLANAR, PLANAR[:2]} or table.components != validation.components:
        said = "only poses in the plane, or positions, can be placed by the survey"
    elif len(stops) < 2 and len(table.components) < 3:
        said = "positions need two stops"
    if said or not stops:
        place = line_of(campaign.toml, ("published", "placed_by"))
        problem = said or "no stop is in common with the survey"
        raise InputError(
            [Problem(campaign.toml, problem, place, "published.placed_by", str(asked))]
        )
    return placed_by(table, validation, stops, mount=entry.placed_mount)


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
