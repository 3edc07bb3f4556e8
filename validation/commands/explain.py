"""The command ``gtval explain``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, EVERYTHING, PATH, STRICT, progress_bar
from validation.commands.trajectory_files import moves, refuse_tables

if TYPE_CHECKING:
    from validation.campaign.folder import Campaign
    from validation.explain.analysis import Explanation
    from validation.poses.pose_table import PoseTable
    from validation.results import Finding, Section
    from validation.systems import Progress


@click.command()
@click.argument("validation", type=PATH, metavar="CAMPAIGN | VALIDATION.csv")
@click.argument("gt", type=PATH, nargs=-1, metavar="[GT.csv]...")
@click.option(
    "--reference",
    "references",
    multiple=True,
    metavar="SYSTEM=POSE",
    help="The pose that tied a system to the GTV frame; '?' if one did but not known which.",
)
@click.option(
    "--shared-sensor",
    "sensors",
    multiple=True,
    metavar="NAME=SYSTEM,SYSTEM",
    help="Systems that use the same sensor.",
)
@click.option(
    "--independent",
    "independent",
    multiple=True,
    metavar="SYSTEM,SYSTEM",
    help="Tables that look like copies of one another, and are none.",
)
@click.option(
    "--witness",
    "witnesses",
    multiple=True,
    type=PATH,
    help="Rough poses from elsewhere (CSV) that only help to decide who is wrong.",
)
@click.option("--output", type=PATH, help="Folder for corrected poses and numbers.")
@click.option("--figures", is_flag=True, help="Write the figures there too (SVG).")
@AS_JSON
@STRICT
@EVERYTHING
def explain(
    validation: Path,
    gt: tuple[Path, ...],
    references: tuple[str, ...],
    sensors: tuple[str, ...],
    independent: tuple[str, ...],
    witnesses: tuple[Path, ...],
    output: Path | None,
    figures: bool,
    *,
    as_json: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Tell where errors come from: a mount, a frame, a few wrong poses, and whose.

    Takes a campaign folder (its table [explain] says which systems have a reference pose or share
    a sensor), or pose tables: VALIDATION.csv and one or more GT.csv with the columns pose, x, y,
    theta (metres, radians) and, if known, the covariance xx, xy, xt, yy, yt, tt; a column time
    (seconds) lets a time offset show. Files are named after their system. For a campaign,
    corrected poses and all numbers go to CAMPAIGN/results/explain; for tables, to --output.

    Takes trajectories as well, a reference and one or more sources: then frame, mount, scale,
    delay, drift of the clock and drift of the poses are told apart. Poses in space (x, y, z, yaw,
    pitch, roll) and positions (x, y or x, y, z) are explained as far as they go.
    """
    from validation.commands.output import end_of_command

    if gt and (moves(validation) or _without_plane(validation, gt)):
        if references or sensors or independent or witnesses or figures or output:
            raise click.UsageError(
                "trajectories, poses in space and positions take no options but --json, --all and "
                "--strict"
            )
        told = _in_time if moves(validation) else _in_space
        told(validation, gt, as_json=as_json, strict=strict, everything=everything)
        return
    folder, campaign = output, None
    with progress_bar("explaining") as progress:
        if validation.is_dir() or validation.name == "campaign.toml":
            if gt or references or sensors or independent or witnesses:
                raise click.UsageError(
                    "with a campaign folder, references, sensors, independent tables and witnesses "
                    "are stated in the table [explain] of its campaign.toml"
                )
            campaign, explanation, found, sections = _of_campaign(validation, progress)
            folder = output or campaign.results
        elif gt:
            explanation, found, sections = _of_files(
                validation, gt, references, sensors, independent, witnesses
            )
        else:
            raise click.UsageError(
                "give at least one GT table to explain with the validation table"
            )
        if folder is not None:
            files = _files(explanation, sections if figures else ())
            found = (*found, *_write(folder, None if output else campaign, files))
        elif figures:
            raise click.UsageError("--figures needs --output")
    if as_json:
        from validation.explain.telling.output import explanation_json
        from validation.report.terminal import print_json

        print_json({**explanation_json(explanation), "findings": found})
    else:
        _print(explanation, found, sections, folder, everything=everything)
    end_of_command(found, failed=False, strict=strict)


