"""The explanation in plain sentences, made from its numbers and from nothing else."""

import numpy as np

from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.fitting.models import ErrorModel
from validation.explain.fitting.selection import Candidate, Selection, smallest_shown
from validation.explain.fitting.settled import Parameter, Settled
from validation.explain.sources.agreement import MOUNT, Agreement
from validation.explain.sources.reference import RULED_OUT, ReferenceEvidence
from validation.explain.sources.verdicts import listed
from validation.explain.telling.verdict_words import arbitration_findings
from validation.results import Finding

ALL_ODDS = 1e6
"""Odds beyond this are not told in figures: they rest on the tails of the noise model, which no
table shows."""

SLIP = 0.01
"""A slip of the reference pose is told below this p-value. A judgement: it is a note, and one of
three numbers for each system, so that one clean system in thirty has it."""


def findings(explanation: Explanation) -> list[Finding]:
    """All that a reader should take from the explanation."""
    told: list[Finding] = []
    for one in explanation.systems:
        if one.unit_doubt:
            text = one.unit_doubt[0].upper() + one.unit_doubt[1:]
            told.append(Finding("warning", text, one.system, "perhaps_degrees"))
        told += system_findings(one, explanation.question.confidence)
    told += [_agreement(one, explanation.question.confidence) for one in explanation.agreements]
    told += arbitration_findings(explanation.arbitration)
    return told


def system_findings(one: SystemExplanation, confidence: float) -> list[Finding]:
    """What was found out about one system."""
    if one.selection is None or one.settled is None:
        text = (
            "There are too few poses in common with the validation to explain the errors; "
            "survey at least four stops at different headings, better twenty."
        )
        return [Finding("warning", text, one.system, "too_few_poses")]
    told = [_cause(one, one.selection, one.settled, confidence)]
    if one.settled.fit.model.parts:
        evidence = f"{_sureness(one.selection)} {_taken_away(one.settled)}"
        told.append(Finding("note", evidence, one.system, "evidence"))
    told += _reference(one)
    told += _slip(one.selection, one.settled, confidence)
    told += _rivals(one.selection)
    told += _more(one.selection)
    told += _blind(one.selection)
    told += _noise(one.selection, one.settled)
    return told


def _number(value: float, unit: str) -> str:
    """A value as people read it: mm and mrad below a metre or radian, per mille for scale."""
    if unit in {"m", "rad"}:
        return f"{1000 * value:+.1f} m{unit}"
    if unit in {"m/s", "rad/s"}:
        return f"{1000 * value:+.3f} m{unit}"
    if unit == "s/s":
        return f"{1e6 * value:+.0f} ppm"
    return f"{1000 * value:+.2f} per mille" if not unit else f"{value:+.4f} {unit}"


def parameter_text(one: Parameter) -> str:
    """'mount x -89.3 mm (-92.8 to -85.8)'."""
    low, high = (_number(value, one.unit).split(" ")[0] for value in (one.low, one.high))
    return f"{one.name.replace('_', ' ')} {_number(one.value, one.unit)} ({low} to {high})"


def _cause(
    one: SystemExplanation, selection: Selection, settled: Settled, confidence: float
) -> Finding:
    """Which explanation, how large, how sure, what it takes away, what to measure."""
    model = settled.fit.model
    if not model.parts:
        best = min(selection.candidates[1:], key=lambda item: item.criterion)
        p = best.p_values.get("none", 1.0)
        text = (
            f"No systematic error is shown. The best of the others, {best.model.words}, would "
            f"fit this well by chance with p = {p:.2g}; it counts below {selection.threshold:.2g}."
            f"{_hidden(selection)}"
        )
        return Finding("good", text, one.system, "no_systematic_error")
    values = [p for p in settled.parameters(confidence) if p.name in model.parameters]
    said = ", ".join(parameter_text(value) for value in values)
    text = (
        f"Explained by {_named(one, model)}{_or(selection)}: {said} "
        f"({100 * confidence:.3g} % intervals). {_change(settled)} {measure(one, settled)}"
    )
    return Finding("warning", text, one.system, "systematic_error")


