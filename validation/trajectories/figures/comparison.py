"""Figures of a comparison in time, with matplotlib's object interface."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array
from validation.statistics.dependence import mean_of_series
from validation.trajectories.comparison import TimeComparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 4000
"""Points drawn: a page of print shows no more beside each other, and an SVG stays below 1 MB."""
FEW_POINTS = 500
"""So many are drawn larger: a small mark shows no colour. A judgement."""
PARTS = 5
"""Of the record, that each have a mean with an interval drawn."""
SCALES = {"length": (1000.0, "mm"), "angle": (1000.0, "mrad")}


def errors_over_time(comparison: TimeComparison) -> Figure:
    """Every error over time, with the means of parts of the record and their intervals."""
    times = comparison.times - comparison.start
    count = len(comparison.components)
    figure = Figure(figsize=(7, 1.2 + 1.6 * count), layout="constrained")
    panels = np.atleast_1d(figure.subplots(count, 1, sharex=True))
    shown = _shown(len(times))
    for number, (axes, component) in enumerate(zip(panels, comparison.components, strict=True)):
        scale, unit = SCALES[component.kind]
        errors = scale * comparison.errors[:, number]
        for start, end in comparison.coverage.holes - comparison.start:
            axes.axvspan(start, end, color="#E8E8E8", linewidth=0)
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.plot(times[shown], errors[shown], ".", color=COLOURS[0], markersize=2.5)
        _means(axes, times, errors, comparison.confidence)
        axes.set_ylabel(f"{component.name} [{unit}]")
        axes.grid(visible=True, linewidth=0.3)
    panels[0].set_title(
        f"{comparison.system}: errors (reference minus source), means with "
        f"{100 * comparison.confidence:g} % intervals",
        fontsize=10,
    )
    panels[-1].set_xlabel("time after the first pose of the reference [s]")
    return figure


def _means(axes: "Axes", times: Array, errors: Array, confidence: float) -> None:
    """Mean and interval of each part with an equal number of poses; withheld ones have no bar."""
    for rows in np.array_split(np.arange(len(times)), PARTS):
        if not len(rows):
            continue
        found = mean_of_series(errors[rows], confidence)
        middle = float(np.median(times[rows]))
        axes.plot(middle, found.mean, "D", color=COLOURS[1], markersize=4)
        if np.isfinite(found.low):
            axes.plot([middle] * 2, [found.low, found.high], color=COLOURS[1], linewidth=2)


def error_against_speed(comparison: TimeComparison) -> Figure:
    """Errors along the motion and across it over the speed, with the line of a delay."""
    speed = comparison.motion.speed
    figure = Figure(figsize=(7, 5.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    shown = _shown(len(speed))
    for axes, values, name in zip(
        panels, comparison.along_across, ("along the motion", "across"), strict=True
    ):
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.plot(speed[shown], 1000 * values[shown], ".", color=COLOURS[0], markersize=3)
        axes.set_ylabel(f"error {name} [mm]")
        axes.grid(visible=True, linewidth=0.3)
    delay, spread = comparison.delay_by_speed
    along = comparison.along_across[0]
    moves = np.isfinite(along)
    title = "no delay can be told from the speeds driven"
    if spread is not None:
        ends = np.array([speed[moves].min(), speed[moves].max()])
        line = along[moves].mean() - delay * (ends - speed[moves].mean())
        interval = f" ({1000 * spread.low:+.0f} to {1000 * spread.high:+.0f} ms)"
        known = interval if np.isfinite(spread.low) else " (no interval)"
        panels[0].plot(ends, 1000 * line, color=COLOURS[1], linewidth=2)
        title = f"the line is that of a delay of {1000 * delay:+.1f} ms{known}"
    panels[0].set_title(f"{comparison.system}: {title}", fontsize=10)
    panels[1].set_xlabel("speed of the reference [m/s]")
    return figure


def trajectories_on_map(comparison: TimeComparison) -> Figure:
    """Both trajectories from above; the source's colour is its position error."""
    ours = comparison.pairs.reference.positions
    theirs = comparison.pairs.source.positions
    figure = Figure(figsize=(7, 6.5), layout="constrained")
    axes = figure.add_subplot()
    for rows in np.split(np.arange(len(ours)), np.flatnonzero(comparison.pairs.starts_anew)[1:]):
        axes.plot(*ours[rows, :2].T, color=GREY, linewidth=1, zorder=1)
    # The largest errors are drawn last, on top.
    shown = np.arange(len(ours))[_shown(len(ours))]
    shown = shown[np.argsort(comparison.distances[shown], kind="stable")]
    errors = 1000 * comparison.distances[shown]
    x, y = theirs[shown, 0], theirs[shown, 1]
    size = 9 if len(shown) > FEW_POINTS else 25
    marks = axes.scatter(x, y, size, errors, cmap="cividis_r", vmin=0, zorder=2, linewidths=0)
    figure.colorbar(marks, ax=axes, label="position error [mm]", shrink=0.7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(visible=True, linewidth=0.3)
    axes.set_title(f"{comparison.system} (points) on the reference (line)", fontsize=10)
    return figure


def coverage_over_time(comparison: TimeComparison) -> Figure:
    """Bars over time: the reference's span, and the stretches with pairs."""
    times = comparison.times - comparison.start
    starts = np.flatnonzero(comparison.pairs.starts_anew)
    ends = np.concatenate([starts[1:] - 1, [len(times) - 1]])
    bars = [(times[a], max(times[b] - times[a], 0.0)) for a, b in zip(starts, ends, strict=True)]
    figure = Figure(figsize=(7, 1.7), layout="constrained")
    axes = figure.add_subplot()
    span = comparison.coverage.span_s
    axes.broken_barh([(0.0, span)], (0.6, 0.8), color="#E8E8E8", edgecolor=GREY)
    # A bar of a few seconds in an hour would not be seen without an edge.
    axes.broken_barh(bars, (0.6, 0.8), color=COLOURS[0], edgecolor=COLOURS[0], linewidth=0.8)
    axes.set_yticks([1.0], [comparison.system])
    axes.set_xlim(-0.01 * span, 1.01 * span)
    axes.set_xlabel("time after the first pose of the reference [s]")
    covered = comparison.coverage
    axes.set_title(
        f"{covered.paired} of {covered.asked} poses of the {covered.at} have a pair: "
        f"{100 * covered.share:.3g} % of the time",
        fontsize=10,
    )
    return figure


def _shown(count: int) -> slice:
    """Every so many-th row, so that no more than `MOST_POINTS` are drawn."""
    return slice(None, None, max(1, -(-count // MOST_POINTS)))
