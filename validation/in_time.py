"""The trajectories of a campaign compared in time: what a run adds to its results and report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.explain.telling.in_time import (
    cause_json,
    time_cause_table,
    time_findings,
    time_parameter_table,
)
from validation.poses.trajectory import Trajectory
from validation.results import Finding, Section, Table
from validation.systems import Progress, no_progress
from validation.text_files.csv_text import csv_text
from validation.trajectories.alignment import parts_of
from validation.trajectories.causes.explanation import time_causes
from validation.trajectories.clock.estimate import sync
from validation.trajectories.clock.result import ClockEstimate, on_reference_clock
from validation.trajectories.clock.tables import (
    Tolerance,
    clock_findings,
    clock_json,
    clock_table,
    parts_table,
)
from validation.trajectories.comparison import TimeComparison, compare_in_time
from validation.trajectories.correlation_telling import correlation_section
from validation.trajectories.findings import findings_in_time, millimetres
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
    facts: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
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
    for key in ("reference", "odometry"):
        if (value := getattr(settings, key)) and value not in by_name:
            there = ", ".join(by_name) or "none"
            said = f"no system of that name has a trajectory; there are: {there}"
            raise InputError([Problem(campaign.toml, said, field=f"time.{key}", value=value)])
    if len(by_name) < 2:
        return None
    correlated = TimeParts(sections=_correlated(settings, by_name))
    if not settings.reference:
        text = (
            f"The trajectories of {', '.join(by_name)} are not compared with each other: write "
            '[time] and reference = "NAME" in campaign.toml to say which is the reference.'
        )
        note = TimeParts(findings=(Finding("note", text, "time", "no_time_reference"),))
        return _joined([correlated, note])
    reference = by_name.pop(settings.reference)
    sources = list(by_name.values())
    parts, clocks = _clocks(campaign, settings, reference, sources, progress)
    for number, source in enumerate(sources):
        progress(f"comparing {source.system} in time", 0.5 + 0.5 * number / len(sources))
        parts.append(_of_source(campaign, settings, reference, source, clocks[source.system]))
    return _joined([correlated, *parts])


def _correlated(settings: TimeSettings, by_name: Mapping[str, Trajectory]) -> tuple[Section, ...]:
    """Headings against those of the odometry; the reference's only where there is no other."""
    if not settings.odometry:
        return ()
    others = [one for name, one in by_name.items() if name != settings.odometry]
    judged = [one for one in others if one.system != settings.reference]
    return (correlation_section(by_name[settings.odometry], judged or others),)


def _joined(parts: Sequence[TimeParts]) -> TimeParts:
    """All parts as one; what is known of a system stands together."""
    facts: dict[str, dict[str, object]] = {}
    for part in parts:
        for name, known in part.facts.items():
            facts.setdefault(name, {}).update(known)
    return TimeParts(
        tuple(one for part in parts for one in part.comparisons),
        tuple(one for part in parts for one in part.findings),
        tuple(one for part in parts for one in part.sections),
        facts,
        {name: text for part in parts for name, text in part.files.items()},
    )


def _clocks(
    campaign: Campaign,
    settings: TimeSettings,
    reference: Trajectory,
    sources: Sequence[Trajectory],
    progress: Progress,
) -> tuple[list[TimeParts], Mapping[str, ClockEstimate]]:
    """The clock of every source, and what is said of them."""
    confidence = campaign.settings.comparison.confidence
    tolerance = Tolerance(settings.limit, settings.limit_angle)
    found = sync(
        reference,
        sources,
        window=settings.window,
        confidence=confidence,
        progress=lambda what, share: progress(what, 0.5 * share),
    )
    estimates = list(found.values())
    tables = [clock_table(estimates), *(parts_table(one) for one in estimates if one.parts)]
    told = TimeParts(
        findings=tuple(said for one in estimates for said in clock_findings(one, tolerance)),
        sections=(Section("Clocks", tables),),
        facts={one.source: {"clock": clock_json(one, tolerance)} for one in estimates},
    )
    return [told], found


def _of_source(
    campaign: Campaign,
    settings: TimeSettings,
    reference: Trajectory,
    source: Trajectory,
    clock: ClockEstimate,
) -> TimeParts:
    """One trajectory against the reference: its errors, and where they come from."""
    name = source.system
    try:
        parts = parts_of(settings.align)
    except GtvalError as error:
        problem = Problem(campaign.toml, str(error), field="time.align", value=settings.align)
        raise InputError([problem]) from None
    if source.frame == OWN_FRAME:
        parts = tuple({"frame": None, **dict.fromkeys(parts)})
    confidence = campaign.settings.comparison.confidence
    right = on_reference_clock(source, clock) if clock.verdict == "determined" else source
    try:
        comparison = compare_in_time(reference, source, parts, confidence=confidence)
        corrected = compare_in_time(reference, right, parts, confidence=confidence)
    except GtvalError as error:
        text = f"Not compared with '{reference.system}' in time: {error}"
        return TimeParts(findings=(Finding("error", text, name, "not_comparable"),))
    said = findings_in_time(comparison, settings.limit)
    # By medians: a few wrong poses leave the root mean square as large as it was.
    if np.median(corrected.distances) < DELAY_SHARE * np.median(comparison.distances):
        right_stamps = findings_in_time(corrected, settings.limit)
        said = [one for one in said if one.code not in FOLLOWING]
        said += [one for one in right_stamps if one.code in FOLLOWING]
        said.append(_without_delay(comparison, corrected))
    said = [one for one in said if one.code not in REPEATED]
    section = section_in_time(comparison, settings.limit)
    causes, blocks, facts = _causes(reference, right)
    return TimeParts(
        (comparison,),
        (*said, *causes),
        (Section(section.title, [*section.blocks, *blocks]),),
        {name: {**comparison_json(comparison, settings.limit), **facts}},
        {f"errors_in_time_{name}.csv": errors_in_time(comparison)},
    )


def _without_delay(comparison: TimeComparison, corrected: TimeComparison) -> Finding:
    """What is left once the stamps are right."""
    text = (
        f"With right stamps the median of its position error would be "
        f"{millimetres(float(np.median(corrected.distances)))} in place of "
        f"{millimetres(float(np.median(comparison.distances)))}. Its bias, its NEES and its worst "
        "stretches are told with right stamps."
    )
    return Finding("note", text, comparison.system, "without_delay")


def _causes(
    reference: Trajectory, source: Trajectory
) -> tuple[list[Finding], list[Table], dict[str, object]]:
    """Where the errors of a source with right stamps come from."""
    try:
        explained = time_causes(reference, source)
    except GtvalError as error:
        text = f"Not explained in time: {error}"
        return [Finding("note", text, source.system, "not_explained")], [], {}
    blocks = [time_cause_table([explained])]
    blocks += [time_parameter_table(explained)] if explained.parameters else []
    return time_findings(explained, CLOCK), blocks, {"causes": cause_json(explained)}


OWN_FRAME = "own"
"""What a trajectory's ``frame`` says where its coordinates are not those of the GTV frame."""
CLOCK = ("delay", "clock_drift")
"""Causes that the clocks tell."""
REPEATED = frozenset({"delay_suspected", "other_frame"})
"""Findings of a comparison that the clock and the causes tell with more certainty."""
FOLLOWING = frozenset({"worst_stretches", "bias", "nees"})
"""Findings that say no more than the delay where most of the errors are its: they are then those
of the poses with right stamps."""
DELAY_SHARE = 0.5
"""Of the median position error that must be left without the delay, for the delay not to be most
of it."""


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