def _or(selection: Selection) -> str:
    """The simplest explanations that these poses do not tell from the chosen one."""
    rivals = [one.model for one in selection.rivals]
    simplest = [one for one in rivals if not any(other.nested_in(one) for other in rivals)]
    if not simplest:
        return ""
    others = " or ".join(one.words for one in simplest)
    words = selection.chosen.model.words
    return f", or as well by {others}; these poses do not tell which. Taken for {words}"


def _hidden(selection: Selection) -> str:
    """How large a frame or mount error would have to be to be claimed in 95 % of campaigns."""
    said = []
    for name in ("frame", "mount"):
        one = selection.candidate(name)
        if one.observability.complete:
            shift, turn = smallest_shown(one.fit, selection.threshold)
            said.append(f"of the {name} by {1000 * shift:.1f} mm or {1000 * turn:.1f} mrad")
    if not said:
        return ""
    return f" These poses would not reliably show a smaller error than one {' or '.join(said)}."


def _named(one: SystemExplanation, model: ErrorModel) -> str:
    """The explanation in words, with its reference."""
    if model.through_reference and "frame" not in model.parts:
        assert one.selection is not None
        return f"{model.words} {one.selection.pairs.reference}"
    if one.reference is not None and one.reference.accepted:
        return (
            "a wrong mount that also went into the frame through a reference pose (inferred: "
            f"{' or '.join(one.reference.possible)})"
        )
    return model.words


def _sureness(selection: Selection) -> str:
    """Odds over the next best, and the test against no systematic error."""
    chosen = selection.chosen
    others = [
        item
        for item in selection.candidates
        if item.name != chosen.name and not chosen.model.nested_in(item.model)
    ]
    best = min(others, key=lambda item: item.criterion)
    odds = float(np.exp(min((best.criterion - chosen.criterion) / 2, 700.0)))
    told = f"{odds:.0f} to 1" if odds < ALL_ODDS else "more than a million to 1"
    gain = chosen.loo.score - best.loo.score
    p = max(chosen.p_values.values(), default=1.0)
    return (
        f"How sure: odds over the next best that does not contain it ({best.model.words}) are "
        f"{told} by BIC; "
        f"left-out poses are predicted {'better' if gain > 0 else 'no better'} "
        f"(log score {gain:+.1f}); every part is needed (largest p = {p:.1g})."
    )


def _change(settled: Settled) -> str:
    """The spread before and after in short."""
    before, after = settled.spread(settled.before), settled.spread(settled.after)
    return (
        f"It takes the standard deviation of the poses not flagged from {1000 * before[0]:.1f} to "
        f"{1000 * after[0]:.1f} mm in x and from {1000 * before[1]:.1f} to "
        f"{1000 * after[1]:.1f} mm in y."
    )


def _taken_away(settled: Settled) -> str:
    """Spread before and after, of the cells used."""
    before, after = settled.spread(settled.before), settled.spread(settled.after)
    explained = settled.explained
    parts = []
    for column, name in enumerate(("x", "y", "theta")):
        unit = "mrad" if column == 2 else "mm"
        change = f"{name} {1000 * before[column]:.1f} to {1000 * after[column]:.1f} {unit}"
        if column < 2:
            # Noise of the noise estimate can make the share fall below zero.
            share = 100 * max(explained[column], 0.0)
            change += f" ({share:.0f} % of the mean square explained)"
        parts.append(change)
    used, n = settled.cells.sum(0), len(settled.cells)
    first, last = settled.mean(settled.before), settled.mean(settled.after)
    means = ", ".join(
        f"{name} {1000 * first[column]:+.1f} to {1000 * last[column]:+.1f} mm"
        for column, name in enumerate("xy")
    )
    return (
        f"Standard deviation before and after, without flagged cells ({used[0]} of {n} positions, "
        f"{used[1]} of {n} headings): {', '.join(parts)}; mean {means}."
    )


