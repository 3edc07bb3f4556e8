"""The command ``gtval accuracy``."""

from math import degrees, isfinite, radians, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, STRICT

if TYPE_CHECKING:
    from survey.settings import Motion
    from survey.studies.accuracy import DetectableMotion, MotionCheck
    from validation.poses.pose_table import PoseTable
    from validation.results import Finding, Table


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

    Takes the motions of [[survey.motions]] in campaign.toml, or one given by options.
    """
    from survey.campaign.solve import solve_campaign
    from survey.settings import SurveySettings
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from validation.errors import GtvalError

    loaded = load_campaign(campaign)
    given = (start, end, dx, dy, dtheta)
    motions = loaded.section("survey", SurveySettings).motions
    if any(value is not None for value in given):
        motions = [_motion(start, end, dx, dy, dtheta, frame, in_degrees=in_degrees)]
    if not motions:
        raise GtvalError(
            f"{loaded.toml}: no [[survey.motions]] there, and none given by --start, --end, --dx, "
            "--dy, --dtheta"
        )
    poses = solve_campaign(loaded).poses
    if poses is None:
        raise GtvalError(f"{campaign}: the survey gives no poses")
    checks = [check_poses(poses, motion) for motion in motions]
    findings = [f for m, c in zip(motions, checks, strict=True) for f in motion_findings(m, c)]
    pairs = list(zip(motions, checks, strict=True))
    facts = [
        {"motion": motion, "check": check, "detectable": _detectable(check)}
        for motion, check in pairs
    ]
    tables = [motion_table(motion, check) for motion, check in pairs]
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


def check_poses(poses: "PoseTable", motion: "Motion") -> "MotionCheck":
    """The motion between two poses of a table, with their correlation where it is known."""
    import numpy as np

    from survey.studies.accuracy import check_motion

    pair = poses.select([motion.start, motion.end])
    covariance = pair.joint
    correlated = covariance is not None
    if covariance is None and pair.has_covariance.all():
        covariance = np.zeros((6, 6))
        covariance[:3, :3], covariance[3:, 3:] = pair.covariances
    real = np.array([motion.dx, motion.dy, motion.dtheta])
    start, end = pair.poses
    sigmas = None if motion.sigmas is None else np.array(motion.sigmas)
    return check_motion(start, end, covariance, real, motion.frame, sigmas, correlated=correlated)


def motion_table(motion: "Motion", check: "MotionCheck") -> "Table":
    """The document's table (real, measured, error), and what the error means."""
    from validation.results import Table

    names = ("ΔX [m]", "ΔY [m]", "Δθ [°]")
    detectable = _detectable(check)
    rows: list[list[str | float | None]] = []
    for i, name in enumerate(names):
        unit = degrees if i == 2 else float
        variance = check.covariance[i, i]
        least = None if detectable is None else unit(detectable.components[i])
        rows.append(
            [
                name,
                unit(check.real[i]),
                unit(check.measured[i]),
                unit(check.error[i]),
                unit(sqrt(variance)) if variance >= 0 else None,
                check.normalised[i],
                least,
            ]
        )
    axes = "the GTV frame" if motion.frame == "gtv" else f"pose {motion.start}"
    return Table(
        f"Motion from {motion.start} to {motion.end}, along the axes of {axes}",
        ["", "real", "measured", "error", "sigma", "error/sigma", "detectable"],
        rows,
        ["", ".6f", ".6f", "+.6f", ".6f", "+.2f", ".6f"],
        "Detectable: the smallest motion of this component alone that is seen with 95 % "
        "confidence and 80 % power.",
    )


def motion_findings(motion: "Motion", check: "MotionCheck") -> "list[Finding]":
    """Whether the survey saw the motion."""
    from math import isnan

    from validation.results import Finding

    subject = f"motion {motion.start} to {motion.end}"
    detectable = _detectable(check)
    if detectable is None or isnan(check.p_value):
        text = "The poses have no stated uncertainty, so the error cannot be judged."
        return [Finding("note", text, subject, "no_uncertainty")]
    agrees = check.p_value >= 0.05  # usual: one right survey in twenty is said to disagree
    verdict = (
        f"The survey {'agrees' if agrees else 'disagrees'} with the motion: error "
        f"{1e3 * check.error[0]:+.1f} mm, {1e3 * check.error[1]:+.1f} mm, "
        f"{degrees(check.error[2]):+.3f}° (chi-squared {check.squared:.1f} with 3 degrees of "
        f"freedom, p = {check.p_value:.2g})."
    )
    sees = (
        f"A shift in any direction is seen from {1e3 * float(detectable.any_direction):.1f} mm, a "
        f"turn from {degrees(detectable.components[2]):.2f}°."
    )
    findings = [Finding("good" if agrees else "warning", f"{verdict} {sees}", subject, "motion")]
    if not check.correlated:
        text = (
            "The correlation between the two poses is not known and was taken as none; poses of "
            "one survey share world points, so the uncertainty of the difference is overstated."
        )
        findings.append(Finding("note", text, subject, "no_correlation"))
    return findings


def _detectable(check: "MotionCheck") -> "DetectableMotion | None":
    import numpy as np

    from survey.studies.accuracy import detectable_motion

    if not np.isfinite(check.covariance).all():
        return None
    return detectable_motion(check.covariance)
