"""The accuracy experiment of a campaign: known motions, surveyed or published, and what they show.

AD2.3, "Accuracy experiments": pose 18 and, moved by 1 cm, 1 cm and one degree, pose 18'.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import degrees, isnan, radians, sqrt

import numpy as np
from scipy.special import chdtrc

from survey.campaign.outcome import SurveyOutcome
from survey.settings import Motion, SurveySettings
from survey.studies.accuracy import (
    DetectableMotion,
    MotionCheck,
    check_motion,
    detectable_motion,
    judge_motion,
)
from validation.campaign.folder import Campaign
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.results import Finding, Section, Severity, Size, SystemResult, Table
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.csv_text import csv_text

PARTS = ("dx", "dy", "dtheta")


@dataclass(frozen=True)
class CheckedMotion:
    """A known motion and what the survey made of it; ``published`` where that was printed."""

    motion: Motion
    check: MotionCheck
    published: bool = False

    @property
    def table(self) -> Table:
        """Real, measured, error."""
        return motion_table(self.motion, self.check, published=self.published)

    @property
    def findings(self) -> list[Finding]:
        """Whether the survey saw it."""
        found = motion_findings(self.motion, self.check)
        if not self.published or found[0].code != "motion":
            return found
        text = (
            f"{found[0].text} Its uncertainty is that of a survey as planned, every world point "
            "being read from every mark, and of a motion that was made exactly: neither was stated."
        )
        return [replace(found[0], severity="note", text=text), *found[1:]]


def published_motions(
    campaign: Campaign, settings: SurveySettings, predicted: Mapping[str, Array]
) -> list[CheckedMotion]:
    """Motions whose measured values were printed elsewhere; none where there is no file.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    settings : SurveySettings
        Name the file: start, end, real_dx, real_dy, real_dtheta_degrees, found_dx, ...
    predicted : mapping of str to (3, 3) array
        For each planned stop the covariance of a small motion of it, for want of a stated one.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    path = campaign.folder / settings.published_motions
    if not path.exists():
        return []
    shifts = [f"{what}_{part}" for what in ("real", "found") for part in PARTS[:2]]
    turns = [f"{what}_dtheta_degrees" for what in ("real", "found")]
    columns = [
        *(Column("start"), Column("end")),
        *(Column(name, "number", low=-100.0, high=100.0, unit="m") for name in shifts),
        *(Column(name, "number", low=-360.0, high=360.0) for name in turns),
    ]
    table = read_csv(path, columns)
    table.raise_problems()
    nothing = np.full((3, 3), np.nan)
    checked = []
    for row, (start, end) in enumerate(zip(table.text["start"], table.text["end"], strict=True)):
        real, found = (
            np.array([
                *(table.numbers[f"{what}_{part}"][row] for part in PARTS[:2]),
                radians(table.numbers[f"{what}_dtheta_degrees"][row]),
            ])
            for what in ("real", "found")
        )  # fmt: skip
        motion = Motion(start=start, end=end, **dict(zip(PARTS, real.tolist(), strict=True)))
        check = judge_motion(real, found, predicted.get(start, nothing))
        checked.append(CheckedMotion(motion, check, published=True))
    return checked


def motions_chapter(outcome: SurveyOutcome, predicted: Mapping[str, Array]) -> SystemResult:
    """All known motions of a campaign; ``predicted`` as of `published_motions`."""
    settings, poses = outcome.inputs.settings, outcome.poses
    checked, findings = [], []
    for motion in settings.motions:
        lost = [
            name for name in (motion.start, motion.end) if poses is None or name not in poses.ids
        ]
        if lost or poses is None:
            text = f"This known motion is not checked: there is no pose {' and '.join(lost)}."
            subject = f"motion {motion.start} to {motion.end}"
            findings.append(Finding("warning", text, subject, "motion_open"))
            continue
        checked.append(CheckedMotion(motion, check_poses(poses, motion)))
    checked += published_motions(outcome.campaign, settings, predicted)
    if not checked:
        return SystemResult(findings=findings)
    return SystemResult(
        findings=[*findings, *(finding for one in checked for finding in one.findings)],
        sections=[Section("Accuracy experiment", [one.table for one in checked])],
        files={"motions.csv": _motions_csv(checked)},
        overview=[one.table for one in checked],
    )


