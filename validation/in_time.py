"""The trajectories of a campaign compared in time: what a run adds to its results and report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.trajectory import Trajectory
from validation.results import Finding, Section
from validation.systems import Progress, no_progress
from validation.text_files.csv_text import csv_text
from validation.trajectories.alignment import parts_of
from validation.trajectories.comparison import TimeComparison, compare_in_time
from validation.trajectories.findings import findings_in_time
from validation.trajectories.settings import TimeSettings
from validation.trajectories.telling import comparison_json, section_in_time


@dataclass(frozen=True)
class TimeParts:
    """What goes into the results and the report.

    Parameters
    ----------
    comparisons : tuple of TimeComparison
        One for each trajectory but the reference.
    findings : tuple of Finding
        In words.
    sections : tuple of Section
        Tables and figures.
    facts : mapping
        Of every system, for ``--json`` and results/run.json.
    files : mapping of str to str
        By names relative to results/.
    """

    comparisons: tuple[TimeComparison, ...] = ()
    findings: tuple[Finding, ...] = ()
    sections: tuple[Section, ...] = ()
    facts: Mapping[str, object] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)


def time_parts(
    campaign: Campaign, trajectories: Sequence[Trajectory], progress: Progress = no_progress
) -> TimeParts | None:
    """Each trajectory against the one that campaign.toml names as the reference.

    Parameters
    ----------
    campaign : Campaign
        For its [time] table.
    trajectories : sequence of Trajectory
        Of all systems that move.
    progress : callable
        Called with what is being done and the share done.

    Returns
    -------
    TimeParts or None
        None where there are not two trajectories to compare.

    Raises
    ------
    InputError
        If the [time] table is bad or names a system without a trajectory.
    """
    settings = campaign.section("time", TimeSettings)
    by_name = {one.system: one for one in trajectories}
    if settings.reference and settings.reference not in by_name:
        there = ", ".join(by_name) or "none"
        said = f"no system of that name has a trajectory; there are: {there}"
        problem = Problem(campaign.toml, said, field="time.reference", value=settings.reference)
        raise InputError([problem])
    if len(by_name) < 2:
        return None
    if not settings.reference:
        text = (
            f"The trajectories of {', '.join(by_name)} are not compared with each other: write "
            '[time] and reference = "NAME" in campaign.toml to say which is the reference.'
        )
        return TimeParts(findings=(Finding("note", text, "time", "no_time_reference"),))
    reference = by_name.pop(settings.reference)
    parts = TimeParts()
    for number, source in enumerate(by_name.values()):
        progress(f"comparing {source.system} in time", number / len(by_name))
        parts = _joined(parts, _of_source(campaign, settings, reference, source))
    return parts


def _joined(a: TimeParts, b: TimeParts) -> TimeParts:
    return TimeParts(
        a.comparisons + b.comparisons,
        a.findings + b.findings,
        a.sections + b.sections,
        {**a.facts, **b.facts},
        {**a.files, **b.files},
    )


def _of_source(
    campaign: Campaign, settings: TimeSettings, reference: Trajectory, source: Trajectory
) -> TimeParts:
    """One trajectory against the reference."""
    name = source.system
    try:
        parts = parts_of(settings.align)
    except GtvalError as error:
        problem = Problem(campaign.toml, str(error), field="time.align", value=settings.align)
        raise InputError([problem]) from None
    try:
        comparison = compare_in_time(
            reference, source, parts, confidence=campaign.settings.comparison.confidence
        )
    except GtvalError as error:
        text = f"Not compared with '{reference.system}' in time: {error}"
        return TimeParts(findings=(Finding("error", text, name, "not_comparable"),))
    return TimeParts(
        (comparison,),
        tuple(findings_in_time(comparison, settings.limit)),
        (section_in_time(comparison, settings.limit),),
        {name: comparison_json(comparison, settings.limit)},
        {f"errors_in_time_{name}.csv": errors_in_time(comparison)},
    )


def errors_in_time(comparison: TimeComparison) -> str:
    """Every error of a comparison as CSV text: metres, radians, seconds since the epoch."""
    along, across = comparison.along_across
    columns = {"time": comparison.times + comparison.pairs.reference.epoch}
    for number, component in enumerate(comparison.components):
        columns[f"d{component.name}"] = comparison.errors[:, number]
    columns |= {"along": along, "across": across, "speed": comparison.motion.speed}
    columns["nees"] = comparison.nees
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return csv_text(list(columns), rows)
