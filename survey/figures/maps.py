"""Figures of the survey: where things are and how well they are known.

Lengths are in metres with equal axes. Nothing is told by colour alone: kinds differ by marker,
line or hatch as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.patheffects import withStroke

from survey.estimation.geometry import ELLIPSE_SIGMAS, ellipse_axes, rotate
from validation.figures.errors import COLOURS, GREY, Walls, arrow_scale
from validation.poses.angles import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 5.6
"""Inches. A judgement: narrow enough for the letters to be read on a phone."""


@dataclass(frozen=True)
class Places:
    """Named points, or robot frames, with their covariances.

    Parameters
    ----------
    names : sequence of str, length n
        Their names.
    states : (n, 2) or (n, 3) array
        x, y in metres, and theta in radians for robot frames.
    covariances : (n, k, k) array
        Of each; NaN where not stated.
    """

    names: Sequence[str]
    states: Array
    covariances: Array

    @property
    def positions(self) -> Array:
        """(n, 2) metres."""
        return np.asarray(self.states, dtype=float)[:, :2]


@dataclass(frozen=True)
class Room:
    """What the survey's maps have in common.

    Parameters
    ----------
    vframe : mapping-like sequence of (name, (x, y))
        Points of the Vframe, metres.
    rig : (k, 2) array
        Points of the robot frame, the first being the one that its arms start from.
    walls : sequence of polylines
        In the GTV frame, metres.
    """

    vframe: Sequence[tuple[str, tuple[float, float]]] = ()
    rig: Array = field(default_factory=lambda: np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.4]]))
    walls: Walls = ()


def survey_map(room: Room, world: Places | None = None, frames: Places | None = None) -> Figure:
    """World points and robot frames with their ellipses, enlarged so that they can be seen.

    Parameters
    ----------
    room : Room
        Vframe, rig and walls.
    world, frames : Places, optional
        What is drawn.
    """
    figure, axes = _map_figure()
    _draw_walls(axes, room.walls)
    _draw_vframe(axes, room)
    shown = [places for places in (world, frames) if places is not None and len(places.names)]
    scale = ellipse_scale(shown)
    if world is not None:
        _draw_ellipses(axes, world, scale)
        axes.plot(*world.positions.T, "^", color=COLOURS[0], ms=4, label="world point")
        frame = np.array([point for _, point in room.vframe]).reshape(-1, 2)
        middle = frame if len(frame) else world.positions
        _name_points(axes, world, away=world.positions - middle.mean(0))
    if frames is not None:
        _draw_ellipses(axes, frames, scale)
        _draw_rigs(axes, frames, room.rig)
        _name_points(axes, frames, away=-rotate(frames.states[:, 2], room.rig.mean(0)))
    if shown:
        axes.set_title(f"{ELLIPSE_SIGMAS:g} sigma ellipses, enlarged {scale} times", fontsize=10)
    _finish_map(axes)
    return figure


def ellipse_scale(places: Sequence[Places]) -> int:
    """Factor by which ellipses are enlarged: 1, 2, 3 or 5 times a power of ten.

    Parameters
    ----------
    places : sequence of Places
        All that stands on one map. The larger ellipses get about a fifteenth of its size.
    """
    sizes, positions = [np.empty(0)], [np.empty((0, 2))]
    for one in places:
        stated = np.isfinite(one.covariances).all((1, 2))
        largest = np.linalg.eigvalsh(one.covariances[stated][:, :2, :2])[:, -1]
        sizes.append(ELLIPSE_SIGMAS * np.sqrt(np.maximum(largest, 0.0)))
        positions.append(one.positions)
    together = np.concatenate(positions)
    extent = float(np.ptp(together, axis=0).max(initial=0.0)) if len(together) else 0.0
    return arrow_scale(np.concatenate(sizes), 7 * extent / 25)


def hand_against_validation(hand: Places, validation: Places, room: Room) -> Figure:
    """Arrows from the surveyed poses towards those measured roughly by hand, enlarged.

    Parameters
    ----------
    hand, validation : Places
        The same robot frames.
    room : Room
        Vframe, rig and walls.
    """
    figure, axes = _map_figure()
    _draw_walls(axes, room.walls)
    _draw_vframe(axes, room)
    shift = hand.positions - validation.positions
    extent = float(np.ptp(validation.positions, axis=0).max(initial=0.0))
    scale = arrow_scale(np.linalg.norm(shift, axis=1), extent)
    axes.quiver(
        *validation.positions.T,
        *(scale * shift.T),
        angles="xy",
        scale_units="xy",
        scale=1,
        color=COLOURS[1],
        width=0.005,
        zorder=3,
    )
    axes.update_datalim(validation.positions + scale * shift)
    by_hand = np.concatenate([validation.positions, hand.states[:, 2:]], axis=1)
    _draw_headings(axes, validation, COLOURS[0], "-", "heading surveyed")
    _draw_headings(axes, Places(hand.names, by_hand, hand.covariances), GREY, ":", "by hand")
    axes.plot(*validation.positions.T, "o", color=COLOURS[0], ms=4)
    _name_points(axes, validation, away=-shift)
    axes.set_title(f"from the survey to the hand measurement, enlarged {scale} times", fontsize=10)
    _finish_map(axes)
    return figure


def _map_figure() -> "tuple[Figure, Axes]":
    figure = Figure(figsize=(WIDTH, WIDTH), layout="constrained")
    return figure, figure.add_subplot()


def _finish_map(axes: "Axes") -> None:
    axes.set_xlabel("x [m], GTV frame")
    axes.set_ylabel("y [m], GTV frame")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.grid(visible=True, linewidth=0.3)
    finish_legend(axes)


def finish_legend(axes: "Axes") -> None:
    """Put every kind that the axes show once under the figure, in place of an earlier legend."""
    figure = axes.figure
    for legend in list(figure.legends):
        legend.remove()
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(
            unique.values(),
            unique.keys(),
            loc="outside lower center",
            ncols=min(len(unique), 3),
            fontsize=8,
            frameon=False,
        )


def _draw_walls(axes: "Axes", walls: Walls) -> None:
    for wall in walls:
        axes.plot(*np.array(wall).T, color=GREY, linewidth=1.5)


def _draw_vframe(axes: "Axes", room: Room) -> None:
    """The frame's points, and the outline of their hull in order of direction."""
    if not room.vframe:
        return
    points = np.array([point for _, point in room.vframe])
    centred = points - points.mean(0)
    order = np.argsort(np.arctan2(centred[:, 1], centred[:, 0]))
    axes.fill(*points[order].T, facecolor="none", edgecolor="black", linewidth=0.8, linestyle="--")
    axes.plot(*points.T, "s", color="black", ms=4, label="Vframe")
    for (name, point), away in zip(room.vframe, centred, strict=True):
        _label(axes, name, point, -away, weight="bold")


