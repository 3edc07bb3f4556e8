"""What may be claimed of a campaign: pairs, printed statistics, conclusions, words of standards."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from validation.campaign.folder import Campaign
from validation.explain.analysis import Explanation
from validation.explain.telling.budgets import system_budgets
from validation.results import Finding, Section, Size
from validation.statistics.by_source import (
    SourceDifference,
    source_differences,
    source_findings,
    source_section,
)
from validation.statistics.claims import JudgedClaim, claims_section, judge_claims
from validation.statistics.comparison import Comparison
from validation.statistics.evaluation import Evaluation
from validation.statistics.paired import PairedErrors, paired_errors, paired_section
from validation.statistics.printed import (
    Judged,
    errors_finding,
    evaluated,
    judged_numbers,
    load_printed,
    load_printed_errors,
    printed_findings,
    printed_table,
)
from validation.statistics.standards.rows import standards_csv
from validation.statistics.standards.summary import Standards, standards_of
from validation.statistics.standards.tables import standards_section
from validation.text_files.csv_text import csv_text


@dataclass(frozen=True)
class Statements:
    """Chapters, findings and files of what may be claimed.

    Parameters
    ----------
    sections, last_sections : sequence of Section
        Behind those of the systems; at the end of the report.
    findings : sequence of Finding
        New ones.
    files : mapping of str to str
        By names relative to results/.
    standards : sequence of Standards
        Of each compared system.
    by_source : sequence of SourceDifference
        Errors between who made the poses, where the tables say so.
    """

    sections: Sequence[Section] = ()
    last_sections: Sequence[Section] = ()
    findings: Sequence[Finding] = ()
    files: dict[str, str] = field(default_factory=dict)
    standards: Sequence[Standards] = ()
    by_source: Sequence[SourceDifference] = ()


def make_statements(
    campaign: Campaign,
    evaluations: Sequence[Evaluation],
    findings: Sequence[Finding],
    explanation: Explanation | None = None,
) -> Statements:
    """What may be claimed.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings.
    evaluations : sequence of Evaluation
        All systems.
    findings : sequence of Finding
        All others of the run: conclusions of a document are set beside them.
    explanation : Explanation, optional
        For budgets that tell frame, mount and clock apart.

    Raises
    ------
    InputError
        Naming every bad place of the file of printed statistics.
    """
    comparison = campaign.settings.comparison
    pairs = paired_errors(evaluations, comparison.confidence)
    sections, files, new = [], {}, list(_paired_findings(pairs, evaluations, comparison.confidence))
    if pairs:
        sections.append(paired_section(pairs))
        files["paired.csv"] = _paired_csv(pairs)
    makers = [one for each in evaluations for one in source_differences(each)]
    if makers:
        sections.append(source_section(makers))
        new += source_findings(makers)
    if comparison.published_statistics:
        printed = load_printed(campaign.folder / comparison.published_statistics)
        judged = judged_numbers(printed, evaluated(evaluations))
        sizes = {one.system: len(one.comparison) for one in evaluations}
        new += printed_findings(judged, printed, sizes)
        if judged:
            sections.append(Section("Printed statistics", [printed_table(judged)]))
            files["printed_statistics.csv"] = _printed_csv(judged)
    if comparison.published_errors:
        names = {one.name: None for e in evaluations for one in e.comparison.components}
        errors = load_printed_errors(campaign.folder / comparison.published_errors, names)
        for one in evaluations:
            new += errors_finding(one.system, errors, _errors_of(one.comparison))
    claims = judge_claims(campaign.settings.claims, pairs, [*findings, *new])
    last = [claims_section(claims)] if claims else []
    if claims:
        files["conclusions.csv"] = _claims_csv(claims)
    told = explanation.systems if explanation else ()
    budgets = {one.system: system_budgets(one, comparison.confidence) for one in told}
    standards = [standards_of(one, comparison, budgets.get(one.system, ())) for one in evaluations]
    if standards:
        last.append(standards_section(standards))
        files["standards.csv"] = standards_csv(standards)
    return Statements(sections, last, new, files, standards, makers)


def _errors_of(comparison: Comparison) -> dict[tuple[str, str], float]:
    """Every error, by pose and component."""
    return {
        (pose, component.name): float(value)
        for pose, row in zip(comparison.ids, comparison.errors, strict=True)
        for component, value in zip(comparison.components, row, strict=True)
    }


def _paired_findings(
    pairs: Sequence[PairedErrors], evaluations: Sequence[Evaluation], confidence: float
) -> list[Finding]:
    """One sentence for every two systems."""
    findings = []
    placed = {one.system: one.comparison.follows for one in evaluations}
    for names in dict.fromkeys((one.first, one.second) for one in pairs):
        own = [one for one in pairs if (one.first, one.second) == names and not one.without]
        shown = [f"{one.better} errs less in {one.component}" for one in own if one.better]
        first, second = names
        told = "; ".join(shown) or f"that one of {first} and {second} errs less is not shown"
        numbers = ", ".join(
            f"{one.component} {1e3 * one.mean:+.0f} m{one.unit} "
            f"({1e3 * one.low:+.0f} to {1e3 * one.high:+.0f})"
            for one in own
        )
        text = (
            f"{told[:1].upper()}{told[1:]}: sizes of the errors of {first} less those of {second} "
            f"at the {own[0].n} stops that both have: {numbers}."
        )
        helped = [name for name in names if placed.get(name) is not None]
        if len(helped) == 1:
            text += f" The survey placed {helped[0]}, so that no error of its frame is in these."
        sizes = tuple(
            Size(f"{one.component} of {first} less {second}", one.mean, one.unit, one.low, one.high,
                 confidence)
            for one in own
        )  # fmt: skip
        findings.append(Finding("note", text, f"{first}, {second}", "errs_less", sizes))
    return findings


def _paired_csv(pairs: Sequence[PairedErrors]) -> str:
    header = ["first", "second", "component", "unit", "n", "without", "mean", "low", "high"]
    rows = [
        [
            *(one.first, one.second, one.component, one.unit, one.n, " ".join(one.without)),
            *(one.mean, one.low, one.high, one.p_value, one.better),
        ]
        for one in pairs
    ]
    return csv_text([*header, "p_value", "errs_less"], rows)


def _printed_csv(judged: Sequence[Judged]) -> str:
    header = ["system", "component", "number", "printed", "computed", "verdict"]
    rows = [
        [
            *(one.numbers.system, one.numbers.component, one.kind),
            *(one.numbers.texts[one.kind], one.computed, one.verdict),
        ]
        for one in judged
    ]
    return csv_text(header, rows)


def _claims_csv(claims: Sequence[JudgedClaim]) -> str:
    rows = [[one.claim.says, one.claim.source, one.verdict, one.reasons] for one in claims]
    return csv_text(["conclusion", "where", "verdict", "why"], rows)
