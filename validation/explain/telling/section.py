"""What the explanation adds to a report: sections, findings and files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

from validation.errors import GtvalError
from validation.explain.analysis import Explanation, SystemExplanation, explain
from validation.explain.loading import campaign_question, split_validation, unknown_systems
from validation.explain.sources.equivalence import paired_comparison
from validation.explain.sources.repeatability import (
    REVISIT_RADIUS,
    Repeatability,
    repeated_runs,
    revisits,
)
from validation.explain.space.explanation import SpaceExplanation, explain_in_space
from validation.explain.telling.in_space import space_findings, space_json, space_section
from validation.explain.telling.output import FOLDER, explanation_files
from validation.explain.telling.tables import (
    before_after_table,
    candidate_table,
    good_enough_table,
    noise_table,
    paired_table,
    parameter_table,
    repeatability_table,
    suspect_table,
    verdict_table,
)
from validation.explain.telling.words import findings
from validation.poses.pose_table import PLANAR, PoseTable
from validation.results import Figure, Finding, Section, Table, Text
from validation.text_files.json_text import json_text
from validation.text_files.writing import Content

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.campaign.folder import Campaign, Comparison


@dataclass(frozen=True)
class ExplainParts:
    """What goes into the report.

    Parameters
    ----------
    explanation : Explanation, optional
        The numbers; None where there was nothing to explain.
    sections : tuple of Section
        Tables and figures.
    findings : tuple of Finding
        In words.
    files : mapping of str to str or bytes
        By names relative to results/.
    """

    explanation: Explanation | None
    sections: tuple[Section, ...]
    findings: tuple[Finding, ...]
    files: Mapping[str, Content]


def explain_campaign(campaign: "Campaign", tables: Sequence[PoseTable]) -> ExplainParts:
    """The explanation of a campaign's errors.

    Parameters
    ----------
    campaign : Campaign
        For its [explain] table.
    tables : sequence of PoseTable
        The validation poses and those of all systems; tables that are not planar, or have no
        stop in common with the validation, are left out and named.

    Raises
    ------
    GtvalError
        If the [explain] table or one of its files is bad, or a reference does not exist.
    """
    from validation.explain.settings import ExplainSettings  # noqa: PLC0415  (pydantic is slow)

    settings = campaign.section("explain", ExplainSettings)
    validation, others = split_validation(tables)
    fit = [one for one in others if one.components == PLANAR and set(one.ids) & set(validation.ids)]
    if validation.components != PLANAR:
        fit = []
    spatial, left_out = explain_others(validation, [one for one in others if one not in fit])
    told = [space_section(spatial)] if spatial else []
    left_out += [finding for one in spatial for finding in space_findings(one)]
    left_out += unknown_systems(campaign, settings, [one.system for one in others])
    if not fit:
        return ExplainParts(None, tuple(told), tuple(left_out), _space_files(spatial))
    question = campaign_question(campaign, settings, [one.system for one in fit])
    explanation = explain(validation, fit, question)
    found = repeatability(explanation, settings.runs, settings.revisit_radius)
    return ExplainParts(
        explanation,
        (*explain_sections(explanation, asked_limits(campaign.settings.comparison), found), *told),
        (*findings(explanation), *left_out),
        {**explanation_files(explanation), **_space_files(spatial)},
    )


def explain_others(
    validation: PoseTable, others: Sequence[PoseTable], times: Mapping[str, float] | None = None
) -> tuple[list[SpaceExplanation], list[Finding]]:
    """Poses in space and positions explained one by one, and those that cannot be.

    Parameters
    ----------
    validation : PoseTable
        The validation poses or positions.
    others : sequence of PoseTable
        Systems of which one side is not planar.
    times : mapping of str to float, optional
        Seconds of the stops of a moving robot.
    """
    explained, left_out = [], []
    for one in others:
        try:
            explained.append(explain_in_space(validation, one, times))
        except GtvalError as error:
            left_out.append(Finding("note", f"Not explained: {error}", one.system, "not_explained"))
    return explained, left_out


def _space_files(explained: Sequence[SpaceExplanation]) -> dict[str, Content]:
    """All numbers, by names relative to results/."""
    if not explained:
        return {}
    numbers = {one.system: space_json(one) for one in explained}
    return {f"{FOLDER}/explanation_in_space.json": json_text(numbers)}


def asked_limits(asked: "Comparison") -> tuple[float, ...]:
    """What is asked of x, y and theta, in metres and radians."""
    return (asked.acceptable_bias_length,) * 2 + (asked.acceptable_bias_angle,)


def repeatability(
    explanation: Explanation,
    runs: Mapping[str, Sequence[str]] | None = None,
    radius: float = REVISIT_RADIUS,
) -> list[tuple[str, str, Repeatability]]:
    """Repeatability over the runs that are named, and where a path comes back.

    Parameters
    ----------
    explanation : Explanation
        For the tables.
    runs : mapping of str to sequence of str, optional
        Systems that are repeated runs of one, by its name.
    radius : float
        Stops closer than this (metres) are the same place.

    Raises
    ------
    GtvalError
        If a run is named that is not there.
    """
    tables = {one.system: one.table for one in explanation.systems}
    rows = []
    for name, members in (runs or {}).items():
        missing = [run for run in members if run not in tables]
        if missing:
            raise GtvalError(f"[explain.runs] {name}: there are no poses of {', '.join(missing)}")
        found = repeated_runs([tables[run] for run in members], explanation.question.confidence)
        rows += [(name, f"{len(members)} runs", one) for one in found]
    for name, table in tables.items():
        again = revisits(explanation.validation, table, radius, explanation.question.confidence)
        rows += [(name, f"revisits within {radius:g} m", one) for one in again]
    return rows


def explain_sections(
    explanation: Explanation,
    limits: tuple[float, ...],
    repeated: Sequence[tuple[str, str, Repeatability]] = (),
) -> tuple[Section, ...]:
    """Tables and figures of an explanation.

    Parameters
    ----------
    explanation : Explanation
        What was found.
    limits : tuple of float
        The d of 'equivalent within d' for x, y and theta.
    repeated : sequence of (str, str, Repeatability)
        System, how it was found, and the numbers.
    """
    sections = [_overview(explanation, limits, repeated)]
    sections += [
        _system_section(one, explanation.question.confidence) for one in explanation.systems
    ]
    return tuple(sections)


def _overview(
    explanation: Explanation,
    limits: tuple[float, ...],
    repeated: Sequence[tuple[str, str, Repeatability]],
) -> Section:
    """What concerns all sources together."""
    blocks: list[Table | Figure | Text] = [
        before_after_table(explanation.systems),
        Figure(
            "explain_sources",
            "Every source at every pose after the systematic parts are taken out: how far it is "
            "from the others. X: wrong; ?: one of those marked is "
            "wrong; s: look again.",
            "Matrix of sources and poses. The flagged cells are in the table below.",
            partial(_draw, "source_matrix", explanation),
        ),
        verdict_table(explanation),
    ]
    suspects = suspect_table(explanation)
    blocks += [] if suspects is None else [suspects]
    blocks.append(noise_table(explanation))
    if any(one.settled is not None for one in explanation.systems):
        blocks.append(
            Figure(
                "explain_ellipses",
                "Position errors of each system before and after, with 95 % ellipses.",
                "Scatter plots of the position errors; the spreads are in the table above.",
                partial(_draw, "residual_ellipses", explanation),
            )
        )
    pairs = [
        one
        for a, b in combinations([one.table for one in explanation.systems], 2)
        if set(a.ids) & set(b.ids) & set(explanation.validation.ids)
        for one in paired_comparison(
            explanation.validation, a, b, limits, explanation.question.confidence
        )
    ]
    if any(one.settled is not None for one in explanation.systems):
        confidence = explanation.question.confidence
        blocks.append(good_enough_table(explanation.systems, limits, confidence))
    if pairs:
        blocks.append(paired_table(pairs))
    if repeated:
        blocks.append(repeatability_table(repeated))
    return Section("Where the errors come from", blocks)


def _system_section(one: SystemExplanation, confidence: float) -> Section:
    """What concerns one system."""
    title = f"Where the errors of {one.system} come from"
    if one.selection is None or one.settled is None:
        return Section(title, [Text("There are too few poses to explain the errors.")])
    blocks: list[Table | Figure | Text] = [candidate_table(one)]
    if one.settled.fit.model.fitted:
        blocks.append(parameter_table(one, confidence))
    blocks += [
        Figure(
            f"explain_heading_{one.system}",
            "Errors against the heading, with what the chosen explanation makes of them in the "
            "middle of the room. Crosses are flagged cells; those off the scale are at the edge.",
            f"Scatter plots of the errors of {one.system} over the heading with fitted curves.",
            partial(_draw, "error_with_curve", one),
        ),
        Figure(
            f"explain_arrows_{one.system}",
            "Errors on the floor before and after the systematic part is taken out.",
            f"Two maps with an arrow for each pose of {one.system}.",
            partial(_draw, "arrows_before_after", one),
        ),
    ]
    return Section(title, blocks)


def _draw(name: str, *arguments: object) -> "MatplotlibFigure":
    """A figure, whose library is imported only when something is drawn."""
    from validation.explain.telling import figures  # noqa: PLC0415  (half a second that text does without)

    draw: Callable[..., MatplotlibFigure] = getattr(figures, name)
    return draw(*arguments)
