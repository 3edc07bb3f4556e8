"""The explanation in plain sentences, made from its numbers and from nothing else."""

from collections.abc import Sequence

import numpy as np

from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.fitting.models import ErrorModel
from validation.explain.fitting.selection import Candidate, Selection, smallest_shown
from validation.explain.fitting.settled import Settled
from validation.explain.telling.number_words import (
    noise_sizes,
    parameter_text,
    sizes_of,
    times_text,
)
from validation.explain.telling.reference_words import (
    agreement_finding,
    reference_findings,
    slip_findings,
)
from validation.explain.telling.sizes import left_findings, looks_constant
from validation.explain.telling.verdict_words import arbitration_findings
from validation.poses.angles import Array
from validation.results import Finding, Size
from validation.statistics.neighbours import RATE


def findings(explanation: Explanation) -> list[Finding]:
    """All that a reader should take from the explanation."""
    told: list[Finding] = []
    for one in explanation.systems:
        if one.unit_doubt:
            text = one.unit_doubt[0].upper() + one.unit_doubt[1:]
            told.append(Finding("warning", text, one.system, "perhaps_degrees"))
        rest = [other for other in explanation.systems if other is not one]
        told += system_findings(one, explanation.question.confidence, rest)
    told += [
        agreement_finding(one, explanation.question.confidence) for one in explanation.agreements
    ]
    told += arbitration_findings(explanation.arbitration)
    return told


def system_findings(
    one: SystemExplanation, confidence: float, others: Sequence[SystemExplanation] = ()
) -> list[Finding]:
    """What was found out about one system, beside the others."""
    if one.selection is None or one.settled is None:
        text = (
            "There are too few poses in common with the validation to explain the errors; "
            "survey at least four stops at different headings, better twenty."
        )
        return [Finding("warning", text, one.system, "too_few_poses", (_in_common(one),))]
    told = [*_convention(one.selection), *_covariance_unit(one.selection)]
    told.append(_cause(one, one.selection, one.settled, confidence, others))
    told += dependence_findings(one.selection, one.settled, one.system)
    if one.settled.fit.model.parts:
        evidence = f"{_sureness(one.selection)} {_taken_away(one.settled)}"
        left = noise_sizes(_rms(one.settled, one.settled.after), "rms left")
        told.append(Finding("note", evidence, one.system, "evidence", left))
    told += reference_findings(one)
    told += slip_findings(one.selection, one.settled, confidence)
    told += _rivals(one.selection)
    told += _more(one.selection)
    told += _blind(one.selection)
    told += _noise(one.selection, one.settled)
    return told


def _in_common(one: SystemExplanation) -> Size:
    """How many poses there are to explain."""
    n = 0 if one.selection is None else len(one.selection.pairs)
    return Size("poses in common", n, "poses")


def _cause(
    one: SystemExplanation,
    selection: Selection,
    settled: Settled,
    confidence: float,
    others: Sequence[SystemExplanation],
) -> Finding:
    """Which explanation, how large, how sure, what it takes away, what to measure."""
    model = settled.fit.model
    if one.wanders:
        spread = noise_sizes(settled.spread(settled.before), "spread")
        return Finding("warning", _wandering(settled), one.system, "drift", spread)
    if not model.parts:
        left = noise_sizes(settled.noise, "noise")
        if selection.dependent and selection.taken_out.model.parts:
            text = _hidden_by_lasting(selection)
            return Finding("note", text, one.system, "no_systematic_error", left)
        best = min(selection.candidates[1:], key=lambda item: item.criterion)
        p = best.p_values.get("none", 1.0)
        text = (
            f"No systematic error is shown. Of the causes tried, {best.model.words} fits best, but "
            f"errors without a cause fit as well with the chance p = {p:.2g}, and a cause is "
            f"claimed only below {selection.threshold:.2g}.{_hidden(selection)}"
            f"{_cannot_show(selection)}"
        )
        return Finding("good", text, one.system, "no_systematic_error", left)
    values = [p for p in settled.parameters(confidence) if p.name in model.parameters]
    said = ", ".join(parameter_text(value) for value in values)
    withheld = settled.serial is not None and settled.serial.withheld
    how = f"no intervals: {withheld}" if withheld else f"{100 * confidence:.3g} % intervals"
    credible = one.credible(others)
    begin = "Explained by" if credible else "In part, at most, by"
    rest = 1000 * settled.noise
    doubt = "" if credible else (
        f" What is left (x {rest[0]:.1f} mm, y {rest[1]:.1f} mm) is more than noise would be: "
        "there is another cause, or the noise is larger than is known."
    )  # fmt: skip
    text = (
        f"{begin} {_named(one, model)}{_or(selection)}: {said} ({how}). {_change(settled)}{doubt} "
        f"{measure(one, settled)}{looks_constant(settled)}"
    )
    sizes = sizes_of(values, confidence)
    return Finding("warning", text, one.system, "systematic_error", sizes)


