"""What is told of a reference pose, and of a mount that systems share."""

import numpy as np

from validation.explain.analysis import SystemExplanation
from validation.explain.fitting.selection import Selection
from validation.explain.fitting.settled import Settled
from validation.explain.sources.agreement import MOUNT, Agreement
from validation.explain.sources.reference import RULED_OUT, ReferenceEvidence
from validation.explain.sources.verdicts import listed
from validation.explain.telling.number_words import (
    ALL_ODDS,
    number_text,
    parameter_text,
    sizes_of,
    times_text,
)
from validation.results import Finding, Size

SLIP = 0.01
"""A slip of the reference pose is told below this p-value. A judgement: it is a note, and one of
three numbers for each system, so that one clean system in thirty has it."""


def reference_findings(one: SystemExplanation) -> list[Finding]:
    """What the evidence for a reference says, where none was stated."""
    evidence = one.reference
    if evidence is None:
        return []
    heading = (
        f"If one reference stop tied the frame to the Vframe through the mount, its heading was "
        f"{evidence.heading:+.2f} rad (standard deviation {evidence.heading_sigma:.2f})"
    )
    name = "heading of the reference"
    size = (Size.normal(name, evidence.heading, evidence.heading_sigma, "rad"),)
    if not evidence.possible:
        text = f"{heading}. No stop has that heading, so no reference explains the frame error."
        return [Finding("note", text, one.system, "no_reference", size)]
    text = f"{heading}. {_possible(evidence)} "
    if evidence.certain:
        text += "That there is a reference was stated in campaign.toml; the errors do not show it."
    else:
        odds = evidence.odds
        two = ("a reference", "a wrong frame that looks like one by chance")
        more, less = two if odds >= 1 else two[::-1]
        larger = max(odds, 1 / max(odds, 1 / ALL_ODDS))
        text += (
            f"{more.capitalize()} is {times_text(larger)} as likely as {less}"
            f"{'.' if larger > 3 else ': this table alone cannot tell.'}"
        )
    return [Finding("note", text, one.system, "inferred_reference", size)]


def _possible(evidence: ReferenceEvidence) -> str:
    """The stops that could be the reference, with their p-values."""
    said = [
        f"{name} (p = {evidence.p_values[evidence.ids.index(name)]:.2g})"
        for name in evidence.possible[:5]
    ]
    out = len(evidence.ids) - len(evidence.possible)
    return (
        f"It may be stop {' or '.join(said)}; the {out} others are ruled out (p < {RULED_OUT:g})."
    )


def slip_findings(selection: Selection, settled: Settled, confidence: float) -> list[Finding]:
    """The survey's own error at the reference pose."""
    if not settled.fit.model.slip:
        return []
    slip = [p for p in settled.parameters(confidence) if p.name.startswith("slip")]
    if min(p.p_value for p in slip) > SLIP:
        return []
    text = (
        f"By all other stops, the validation pose of the reference {selection.pairs.reference} is "
        f"wrong itself: {', '.join(parameter_text(p) for p in slip)}. This shifted all poses of "
        "this system, and is taken out together with the explanation."
    )
    sizes = sizes_of(slip, confidence)
    return [Finding("note", text, selection.pairs.system, "reference_slip", sizes)]


def agreement_finding(one: Agreement, confidence: float) -> Finding:
    """Whether systems of one sensor share a mount error."""
    half = one.interval_factor(confidence) * np.sqrt(np.diagonal(one.joint_covariance))
    joint = ", ".join(
        f"{name.replace('_', ' ')} {number_text(float(v), unit)} (+-{1000 * h:.1f})"
        for name, unit, v, h in zip(MOUNT, ("m", "m", "rad"), one.joint, half, strict=True)
    )
    differences = one.differences(confidence)
    apart = "; ".join(
        f"{system} minus {one.systems[0]}: "
        + ", ".join(
            f"{name.replace('_', ' ')} {1000 * d[0]:+.1f} "
            f"({1000 * d[1]:+.1f} to {1000 * d[2]:+.1f}) m{unit}"
            for name, unit, d in zip(MOUNT, ("m", "m", "rad"), rows, strict=True)
        )
        for system, rows in zip(one.systems[1:], differences, strict=True)
    )
    names, units = listed(one.systems), ("m", "m", "rad")
    sizes = tuple(
        Size(name.replace("_", " "), float(v), unit, float(v - h), float(v + h), confidence)
        for name, unit, v, h in zip(MOUNT, units, one.joint, half, strict=True)
    )
    if one.p_value >= 1 - confidence:
        text = (
            f"{names} agree on the same mount error (p = {one.p_value:.2g}; {apart}). Fitted "
            f"together: {joint}."
        )
        return Finding("note", text, one.sensor, "same_mount", sizes)
    text = (
        f"{names} do not agree on one mount error (p = {one.p_value:.2g}; {apart}): the mount is "
        "not the whole cause, or a wrong pose that is not flagged changes one of them."
    )
    return Finding("warning", text, one.sensor, "different_mounts", sizes)
