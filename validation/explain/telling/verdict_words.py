"""Who is wrong at which stop, and how noisy each source is, in plain sentences."""

from collections.abc import Sequence

import numpy as np

from validation.explain.sources.tails import HEAVY
from validation.explain.sources.verdicts import Arbitration, Verdict, listed
from validation.results import TWO_SIDED, Finding, Severity, Size, listed_ids


def arbitration_findings(result: Arbitration) -> list[Finding]:
    """Who is wrong where, and the noise of each source."""
    told = _copies(result)
    told += [_verdict(one, result) for one in result.verdicts]
    cells = int((result.present.sum(0) > 1).sum()) * 2
    text = (
        f"{len(result.verdicts)} of {cells} cells (position and heading of each stop) do not fit. "
        f"In a table of good poses with normal errors the chance of even one is "
        f"{100 * result.false_alarm:.3g} % (over all {result.questions} tests together)."
    )
    if result.tails is not None and result.tails.heavy > HEAVY:
        text += (
            " But the errors of this table have heavier tails than normal ones (like Student's "
            f"with about {result.tails.freedom:.2g} degrees of freedom): in good tables with such "
            f"tails the chance is about {100 * result.rate:.2g} %, and a flag says that a pose is "
            "off, not that somebody made a mistake."
        )
    count = Size("cells that do not fit", len(result.verdicts), "cells")
    told.append(Finding("note", text, "all sources", "arbitration", (count,)))
    told += _suspects(result)
    told += _pairs_only(result)
    told.append(_hat(result))
    return told


def _copies(result: Arbitration) -> list[Finding]:
    """Tables that are copies of one another."""
    told = []
    for one in result.copies:
        text = (
            f"{listed(one.names)} differ by {_size(one.apart)} only (typically, a frame and a "
            f"mount taken out), but by {_size(one.others)} or more from any other source. That is "
            "too little for independent errors: one is a copy of another, or derived from it. They "
            "count as one witness; if they are independent, state it: [explain] independent, or "
            "--independent with single tables."
        )
        size = Size("distance from each other", one.apart, "m")
        told.append(Finding("warning", text, listed(one.names), "copies", (size,)))
    return told


def _size(length: float) -> str:
    return "less than 0.1 mm" if length < 1e-4 else f"{1000 * length:.1f} mm"


def _suspects(result: Arbitration) -> list[Finding]:
    """Cells to look at again."""
    if not result.suspects:
        return []
    said = "; ".join(
        f"pose {one.stop}, {one.cell} ({' or '.join(one.blamed)}, off by {one.size:.3f} "
        f"{_unit(one)})"
        for one in result.suspects
    )
    text = (
        f"Look again at {said}. No source is called wrong there, and nothing is left out. One "
        "such entry is normal, even if all poses are good."
    )
    sizes = tuple(_off(one, result) for one in result.suspects)
    return [Finding("note", text, "all sources", "suspects", sizes)]


def _unit(one: Verdict) -> str:
    return "m" if one.cell == "position" else "rad"


def _off(one: Verdict, result: Arbitration) -> Size:
    """How far off a cell is; with an interval by the noise of the sources where one is blamed."""
    half = np.nan
    if len(one.blamed) == 1 and one.blamed[0] in result.sources:
        row, column = result.sources.index(one.blamed[0]), result.ids.index(one.stop)
        score = float(result.scores[row, column, int(one.cell == "heading")])
        half = TWO_SIDED * one.size / score if score > 0 else np.nan
    name = f"{one.cell} of pose {one.stop}"
    if np.isnan(half):
        return Size(name, one.size, _unit(one))
    return Size(name, one.size, _unit(one), max(one.size - half, 0.0), one.size + half, 0.95)


def _verdict(one: Verdict, result: Arbitration) -> Finding:
    """One flagged cell."""
    size, validation = f"{one.size:.3f} {_unit(one)}", result.sources[0]
    code = {"sure": "wrong_pose", "likely": "likely_wrong_pose"}.get(one.certainty, "disputed_pose")
    if one.certainty == "undecided":
        text = (
            f"The {one.cell} is off by {size}: {one.reason}. To decide: measure this stop again, "
            "by the survey and by something that has no part in any of them, as a tape from two "
            "marks, and give it as a witness."
        )
    else:
        how = "is" if len(one.blamed) == 1 else "are"
        how += "" if one.certainty == "sure" else " most likely"
        text = f"{listed(one.blamed)} {how} wrong in the {one.cell}, by {size}: {one.reason}."
        if validation in one.blamed:
            text += " Survey this stop again."
    severity: Severity = "warning"
    return Finding(severity, text, f"pose {one.stop}", code, (_off(one, result),))


def _pairs_only(result: Arbitration) -> list[Finding]:
    """Stops with two sources, at which a disagreement does not show who is wrong."""
    two = [name for name, n in zip(result.ids, result.present.sum(0), strict=True) if n == 2]
    if not two:
        return []
    where = "all stops" if len(two) == len(result.ids) else f"pose {listed_ids(two)}"
    text = (
        f"At {where} there are only two sources. Where they disagree, one is wrong, but nothing "
        "tells which. A third source tells it, even a rough one."
    )
    count = Size("stops with two sources", len(two), "stops")
    return [Finding("note", text, "all sources", "two_sources", (count,))]


def _hat(result: Arbitration) -> Finding:
    """Noise of each source alone."""
    if not result.variances.determined:
        text = (
            "The noise of each source alone cannot be found. It needs three sources that share no "
            "sensor, each with at least three stops in common with the others."
        )
        return Finding("note", text, "all sources", "no_three_cornered_hat")
    intervals = result.variances.intervals()
    said = "; ".join(
        f"{name} {_range(intervals[row, 0], 'mm')}, {_range(intervals[row, 1], 'mrad')}"
        for row, name in enumerate(result.sources)
    )
    text = (
        "Noise of each source alone, from the differences between independent ones (standard "
        f"deviation of a coordinate and of the heading, 95 % intervals): {said}."
    )
    kinds = (("a coordinate", "m"), ("the heading", "rad"))
    sizes = tuple(
        Size(
            f"noise of {name} in {what}", _middle(ends), unit, float(ends[0]), float(ends[1]), 0.95
        )
        for name, rows in zip(result.sources, intervals, strict=True)
        for (what, unit), ends in zip(kinds, rows, strict=True)
    )
    return Finding("note", text, "all sources", "three_cornered_hat", sizes)


def _middle(ends: Sequence[float]) -> float:
    return float(ends[0] + ends[1]) / 2


def _range(ends: Sequence[float], unit: str) -> str:
    if 1000 * ends[1] < SHOWN:
        return f"below {SHOWN:g} {unit}"
    return f"{1000 * ends[0]:.1f} to {1000 * ends[1]:.1f} {unit}"


SHOWN = 0.1
"""Millimetres and milliradians below which no figure is told: the digits of printed tables."""