def _hidden_by_lasting(selection: Selection) -> str:
    """What would be claimed if errors did not depend on their neighbours."""
    best = selection.taken_out
    p = max(best.p_values.values(), default=1.0)
    return (
        f"No systematic error is shown. If errors were independent, {best.model.words} would be "
        "claimed; but they depend on their neighbours, and such errors without a cause look like "
        f"that with the chance p = {p:.2g}. A cause is claimed only below "
        f"{selection.threshold:.2g}. Take it as a hint."
    )


def _or(selection: Selection) -> str:
    """The simplest explanations that these poses do not tell from the chosen one."""
    rivals = [one.model for one in selection.rivals]
    simplest = [one for one in rivals if not any(other.nested_in(one) for other in rivals)]
    if not simplest:
        return ""
    others = " or ".join(one.words for one in simplest)
    words = selection.chosen.model.words
    return f", or equally well by {others}; these poses cannot tell which. As {words}"


def _hidden(selection: Selection) -> str:
    """How large a frame or mount error would have to be to be claimed in 95 % of campaigns."""
    said = []
    follows = None if selection.pairs.reference else selection.pairs.follows
    for one in selection.candidates:
        name = one.name
        if name not in {"frame", "mount"} or (follows is not None and name in follows.what):
            continue
        if one.observability.complete:
            shift, turn = smallest_shown(one.fit, selection.threshold)
            said.append(f"of the {name} from {1000 * shift:.1f} mm or {1000 * turn:.1f} mrad on")
    if not said:
        return ""
    return f" With these poses only errors {' and '.join(said)} are found reliably."


def _cannot_show(selection: Selection) -> str:
    """What the survey itself took out of the errors."""
    follows = selection.pairs.follows
    if follows is None or selection.pairs.reference:
        return ""
    stops = f"{len(follows.ids)} surveyed stop{'s' if len(follows.ids) > 1 else ''}"
    return f" Its {follows.what} came from {stops}, so that it cannot show whether it is wrong."


def _named(one: SystemExplanation, model: ErrorModel) -> str:
    """The explanation in words, with its reference."""
    if model.through_reference and "frame" not in model.parts:
        assert one.selection is not None
        return f"{model.words} {one.selection.pairs.reference}"
    if one.reference is not None and one.reference.accepted:
        which = one.reference.possible[0] if one.reference_decided else "which is not decided"
        words = "a wrong mount that also shifted the frame through a reference pose"
        return f"{words} (inferred: {which})"
    return model.words


def _convention(selection: Selection) -> list[Finding]:
    """A convention in which the table differs from the validation."""
    read = selection.pairs.convention
    if not read.name:
        return []
    text = (
        f"This table has {read.words}, compared with the validation. It was read so, and all that "
        "follows is of the poses as they were read. Correct the table; if the validation is what "
        "is wrong, correct that."
    )
    if "direction_of_motion" in read.name:
        text += " Headings of motion say nothing of the robot's; compare its positions alone."
    return [Finding("error", text, selection.pairs.system, "convention")]


def _covariance_unit(selection: Selection) -> list[Finding]:
    """Covariances in another unit than the positions."""
    slip, system = selection.pairs.covariance_unit, selection.pairs.system
    if not slip.words:
        return []
    text = (
        f"By the size of the errors, {slip.words}. They were read so. Write covariances in the "
        "square of the unit of the positions."
    )
    size = Size("what is left over what is stated", slip.ratio)
    return [Finding("error", text, system, "covariance_unit", (size,))]


