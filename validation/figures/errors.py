"""Figures of the comparisons. Drawn with matplotlib's object interface, for print and screen.

Colours are those of Okabe and Ito, in an order that also falls from dark to light; markers
differ too, so that nothing is told by colour alone.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator

from validation.poses.angles import Array, wrap
from validation.statistics.comparison import Comparison
from validation.statistics.evaluation import Evaluation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
GREY = "#555555"

Walls = Sequence[Sequence[tuple[float, float]]]
Landmarks = Mapping[str, tuple[float, float]]


def arrow_scale(distances: Array, extent: float) -> int:
    """Factor by which errors are enlarged: 1, 2, 3 or 5 times a power of ten.

    Parameters
    ----------
    distances : (n,) array
        Lengths of the errors, in metres.
    extent : float
        Size of what is drawn, in metres. A seventh of it is the 90 % quantile of the arrows.
    """
    typical = float(np.quantile(distances, 0.9)) if len(distances) else 0.0
    if typical <= 0 or extent <= 0:
        return 1
    wanted = max(extent / 7 / typical, 1.0)
    power = 10 ** int(np.floor(np.log10(wanted)))
    return int(power * max(step for step in (1, 2, 3, 5) if step * power <= wanted))


MOST_NAMES = 60
"""Up to so many poses are named on a map. A judgement: with more, names cover each other."""


def error_map(
    comparison: Comparison, walls: Walls = (), landmarks: Landmarks | None = None
) -> Figure:
    """Arrows from each validation pose towards the GT pose, enlarged, on the map of the room.

    Parameters
    ----------
    comparison : Comparison
        The errors; its first two lengths are drawn.
    walls : sequence of polylines
        In the GTV frame, metres.
    landmarks : mapping of str to (float, float), optional
        Named points, in the GTV frame.
    """
    across, up = _first_two_lengths(comparison)
    positions = comparison.validation.poses[:, [across, up]]
    arrows = -comparison.errors[:, [across, up]]
    marked = landmarks or {}
    points = [positions, *(np.array(wall) for wall in walls if wall)]
    if marked:
        points.append(np.array(list(marked.values())))
    extent = float(np.ptp(np.vstack(points), axis=0).max())
    scale = arrow_scale(np.linalg.norm(arrows, axis=1), extent)

    figure = Figure(figsize=(7, 7), layout="constrained")
    axes = figure.add_subplot()
    for wall in walls:
        axes.plot(*np.array(wall).T, color=GREY, linewidth=1.5)
    for name, point in marked.items():
        axes.plot(*point, marker="x", color=GREY, markersize=5)
        axes.annotate(name, point, (3, 3), textcoords="offset points", fontsize=7, color=GREY)
    axes.quiver(
        *positions.T,
        *(scale * arrows.T),
        angles="xy",
        scale_units="xy",
        scale=1,
        color=COLOURS[1],
        width=0.004,
    )
    axes.plot(*positions.T, "o", color=COLOURS[0], markersize=4)
    # Arrows are no data to matplotlib: make room for their heads.
    axes.update_datalim(positions + scale * arrows)
    axes.autoscale_view()
    # Names of a whole path would cover it.
    named = comparison.ids if len(comparison.ids) <= MOST_NAMES else ()
    for name, point, arrow in zip(named, positions, arrows, strict=False):
        side = -5 if arrow[0] > 0 else 5
        axes.annotate(
            name,
            point,
            (side, 4),
            textcoords="offset points",
            fontsize=8,
            ha="right" if side < 0 else "left",
        )
    _name_axes(axes, comparison, across, up)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.set_title(f"{comparison.system}: from validation to GT, enlarged {scale} times")
    return figure


def _first_two_lengths(comparison: Comparison) -> tuple[int, int]:
    """Columns of x and y."""
    columns = [i for i, component in enumerate(comparison.components) if component.kind == "length"]
    return columns[0], columns[1]


def _name_axes(axes: "Axes", comparison: Comparison, across: int, up: int) -> None:
    axes.set_xlabel(f"{comparison.components[across].name} [m], GTV frame")
    axes.set_ylabel(f"{comparison.components[up].name} [m], GTV frame")
    axes.grid(visible=True, linewidth=0.3)


def heading_column(comparison: Comparison) -> int | None:
    """Column of the angle about the vertical; None if the poses have none."""
    names = [component.name for component in comparison.components]
    return next((names.index(name) for name in ("theta", "yaw") if name in names), None)


def error_against_heading(comparison: Comparison) -> Figure:
    """Errors over the heading of the validation pose: a wrong mount shows as a sine.

    Parameters
    ----------
    comparison : Comparison
        The errors; poses without heading raise a ValueError.
    """
    column = heading_column(comparison)
    if column is None:
        raise ValueError("the poses have no heading")
    heading = np.degrees(wrap(comparison.validation.poses[:, column]))
    count = len(comparison.components)
    figure = Figure(figsize=(7, 1.2 + 1.9 * count), layout="constrained")
    panels = np.atleast_1d(figure.subplots(count, 1, sharex=True))
    for number, (axes, component) in enumerate(zip(panels, comparison.components, strict=True)):
        axes.axhline(0, color=GREY, linewidth=0.8)
        axes.plot(
            heading, comparison.errors[:, number], MARKERS[number % 6], color=COLOURS[0], ms=4
        )
        for row in _worth_a_label(comparison.errors[:, number]):
            at = (heading[row], comparison.errors[row, number])
            axes.annotate(comparison.ids[row], at, (4, 2), textcoords="offset points", fontsize=8)
        axes.set_ylabel(f"{component.name} error [{component.unit}]")
        axes.grid(visible=True, linewidth=0.3)
        axes.margins(y=0.15)
    panels[-1].set_xlabel("heading of the validation pose [degrees]")
    panels[-1].set_xlim(-185, 190)
    panels[-1].xaxis.set_major_locator(MultipleLocator(90))
    panels[-1].xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0f}°"))
    panels[0].set_title(f"{comparison.system}: error against heading")
    return figure


def _worth_a_label(errors: Array) -> npt.NDArray[np.intp]:
    """Rows to be named: all of a few, else the third farthest from the median, 60 at most."""
    apart = np.abs(errors - np.median(errors))
    count = len(errors) if len(errors) <= 8 else min(len(errors) // 3, MOST_NAMES)
    return np.argsort(-apart, kind="stable")[:count]


def error_strips(evaluations: Sequence[Evaluation]) -> Figure:
    """Every error as a point, system by system, with the mean and its interval.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        At least one; all with the same components.
    """
    components = evaluations[0].comparison.components
    count = len(components)
    height = 1.0 + count * (0.5 + 0.42 * len(evaluations))
    figure = Figure(figsize=(7, height), layout="constrained")
    panels = np.atleast_1d(figure.subplots(count, 1))
    for column, (axes, component) in enumerate(zip(panels, components, strict=True)):
        axes.axvline(0, color=GREY, linewidth=0.8)
        for row, evaluation in enumerate(evaluations):
            _strip(axes, evaluation, column, row)
        axes.set_yticks(range(len(evaluations)), [one.system for one in evaluations])
        axes.set_ylim(len(evaluations) - 0.4, -0.6)
        axes.set_xlabel(f"{component.name} error [{component.unit}]")
        axes.grid(visible=True, axis="x", linewidth=0.3)
    return figure


def _strip(axes: "Axes", evaluation: Evaluation, column: int, row: int) -> None:
    """One system's errors of one component: points above, mean and interval below the line."""
    errors = evaluation.comparison.errors[:, column]
    statistics = evaluation.statistics[column]
    colour, marker = COLOURS[row % len(COLOURS)], MARKERS[row % len(MARKERS)]
    axes.plot(
        errors, np.full(len(errors), row - 0.12), marker, color=colour, ms=5, mfc="none", mew=1
    )
    if not np.isnan(statistics.ci_low):
        axes.plot([statistics.ci_low, statistics.ci_high], [row + 0.22] * 2, color="black", lw=2)
    axes.plot(statistics.mean, row + 0.22, "|", color="black", ms=11, mew=2)
