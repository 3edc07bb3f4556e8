"""Figures of a plan: the sky, satellites and DOP over time, and predicted beside seen."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rtk_gt.planning.against_log import AgainstLog
from rtk_gt.planning.almanacs.almanac import SYSTEMS
from rtk_gt.planning.plan import SkyPlan
from rtk_gt.planning.telling import clock, dops, stamp, until
from rtk_gt.planning.visibility import Bools
from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array

WIDTH = 5.6
"""Inches: letters of 8 points are then 9 pixels high on a telephone of 390."""
_LINES = {"G": "-", "E": "--", "R": ":", "C": "-.", "J": "-", "X": ":"}
"""Lines of the systems: told apart in grey, too."""
_INKS = {"G": COLOURS[0], "E": COLOURS[1], "R": COLOURS[2], "C": COLOURS[3]}
_LABEL_ABOVE = np.radians(13.0)
_LARGEST_DOP = 10.0
"""End of the axis of DOP: beyond it no position is of use, and the rest could not be read."""


def sky_figure(plan: SkyPlan) -> Figure:
    """The paths of the satellites over the rover, as AD2.3 shows them.

    North is up, the middle is the zenith, the rim the horizon. Heavy lines are what the rover has,
    thin ones what mask or obstacles hide; the shaded part is hidden.
    """
    figure = Figure(figsize=(WIDTH, WIDTH + 0.35), layout="constrained")
    axes = figure.add_subplot()
    _rose(axes)
    view = plan.rover
    _shade(axes, np.maximum(view.place.horizon.elevation(_AROUND), plan.wanted.mask))
    x, y = _on_disc(view.azimuth, view.elevation)
    placed: list[tuple[float, float]] = []
    for k, name in enumerate(plan.almanac.names):
        above = view.elevation[k] > 0
        line, ink = _LINES[name[0]], _INKS.get(name[0], GREY)
        hidden = _only(above & ~_inside(view.visible[k]), x[k], y[k])
        axes.plot(*hidden, line, color=GREY, linewidth=0.5, alpha=0.7)
        axes.plot(*_only(view.visible[k], x[k], y[k]), line, color=ink, linewidth=1.1)
        own = view.visible[k] & (view.elevation[k] > _LABEL_ABOVE)
        _name(axes, name, np.column_stack([x[k], y[k]])[own], placed)
    there = sorted(set(plan.almanac.systems))
    if len(there) > 1:
        for letter in there:
            axes.plot([], [], _LINES[letter], color=_INKS.get(letter, GREY), label=SYSTEMS[letter])
        axes.legend(fontsize=8, frameon=False, loc="lower left")
    day = stamp(plan.times[0])[:10]
    span = f"{clock(plan.times[0])} to {until(plan.times[-1])} UTC"
    axes.set_title(f"{view.place.name}, {day}, {span}", fontsize=9)
    axes.set_xlim(-1.12, 1.12)
    axes.set_ylim(-1.12, 1.12)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure


_AROUND = np.linspace(0, 2 * np.pi, 721)


def _on_disc(azimuth: Array, elevation: Array) -> tuple[Array, Array]:
    """Places on a disc of radius 1: the zenith distance grows evenly from the middle."""
    radius = 1 - elevation / (np.pi / 2)
    return radius * np.sin(azimuth), radius * np.cos(azimuth)


def _inside(rows: Bools) -> Bools:
    """The rows whose neighbours are True, too: so that thin lines begin where heavy ones end."""
    return np.asarray(rows & np.roll(rows, 1) & np.roll(rows, -1))


def _only(rows: Bools, x: Array, y: Array) -> tuple[Array, Array]:
    """The points of some rows, with gaps for the others."""
    return np.where(rows, x, np.nan), np.where(rows, y, np.nan)


def _rose(axes: Axes) -> None:
    """Circles each 30 degrees of elevation, and the compass."""
    for elevation in (0, 30, 60):
        circle = _on_disc(_AROUND, np.full_like(_AROUND, np.radians(elevation)))
        axes.plot(*circle, color=GREY, linewidth=0.9 if elevation == 0 else 0.4)
        if elevation:
            axes.text(0.012, 1 - elevation / 90, f"{elevation}°", fontsize=7, color=GREY,
                      va="bottom")  # fmt: skip
    for at, name in enumerate(("N", "NE", "E", "SE", "S", "SW", "W", "NW")):
        azimuth = np.pi / 4 * at
        axes.plot([0, np.sin(azimuth)], [0, np.cos(azimuth)], color=GREY, linewidth=0.3)
        axes.text(1.06 * np.sin(azimuth), 1.06 * np.cos(azimuth), name, fontsize=9, ha="center",
                  va="center")  # fmt: skip


def _shade(axes: Axes, lowest: Array) -> None:
    """Shade the disc from its rim up to an elevation around the compass."""
    outer = np.column_stack(_on_disc(_AROUND, np.zeros_like(_AROUND)))
    inner = np.column_stack(_on_disc(_AROUND, np.clip(lowest, 0, np.pi / 2)))
    axes.fill(*np.vstack([outer, inner[::-1]]).T, color="#dddddd", linewidth=0, zorder=0)


def _name(axes: Axes, name: str, points: Array, placed: list[tuple[float, float]]) -> None:
    """Write a satellite's name on its path, away from the names that are there."""
    if not len(points):
        return
    if placed:
        apart = np.linalg.norm(points[:, None] - np.array(placed), axis=-1).min(1)
        point = points[int(np.argmax(apart))]
    else:
        point = points[len(points) // 2]
    placed.append((float(point[0]), float(point[1])))
    axes.text(
        float(point[0]), float(point[1]), name, fontsize=7, ha="center", va="center",
        bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "linewidth": 0, "alpha": 0.8},
    )  # fmt: skip