def dependence_findings(selection: Selection, settled: Settled, system: str) -> list[Finding]:
    """Whether errors depend on those of their neighbours, and what that does."""
    if not selection.dependent or settled.serial is None:
        return []
    kinds = zip(("positions", "headings"), settled.serial.kinds, strict=True)
    said = "; ".join(
        f"what is left of the {name} of neighbours has a correlation of {kind.neighbours:.1f} and "
        f"lasts for about {kind.length:.2g} poses ({len(kind.steps)} tell a mean as well as "
        f"{kind.effective():.2g} independent ones)"
        for name, kind in kinds
        if kind.weights[0] < 0.5  # more likely than not
    )
    what = settled.serial.withheld
    then = (
        f"Intervals are withheld: {what}."
        if what
        else "Intervals and tests allow for that: they are wider than for independent errors."
    )
    odds = times_text(float(np.exp(min(selection.memory, 700.0))))
    text = (
        f"Errors depend on those of their neighbours in order ({odds} as likely as that they do "
        f"not): {said or 'neighbours are alike'}. {then} {RATE}. "
        "Repeat stops at another time, in another order."
    )
    alike = zip(("positions", "headings"), settled.serial.kinds, strict=True)
    sizes = tuple(Size(f"correlation of neighbouring {n}", kind.neighbours) for n, kind in alike)
    return [Finding("warning", text, system, "dependent_errors", sizes)]


def _wandering(settled: Settled) -> str:
    """Errors that last as long as the table."""
    left = settled.spread(settled.before)
    return (
        "The errors drift: those of neighbours are alike for as long as the table, so that a "
        f"constant cause cannot be told from them. Around their mean they spread by x "
        f"{1000 * left[0]:.1f} mm, y {1000 * left[1]:.1f} mm, theta {1000 * left[2]:.1f} mrad. To "
        "confirm: return to the first stops; the error there must have changed."
    )


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
    gain = chosen.loo.score - best.loo.score
    p = max(chosen.p_values.values(), default=1.0)
    return (
        f"How sure: it is {times_text(odds)} as likely (by BIC) as the next best explanation that "
        f"does not include it, {best.model.words}. Poses that a fit did not use are predicted "
        f"{'better' if gain > 0 else 'no better'} than by that one (log score {gain:+.1f}). Every "
        f"part of it is needed (largest p = {p:.1g})."
    )


def _rms(settled: Settled, errors: Array) -> Array:
    """(3,) root mean square of x, y and theta over the cells used: mean and spread together."""
    mean, spread = settled.mean(errors), settled.spread(errors)
    n = settled.cells.sum(0)[[0, 0, 1]]
    return np.asarray(np.sqrt(mean**2 + spread**2 * (n - 1) / np.maximum(n, 1)))


def _change(settled: Settled) -> str:
    """Root mean square before and after in short."""
    said = " to ".join(
        "({:.1f}, {:.1f})".format(*1000 * _rms(settled, errors)[:2])
        for errors in (settled.before, settled.after)
    )
    return (
        "Taking it out brings the root mean square of x and y, in mm where nothing is flagged, "
        f"from {said}."
    )


