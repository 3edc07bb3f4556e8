"""The command ``gtval laser`` with its steps: solve, inspect, decide, check-mount."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import (
    AS_JSON,
    AS_PUBLISHED,
    CAMPAIGN,
    STRICT,
    WORKERS,
    progress_bar,
)
from validation.commands.solve import CampaignGroup, solve_command

if TYPE_CHECKING:
    from laser_gt.campaign.outcome import LaserOutcome
    from laser_gt.placing.engines import Engine
    from validation.campaign.folder import Campaign

ENGINES = click.option(
    "--engine",
    "engines",
    type=click.Choice(["scanmatch", "genetic"]),
    multiple=True,
    callback=lambda _context, _option, chosen: chosen or None,
    help="What matches the scans; may be given twice. Default: as campaign.toml says.",
)


@click.group(cls=CampaignGroup)
def laser() -> None:
    """Robot poses from laser scans: match, judge, inspect, place.

    Never use laser poses as ground truth for a method that uses the same laser.
    """


laser.add_command(
    solve_command(
        "laser",
        """Match all scans, judge every match, and compute the robot poses.

        Writes poses_laser_scanmatch.csv, poses_laser_genetic.csv and laser_matches_*.csv to
        CAMPAIGN/results: all of them, or none if anything fails.
        """,
        [ENGINES, AS_PUBLISHED],
    )
)


laser.add_command(
    solve_command(
        "laser_drive",
        """Make a trajectory of a log of scans that was taken while driving.

        Writes trajectory_laser_drive.csv and, where the robot stood at named stops,
        poses_laser_drive.csv to CAMPAIGN/results: all of them, or none if anything fails.
        """,
        [WORKERS],
        name="drive",
    )
)


def _solved(
    folder: Path, engines: "tuple[Engine, ...]", *, need_poses: bool
) -> "tuple[Campaign, LaserOutcome]":
    """The campaign and what laser GT makes of it, whose matches are kept for the next command."""
    from laser_gt.campaign.result_files import kept_files
    from laser_gt.campaign.solve import solve_campaign
    from validation.campaign.folder import load_campaign
    from validation.solving import solve_validation
    from validation.systems import installed_systems
    from validation.text_files.writing import write_files

    campaign = solve_validation(load_campaign(folder), installed_systems())
    with progress_bar("laser") as report:
        outcome = solve_campaign(campaign, report, engines=engines, need_poses=need_poses)
    write_files(campaign.results, kept_files(outcome))
    return campaign, outcome


@laser.command()
@CAMPAIGN
@AS_JSON
@ENGINES
@click.option(
    "--most",
    type=click.IntRange(1),
    default=200,
    show_default=True,
    help="Pairs drawn; the doubtful ones come first.",
)
def inspect(campaign: Path, as_json: bool, engines: "tuple[Engine, ...] | None", most: int) -> None:
    """Write a gallery of the matches to CAMPAIGN/report/laser_matches.html.

    Each pair is shown before and after, with its verdict, the reasons, and the command that
    records a decision about it.
    """
    from laser_gt.commands.gallery import gallery
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    loaded, outcome = _solved(campaign, engines or ("scanmatch",), need_poses=False)
    matches = [match for matching in outcome.matchings.values() for match in matching.matches]
    page = gallery(matches, outcome.inputs.by_stop, str(campaign), most)
    write_files(loaded.report, {"laser_matches.html": page})
    path = loaded.report / "laser_matches.html"
    to_see = [[m.reference, m.moving] for m in matches if m.verdict == "may be wrong"]
    if as_json:
        print_json({"page": path, "may_be_wrong": to_see, "matches": len(matches)})
        return
    said = f"{len(to_see)} of {len(matches)} matches may be wrong and wait for your decision."
    click.echo(f"{said}\nGallery: {path}")


@laser.command(context_settings={"ignore_unknown_options": True})
@CAMPAIGN
@click.argument("reference")
@click.argument("moving")
@click.argument("decision", type=click.Choice(["accept", "reject", "guess", "open"]))
@click.argument("pose", type=float, nargs=-1)
@AS_JSON
@click.option("--by", default="", help="Who or what decided.")
@click.option("--note", default="", help="Why.")
def decide(
    campaign: Path,
    reference: str,
    moving: str,
    decision: str,
    pose: tuple[float, ...],
    as_json: bool,
    by: str,
    note: str,
) -> None:
    """Record a decision about the pair REFERENCE MOVING: accept, reject, guess X Y THETA, or open.

    It is added to the campaign's decisions file, where the last one about a pair counts, and the
    next run obeys it. The guess is the moving laser frame in the reference laser frame; 'open'
    takes back what was decided before.
    """
    from datetime import datetime

    import numpy as np

    from laser_gt.campaign.inputs import load_inputs
    from laser_gt.logs.decision_file import append_decision
    from laser_gt.logs.decisions import Decision
    from laser_gt.settings import LaserSettings
    from validation.campaign.folder import load_campaign
    from validation.report.terminal import print_json

    loaded = load_campaign(campaign)
    settings = loaded.section("laser", LaserSettings)
    stops = load_inputs(loaded, settings).stops
    path = loaded.folder / settings.decisions
    guess = np.array(pose) if pose else None
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    made = Decision(reference, moving, decision, guess, by, note)
    append_decision(path, made, stops, now)
    if as_json:
        print_json({"decisions": path, "pair": [reference, moving], "decision": decision})
        return
    click.echo(f"Recorded in {path}.")


def _pairs(
    _context: click.Context, _option: click.Parameter, values: tuple[str, ...]
) -> list[tuple[str, str]]:
    """Pairs such as 13-14."""
    pairs = []
    for value in values:
        first, _, second = value.partition("-")
        if not first or not second or first == second:
            raise click.BadParameter(f"{value!r} is no pair of stops, such as 13-14")
        pairs.append((first, second))
    return pairs


@laser.command("check-mount")
@CAMPAIGN
@AS_JSON
@STRICT
@click.option(
    "--pair",
    "pairs",
    multiple=True,
    metavar="A-B",
    callback=_pairs,
    help="Stops whose scans are laid over each other; may be given several times.",
)
def check_mount(campaign: Path, as_json: bool, strict: bool, pairs: list[tuple[str, str]]) -> None:
    """Compare the stated place of the laser on the robot with the one the data show.

    Writes CAMPAIGN/report/laser_mount_overlay.png: scans of pairs of stops laid over each other
    through the surveyed poses, with the stated mount and with the one found, and as matched.
    """
    from laser_gt.campaign.facts import laser_facts
    from laser_gt.campaign.findings import laser_findings
    from laser_gt.campaign.overlays import chosen_pairs, overlay_figure, overlay_table, overlays
    from laser_gt.campaign.sections import mount_table
    from validation.commands.output import tell_check
    from validation.errors import GtvalError
    from validation.figures.writing import write_figure

    loaded, outcome = _solved(campaign, ("scanmatch",), need_poses=True)
    if outcome.mount_check is None and not pairs:
        raise GtvalError(f"the mount cannot be checked: {outcome.mount_note}")
    shown = overlays(outcome, chosen_pairs(outcome, pairs))
    path = loaded.report / "laser_mount_overlay.png"
    write_figure(path, overlay_figure(outcome, shown).draw())
    check = outcome.mount_check
    tell_check(
        {"mount": laser_facts(outcome)["mount"], "pairs": shown, "overlay": path},
        [*([] if check is None else [mount_table(check)]), overlay_table(shown)],
        [one for one in laser_findings(outcome) if one.code.startswith("mount")],
        as_json=as_json,
        strict=strict,
        more=f"Overlay: {path}",
    )


COMMANDS: list[click.Command] = [laser]
