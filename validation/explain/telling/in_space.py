"""What explains errors of poses in space, or of positions, as sentences, tables and JSON."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from validation.explain.space.explanation import SpaceExplanation, words_of
from validation.explain.telling.number_words import parameter_text, sizes_of, table_of_parameters
from validation.results import Finding, Section, Size, Table

TITLE = "Where the errors come from, in space"


def space_findings(one: SpaceExplanation) -> list[Finding]:
    """What is there, what else could be, and what these tables cannot say."""
    found = [_first(one)]
    if one.rivals:
        others = " or ".join(words_of(parts) for parts in one.rivals)
        text = f"As well as {one.words}, {others} explains these errors: measure at other headings."
        found.append(Finding("warning", text, one.system, "rivals"))
    if one.not_told:
        text = (
            f"These stops do not determine {', '.join(one.not_told)}, beside what is named before "
            "them: stops at other headings, tilts or places would."
        )
        found.append(Finding("note", text, one.system, "not_observable"))
    if not one.pairs.oriented:
        found.append(Finding("note", _positions(one), one.system, "positions_only"))
    out = [name for name, good in zip(one.pairs.ids, one.cells, strict=True) if not good[0]]
    if out:
        some = ", ".join(out[:5]) + (f" and {len(out) - 5} more" if len(out) > 5 else "")
        count = Size("positions left out", len(out), "poses")
        text = f"Positions that fit neither this nor any other explanation, left out: {some}."
        found.append(Finding("warning", text, one.system, "stops_left_out", (count,)))
    return found


def _first(one: SpaceExplanation) -> Finding:
    """The explanation, or that there is none."""
    left = f"{1000 * one.after[0]:.1f} mm"
    if np.isfinite(one.after[1]):
        left += f" and {1000 * one.after[1]:.1f} mrad"
    rms = Size("rms of what is left of positions", float(one.after[0]), "m")
    if not one.credible:
        ratio = Size("what is left over what is stated", one.misfit)
        text = (
            f"Not explained: with {one.words} there remain {left}, {one.misfit:.2g} times what is "
            "stated. Either the stated covariances are too small, or the cause is none of frame, "
            "mount, scale and time."
        )
        return Finding("warning", text, one.system, "not_explained", (rms, ratio))
    if not one.parts:
        text = f"No systematic error is shown in {len(one.pairs)} stops: what is left is {left}."
        return Finding("good", text, one.system, "no_systematic_error", (rms,))
    said = ", ".join(parameter_text(value) for value in one.parameters)
    text = (
        f"{one.words.capitalize()}: {said}. It takes positions from {1000 * one.before[0]:.1f} to "
        f"{left} (root mean square of {int(one.cells[:, 0].sum())} stops that fit)."
    )
    sizes = sizes_of(one.parameters, one.confidence)
    return Finding("warning", text, one.system, "systematic_error", sizes)


def _positions(one: SpaceExplanation) -> str:
    """How far positions without orientation go."""
    if one.pairs.some_orientation:
        whose = "validation" if one.pairs.turned_truth is not None else "system"
        can = "a lever arm can show, a turn of the mount cannot"
        return f"Only the {whose} knows orientations: {can}."
    return (
        "Neither side knows orientations: frame and scale can show. A lever arm cannot: a heading "
        "at each stop would show it."
    )


def space_cause_table(explained: Sequence[SpaceExplanation]) -> Table:
    """One row a system."""
    rows = [
        [
            *(one.system, len(one.pairs), one.words if one.credible else "not explained"),
            *(one.before[0], one.after[0], one.before[1], one.after[1]),
        ]
        for one in explained
    ]
    return Table(
        TITLE,
        [
            *("system", "stops", "explained by", "positions before [m]", "after [m]"),
            *("turns before [rad]", "after [rad]"),
        ],
        rows,
        ["", "d", "", *[".4f"] * 4],
        "Root mean square of the stops that fit.",
    )


def space_parameter_table(one: SpaceExplanation) -> Table:
    """Numbers of what is there."""
    return table_of_parameters(
        one.system,
        one.name,
        one.parameters,
        "The frame maps the system's coordinates to the validation's; the mount is what to add in "
        "the robot's axes. rx, ry, rz: rotation vector. Intervals allow for neighbours that depend "
        "on each other, and assume normal errors.",
    )


def space_section(explained: Sequence[SpaceExplanation]) -> Section:
    """Tables of all systems."""
    tables = [space_parameter_table(one) for one in explained if one.parameters]
    return Section(TITLE, [space_cause_table(explained), *tables])


def space_json(one: SpaceExplanation) -> Mapping[str, object]:
    """All numbers of one system; the same keys as for planar poses where they are the same."""
    return {
        "gtval": version("gtval"),
        "explanation": one.name,
        "words": one.words,
        "credible": one.credible,
        "misfit": one.misfit,
        "poses": len(one.pairs),
        "oriented": one.pairs.oriented,
        "parameters": one.parameters,
        "not_ruled_out": ["_".join(parts) for parts in one.rivals],
        "not_told": one.not_told,
        "unasked": one.unasked,
        "left_out": [n for n, good in zip(one.pairs.ids, one.cells, strict=True) if not good[0]],
        "effective_poses": one.effective,
        "rms": {"before": one.before, "after": one.after},
    }
