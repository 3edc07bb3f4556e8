"""Figures for a report's first page, and the evidence on one system in one figure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY, MARKERS, Landmarks, Walls, arrow_scale
from validation.poses.angles import Array
from validation.statistics.evaluation import Evaluation

MOST_NAMES = 30
"""Stops named on a small map. A judgement: with more, names cover each other."""
MOST_SOURCES = 8
"""Sources with a place of their own on an axis; the others share the last."""


def maps(evaluations: Sequence[Evaluation], walls: Walls, landmarks: Landmarks) -> Figure:
    """A small map of each system, side by side, errors enlarged by one factor.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        At least one, with two lengths or more.
    walls, landmarks
        As for `validation.figures.errors.error_map`.
    """
    compared = [one.comparison for one in evaluations]
    kinds = [component.kind for component in compared[0].components]
    across, up = [k for k, kind in enumerate(kinds) if kind == "length"][:2]
    places = [one.validation.poses[:, [across, up]] for one in compared]
    arrows = [-one.errors[:, [across, up]] for one in compared]
    drawn = [np.array(wall) for wall in walls if wall]
    drawn += [np.array(list(landmarks.values()))] if landmarks else []
    everything = np.vstack([*places, *drawn])
    extent = np.ptp(everything, axis=0)
    scale = arrow_scale(np.linalg.norm(np.vstack(arrows), axis=1), float(extent.max()))
    wide = 9.0 / len(compared)
    tall = min(max(wide * float(extent[1] / max(extent[0], 1e-9)), 2.0), 4.0) + 0.8
    figure = Figure(figsize=(9, tall), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(compared), sharex=True, sharey=True))
    for axes, one, points, off in zip(panels, compared, places, arrows, strict=True):
        for wall in walls:
            axes.plot(*np.array(wall).T, color=GREY, linewidth=1)
        if landmarks:
            axes.plot(*np.array(list(landmarks.values())).T, "x", color=GREY, markersize=3)
        moved = scale * off
        axes.quiver(
            *points.T, *moved.T, angles="xy", scale_units="xy", scale=1, color=COLOURS[1],
            width=0.007,
        )  # fmt: skip
        axes.plot(*points.T, "o", color=COLOURS[0], markersize=2.5)
        axes.update_datalim(points + moved)
        axes.autoscale_view()
        for name, point in zip(one.ids if len(one) <= MOST_NAMES else (), points, strict=False):
            axes.annotate(name, point, (3, 2), textcoords="offset points", fontsize=7)
        axes.set_aspect("equal")
        axes.margins(0.05)
        axes.grid(visible=True, linewidth=0.3)
        axes.set_title(one.system, fontsize=10)
        axes.set_xlabel(f"{one.components[across].name} [m]")
    panels[0].set_ylabel(f"{compared[0].components[up].name} [m]")
    figure.suptitle(f"From validation to GT, enlarged {scale} times", fontsize=10)
    return figure


@dataclass(frozen=True)
class Evidence:
    """Sizes of the errors of one system, and what they may depend on.

    Parameters
    ----------
    unit : str
        Of the sizes times a thousand: 'mm'.
    before, after : (n,) array
        Sizes of the errors as they came and with the explanation taken out (the same where there
        is none), in metres or radians.
    axes : mapping of str to (n,) array
        Against what they are drawn, by its name with unit; NaN where unknown.
    sources : sequence of str
        Who made each pose; empty where unknown.
    """

    unit: str
    before: Array
    after: Array | None
    axes: dict[str, Array]
    sources: Sequence[str] = ()


def evidence(title: str, told: Evidence) -> Figure:
    """Sizes of errors against all that they may depend on, their distribution, and neighbours."""
    names = list(told.axes)
    sources = sorted(set(told.sources))
    count = len(names) + 2 + (len(sources) > 1)
    rows = -(-count // 3)
    figure = Figure(figsize=(9, 2.2 * rows + 0.4), layout="constrained")
    panels = list(np.ravel(figure.subplots(rows, 3)))
    for axes in panels[count:]:
        axes.set_axis_off()
    for name in names:
        _dots(axes := panels.pop(0), told, told.axes[name])
        axes.set_xlabel(name)
    if len(sources) > 1:
        place = [min(sources.index(one), MOST_SOURCES - 1) for one in told.sources]
        _dots(axes := panels.pop(0), told, np.array(place, dtype=float))
        shown = sources[:MOST_SOURCES]
        shown = [*shown[:-1], "others"] if len(sources) > MOST_SOURCES else shown
        axes.set_xticks(range(len(shown)), shown, rotation=20, ha="right", fontsize=7)
        axes.set_xlabel("source")
    _distribution(panels.pop(0), told)
    _successive(panels.pop(0), told)
    figure.suptitle(title, fontsize=10)
    return figure


def _series(told: Evidence) -> list[tuple[Array, str, str, str]]:
    """Sizes, name, colour and marker of what is drawn."""
    found = [(1e3 * told.before, "as it came", COLOURS[1], MARKERS[0])]
    if told.after is not None:
        found.append((1e3 * told.after, "explanation out", COLOURS[0], MARKERS[2]))
    return found


def _dots(axes: Axes, told: Evidence, values: Array) -> None:
    for sizes, _, colour, marker in _series(told):
        axes.plot(values, sizes, marker, color=colour, ms=3.5, mfc="none", mew=0.9)
    axes.set_ylabel(f"error [{told.unit}]")
    axes.set_ylim(bottom=0)
    axes.grid(visible=True, linewidth=0.3)


def _distribution(axes: Axes, told: Evidence) -> None:
    """The share of errors below each size."""
    for sizes, name, colour, _ in _series(told):
        known = np.sort(sizes[np.isfinite(sizes)])
        share = 100 * np.arange(1, len(known) + 1) / len(known)
        axes.step(known, share, where="post", color=colour, label=name)
    axes.set_xlabel(f"error [{told.unit}]")
    axes.set_ylabel("errors below [%]")
    axes.set_ylim(0, 102)
    axes.legend(fontsize=7, loc="lower right")
    axes.grid(visible=True, linewidth=0.3)


def _successive(axes: Axes, told: Evidence) -> None:
    """Each size over that of the stop before."""
    for sizes, _, colour, marker in _series(told):
        axes.plot(sizes[:-1], sizes[1:], marker, color=colour, ms=3.5, mfc="none", mew=0.9)
    axes.set_xlabel(f"error at the stop before [{told.unit}]")
    axes.set_ylabel(f"error [{told.unit}]")
    axes.grid(visible=True, linewidth=0.3)