def _draw_ellipses(axes: "Axes", places: Places, scale: float) -> None:
    for position, covariance in zip(places.positions, places.covariances, strict=True):
        if not np.isfinite(covariance).all():
            continue
        long, short, direction = ellipse_axes(covariance)
        ellipse = Ellipse(
            (float(position[0]), float(position[1])),
            2 * ELLIPSE_SIGMAS * scale * long,
            2 * ELLIPSE_SIGMAS * scale * short,
            angle=float(np.degrees(direction)),
            facecolor="#00000012",
            edgecolor="black",
            linewidth=0.7,
        )
        axes.add_patch(ellipse)


def _draw_rigs(axes: "Axes", frames: Places, rig: Array) -> None:
    """Every robot frame's arms in true size, the first with an arrow head."""
    for x, y, theta in frames.states:
        ends = np.array([x, y]) + rotate(theta, rig)
        for number, end in enumerate(ends[1:]):
            axes.annotate(
                "",
                end,
                ends[0],
                arrowprops={
                    "arrowstyle": "-|>" if number == 0 else "-",
                    "color": COLOURS[1],
                    "linewidth": 1.2,
                    "shrinkA": 0,
                    "shrinkB": 0,
                },
            )
    axes.plot(*frames.positions.T, "o", color=COLOURS[1], ms=3, label="robot frame (arrow: x)")


def _draw_headings(axes: "Axes", frames: Places, colour: str, style: str, label: str) -> None:
    """A short line along each frame's x axis."""
    ends = frames.positions + rotate(frames.states[:, 2], np.array([0.4, 0.0]))
    for row, (start, end) in enumerate(zip(frames.positions, ends, strict=True)):
        axes.plot(
            *np.array([start, end]).T,
            style,
            color=colour,
            linewidth=1.4,
            label=label if row == 0 else None,
        )


def _name_points(axes: "Axes", places: Places, away: Array) -> None:
    """Names beside the points, in directions (n, 2)."""
    for name, position, direction in zip(places.names, places.positions, away, strict=True):
        _label(axes, name, position, direction)


def _label(
    axes: "Axes",
    name: str,
    point: npt.ArrayLike,
    direction: Array,
    weight: str = "normal",
) -> None:
    """A name eleven points away from a place in a direction, with a white edge."""
    length = float(np.hypot(*direction))
    unit = direction / length if length > 0 else np.array([0.7, 0.7])
    axes.annotate(
        name,
        tuple(np.asarray(point, dtype=float)),
        (11 * unit[0], 11 * unit[1]),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8,
        fontweight=weight,
        path_effects=[withStroke(linewidth=2, foreground="white")],
        zorder=5,
    )
