"""Figures of correlated headings, in the colours of AD2.3: odometry black, cameras by number."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from validation.figures.errors import GREY
from validation.poses.angles import Array, wrap
from validation.trajectories.clock.correlation import (
    LAGS,
    STEP,
    WINDOW,
    HeadingCorrelation,
    Mask,
    Peak,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CAMERAS = (("#0072B2", "o"), ("#009E73", "s"), ("#C79A00", "^"), ("#C1272D", "D"))
"""Blue, green, a yellow that reads on white, red; markers differ too."""
CLOSE = 4.0
"""Seconds that the closest view shows: some forty images, whose steps are still seen."""
MOST_POINTS = 4000
"""Images drawn of a camera, see `validation.trajectories.figures.comparison`."""


def aligned_signals(found: Sequence[HeadingCorrelation]) -> Figure:
    """All headings, as they came (above) and without what is spurious (below)."""
    figure = Figure(figsize=(7, 6.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for axes, cleaned in zip(panels, (False, True), strict=True):
        for number, one in enumerate(found):
            shown = ~one.spurious if cleaned else np.ones_like(one.spurious)
            _images(axes, number, one, shown)
        _odometry(axes, found[0])
        spurious = sum(int(one.spurious.sum()) for one in found)
        title = f"without {spurious} spurious images" if cleaned else "as they came"
        axes.set_title(title, fontsize=10)
        axes.set_ylabel("heading [degrees]")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=9,
        markerscale=2,
    )  # fmt: skip
    panels[1].set_xlabel(f"time after the first pose of {found[0].odometry} [s]")
    return figure


def selected_parts(found: Sequence[HeadingCorrelation]) -> Figure:
    """The selected parts of each camera, numbered, each with its delay in milliseconds."""
    figure = Figure(figsize=(7, 1 + 1.9 * len(found)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(found), 1, sharex=True))
    for number, (axes, one) in enumerate(zip(panels, found, strict=True)):
        start = _start(one)
        for at, peak in enumerate(one.parts):
            inside = (one.times >= peak.first_s) & (one.times <= peak.last_s) & ~one.spurious
            axes.axvspan(peak.first_s - start, peak.last_s - start, color="#E8E8E8", linewidth=0)
            _images(axes, number, one, inside)
            # Neighbours are named at two heights, so that they do not cover each other.
            axes.annotate(
                f"{at + 1}: {_ms(peak.delay_s)}",
                ((peak.first_s + peak.last_s) / 2 - start, 185),
                (0, 3 + 11 * (at % 2)), textcoords="offset points", ha="center", fontsize=9,
            )  # fmt: skip
        _odometry(axes, one)
        axes.set_ylabel(f"{one.camera}\n[degrees]", fontsize=9)
        axes.set_title(" \n", fontsize=9)
        if not one.parts:
            axes.set_title("no part is long enough and turns", fontsize=9)
    panels[-1].set_xlabel(f"time after the first pose of {found[0].odometry} [s]")
    figure.suptitle("Selected parts (grey), and the delay of each [ms]", fontsize=10)
    return figure


def closer_view(one: HeadingCorrelation, number: int, part: int) -> Figure:
    """A part, a piece of it where the robot turns fastest, and the correlation of the part.

    Parameters
    ----------
    one : HeadingCorrelation
        Of a camera.
    number : int
        Of the camera, for its colour.
    part : int
        Of the part, from 0.
    """
    peak, (colour, marker) = one.parts[part], _look(number)
    inside = (one.times >= peak.first_s) & (one.times <= peak.last_s) & ~one.spurious
    held = np.degrees(one.held(inside))
    truth = np.degrees(one.odometry_headings)
    rows = np.flatnonzero(np.isfinite(held))
    rows = np.arange(rows[0], rows[-1] + 1)
    times = one.start_s + STEP * rows - _start(one)
    figure = Figure(figsize=(7, 8), layout="constrained")
    whole, close, curve = figure.subplots(3, 1)
    whole.plot(times, held[rows], color=colour, linewidth=2, label=one.camera)
    moved = f"{one.camera}, moved by the delay"
    whole.plot(times + peak.delay_s, held[rows], ":", color=colour, label=moved)
    whole.plot(times, truth[rows], "k", linewidth=1, label=one.odometry)
    whole.set_title(f"{one.camera}, part {part + 1}: delay {_ms(peak.delay_s)} ms", fontsize=10)
    whole.set_xlabel("time [s]")
    near = _fastest(truth[rows], rows)
    whole.axvspan(*(one.start_s + STEP * near[[0, -1]] - _start(one)), color="#E8E8E8", linewidth=0)
    close.plot(near - rows[0], held[near], marker, color=colour, markersize=3, label=one.camera)
    close.plot(near - rows[0], truth[near], "k", linewidth=1, label=one.odometry)
    repeated = f"; each image stands for {one.repeats}" if one.repeats > 1 else ""
    close.set_xlabel(f"samples of the part, of {1000 * STEP:.0f} ms{repeated}")
    close.set_title("closer, where it turns fastest (grey above)", fontsize=10)
    for axes in (whole, close):
        axes.set_ylabel("heading [degrees]")
        axes.legend(fontsize=8)
    _curve(curve, peak, colour)
    for axes in (whole, close, curve):
        axes.grid(visible=True, linewidth=0.3)
    return figure


def _curve(axes: "Axes", peak: Peak, colour: str) -> None:
    """The correlation over the delay, its maximum, and what fits as well."""
    axes.axvspan(1000 * peak.low_s, 1000 * peak.high_s, color="#E8E8E8", label="fit as well")
    axes.plot(1000 * STEP * LAGS, peak.values, color=colour, linewidth=1.5)
    axes.axvline(1000 * peak.delay_s, color="black", linewidth=1, label="maximum")
    axes.set_xlim(-1000 * WINDOW, 1000 * WINDOW)
    axes.set_xlabel("delay [ms], added to the camera's stamps")
    axes.set_ylabel("correlation")
    axes.set_title("the correlation in the window", fontsize=10)
    axes.legend(fontsize=8)


def _fastest(headings: Array, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Rows of the `CLOSE` seconds in which the heading changes most."""
    n = min(round(CLOSE / STEP), len(rows) - 1)
    steps = np.nan_to_num(np.abs(np.diff(headings)))
    ways = np.convolve(steps, np.ones(n), "valid")
    first = int(np.argmax(ways))
    return rows[first : first + n]


