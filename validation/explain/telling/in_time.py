"""What explains the errors of a source in time, as sentences, tables and JSON."""

from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import version

import numpy as np

from validation.explain.telling.number_words import parameter_text, sizes_of, table_of_parameters
from validation.results import Finding, Size, Table
from validation.trajectories.causes.chain import CAUSES, WORDS
from validation.trajectories.causes.explanation import Cause, TimeExplanation


def time_findings(one: TimeExplanation, elsewhere: Collection[str] = ()) -> list[Finding]:
    """One sentence for each cause, and what this drive does not tell.

    Parameters
    ----------
    one : TimeExplanation
        What is told.
    elsewhere : collection of str
        Names of causes that are told elsewhere.
    """
    left = (
        Size("what is left in x and y", one.position.sigma, "m"),
        Size("what is left in theta", one.heading.sigma, "rad"),
    )
    told = [
        Finding(
            "warning",
            _cause(one, cause),
            one.system,
            "systematic_error",
            sizes_of(cause.parameters, one.confidence),
        )
        for cause in one.causes
        if cause.name not in elsewhere
    ]
    if not one.causes:
        told.append(Finding("good", _nothing(one), one.system, "no_systematic_error", left))
    if one.rivals:
        told.append(Finding("warning", _rivals(one), one.system, "rivals"))
    told += _blind(one)
    told.append(Finding("note", _noise(one), one.system, "left", left))
    return told


def _cause(one: TimeExplanation, cause: Cause) -> str:
    """Size, what it spoils, how to confirm."""
    said = ", ".join(parameter_text(value) for value in cause.parameters)
    spoils = f"{1000 * cause.spoils:.1f} mm"
    if cause.turns > 0.1e-3:
        spoils += f" and {1000 * cause.turns:.1f} mrad"
    return (
        f"{cause.words.capitalize()}: {said} ({100 * one.confidence:.3g} % intervals). It moves "
        f"poses by {spoils} (root mean square; typical speed {one.typical_speed:.2f} m/s). "
        f"To confirm: {_confirm(cause)}."
    )


def _confirm(cause: Cause) -> str:
    """What to do in the room."""
    values = {value.name: value.value for value in cause.parameters}
    if cause.name == "mount":
        arm = 2 * float(np.hypot(values["mount_x"], values["mount_y"]))
        return (
            "turn the robot by 180 degrees on one spot: its given position must move by "
            f"{arm:.3f} m against the reference's"
        )
    return {
        "frame": "let the source locate marks whose places in the reference's frame are known",
        "turn": "compare a given heading with the robot's at rest",
        "scale": "measure a long known distance with the source",
        "delay": "drive the same way at half the speed: the error must be half as large, and "
        "vanish at rest",
        "clock_drift": "compare the delays of two short drives, one at the start of a long record "
        "and one at its end",
        "pose_drift": "return to the start after the drive: the pose there must have moved",
    }[cause.name]


def _set_words(causes: Sequence[str]) -> str:
    """'a wrong frame and a delay'."""
    return " and ".join(WORDS[name] for name in causes)


def _rivals(one: TimeExplanation) -> str:
    """Which explanations the drive does not tell apart, and how to drive."""
    sets = [tuple(cause.name for cause in one.causes), *one.rivals]
    common = set(sets[0]).intersection(*sets[1:])
    names = [_short([name for name in causes if name not in common]) for causes in sets]
    return (
        f"{' or '.join(names)}: cannot be told. As well as {one.words}, "
        f"{' or '.join(_set_words(causes) for causes in one.rivals)} explains these errors. "
        f"{_advice({name for causes in sets for name in causes})}"
    )


def _short(names: Sequence[str]) -> str:
    return " with ".join(name.replace("_", " ") for name in names) or "nothing more"


def _advice(names: set[str]) -> str:
    """How a drive would tell these apart."""
    advice = []
    if names & {"delay", "clock_drift"}:
        advice.append("at changing speeds, with stops")
    if names & {"frame", "mount", "turn", "delay"}:
        advice.append("with turns both ways and all headings at one place")
    if names & {"scale", "pose_drift"}:
        advice.append("through the whole room and back to the same places")
    return f"Drive {', '.join(advice)}."