def _taken_away(settled: Settled) -> str:
    """What the explanation takes away of the cells used: of their mean, and of their spread."""
    both = settled.before, settled.after
    (first, last), (before, after) = (
        [what(errors) for errors in both] for what in (settled.mean, settled.spread)
    )
    parts = []
    for column, name in enumerate(("x", "y", "theta")):
        unit = "mrad" if column == 2 else "mm"
        square = first[column] ** 2 + before[column] ** 2
        rest = last[column] ** 2 + after[column] ** 2
        # Noise of the noise estimate can make the share fall below zero.
        share = 100 * max(1 - rest / square, 0.0) if square > 0 else 0.0
        parts.append(
            f"{name} {share:.0f} % (mean from {1000 * first[column]:+.1f} to "
            f"{1000 * last[column]:+.1f}, spread from {1000 * before[column]:.1f} to "
            f"{1000 * after[column]:.1f} {unit})"
        )
    used, n = settled.cells.sum(0), len(settled.cells)
    return (
        "Of the mean square it takes away, where nothing is flagged "
        f"({used[0]} of {n} positions, {used[1]} of {n} headings): {', '.join(parts)}."
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
            "compare a heading that the system gives with the robot's own: its mount is turned by "
            f"{1000 * values['mount_theta']:+.1f} mrad; only stops at another heading can tell "
            "whether the shift is the frame's or the mount's"
        )
    through = settled.fit.model.through_reference or (
        one.reference is not None and one.reference.accepted
    )
    if through:
        advice.append(
            "the error must vanish at the heading of the reference pose and be largest, "
            f"{2 * float(np.hypot(values['mount_x'], values['mount_y'])):.3f} m, opposite to it"
        )
    assert one.selection is not None
    placed = one.selection.pairs.follows
    if {"frame", "shift"} & set(parts) and not through and placed is not None:
        advice.append(
            f"the frame came from {len(placed.ids)} surveyed stops: place it again without those "
            "that are flagged"
        )
    elif {"frame", "shift"} & set(parts) and not through:
        advice.append(
            "let the system locate the marks of the Vframe itself (the numbers are what its poses "
            "must be moved by, along the axes of the validation; the marks are off the other way)"
        )
    if "scale" in parts:
        advice.append("measure a long known distance, such as the pole, with the system")
    if settled.fit.model.drifts:
        advice.append("return to the first stops after the last: the error there must have grown")
    if "time" in parts:
        advice.append("repeat with the robot at rest, where the error must vanish")
    return f"To confirm: {'; '.join(advice)}." if advice else ""


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
        f"Other explanations are not ruled out: {said}. These poses cannot tell them apart "
        f"(headings spread by {spread:.0f} degrees). {_why(selection)}Survey stops at other "
        "headings and farther apart."
    )
    chosen = selection.chosen.criterion
    sizes = tuple(Size(f"BIC of {o.model.words}", o.criterion - chosen) for o in selection.rivals)
    return [Finding("warning", text, selection.pairs.system, "rivals", sizes)]


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
        f"{best.model.words.capitalize()} has a lower BIC "
        f"({best.criterion - chosen.criterion:+.1f}), but what it adds has p = {p:.2g} and is "
        f"claimed only below {selection.threshold:.2g}. Take it as a hint."
    )
    size = Size(f"BIC of {best.model.words}", best.criterion - chosen.criterion)
    return [Finding("note", text, selection.pairs.system, "hint", (size,))]


def _blind(selection: Selection) -> list[Finding]:
    """What these poses cannot show."""
    lost = [one for one in selection.candidates if not one.observability.complete]
    if not lost:
        return []
    said = "; ".join(
        f"'{one.name}': {_directions(one)}"
        for one in sorted(lost, key=lambda o: len(o.model.parts))
    )
    n = len(selection.pairs)
    spread = np.degrees(lost[0].observability.heading_spread)
    text = (
        f"These {n} poses (headings spread by {spread:.0f} degrees) cannot test every explanation. "
        f"They do not determine, of {said}."
    )
    size = Size("spread of the headings", lost[0].observability.heading_spread, "rad")
    return [Finding("warning", text, selection.pairs.system, "not_observable", (size,))]


def _directions(one: Candidate) -> str:
    """The parameters that are not determined."""
    return ", ".join(one.observability.undetermined)


def _noise(selection: Selection, settled: Settled) -> list[Finding]:
    """Where the noise level came from, and what is left unexplained."""
    left = settled.noise
    told = (
        f"What remains, per degree of freedom: x {1000 * left[0]:.1f} mm, "
        f"y {1000 * left[1]:.1f} mm, theta {1000 * left[2]:.1f} mrad (root mean square of the "
        "cells that are not flagged; it contains the noise of the validation)."
    )
    sizes = noise_sizes(left, "what remains")
    if selection.pairs.stated:
        found = [Finding("note", told, selection.pairs.system, "left", sizes)]
        return found + left_findings(settled)
    text = (
        "No covariances are stated on both sides, so the noise level is estimated from the errors "
        f"themselves, one for positions and one for headings. {told}"
    )
    return [Finding("note", text, selection.pairs.system, "noise_estimated", sizes)]