def _images(axes: "Axes", number: int, one: HeadingCorrelation, shown: Mask) -> None:
    rows = np.flatnonzero(shown)
    rows = rows[:: max(1, -(-len(rows) // MOST_POINTS))]
    colour, marker = _look(number)
    axes.plot(
        one.times[rows] - _start(one), np.degrees(wrap(one.headings[rows])), marker, color=colour,
        markersize=3, markeredgewidth=0, label=one.camera,
    )  # fmt: skip


def _odometry(axes: "Axes", one: HeadingCorrelation) -> None:
    """A line that ends where it leaves the circle's edge and begins anew at the other."""
    headings = np.degrees(wrap(one.odometry_headings))
    jumps = np.append(np.abs(np.diff(headings)) > 180, False)
    times = one.start_s + STEP * np.arange(len(headings)) - _start(one)
    axes.plot(times, np.where(jumps, np.nan, headings), "k", linewidth=0.8, label=one.odometry)
    axes.set_ylim(-185, 185)
    axes.yaxis.set_major_locator(MultipleLocator(90))
    axes.axhline(0, color=GREY, linewidth=0.4)
    axes.grid(visible=True, linewidth=0.3)


def _start(one: HeadingCorrelation) -> float:
    """Time of the odometry's first pose."""
    return one.start_s + WINDOW


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:+.0f}" if np.isfinite(seconds) else "none"


def _look(number: int) -> tuple[str, str]:
    return CAMERAS[number % len(CAMERAS)]