def _without_plane(validation: Path, gt: Sequence[Path]) -> bool:
    """Whether one of the tables has poses in space, or positions without heading."""
    from validation.campaign.stored import components_of
    from validation.poses.pose_table import PLANAR

    tables = [path for path in (validation, *gt) if path.is_file() and not moves(path)]
    return any(components_of(path) != PLANAR for path in tables)


def _in_space(
    validation: Path, gt: Sequence[Path], *, as_json: bool, strict: bool, everything: bool
) -> None:
    """The causes of errors of poses in space, or of positions, told and printed."""
    from validation.campaign.stored import read_tables
    from validation.commands.output import end_of_command, print_first_findings
    from validation.explain.loading import read_times
    from validation.explain.telling.in_space import space_findings, space_json, space_section
    from validation.explain.telling.section import explain_others
    from validation.report.terminal import print_json, print_table
    from validation.results import Table

    truth, *systems = read_tables([validation, *gt]).tables
    explained, found = explain_others(truth, systems, read_times(gt))
    found += [finding for one in explained for finding in space_findings(one)]
    if as_json:
        print_json({"systems": {o.system: space_json(o) for o in explained}, "findings": found})
    else:
        for block in space_section(explained).blocks if explained else ():
            if isinstance(block, Table):
                print_table(block)
        print_first_findings(found, everything=everything)
    end_of_command(found, strict=strict)


def _in_time(
    reference: Path, sources: Sequence[Path], *, as_json: bool, strict: bool, everything: bool
) -> None:
    """The causes of errors of moving sources, told and printed."""
    from validation.commands.output import end_of_command, print_first_findings
    from validation.explain.telling.in_time import (
        time_cause_table,
        time_findings,
        time_json,
        time_parameter_table,
    )
    from validation.report.terminal import print_json, print_table
    from validation.trajectories.causes.explanation import time_causes
    from validation.trajectories.formats import read_trajectory

    refuse_tables(sources)
    truth = read_trajectory(reference)
    explained = [time_causes(truth, read_trajectory(path)) for path in sources]
    found = [finding for one in explained for finding in time_findings(one)]
    if as_json:
        print_json(time_json(explained))
    else:
        print_table(time_cause_table(explained))
        for one in explained:
            if one.parameters:
                print_table(time_parameter_table(one))
        print_first_findings(found, everything=everything)
    end_of_command(found, strict=strict)


def _of_files(
    validation: Path,
    gt: tuple[Path, ...],
    references: tuple[str, ...],
    sensors: tuple[str, ...],
    independent: tuple[str, ...],
    witnesses: tuple[Path, ...],
) -> "tuple[Explanation, Sequence[Finding], Sequence[Section]]":
    """The explanation of single tables."""
    from validation.campaign.folder import Comparison
    from validation.campaign.stored import read_tables
    from validation.explain.analysis import Question
    from validation.explain.analysis import explain as explained
    from validation.explain.loading import read_times
    from validation.explain.telling.section import asked_limits, explain_sections, repeatability
    from validation.explain.telling.words import findings
    from validation.published.moving import at_stops

    still = [path for path in gt if not moves(path)]
    truth, *systems = read_tables([validation, *still]).tables
    moving = [at_stops(path, truth) for path in gt if moves(path)]
    systems += [table for one in moving for table in one.tables]
    groups = {name: tuple(value.split(",")) for name, value in _assignments(sensors)}
    stated = tuple(tuple(name.strip() for name in row.split(",")) for row in independent)
    there = [truth.system, *(one.system for one in systems)]
    if unknown := [name for row in stated for name in row if name not in there]:
        said = f"{', '.join(unknown)} is not there; there are {', '.join(there)}"
        raise click.UsageError(f"--independent: {said}")
    question = Question(
        references=dict(_assignments(references)),
        sensors=groups,
        times=read_times(still),
        witnesses=read_tables(witnesses, [path.stem for path in witnesses]).tables,
        independent=stated,
    )
    explanation = explained(truth, systems, question)
    sections = explain_sections(explanation, asked_limits(Comparison()), repeatability(explanation))
    found = [finding for one in moving for finding in one.findings]
    return explanation, [*findings(explanation), *found], sections


