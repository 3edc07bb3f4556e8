"""Residuals of the readings: over their distance, and how they are distributed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from survey.figures.maps import WIDTH
from survey.readings.levels import CRITICAL
from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_NAMED = 4
"""Suspect readings named in the figure. A judgement: a large blunder spoils many others, and more
names would cover one another."""


def residual_figure(
    distance: Array, standardised: Array, labels: Sequence[str], suspect: float = CRITICAL
) -> Figure:
    """Standardised residuals of the readings over their distance, and how they are distributed.

    Parameters
    ----------
    distance : (n,) array
        Metres.
    standardised : (n,) array
        Standard normal if all is well; NaN where nothing checks a reading.
    labels : sequence of str, length n
        'O to 1'; written beside the largest of those beyond ``suspect``.
    suspect : float
        Size from which a reading is called suspect.
    """
    figure = Figure(figsize=(WIDTH, 6.0), layout="constrained")
    over, histogram = figure.subplots(2, 1)
    checked = np.isfinite(standardised)
    far = checked & (np.abs(np.where(checked, standardised, 0.0)) > suspect)
    over.axhline(0, color=GREY, linewidth=0.8)
    for limit in (-suspect, suspect):
        over.axhline(limit, color=GREY, linestyle="--", linewidth=0.8)
    over.plot(distance[checked & ~far], standardised[checked & ~far], "o", color=COLOURS[0], ms=3)
    over.plot(distance[far], standardised[far], "X", color=COLOURS[1], ms=7, label="suspect")
    largest = np.argsort(-np.abs(np.where(far, standardised, 0.0)), kind="stable")
    for row in largest[: min(int(far.sum()), _MOST_NAMED)]:
        over.annotate(
            labels[row],
            (distance[row], standardised[row]),
            (5, 3),
            textcoords="offset points",
            fontsize=8,
        )
    over.set_xlabel("distance [m]")
    over.set_ylabel("standardised residual")
    over.set_title(f"dashed: {suspect:g} sigma; crosses: beyond it", fontsize=10)
    over.margins(y=0.1)
    over.grid(visible=True, linewidth=0.3)
    _draw_histogram(histogram, standardised[checked])
    return figure


def _draw_histogram(axes: "Axes", standardised: Array) -> None:
    """Histogram with the normal curve that it should follow."""
    if len(standardised) == 0:
        axes.text(0.5, 0.5, "no reading is checked by others", ha="center", va="center")
        axes.set_axis_off()
        return
    reach = max(4.0, min(float(np.abs(standardised).max()) + 0.5, 10.0))
    step = 0.5
    edges = np.arange(-np.ceil(reach), np.ceil(reach) + step, step)
    axes.hist(
        np.clip(standardised, edges[0], edges[-1]),
        bins=list(edges),
        color="#BBD7EA",
        edgecolor=COLOURS[0],
        linewidth=0.6,
        label="readings",
    )
    at = np.linspace(edges[0], edges[-1], 200)
    expected = len(standardised) * step * np.exp(-(at**2) / 2) / np.sqrt(2 * np.pi)
    axes.plot(at, expected, "--", color="black", linewidth=1.2, label="expected")
    axes.set_xlabel("standardised residual")
    axes.set_ylabel("readings")
    axes.legend(fontsize=8, frameon=False)
