"""What to measure, look at or repeat: one line each, the most valuable first."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.errors import GtvalError
from validation.explain.analysis import Explanation
from validation.explain.fitting.planning import poses_for_bias, poses_for_deviation
from validation.explain.sources.verdicts import Verdict
from validation.explain.telling.words import measure
from validation.report.summary.first_page import NOT_SHOWN, Line
from validation.results import VALIDATION_SYSTEM, Finding
from validation.results import listed_ids as listed
from validation.statistics.error_statistics import ComponentStatistics

MILLI = 1e3
SOURCES = "Where the errors come from"
FINDINGS = "Findings"
_FIRST = {"blunder": "Measure this again", "covariance_unit": "Correct this table"}
"""What to do about an error, where it is one thing."""
MOST_STOPS = 100
"""Stops beyond which something else is more useful than more of them. A stop takes about 12 minutes
(three rig points, three world points each, a minute a reading at most, three to the next stop): 40
in a day of eight hours, 100 in two days and a half. Half the uncertainty takes four times as many
stops, but only half the spread."""
FEWEST_TO_PLAN = 9
"""Stops from which on a spread is known to a factor of two: the upper end of its 95 % interval is
1.9 times what was found with 9, 2.04 times with 8, 6.3 times with 3 (chi squared)."""
_BRACKETS = re.compile(r"\s*\([^()]*\)")
TOLD = frozenset({
    "wrong_pose", "likely_wrong_pose", "disputed_pose", "systematic_error", "dependent_errors",
    "bias", "nees_above",
})  # fmt: skip
"""Codes of warnings that have a line of their own kind, or that the first page's verdict holds."""


@dataclass(frozen=True)
class ToDo:
    """One line of the list.

    Parameters
    ----------
    subject : str
        The stop or the system.
    text : str
        What to do, and why.
    evidence : str
        Title of the section that shows why.
    rank : (int, float)
        The least is the most valuable.
    """

    subject: str
    text: str
    evidence: str
    rank: tuple[int, float] = (9, 0.0)


def to_do(
    findings: Sequence[Finding], lines: Sequence[Line], explanation: Explanation | None
) -> list[ToDo]:
    """What to do next.

    Parameters
    ----------
    findings : sequence of Finding
        Of the whole run.
    lines : sequence of Line
        What the first page says of the systems.
    explanation : Explanation, optional
        Who is wrong where, and by how much.
    """
    # What spoils all poses of a system is one line, and not one for each of its stops.
    spoilt = frozenset(one.subject for one in findings if one.code == "spoilt_by_cause")
    told = [
        *_errors(findings),
        *_stops(lines, explanation, spoilt),
        *_causes(findings, explanation),
    ]
    told += [*_neighbours(findings), *_more_stops(lines), *_missing(lines), *_covariances(findings)]
    told += [
        ToDo(one.subject, f"Look at this: {one.sentence}", FINDINGS, (5, 1.0))
        for one in findings
        if one.severity == "warning" and not _own_line(one, explanation)
    ]
    return sorted(dict.fromkeys(told), key=lambda one: one.rank)


def _own_line(one: Finding, explanation: Explanation | None) -> bool:
    """Whether a warning has a line already."""
    by_stop = explanation is not None and one.subject.startswith("pose ")
    return one.code in TOLD or (by_stop and "wrong" in one.code)


def _errors(findings: Iterable[Finding]) -> list[ToDo]:
    """What must be settled before any number is used."""
    return [
        ToDo(
            one.subject,
            f"{_FIRST.get(one.code, 'Settle this first')}: {one.sentence}",
            FINDINGS,
            (0, 0.0),
        )
        for one in findings
        if one.severity == "error"
    ]