def measure(one: SystemExplanation, settled: Settled) -> str:
    """What to measure in the room to confirm the explanation."""
    parts = settled.fit.model.parts
    values = dict(zip(settled.fit.model.parameters, settled.values, strict=True))
    advice = []
    if "mount" in parts:
        arm = float(np.hypot(values["mount_x"], values["mount_y"]))
        advice.append(
            "measure the sensor's place on the robot again (the numbers are what to add to it, "
            "along the robot's axes), and turn the robot by 180 degrees on one spot: its given "
            f"position must then move by {2 * arm:.3f} m"
        )
    if "turn" in parts:
        advice.append(
            "compare a given heading with the robot's, as its mount is turned by "
            f"{1000 * values['mount_theta']:+.1f} mrad; whether the shift is the frame's or the "
            "mount's shows only at another heading"
        )
    through = settled.fit.model.through_reference or (
        one.reference is not None and one.reference.accepted
    )
    if through:
        advice.append(
            "the error must vanish at the heading of the reference pose and be largest, "
            f"{2 * float(np.hypot(values['mount_x'], values['mount_y'])):.3f} m, opposite to it"
        )
    if "frame" in parts and not through:
        advice.append(
            "let the system locate the marks of the Vframe itself; they must be off by this much"
        )
    if "scale" in parts:
        advice.append("measure a long known distance, such as the pole, with the system")
    if "time" in parts:
        advice.append("repeat with the robot at rest, where the error must vanish")
    return f"To confirm: {'; '.join(advice)}." if advice else ""


def _reference(one: SystemExplanation) -> list[Finding]:
    """What the evidence for a reference says, where none was stated."""
    evidence = one.reference
    if evidence is None:
        return []
    heading = (
        f"Were the frame tied through the mount by one stop, its heading would be "
        f"{evidence.heading:+.2f} rad (standard deviation {evidence.heading_sigma:.2f})"
    )
    if not evidence.possible:
        text = f"{heading}, and none of the stops fits. So no reference explains the frame error."
        return [Finding("note", text, one.system, "no_reference")]
    text = f"{heading}. {_possible(evidence)} "
    if evidence.certain:
        text += "That one of the stops is the reference was stated, not found."
    else:
        odds = evidence.odds
        told = f"{odds:.0f} to 1 for" if odds >= 1 else f"{1 / odds:.0f} to 1 against"
        text += (
            f"The odds are {told} a reference rather than a wrong frame that only happens to "
            "look like one"
            + ("." if odds > 3 or odds < 1 / 3 else ": this table alone does not tell.")
        )
    return [Finding("note", text, one.system, "inferred_reference")]


def _possible(evidence: ReferenceEvidence) -> str:
    """The stops that could be the reference, with their p-values."""
    said = [
        f"{name} (p = {evidence.p_values[evidence.ids.index(name)]:.2g})"
        for name in evidence.possible[:5]
    ]
    out = len(evidence.ids) - len(evidence.possible)
    return (
        f"It can be {' or '.join(said)}; the other {out} stops are ruled out (p < {RULED_OUT:g})."
    )


def _slip(selection: Selection, settled: Settled, confidence: float) -> list[Finding]:
    """The survey's own error at the reference pose."""
    if not settled.fit.model.slip:
        return []
    slip = [p for p in settled.parameters(confidence) if p.name.startswith("slip")]
    if min(p.p_value for p in slip) > SLIP:
        return []
    text = (
        f"The other stops say that the validation pose of the reference {selection.pairs.reference}"
        f" is itself off: {', '.join(parameter_text(p) for p in slip)}. It moved all poses of "
        "this system, and is taken out with the explanation."
    )
    return [Finding("note", text, selection.pairs.system, "reference_slip")]


def _rivals(selection: Selection) -> list[Finding]:
    """Explanations that fit nearly as well."""
    if not selection.rivals:
        return []
    said = ", ".join(
        f"{one.model.words} (BIC {one.criterion - selection.chosen.criterion:+.1f})"
        for one in selection.rivals
    )
    spread = np.degrees(selection.chosen.observability.heading_spread)
    text = (
        f"Not ruled out: {said}. The poses do not tell these apart (headings spread by "
        f"{spread:.0f} degrees). {_why(selection)}Survey stops at other headings and farther apart."
    )
    return [Finding("warning", text, selection.pairs.system, "rivals")]


def _why(selection: Selection) -> str:
    """Why a frame and a mount look alike, where they do."""
    names = {selection.chosen.name, *(one.name for one in selection.rivals)}
    if {"frame", "mount"} <= names:
        return "At a single heading, a wrong mount and a wrong frame shift all poses alike. "
    return ""


