"""The command ``gtval accuracy``."""

from math import isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, STRICT

if TYPE_CHECKING:
    from survey.settings import Motion


@click.command()
@CAMPAIGN
@AS_JSON
@STRICT
@click.option("--start", help="Pose before the motion.")
@click.option("--end", help="Pose after it.")
@click.option("--dx", type=float, help="Real motion along x, metres.")
@click.option("--dy", type=float, help="Real motion along y, metres.")
@click.option("--dtheta", type=float, help="Real turn, radians.")
@click.option("--degrees", "in_degrees", is_flag=True, help="--dtheta is in degrees.")
@click.option(
    "--frame",
    type=click.Choice(["gtv", "robot"]),
    default="gtv",
    show_default=True,
    help="Axes of the motion: the GTV frame's, or the start pose's own.",
)
def accuracy(
    *,
    campaign: Path,
    as_json: bool,
    strict: bool,
    start: str | None,
    end: str | None,
    dx: float | None,
    dy: float | None,
    dtheta: float | None,
    in_degrees: bool,
    frame: str,
) -> None:
    """Whether the survey saw a known small motion between two of its poses.

    Takes the motions of [[survey.motions]] in campaign.toml and those whose measured values were
    published, or one given by options.
    """
    from survey.campaign.solve import solve_campaign
    from survey.chapters.motions import CheckedMotion, check_poses, detectable, published_motions
    from survey.chapters.planned import plan_chapter
    from survey.settings import SurveySettings
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from validation.errors import GtvalError

    loaded = load_campaign(campaign)
    given = (start, end, dx, dy, dtheta)
    settings = loaded.section("survey", SurveySettings)
    motions, published = settings.motions, (loaded.folder / settings.published_motions).exists()
    if any(value is not None for value in given):
        motions = [_motion(start, end, dx, dy, dtheta, frame, in_degrees=in_degrees)]
        published = False
    if not motions and not published:
        raise GtvalError(
            f"{loaded.toml}: no [[survey.motions]] there, and none given by --start, --end, --dx, "
            "--dy, --dtheta"
        )
    outcome = solve_campaign(loaded)
    poses = outcome.poses
    if motions and poses is None:
        raise GtvalError(f"{campaign}: the survey gives no poses")
    checked = [
        CheckedMotion(motion, check_poses(poses, motion)) for motion in motions if poses is not None
    ]
    if published:
        checked += published_motions(loaded, settings, plan_chapter(outcome)[1])
    facts = [
        {
            "motion": one.motion,
            "check": one.check,
            "detectable": detectable(one.check),
            "published": one.published,
        }
        for one in checked
    ]
    tables = [one.table for one in checked]
    findings = [finding for one in checked for finding in one.findings]
    tell_check({"motions": facts}, tables, findings, as_json=as_json, strict=strict)


def _motion(
    start: str | None,
    end: str | None,
    dx: float | None,
    dy: float | None,
    dtheta: float | None,
    frame: str,
    *,
    in_degrees: bool,
) -> "Motion":
    """The motion of the options."""
    from survey.settings import Motion

    if start is None or end is None or dx is None or dy is None or dtheta is None:
        raise click.UsageError("--start, --end, --dx, --dy and --dtheta belong together")
    if not all(isfinite(value) for value in (dx, dy, dtheta)):
        raise click.BadParameter("--dx, --dy and --dtheta must be finite")
    turn = radians(dtheta) if in_degrees else dtheta
    fields = {"start": start, "end": end, "dx": dx, "dy": dy, "dtheta": turn, "frame": frame}
    return Motion.model_validate(fields)
