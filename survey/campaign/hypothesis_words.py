"""Hypotheses about what went wrong, as statements with their sizes."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from survey.causes.lead import Lead
from survey.readings.readings import Readings
from validation.statistics.hypotheses import Parameter, Tried
from validation.statistics.units import unit_of_ratio

MM = 1e3
OTHER_EDGE = (0.06, 0.16)
"""Offsets, in metres, that are the length of a hand laser: from one edge of it to the other."""
NAMES: Mapping[str, str] = {
    "offset": "an offset", "scale": "a scale", "height": "a height", "moved": "a point that moved",
    "vframe_point": "a Vframe point off its place", "rig_mark": "a wrong mark of the rig",
    "rig_point": "a rig point off its place", "exchanged_targets": "two targets exchanged",
    "exchanged_rig_points": "two rig points exchanged", "stop_number": "a wrong stop number",
    "exchanged_rows": "rows exchanged", "blunders": "independent blunders", "none": "nothing wrong",
}  # fmt: skip
"""Kinds of causes in words."""


def short(lead: Lead, used: Readings) -> str:
    """A hypothesis in a few words, without its size."""
    name = NAMES[lead.kind]
    if lead.kind in {"offset", "scale", "height"}:
        return f"{name} in {_where(lead, used)}"
    if lead.kind in _BY_NAMES:
        return _SAID[lead.kind](lead, (), used)
    return f"{name}: {' '.join(lead.subject)}" if lead.subject else name


_BY_NAMES = {"exchanged_targets", "exchanged_rig_points", "stop_number", "exchanged_rows"}
"""Kinds whose statement has no size."""


def said(one: Tried[Lead], used: Readings) -> str:
    """A hypothesis as a statement, with its size and interval."""
    lead = one.what
    return _SAID[lead.kind](lead, one.parameters, used)


def _where(lead: Lead, used: Readings) -> str:
    """Which readings a common error is in."""
    n = len(lead.rows)
    also = f" (the same readings: {', '.join(lead.also)})" if lead.also else ""
    if lead.extent == "all":
        return f"all {n} readings"
    if lead.extent == "walls":
        return f"the {n} readings between floor and walls"
    if lead.extent in {"from", "until", "block"}:
        lines = [used.line[r] for r in lead.rows]
        first, last = int(lead.rows[0]), int(lead.rows[-1])
        ends = f"{used.start[first]}–{used.end[first]} to {used.start[last]}–{used.end[last]}"
        return f"the {n} readings from line {lines[0]} to line {lines[-1]} ({ends})"
    name = lead.subject[0]
    what = {
        "station": f"of stop {name}" if any(s.startswith(f"{name}/") for s in used.start)
        else f"at Vframe point {name}",
        "observer": f"of observer {name}",
        "day": f"of {name}",
        "point": f"to point {name}",
    }[lead.extent]  # fmt: skip
    return f"the {n} readings {what}{also}"


def _offset(lead: Lead, parameters: Sequence[Parameter], used: Readings) -> str:
    (b,) = parameters
    size, low, high = _turned(b, MM)
    what = f"{_where(lead, used)} are too {'long' if b.value > 0 else 'short'} by {size:.1f} mm"
    edge = OTHER_EDGE[0] < abs(b.value) < OTHER_EDGE[1]
    hint = ", as if measured from the other edge of the instrument" if edge else ""
    return f"{what} (95 %: {low:.1f} to {high:.1f}){hint}: one offset"


def _turned(b: Parameter, unit: float) -> tuple[float, float, float]:
    """Size and interval as a person says them, of the absolute value."""
    ends = sorted((b.low * np.sign(b.value) * unit, b.high * np.sign(b.value) * unit))
    return abs(b.value) * unit, float(ends[0]), float(ends[1])


def _scale(lead: Lead, parameters: Sequence[Parameter], used: Readings) -> str:
    (b,) = parameters
    factor = 1 + b.value
    unit = unit_of_ratio(factor)
    if unit:
        return f"{_where(lead, used)} are in {unit}, not in metres (factor {factor:.4f})"
    size, low, high = _turned(b, 1e2)
    return (
        f"{_where(lead, used)} are too {'long' if b.value > 0 else 'short'} by {size:.3f} % "
        f"(95 %: {low:.3f} to {high:.3f}): one scale, of a stretched tape or of the instrument"
    )


def _height(lead: Lead, parameters: Sequence[Parameter], used: Readings) -> str:
    (h,) = parameters
    return (
        f"{_where(lead, used)} run between heights that differ by {MM * h.value:.0f} mm "
        f"(95 %: {MM * h.low:.0f} to {MM * h.high:.0f})"
    )


def _shift(parameters: Sequence[Parameter]) -> str:
    whole = MM * float(np.linalg.norm([p.value for p in parameters]))
    each = [
        f"{p.name} {MM * p.value:+.1f} mm (95 %: {MM * p.low:+.1f} to {MM * p.high:+.1f})"
        for p in parameters
    ]
    return f"{whole:.1f} mm: {', '.join(each)}"


def _moved(lead: Lead, parameters: Sequence[Parameter], used: Readings) -> str:
    before, after = (int(lead.rows[k]) for k in (0, 1))
    return (
        f"point {lead.subject[0]} moved between the readings {named(used, before)} and "
        f"{named(used, after)} by {_shift(parameters)}"
    )


def named(used: Readings, row: int) -> str:
    """A reading by its points and its line."""
    line = f" (line {used.line[row]})" if used.line[row] else ""
    return f"{used.start[row]}–{used.end[row]}{line}"


def _numbers(lead: Lead, _: Sequence[Parameter], used: Readings) -> str:
    lines = f"lines {used.line[lead.rows[0]]} to {used.line[lead.rows[-1]]}"
    wrong, right = lead.subject[:2]
    if not right:
        return (
            f"the {len(lead.rows)} readings of {lines}, written as stop {wrong}, are of another "
            "stop that has no readings of that number"
        )
    points = lead.subject[2].split()
    written, meant = (", ".join(f"{stop}/{p}" for p in points) for stop in (wrong, right))
    return (
        f"the {len(lead.rows)} readings of {lines}, written {written}, are of stop {right}: {meant}"
    )


def _rows(lead: Lead, _: Sequence[Parameter], used: Readings) -> str:
    if lead.extent == "slipped":
        first, last = int(lead.rows[0]), int(lead.rows[-1])
        return (
            f"the {len(lead.rows)} readings {named(used, first)} to {named(used, last)} stand "
            "one row off their place"
        )
    a, b = (int(row) for row in lead.rows)
    text = f"the readings {named(used, a)} and {named(used, b)} stand in each other's row"
    return f"{text}, or the names of their targets are exchanged" if lead.also else text


def _targets(lead: Lead, _: Sequence[Parameter], used: Readings) -> str:
    station, a, b, *last = lead.subject
    stop = any(s.startswith(f"{station}/") for s in (*used.start, *used.end))
    at = f"at stop {station}" if stop else f"from Vframe point {station}"
    if last:
        at = f"from {station} to {last[0]}, in all places where the laser stood between them"
    text = f"the names {a} and {b} are exchanged {at} ({len(lead.rows)} readings)"
    return f"{text}, or, which is the same, everywhere else" if lead.also and last else text


_SAID: Mapping[str, Callable[[Lead, Sequence[Parameter], Readings], str]] = {
    "offset": _offset,
    "scale": _scale,
    "height": _height,
    "moved": _moved,
    "vframe_point": lambda lead, p, _: (
        f"Vframe point {lead.subject[0]} is off its place by {_shift(p)}"
    ),
    "rig_mark": lambda lead, p, _: (
        f"point {lead.subject[1]} of the rig is marked wrong at stop {lead.subject[0]}, off by "
        f"{_shift(p)}, in the robot frame"
    ),
    "rig_point": lambda lead, p, _: (
        f"rig point {lead.subject[0]} is not where campaign.toml says, at all stops, off by "
        f"{_shift(p)}"
    ),
    "exchanged_targets": _targets,
    "exchanged_rig_points": lambda lead, _, __: (
        f"the rig points {lead.subject[1]} and {lead.subject[2]} are exchanged at stop "
        f"{lead.subject[0]}"
    ),
    "stop_number": _numbers,
    "exchanged_rows": _rows,
    "blunders": lambda lead, _, __: f"{lead.subject[0]} independent blunders",
    "none": lambda *_: "nothing is wrong",
}