def _hours(times: Array, first: float) -> Array:
    return np.asarray((times - first) / 3600.0)


def over_time_figure(plan: SkyPlan) -> Figure:
    """Numbers of satellites and DOP over the plan's time, with the good times shaded."""
    figure = Figure(figsize=(WIDTH, 5.0), layout="constrained")
    counts, below = figure.subplots(2, 1, sharex=True)
    first = 86400.0 * np.floor(plan.times[0] / 86400.0)
    hours = _hours(plan.times, first)
    if plan.base is not None:
        counts.step(hours, plan.base.count, where="post", color=GREY, linewidth=0.8, ls="--",
                    label="base")  # fmt: skip
        counts.step(hours, plan.rover.count, where="post", color=COLOURS[1], linewidth=1.0,
                    ls=":", label="rover", zorder=3)  # fmt: skip
    label = "satellites" if plan.base is None else "common"
    counts.step(hours, plan.count, where="post", color=COLOURS[0], linewidth=1.6, label=label)
    counts.axhline(plan.wanted.satellites, color="black", linewidth=0.7, ls=(0, (6, 3)))
    counts.set_ylim(0, None)
    counts.set_ylabel("satellites")
    counts.yaxis.get_major_locator().set_params(integer=True)
    for (name, values), line, ink in zip(
        dops(plan).items(), ("-", "--", ":"), COLOURS, strict=False
    ):
        below.plot(hours, values, line, color=ink, linewidth=1.3, label=name)
    below.axhline(plan.wanted.pdop, color="black", linewidth=0.7, ls=(0, (6, 3)))
    greatest = np.nanmax(plan.dop.position, initial=plan.wanted.pdop)
    below.set_ylim(0, min(1.1 * greatest, max(_LARGEST_DOP, 1.3 * plan.wanted.pdop)))
    below.set_ylabel("dilution of precision")
    below.set_xlabel(f"hour of {stamp(plan.times[0])[:10]}, UTC")
    for panel in (counts, below):
        for one in plan.windows():
            span = _hours(np.array([one.start, one.end]), first)
            panel.axvspan(*span, color="#dbe9dd", linewidth=0, zorder=0)
        panel.grid(visible=True, linewidth=0.3)
        panel.legend(
            fontsize=8, ncols=3, frameon=False, loc="lower right", bbox_to_anchor=(1, 0.97)
        )
    below.set_xlim(hours[0], hours[-1])
    if hours[-1] - hours[0] > 12:
        below.set_xticks(np.arange(np.ceil(hours[0] / 3) * 3, hours[-1] + 0.1, 3))
    counts.set_title(f"{plan.rover.place.name}; good times shaded", fontsize=9, loc="left")
    return figure


def log_figure(held: AgainstLog) -> Figure:
    """Satellites and HDOP, predicted and seen."""
    figure = Figure(figsize=(WIDTH, 5.0), layout="constrained")
    counts, below = figure.subplots(2, 1, sharex=True)
    first = 86400.0 * np.floor(held.seen.times[0] / 86400.0)
    hours = _hours(held.seen.times, first)
    predicted = held.predicted, held.plan.dop.horizontal
    seen = held.seen.satellites, held.seen.hdop
    for panel, plan, log in zip((counts, below), predicted, seen, strict=True):
        panel.plot(hours, plan, "-", color=GREY, linewidth=1.4, label="predicted")
        panel.plot(hours, log, ".", color=COLOURS[1], ms=4, label="seen")
        for one in held.stretches:
            span = _hours(np.array([one.start, one.end]), first)
            panel.axvspan(*span, color="#f3e3d6", linewidth=0, zorder=0)
        panel.grid(visible=True, linewidth=0.3)
    counts.set_ylim(0, None)
    counts.yaxis.get_major_locator().set_params(integer=True)
    counts.set_ylabel("satellites")
    finite = np.concatenate([predicted[1], seen[1]])
    finite = finite[np.isfinite(finite)]
    below.set_ylim(0, min(1.15 * float(finite.max(initial=1.0)), _LARGEST_DOP))
    below.set_ylabel("HDOP")
    below.set_xlabel(f"hour of {stamp(held.seen.times[0])[:10]}, UTC")
    below.legend(fontsize=8, ncols=2, frameon=False, loc="lower right", bbox_to_anchor=(1, 0.97))
    counts.set_title("shaded: fewer satellites than predicted", fontsize=9, loc="left")
    return figure