def _blind(one: TimeExplanation) -> list[Finding]:
    """What no size of error would show on this drive."""
    found = []
    said = [f"{_short([a])} or {_short([b])}: cannot be told apart" for a, b in one.alike]
    said += [f"{_short([name])}: cannot be seen" for name in one.unseen]
    if said:
        asked = {name for pair in one.alike for name in pair} | set(one.unseen)
        text = f"This drive cannot show everything. {'; '.join(said)}. {_advice(asked)}"
        found.append(Finding("warning", text, one.system, "not_observable"))
    return found


def _nothing(one: TimeExplanation) -> str:
    """How large each cause would have to be."""
    said = []
    for name, words in (("frame_x", "a frame"), ("mount_x", "a lever arm"), ("delay", "a delay")):
        cause = next(key for key, names in CAUSES.items() if name in names)
        if cause not in one.unseen:
            unit = "ms" if name == "delay" else "mm"
            said.append(f"{words} of {1000 * one.smallest[name]:.1f} {unit}")
    hidden = f" A smaller one than {', '.join(said)} would not reliably show." if said else ""
    return (
        f"No systematic error is shown in {one.poses} poses; one is claimed by chance in "
        f"{100 * one.false_alarm:.3g} % of drives.{hidden}"
    )


def _noise(one: TimeExplanation) -> str:
    """What is left, and how many poses these poses are worth."""
    return (
        f"What is left of {one.poses} poses ({one.left_out} with a cell left out): "
        f"{1000 * one.position.sigma:.1f} mm in x and y, {1000 * one.heading.sigma:.1f} mrad. "
        f"Errors of neighbours are alike: {1000 * one.position.slow:.1f} mm of it for "
        f"{one.position.correlation_time:.2g} s, {1000 * one.heading.slow:.1f} mrad for "
        f"{one.heading.correlation_time:.2g} s, so that the poses count as "
        f"{one.effective[0]:.0f} positions and {one.effective[1]:.0f} headings."
    )


def time_cause_table(explained: Sequence[TimeExplanation]) -> Table:
    """One row a source, as for stops."""
    rows = [
        [one.system, one.words, one.before[0], one.after[0], one.before[1], one.after[1]]
        for one in explained
    ]
    return Table(
        "Where the errors come from",
        [
            *("system", "explained by", "positions before [m]", "positions after [m]"),
            *("headings before [rad]", "headings after [rad]"),
        ],
        rows,
        ["", "", ".4f", ".4f", ".4f", ".4f"],
        note="Root mean square of the poses that fit, before and after what is explained is taken "
        "out.",
    )


def time_parameter_table(one: TimeExplanation) -> Table:
    """Numbers of the causes that are there."""
    return table_of_parameters(
        one.system,
        one.name,
        one.parameters,
        f"{100 * one.confidence:.3g} % intervals. The frame maps the source's coordinates to "
        "the reference's, the mount stands on the robot's side (right), the delay is added to the "
        "source's stamps.",
    )


def time_json(explained: Sequence[TimeExplanation]) -> Mapping[str, object]:
    """All numbers, for scripts; the same keys as for stops where they are the same."""
    return {
        "gtval": version("gtval"),
        "confidence": explained[0].confidence,
        "false_alarm": explained[0].false_alarm,
        "reference": explained[0].reference,
        "systems": {one.system: cause_json(one) for one in explained},
        "findings": [finding for one in explained for finding in time_findings(one)],
    }


def cause_json(one: TimeExplanation) -> dict[str, object]:
    """All numbers of one source."""
    return {
        "explanation": one.name,
        "words": one.words,
        "poses": one.poses,
        "left_out": one.left_out,
        "parameters": one.parameters,
        "covariance": one.covariance,
        "causes": {
            cause.name: {"spoils": cause.spoils, "turns": cause.turns} for cause in one.causes
        },
        "not_ruled_out": ["_".join(causes) for causes in one.rivals],
        "alike": one.alike,
        "unseen": one.unseen,
        "smallest_shown": one.smallest,
        "typical_speed": one.typical_speed,
        "noise": {"position": one.position, "heading": one.heading},
        "effective_poses": {"position": one.effective[0], "heading": one.effective[1]},
        "rms": {"before": one.before, "after": one.after},
    }
