"""Figures of the checks around a survey: instrument, convergence, plan."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from survey.figures.maps import WIDTH, Places, Room, finish_legend, survey_map
from survey.readings.instrument import tolerance_at
from survey.studies.convergence import NOT_CONVERGED, REACHES_OTHER, REACHES_SOLUTION, Convergence
from survey.studies.instrument_check import InstrumentCheck
from validation.campaign.folder import Instrument
from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array, wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_DRAWN = 1500
"""Starts of one kind drawn in a map. A judgement: more would hide one another."""


def instrument_figure(
    length: Array, reading: Array, check: InstrumentCheck, instrument: Instrument
) -> Figure:
    """Errors of the readings over the length, the fitted line, and what the maker states.

    Parameters
    ----------
    length, reading : (n,) array
        Metres.
    check : InstrumentCheck
        What was found.
    instrument : Instrument
        Its specification.
    """
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    axes = figure.add_subplot()
    pad = max(0.06 * float(np.ptp(length)), 0.2)
    at = np.linspace(max(length.min() - pad, 0.0), length.max() + pad, 100)
    stated = tolerance_at(instrument, at) * 1e3
    axes.fill_between(at, -stated, stated, color="#EEEEEE", label="stated tolerance")
    axes.plot(at, stated, color=GREY, linewidth=0.8)
    axes.plot(at, -stated, color=GREY, linewidth=0.8)
    axes.axhline(0, color=GREY, linewidth=0.6)
    slope = 0.0 if np.isnan(check.scale_error) else check.scale_error
    axes.plot(
        at, (check.offset + slope * at) * 1e3, "--", color=COLOURS[1], linewidth=1.5, label="fit"
    )
    axes.plot(length, (reading - length) * 1e3, "o", color=COLOURS[0], ms=5, label="reading")
    axes.set_xlim(at[0], at[-1])
    axes.set_xlabel("true length [m]")
    axes.set_ylabel("reading − true [mm]")
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def convergence_map(found: Convergence, name: str, heading_limit: float = np.pi) -> Figure:
    """Which first guesses lead where, around the solution.

    Parameters
    ----------
    found : Convergence
        Starts and outcomes.
    name : str
        Of the world point or pose, for the title.
    heading_limit : float
        Starts with a larger heading error, in radians, are left out.

    Notes
    -----
    As AD2.3, figure "Plot showing the absence of other solutions for the filter": the solution is
    the large blue circle, green starts lead to it.
    """
    figure = Figure(figsize=(WIDTH, WIDTH), layout="constrained")
    axes = figure.add_subplot()
    turned = np.abs(wrap(found.starts[:, 2:] - found.solution[2:])).max(axis=-1, initial=0.0)
    shown = turned <= heading_limit
    _draw_starts(axes, found, shown)
    axes.plot(
        *found.solution[:2], "o", ms=13, mfc="none", mec=COLOURS[0], mew=2.5, label="solution"
    )
    for other in found.others:
        axes.plot(*other.state[:2], "D", ms=7, mfc="none", mec="black", label="other solution")
    same = [r for r in found.regions if np.isclose(r.heading_limit, heading_limit)]
    for region in (r for r in same if r.radius > 0):
        turn = np.linspace(0, 2 * np.pi, 200)
        circle = found.solution[:2] + region.radius * np.stack([np.cos(turn), np.sin(turn)], -1)
        label = f"no failure within {region.radius:.2g} m"
        axes.plot(*circle.T, "--", color="black", linewidth=1.5, label=label)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m], GTV frame")
    axes.set_ylabel("y [m], GTV frame")
    within = "" if len(found.solution) == 2 else _heading_words(heading_limit)
    axes.set_title(f"{name}: where {int(shown.sum())} first guesses lead{within}", fontsize=10)
    finish_legend(axes)
    return figure


def _heading_words(limit: float) -> str:
    if np.isclose(limit, np.pi):
        return ", any heading"
    return f", heading within ±{np.degrees(limit):.0f}°"


def _draw_starts(axes: "Axes", found: Convergence, shown: "np.typing.NDArray[np.bool_]") -> None:
    """Starts by kind, those that fail last so that none of them is hidden."""
    kinds = (
        (REACHES_SOLUTION, ".", "#4DB894", 3, "leads to the solution"),
        (REACHES_OTHER, "x", COLOURS[1], 5, "leads elsewhere"),
        (NOT_CONVERGED, "+", "black", 7, "does not converge"),
    )
    for kind, marker, colour, size, label in kinds:
        rows = np.flatnonzero(shown & (found.outcome == kind))
        if rows.size == 0:
            continue
        drawn = rows[:: max(1, -(-rows.size // _MOST_DRAWN))]
        axes.plot(
            *found.starts[drawn, :2].T,
            marker,
            color=colour,
            ms=size,
            label=f"{label} ({rows.size})",
            rasterized=rows.size > 300,
        )


def planning_map(
    room: Room,
    world: Places | None,
    frames: Places | None,
    extra: Sequence[tuple[str, Array, Array]],
) -> Figure:
    """Predicted ellipses, and the readings that would help most as numbered lines.

    Parameters
    ----------
    room : Room
        Vframe, rig and walls.
    world, frames : Places, optional
        Planned or measured places with their covariances.
    extra : sequence of (str, (2,) array, (2,) array)
        Number and ends of each extra reading, metres.
    """
    figure = survey_map(room, world, frames)
    axes = figure.axes[0]
    for row, (number, start, end) in enumerate(extra):
        label = "extra reading" if row == 0 else None
        axes.plot(*np.stack([start, end]).T, ":", color="#CC79A7", linewidth=2.0, label=label)
        axes.annotate(
            number,
            tuple((start + end) / 2),
            ha="center",
            va="center",
            fontsize=7,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "linewidth": 0.6},
        )
    finish_legend(axes)
    return figure