def _stops(
    lines: Sequence[Line], explanation: Explanation | None, spoilt: frozenset[str]
) -> list[ToDo]:
    """One line for each stop with cells that do not fit, or that are to be looked at again."""
    if explanation is None:
        return []
    limits = [one.bias.limit for one in lines[0].evaluation.statistics] if lines else []
    found, compared = explanation.arbitration, {one.evaluation.system for one in lines}
    certain = [(v, True) for v in found.verdicts] + [(v, False) for v in found.suspects]
    certain = [(v, sure) for v, sure in certain if not set(v.blamed) <= spoilt]
    told = []
    for stop in dict.fromkeys(one.stop for one, _ in certain):
        cells = [(one, sure) for one, sure in certain if one.stop == stop]
        named = {name for one, _ in cells for name in one.blamed}
        told_of: dict[tuple[str, str, str], list[str]] = {}
        for one, sure in cells:
            chance = not sure or one.table_p_value > found.false_alarm
            who, how, end = _cell(one, chance=chance)
            told_of.setdefault((who, how, end), []).append(_off(one))
        said = "; ".join(
            f"{who} {how} off by {' and '.join(dict.fromkeys(sizes))}{end}"
            for (who, how, end), sizes in told_of.items()
        )
        again = (
            "Survey this stop again" if VALIDATION_SYSTEM in named else "Look at this stop again"
        )
        d = {"position": limits[0], "heading": limits[-1]} if limits else {}
        size = max(one.size / d.get(one.cell, 1.0) for one, _ in cells)
        first = 2 if VALIDATION_SYSTEM in named else 3 if named & compared else 4
        first = first if any(sure for _, sure in cells) else 6
        told.append(ToDo(f"stop {stop}", f"{again}: {said}.", SOURCES, (first, -size)))
    return told


def _off(one: Verdict) -> str:
    """'167 mm in the position'."""
    unit = "mm" if one.cell == "position" else "mrad"
    return f"{MILLI * one.size:.0f} {unit} in the {one.cell}"


def _cell(one: Verdict, *, chance: bool) -> tuple[str, str, str]:
    """Who, how sure, and what to add: 'survey', 'is probably', ''."""
    either = " or ".join(one.blamed)
    if chance:
        return either, "may be", " (chance can do that too)"
    if one.certainty == "undecided":
        return either, "is", ", undecided which"
    names = " and ".join(one.blamed)
    return names, "is" if one.certainty == "sure" else "is probably", ""


def _causes(findings: Iterable[Finding], explanation: Explanation | None) -> list[ToDo]:
    """How to confirm what explains a system's errors."""
    claimed = {one.subject for one in findings if one.code == "systematic_error"}
    told = []
    for one in explanation.systems if explanation is not None else ():
        if one.system not in claimed or one.settled is None:
            continue
        advice = measure(one, one.settled).removeprefix("To confirm: ").split(";")[0].rstrip(".")
        advice = _BRACKETS.sub("", advice) or "repeat some stops"
        before, after = (
            MILLI * np.sqrt(np.nanmean(np.square(e[one.settled.cells[:, 0], :2]).sum(axis=1)))
            for e in (one.settled.before, one.settled.after)
        )
        text = (
            f"Confirm {one.settled.fit.model.words}, then correct it: {advice} (rms position "
            f"{before:.0f} to {after:.0f} mm)."
        )
        where = f"Where the errors of {one.system} come from"
        text = f"{text[0].upper()}{text[1:]}"
        told.append(ToDo(one.system, text, where, (1, after - before)))
    return told


def _neighbours(findings: Iterable[Finding]) -> list[ToDo]:
    """One line for all systems whose errors depend on their neighbours."""
    names = [one.subject for one in findings if one.code == "dependent_errors"]
    if not names:
        return []
    text = (
        "Repeat some stops at another time and in another order: neighbouring errors are alike, "
        "so these stops tell less than their number."
    )
    return [ToDo(", ".join(dict.fromkeys(names)), text, f"System {names[0]}", (5, 0.0))]


def _more_stops(lines: Sequence[Line]) -> list[ToDo]:
    """What would show that a system is good enough, if its errors stay as they are."""
    told = []
    for line in lines:
        if line.verdicts[0] == NOT_SHOWN:
            text, needed = _plan(line)
            told += [ToDo(line.evaluation.system, text, f"System {line.evaluation.system}",
                          (7, needed))] if text else []  # fmt: skip
    return told


