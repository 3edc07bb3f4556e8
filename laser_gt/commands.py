"""The command ``gtval laser`` with its steps: solve, inspect, decide, check-mount."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from laser_gt.campaign.outcome import LaserOutcome
    from laser_gt.campaign.solve import Engine
    from validation.campaign.folder import Campaign

ENGINE = click.option(
    "--engine",
    type=click.Choice(["scanmatch", "genetic"]),
    multiple=True,
    help="What matches the scans; may be given twice. Default: as campaign.toml says.",
)


@click.group()
def laser() -> None:
    """Robot poses from laser scans: match, judge, inspect, place.

    Never use laser poses as ground truth for a method that uses the same laser.
    """


@laser.command()
@CAMPAIGN
@AS_JSON
@ENGINE
@click.option("--as-published", is_flag=True, help="Also the document's way, for comparison.")
@click.option("--dry-run", is_flag=True, help="Print only; write nothing.")
def solve(
    campaign: Path, as_json: bool, engine: tuple[str, ...], as_published: bool, dry_run: bool
) -> None:
    """Match all scans, judge every match, and compute the robot poses.

    Writes poses_laser_scanmatch.csv, poses_laser_genetic.csv and laser_matches_*.csv to
    CAMPAIGN/results: all of them, or none if anything fails.
    """
    from laser_gt.campaign.findings import laser_facts
    from laser_gt.system import result_of
    from validation.poses.pose_files import pose_files
    from validation.report.terminal import print_findings, print_json, print_table
    from validation.text_files.writing import write_files

    loaded, outcome = _solved(campaign, engine, as_published=as_published)
    result = result_of(outcome)
    if not dry_run:
        tables = pose_files(result.tables)
        write_files(loaded.results, {**result.files, **tables})
    if as_json:
        print_json({**laser_facts(outcome), "findings": result.findings})
        return
    from laser_gt.campaign.sections import pose_table, verdict_table

    for matching in outcome.matchings.values():
        print_table(verdict_table(matching))
    for solution in outcome.solutions.values():
        print_table(pose_table(solution))
    print_findings(result.findings)
    if not dry_run:
        click.echo(f"\nResults: {loaded.results}")


def _solved(
    campaign: Path,
    engines: "Sequence[str]",
    *,
    as_published: bool = False,
    need_poses: bool = True,
) -> "tuple[Campaign, LaserOutcome]":
    """The campaign and what laser GT makes of it."""
    from laser_gt.campaign.outcome import solve_campaign
    from validation.campaign.folder import load_campaign

    loaded = load_campaign(campaign)
    chosen: Sequence[Engine] | None = [
        "genetic" if name == "genetic" else "scanmatch" for name in dict.fromkeys(engines)
    ] or None
    with progress_bar("laser") as report:
        return loaded, solve_campaign(
            loaded, report, engines=chosen, as_published=as_published, need_poses=need_poses
        )


@laser.command()
@CAMPAIGN
@AS_JSON
@ENGINE
@click.option(
    "--most",
    type=click.IntRange(1),
    default=200,
    show_default=True,
    help="Pairs drawn; the doubtful ones come first.",
)
def inspect(campaign: Path, as_json: bool, engine: tuple[str, ...], most: int) -> None:
    """Write a gallery of the matches to CAMPAIGN/report/laser_matches.html.

    Each pair is shown before and after, with its verdict, the reasons, and the command that
    records a decision about it.
    """
    from laser_gt.inspection import gallery
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    loaded, outcome = _solved(campaign, engine or ("scanmatch",), need_poses=False)
    sweeps = dict(zip(outcome.inputs.stops, outcome.inputs.sweeps, strict=True))
    matches = [match for matching in outcome.matchings.values() for match in matching.matches]
    page = gallery(matches, sweeps, str(campaign), most)
    write_files(loaded.report, {"laser_matches.html": page})
    path = loaded.report / "laser_matches.html"
    to_see = [[m.reference, m.moving] for m in matches if m.verdict == "look"]
    if as_json:
        print_json({"page": path, "look": to_see, "matches": len(matches)})
        return
    click.echo(f"{len(to_see)} of {len(matches)} matches need eyes.\nGallery: {path}")


@laser.command(context_settings={"ignore_unknown_options": True})
@CAMPAIGN
@click.argument("reference")
@click.argument("moving")
@click.argument("decision", type=click.Choice(["accept", "reject", "guess"]))
@click.argument("pose", type=float, nargs=-1)
@click.option("--by", default="", help="Who or what decided.")
@click.option("--note", default="", help="Why.")
def decide(
    campaign: Path,
    reference: str,
    moving: str,
    decision: str,
    pose: tuple[float, ...],
    by: str,
    note: str,
) -> None:
    """Record a decision about the pair REFERENCE MOVING: accept, reject, or guess X Y THETA.

    It is added to the campaign's decisions file, where the last one about a pair counts, and the
    next run obeys it. The guess is the moving laser frame in the reference laser frame.
    """
    from datetime import datetime

    import numpy as np

    from laser_gt.campaign.inputs import load_inputs
    from laser_gt.logs.decisions import Decision, append_decisions
    from laser_gt.settings import LaserSettings
    from validation.campaign.folder import load_campaign
    from validation.errors import InputError, Problem

    loaded = load_campaign(campaign)
    settings = loaded.section("laser", LaserSettings)
    stops = load_inputs(loaded, settings).stops
    path = loaded.folder / settings.decisions
    problems = [
        Problem(path, "no scan of this stop", None, name, stop)
        for name, stop in (("reference", reference), ("moving", moving))
        if stop not in stops
    ]
    wanted = 3 if decision == "guess" else 0
    if len(pose) != wanted:
        text = f"'{decision}' takes {wanted} numbers after it" + (": X Y THETA" if wanted else "")
        problems.append(Problem(path, text, None, "x", " ".join(map(str, pose)) or None))
    elif not np.isfinite(pose).all():
        problems.append(Problem(path, "a guess must be finite", None, "x"))
    if reference == moving:
        problems.append(
            Problem(path, "the same stop twice; a pair has two", None, "moving", moving)
        )
    if problems:
        raise InputError(problems)
    guess = np.array(pose) if pose else None
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    append_decisions(path, [Decision(reference, moving, decision, guess, by, note)], now)
    click.echo(f"Recorded in {path}.")


@laser.command("check-mount")
@CAMPAIGN
@AS_JSON
def check_mount(campaign: Path, as_json: bool) -> None:
    """Compare the stated place of the laser on the robot with the one the data show.

    Writes CAMPAIGN/report/laser_mount_overlay.png: two scans laid over each other through the
    surveyed poses, with the stated mount and with the one found.
    """
    from laser_gt.campaign.findings import laser_facts, laser_findings
    from laser_gt.campaign.sections import mount_table, overlay_figure
    from validation.errors import GtvalError
    from validation.figures.writing import write_figure
    from validation.report.terminal import print_findings, print_json, print_table

    loaded, outcome = _solved(campaign, ("scanmatch",))
    if outcome.mount_check is None:
        raise GtvalError(f"the mount cannot be checked: {outcome.mount_note}")
    path = loaded.report / "laser_mount_overlay.png"
    write_figure(path, overlay_figure(outcome, outcome.mount_check).draw())
    if as_json:
        print_json({"mount": laser_facts(outcome)["mount"], "overlay": path})
        return
    print_table(mount_table(outcome.mount_check))
    print_findings([one for one in laser_findings(outcome) if one.code.startswith("mount")])
    click.echo(f"\nOverlay: {path}")


COMMANDS: list[click.Command] = [laser]
