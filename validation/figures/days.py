"""Control charts: what is measured day by day, and what was noticed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array

MOST_LABELS = 12
"""Days named below an axis. A judgement: with more, names cover each other."""


@dataclass(frozen=True)
class Panel:
    """One chart.

    Parameters
    ----------
    title : str
        What is measured, with its unit.
    days : (n,) array of int
        Places of the days.
    values, low, high : (n,) array
        What was measured, and its interval.
    centre, limit_low, limit_high : (n,) array
        What the days before led to expect, and where that day alone would have been noticed.
    evidence, limits : (n,) array
        How sure a change was, and what it had to exceed.
    changes : sequence of (int, int)
        Places of the days on which a change began, and was noticed.
    """

    title: str
    days: npt.NDArray[np.intp]
    values: Array
    low: Array
    high: Array
    centre: Array
    limit_low: Array
    limit_high: Array
    evidence: Array
    limits: Array
    changes: Sequence[tuple[int, int]]


def control_charts(rows: Sequence[Sequence[Panel]], labels: Sequence[str]) -> Figure:
    """The values of the days with their limits; a row a component, bias beside spread."""
    return _grid(rows, labels, _values)


def evidence_charts(rows: Sequence[Sequence[Panel]], labels: Sequence[str]) -> Figure:
    """How sure a change was on each day."""
    return _grid(rows, labels, _evidence)


def _grid(
    rows: Sequence[Sequence[Panel]],
    labels: Sequence[str],
    draw: Callable[[Axes, Panel], None],
) -> Figure:
    wide = max(len(row) for row in rows)
    figure = Figure(figsize=(9, 2.0 * len(rows) + 0.6), layout="constrained")
    grid = np.reshape(figure.subplots(len(rows), wide, sharex=True, squeeze=False), (-1, wide))
    step = -(-len(labels) // MOST_LABELS)
    for panels, axes in zip(rows, grid, strict=True):
        for one in axes[len(panels) :]:
            one.set_axis_off()
        for panel, one in zip(panels, axes, strict=False):
            draw(one, panel)
            one.set_title(panel.title, fontsize=9)
            one.grid(visible=True, linewidth=0.3)
            one.set_xlim(-0.5, len(labels) - 0.5)
            shown = range(0, len(labels), step)
            one.set_xticks(
                shown, [labels[day] for day in shown], rotation=30, ha="right", fontsize=7
            )
    return figure


def _values(axes: Axes, panel: Panel) -> None:
    axes.plot(panel.days, panel.centre, color=GREY, linewidth=1)
    axes.fill_between(
        panel.days, panel.limit_low, panel.limit_high, color=GREY, alpha=0.15, linewidth=0
    )
    half = np.abs(np.array([panel.values - panel.low, panel.high - panel.values]))
    axes.errorbar(
        panel.days, panel.values, np.nan_to_num(half), fmt="o", ms=3.5, color=COLOURS[0],
        elinewidth=0.8,
    )  # fmt: skip
    _marks(axes, panel)
    shown = [panel.values, panel.low, panel.high]
    if np.isfinite(panel.limit_low).any():  # the narrowest: those of the first days are wide
        shown.append(np.array([np.nanmax(panel.limit_low), np.nanmin(panel.limit_high)]))
    known = np.concatenate(shown)
    known = known[np.isfinite(known)]
    room = 0.1 * max(float(np.ptp(known)), 1e-9)
    axes.set_ylim(known.min() - room, known.max() + room)


def _evidence(axes: Axes, panel: Panel) -> None:
    axes.plot(panel.days, panel.evidence, "o-", ms=3, color=COLOURS[0], linewidth=1)
    axes.plot(panel.days, panel.limits, "--", color=COLOURS[1], linewidth=1)
    axes.set_ylim(bottom=0)
    _marks(axes, panel)


def _marks(axes: Axes, panel: Panel) -> None:
    """When a change began, as a shade up to the day it was noticed, as a line."""
    for began, noticed in panel.changes:
        axes.axvspan(began, noticed, color=COLOURS[1], alpha=0.12, linewidth=0)
        axes.axvline(noticed, color=COLOURS[1], linewidth=1.2)