def _more(selection: Selection) -> list[Finding]:
    """Larger explanations with a lower criterion that did not pass the test."""
    chosen = selection.chosen
    beyond = [
        one
        for one in selection.candidates
        if chosen.model.nested_in(one.model) and one.criterion < chosen.criterion
    ]
    if not beyond:
        return []
    best = min(beyond, key=lambda one: one.criterion)
    p = best.p_values.get(chosen.name, 1.0)
    text = (
        f"{best.model.words.capitalize()} would have a lower BIC "
        f"({best.criterion - chosen.criterion:+.1f}), but the addition has p = {p:.2g} and is "
        f"claimed only below {selection.threshold:.2g}: a hint, no finding."
    )
    return [Finding("note", text, selection.pairs.system, "hint")]


def _blind(selection: Selection) -> list[Finding]:
    """What these poses cannot show."""
    lost = [one for one in selection.candidates if not one.observability.complete]
    if not lost:
        return []
    said = "; ".join(
        f"{one.name}: {_directions(one)}" for one in sorted(lost, key=lambda o: len(o.model.parts))
    )
    n = len(selection.pairs)
    spread = np.degrees(lost[0].observability.heading_spread)
    text = (
        f"These {n} poses (headings spread by {spread:.0f} degrees) cannot show everything. Not "
        f"determined in {said}."
    )
    return [Finding("warning", text, selection.pairs.system, "not_observable")]


def _directions(one: Candidate) -> str:
    """The parameters that are not determined."""
    return ", ".join(one.observability.undetermined)


def _noise(selection: Selection, settled: Settled) -> list[Finding]:
    """Where the noise level came from, and what is left unexplained."""
    left = settled.noise
    told = (
        f"What is left, for the degrees of freedom left: x {1000 * left[0]:.1f} mm, "
        f"y {1000 * left[1]:.1f} mm, theta {1000 * left[2]:.1f} mrad (root mean square of the "
        "cells not flagged; validation noise included)."
    )
    if selection.pairs.stated:
        found = [Finding("note", told, selection.pairs.system, "left")]
        return found + _misfit(settled)
    text = (
        "No covariances are stated on both sides, so the noise level is estimated from the errors "
        f"themselves, one for positions and one for headings. {told}"
    )
    return [Finding("note", text, selection.pairs.system, "noise_estimated")]


def _misfit(settled: Settled) -> list[Finding]:
    """Whether what is left agrees with the stated covariances."""
    told = []
    for name, (factor, low, high) in zip(("positions", "headings"), settled.misfit, strict=True):
        if low > 1:
            text = (
                f"What is left of the {name} is {factor:.2g} times what the stated covariances "
                f"say (99 % interval {low:.2g} to {high:.2g}). Either they are too small, or poses "
                "share errors (cameras, a frame), or the errors have a cause that is not among the "
                "explanations. Intervals are too narrow by this factor, and p-values too small. "
                "Leave the covariances out of the tables to have the noise estimated."
            )
            told.append(Finding("warning", text, settled.pairs.system, "covariance_too_small"))
        elif high < 1:
            text = (
                f"What is left of the {name} is only {factor:.2g} times what the stated "
                f"covariances say (99 % interval {low:.2g} to {high:.2g}): they are too large, or "
                "poses and survey share errors that cancel in the differences (as of a frame that "
                "all surveyed stops place). Small causes of error stay hidden."
            )
            told.append(Finding("note", text, settled.pairs.system, "covariance_too_large"))
    return told


def _agreement(one: Agreement, confidence: float) -> Finding:
    """Whether systems of one sensor share a mount error."""
    half = one.interval_factor(confidence) * np.sqrt(np.diagonal(one.joint_covariance))
    joint = ", ".join(
        f"{name.replace('_', ' ')} {_number(float(v), unit)} (+-{1000 * h:.1f})"
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
    names = listed(one.systems)
    if one.p_value >= 1 - confidence:
        text = (
            f"{names} agree on the same mount error (p = {one.p_value:.2g}; {apart}). Fitted "
            f"together: {joint}."
        )
        return Finding("note", text, one.sensor, "same_mount")
    text = (
        f"{names} do not agree on one mount error (p = {one.p_value:.2g}; {apart}): the mount is "
        "not the whole cause, or a pose that is not flagged spoils one of them."
    )
    return Finding("warning", text, one.sensor, "different_mounts")