def _assignments(pairs: Sequence[str]) -> list[tuple[str, str]]:
    """('a', 'b') for each 'a=b'."""
    split = []
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name or not value:
            raise click.UsageError(f"'{pair}' is not of the form NAME=VALUE")
        split.append((name.strip(), value.strip()))
    return split


def _of_campaign(
    folder: Path, progress: "Progress"
) -> "tuple[Campaign, Explanation, Sequence[Finding], Sequence[Section]]":
    """The explanation of a campaign's results, run first where they are missing."""
    from validation.campaign.folder import load_campaign
    from validation.errors import GtvalError
    from validation.explain.telling.section import explain_campaign

    campaign = load_campaign(folder)
    tables, late = _tables(campaign, progress)
    parts = explain_campaign(campaign, tables)
    if parts.explanation is None:
        raise GtvalError(
            "there is nothing to explain: no planar system has a stop in common with the survey"
        )
    return campaign, parts.explanation, (*parts.findings, *late), parts.sections


def _tables(
    campaign: "Campaign", progress: "Progress"
) -> "tuple[Sequence[PoseTable], Sequence[Finding]]":
    """Tables under results/, or of a fresh run where some are missing, and what is out of date."""
    from validation.campaign.stored import stored_tables
    from validation.results import VALIDATION_SYSTEM

    found = stored_tables(campaign)
    named = {table.system for table in found.tables}
    if VALIDATION_SYSTEM in named and len(named) > 1:
        return found.tables, found.findings
    from validation.run import run_campaign
    from validation.run_files import write_results

    done = run_campaign(campaign, progress)
    write_results(done)
    return done.tables, ()


def _files(explanation: "Explanation", sections: "Sequence[Section]") -> "dict[str, str | bytes]":
    """Corrected poses, flags, numbers, and figures of the sections."""
    from validation.explain.telling.output import FOLDER, explanation_files
    from validation.results import Figure

    files = explanation_files(explanation)
    for section in sections:
        for block in section.blocks:
            if isinstance(block, Figure):
                from validation.report.svg import inline_svg

                files[f"{FOLDER}/{block.name}.svg"] = inline_svg(block, block.name)
    return files


def _write(
    folder: Path, campaign: "Campaign | None", files: "dict[str, str | bytes]"
) -> "Sequence[Finding]":
    """All files or none; in a campaign with what they were made from, and what is out of date."""
    from validation.solving import write_step
    from validation.text_files.writing import write_files

    if campaign is None:
        write_files(folder, files)
        return ()
    from validation.campaign.provenance import digest_of
    from validation.run import EXPLANATION

    poses = {path.name: digest_of(path) for path in sorted(folder.glob("poses_*.csv"))}
    return write_step(campaign, EXPLANATION, [campaign.folder], files, poses)


def _print(
    explanation: "Explanation",
    found: "Sequence[Finding]",
    sections: "Sequence[Section]",
    folder: Path | None,
    *,
    everything: bool,
) -> None:
    """One row a system and what asks for action; with everything, all tables too."""
    from validation.commands.output import print_first_findings
    from validation.explain.telling.output import FOLDER
    from validation.explain.telling.tables import cause_table
    from validation.report.terminal import print_table
    from validation.results import Table

    print_table(cause_table(explanation.systems))
    for section in sections if everything else ():
        for block in section.blocks:
            if isinstance(block, Table) and block.rows:
                print_table(block)
    print_first_findings(found, everything=everything)
    if folder is not None:
        click.echo(f"\nCorrected poses and numbers: {folder / FOLDER}")
