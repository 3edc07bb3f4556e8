"""What to measure, look at or repeat: one line each, the most valuable first."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from validation.errors import GtvalError
from validation.explain.analysis import Explanation
from validation.explain.fitting.planning import poses_for_bias, poses_for_deviation
from validation.explain.sources.verdicts import Verdict
from validation.explain.telling.words import measure
from validation.report.summary.first_page import NOT_SHOWN, Line
from validation.results import VALIDATION_SYSTEM, Finding
from validation.results import listed_ids as listed

MILLI = 1e3
SOURCES = "Where the errors come from"
FINDINGS = "Findings"
_END_OF_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z'`])")
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


def sentences(text: str) -> tuple[str, str]:
    """The first sentence of a text, and the reasoning that follows."""
    first, *rest = _END_OF_SENTENCE.split(text, maxsplit=1)
    return first, " ".join(rest)


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
    told = [*_errors(findings), *_stops(lines, explanation), *_causes(findings, explanation)]
    told += [*_neighbours(findings), *_more_stops(lines), *_missing(lines), *_covariances(findings)]
    told += [
        ToDo(one.subject, f"Look at this: {sentences(one.text)[0]}", FINDINGS, (5, 1.0))
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
        ToDo(one.subject, f"Settle this first: {sentences(one.text)[0]}", FINDINGS, (0, 0.0))
        for one in findings
        if one.severity == "error"
    ]


def _stops(lines: Sequence[Line], explanation: Explanation | None) -> list[ToDo]:
    """One line for each stop with cells that do not fit, or that are to be looked at again."""
    if explanation is None:
        return []
    limits = [one.bias.limit for one in lines[0].evaluation.statistics] if lines else []
    found, compared = explanation.arbitration, {one.evaluation.system for one in lines}
    certain = [(v, True) for v in found.verdicts] + [(v, False) for v in found.suspects]
    told = []
    for stop in dict.fromkeys(one.stop for one, _ in certain):
        cells = [(one, sure) for one, sure in certain if one.stop == stop]
        named = {name for one, _ in cells for name in one.blamed}
        said = "; ".join(
            dict.fromkeys(
                _cell(one, chance=not sure or one.table_p_value > found.false_alarm)
                for one, sure in cells
            )
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


def _cell(one: Verdict, *, chance: bool) -> str:
    """'survey is probably off by 167 mm in the position'."""
    unit = "mm" if one.cell == "position" else "mrad"
    off = f"off by {MILLI * one.size:.0f} {unit} in the {one.cell}"
    if chance:
        return f"{' or '.join(one.blamed)} may be {off} (chance can do that too)"
    if one.certainty == "undecided":
        return f"{' or '.join(one.blamed)} is {off}, undecided which"
    sure = "is" if one.certainty == "sure" else "is probably"
    return f"{' and '.join(one.blamed)} {sure} {off}"


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
    """How many stops would show that a system is good enough, if its errors stay as they are."""
    told = []
    for line in lines:
        if line.verdicts[0] != NOT_SHOWN:
            continue
        one, needed = line.evaluation, 0
        try:
            for s in one.statistics:
                asked = s.bias.limit, s.confidence
                needed = max(
                    needed,
                    poses_for_bias(s.std, asked[0], bias=s.mean, confidence=asked[1]),
                    poses_for_deviation(s.std, asked[0], confidence=asked[1]),
                )
        except (GtvalError, ValueError):
            continue
        if needed > len(one.comparison):
            text = (
                f"Survey {needed} stops instead of {len(one.comparison)}: so many independent ones "
                "would show that it is good enough, if its errors stay as they are."
            )
            told.append(ToDo(one.system, text, f"System {one.system}", (7, float(needed))))
    return told


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