def _plan(line: Line) -> tuple[str, float]:
    """More stops where so many can be surveyed, else what is more useful; and the stops needed."""
    one, n = line.evaluation, len(line.evaluation.comparison)
    if n < FEWEST_TO_PLAN:
        factor = np.sqrt((n - 1) / special.chdtri(n - 1, 0.975)) if n > 1 else np.inf
        how = f"{n} tell the spread of the errors only to a factor of {factor:.2g}"
        how = how if n > 1 else "one stop tells nothing of the spread of the errors"
        return f"Survey {FEWEST_TO_PLAN} stops or more: {how}.", float(FEWEST_TO_PLAN)
    needed = {s.component.name: _needed(s, s.mean) for s in one.statistics}
    most = max(needed.values())
    if most <= n:
        return "", 0.0
    if most <= MOST_STOPS:
        text = (
            f"Survey {most:.0f} stops instead of {n}: so many independent ones would show that it "
            "is good enough, if its errors stay as they are."
        )
        return text, most
    worst = max(
        one.statistics, key=lambda s: (needed[s.component.name], abs(s.mean) / s.bias.limit)
    )
    name, unit = worst.component.name, f"m{worst.component.unit}"
    without = _needed(worst, 0.0)
    if without <= MOST_STOPS and worst.bias_is_significant:
        text = (
            f"Find what shifts its errors by {MILLI * worst.mean:+.0f} {unit} in {name}, and take "
            f"it out: {max(without, n):.0f} stops would then show that {name} is good enough; as "
            f"it is, not even {MOST_STOPS} would."
        )
        return text, most
    whose = "system or the survey"
    sigmas = one.comparison.validation.covariances
    if sigmas is not None:
        column = [s.component.name for s in one.statistics].index(name)
        own = sigmas[np.isfinite(sigmas[:, column, column]), column, column]
        if own.size:
            whose = "survey" if own.mean() > worst.std**2 / 2 else "system"
    shown = shown_by(worst, MOST_STOPS)
    text = (
        f"More stops are not what helps: {name} errs by {MILLI * worst.mean:+.0f} {unit} on "
        f"average and spreads by {MILLI * worst.std:.0f} {unit}, and even {MOST_STOPS} stops would "
        f"show no less than {MILLI * shown:.0f} {unit}. Make the {whose} more accurate, or be "
        "content with that."
    )
    return text, most


def _needed(one: ComponentStatistics, mean: float) -> float:
    """Stops that show bias and deviation below d, if there is such a mean; infinite if none do."""
    limit, sure = one.bias.limit, one.confidence
    if np.isinf(limit):
        return 0.0
    try:
        bias = poses_for_bias(one.std, limit, bias=mean, confidence=sure)
        return float(max(bias, poses_for_deviation(one.std, limit, confidence=sure)))
    except (GtvalError, ValueError):
        return np.inf


def shown_by(one: ComponentStatistics, n: int, power: float = 0.9) -> float:
    """The d that n stops would show with the chance ``power``, if errors stay as they are.

    For the bias: its mean and the quantiles of confidence and power (Julious (2004), eq. 5.3,
    the farther of the two tests alone); for the deviation: the ratio of both quantiles of chi
    squared.
    """
    quantiles = special.stdtrit(n - 1, one.confidence) + special.stdtrit(n - 1, power)
    ratio = special.chdtri(n - 1, 1 - power) / special.chdtri(n - 1, one.confidence)
    return float(max(abs(one.mean) + one.std * quantiles / np.sqrt(n), one.std * np.sqrt(ratio)))


def _missing(lines: Sequence[Line]) -> list[ToDo]:
    """Poses that a system lacks."""
    told = []
    for line in lines:
        compared = line.evaluation.comparison
        lost = compared.missing_in_gt
        if lost:
            text = (
                f"Find out why {len(lost)} of {len(compared) + len(lost)} stops have no pose: "
                f"{listed(lost)}."
            )
            told.append(ToDo(compared.system, text, "All systems", (8, -float(len(lost)))))
    return told


def _covariances(findings: Iterable[Finding]) -> list[ToDo]:
    """One line for all tables that state no covariances."""
    names = [one.subject for one in findings if one.code == "nees_unavailable"]
    if not names:
        return []
    text = "State covariances: without them nobody can tell whether errors are as large as stated."
    return [ToDo(", ".join(dict.fromkeys(names)), text, FINDINGS, (9, 0.0))]