def _motions_csv(checked: list[CheckedMotion]) -> str:
    """One row a motion; angles in radians, errors measured less real."""
    rows = []
    for one in checked:
        check, source = one.check, "published" if one.published else "survey"
        sigmas = np.sqrt(np.diagonal(check.covariance))
        numbers = np.concatenate([check.real, check.measured, check.error, sigmas]).tolist()
        names = (one.motion.start, one.motion.end, source)
        rows.append([*names, one.motion.frame, *numbers, check.p_value])
    kinds = ("real", "measured", "error", "sigma")
    header = ["start", "end", "source", "frame", *(f"{k}_{p}" for k in kinds for p in PARTS)]
    return csv_text([*header, "p_value"], rows)


def check_poses(poses: PoseTable, motion: Motion) -> MotionCheck:
    """The motion between two poses of a table, with their correlation where it is known."""
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


def motion_table(motion: Motion, check: MotionCheck, *, published: bool = False) -> Table:
    """The document's table (real, measured, error), and what the error means."""
    names = ("ΔX [m]", "ΔY [m]", "Δθ [°]")
    seen = detectable(check)
    rows: list[list[str | float | None]] = []
    for i, name in enumerate(names):
        unit = degrees if i == 2 else float
        variance = check.covariance[i, i]
        least = None if seen is None else unit(seen.components[i])
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
    how = ", as published" if published else f", along the axes of {axes}"
    return Table(
        f"Motion from {motion.start} to {motion.end}{how}",
        ["", "real", "measured", "error", "sigma", "error/sigma", "detectable"],
        rows,
        ["", ".6f", ".6f", "+.6f", ".6f", "+.2f", ".6f"],
        "Detectable: the smallest motion of this component alone that is seen with 95 % "
        "confidence and 80 % power.",
    )


def motion_findings(motion: Motion, check: MotionCheck) -> list[Finding]:
    """Whether the survey saw the motion."""
    subject = f"motion {motion.start} to {motion.end}"
    seen = detectable(check)
    if seen is None or isnan(check.p_value):
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
        f"A shift in any direction is seen from {1e3 * float(seen.any_direction):.1f} mm, a "
        f"turn from {degrees(seen.components[2]):.2f}°."
    )
    parts = zip(("x", "y", "theta"), ("m", "m", "rad"), check.error, strict=True)
    sizes = tuple(Size(f"error in {name}", float(value), unit) for name, unit, value in parts)
    severity: Severity = "good" if agrees else "warning"
    findings = [Finding(severity, f"{verdict} {sees}", subject, "motion", sizes)]
    size = float(check.measured @ np.linalg.solve(check.covariance, check.measured))
    p_none, seen_at_all = float(chdtrc(3, size)), "is told from none"
    if p_none >= 0.05:  # usual, as above
        seen_at_all = "is not told from none"
    text = f"The motion {seen_at_all} (chi-squared {size:.0f}, p = {p_none:.2g})."
    severity = "good" if p_none < 0.05 else "note"
    findings.append(Finding(severity, text, subject, "motion_seen", (Size("chi-squared", size),)))
    if not check.correlated:
        text = (
            "The correlation between the two poses is not known and was taken as none; poses of "
            "one survey share world points, so the uncertainty of the difference is overstated."
        )
        findings.append(Finding("note", text, subject, "no_correlation"))
    return findings


def detectable(check: MotionCheck) -> DetectableMotion | None:
    """The smallest motion that would be noticed; None without a covariance."""
    if not np.isfinite(check.covariance).all():
        return None
    return detectable_motion(check.covariance)
