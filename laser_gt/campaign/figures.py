"""Figures of laser GT. Verdicts differ by line and marker as well as by colour."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from laser_gt.matching.verdicts import Match, Verdict
from laser_gt.placing.engines import Matching
from laser_gt.placing.solution import LaserSolution
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import compose, transform
from validation.figures.errors import COLOURS, GREY
from validation.figures.maps import in_metres
from validation.poses.angles import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REFERENCE, MOVING = "#D55E00", "#0072B2"
"""The document's red and blue, in a pair that colour-blind readers can tell apart."""
STYLES: dict[Verdict, tuple[str, str, str]] = {
    "accepted": (COLOURS[2], "-", "o"),
    "imprecise": (COLOURS[0], "-.", "s"),
    "may be wrong": (COLOURS[4], "--", "^"),
    "refuted": (GREY, ":", "x"),
}
"""Colour, line and marker of each verdict."""


def room_map(solution: LaserSolution, sweeps: Mapping[str, Prepared], mount: Array) -> Figure:
    """All aligned scans in the GTV frame with the stops they were taken from."""
    figure = Figure(figsize=(7, 7), layout="constrained")
    axes = figure.subplots()
    for stop, pose in zip(solution.stops, solution.placement.poses, strict=True):
        points = transform(compose(pose, mount), sweeps[stop].sweep.points)
        axes.plot(*points.T, ",", color=GREY, alpha=0.6)
    poses = solution.placement.poses
    heading = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    axes.quiver(
        *poses[:, :2].T,
        *heading,
        color=COLOURS[0],
        angles="xy",
        scale=20,
        width=0.005,
    )
    for stop, pose in zip(solution.stops, poses, strict=True):
        anchored = stop in solution.anchors
        axes.annotate(
            stop,
            pose[:2],
            xytext=(4, 4),
            textcoords="offset points",
            fontsize=7,
            fontweight="bold" if anchored else "normal",
        )
    in_metres(axes)
    return figure


def pair_graph(stops: Sequence[str], poses: Array, matching: Matching) -> Figure:
    """Stops and the pairs that were matched, by verdict."""
    figure = Figure(figsize=(7, 7), layout="constrained")
    axes = figure.subplots()
    where = dict(zip(stops, poses, strict=True))
    for verdict, (colour, line, _) in STYLES.items():
        of_this = matching.of(verdict)
        for number, one in enumerate(of_this):
            a, b = where[one.reference], where[one.moving]
            axes.plot(
                [a[0], b[0]],
                [a[1], b[1]],
                line,
                color=colour,
                linewidth=1.2,
                label=f"{verdict} ({len(of_this)})" if number == 0 else None,
                zorder=1,
            )
    axes.plot(poses[:, 0], poses[:, 1], "o", color=COLOURS[0], markersize=5, zorder=2)
    for stop, pose in where.items():
        axes.annotate(stop, pose[:2], xytext=(5, 4), textcoords="offset points", fontsize=8)
    axes.legend(loc="best", fontsize=8)
    in_metres(axes)
    return figure


def draw_pair(axes: "Axes", reference: Prepared, moving: Prepared, pose: Array) -> None:
    """Two scans over each other, the moving one at a pose."""
    axes.plot(*reference.sweep.points.T, ".", color=REFERENCE, markersize=1.6)
    axes.plot(*transform(pose, moving.sweep.points).T, ".", color=MOVING, markersize=1.6)
    axes.plot(0, 0, "^", color=REFERENCE, markersize=5)
    axes.plot(pose[0], pose[1], "s", color=MOVING, markersize=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=6)


def match_figure(match: Match, reference: Prepared, moving: Prepared) -> Figure:
    """A pair before and after."""
    figure = Figure(figsize=(8, 3.9), layout="constrained")
    before, after = figure.subplots(1, 2)
    draw_pair(before, reference, moving, match.guess)
    before.set_title("before", fontsize=9)
    draw_pair(after, reference, moving, match.pose)
    after.set_title(f"after: {match.verdict}", fontsize=9)
    figure.supxlabel(
        f"{match.reference} (triangle) and {match.moving} (square), metres", fontsize=8
    )
    return figure


def match_sheet(matches: Sequence[Match], sweeps: Mapping[str, Prepared]) -> Figure:
    """Several matches as small pictures, each with its verdict."""
    columns = 4
    rows = max((len(matches) + columns - 1) // columns, 1)
    figure = Figure(figsize=(9, 2.4 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(matches) :]:
        axes.set_axis_off()
    for axes, one in zip(grid, matches, strict=False):
        draw_pair(axes, sweeps[one.reference], sweeps[one.moving], one.pose)
        axes.set_title(
            f"{one.reference} - {one.moving}: {one.verdict}",
            fontsize=8,
            color="black" if one.verdict != "refuted" else GREY,
        )
    return figure


def quality_figure(matching: Matching) -> Figure:
    """Agreement and standard deviation of every match, by verdict."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for verdict, (colour, _, marker) in STYLES.items():
        chosen = matching.of(verdict)
        style = {"marker": marker, "color": colour, "linestyle": "none", "markersize": 5}
        left.plot(
            [m.explained for m in chosen],
            [m.violating for m in chosen],
            **style,
            label=f"{verdict} ({len(chosen)})",
        )
        right.plot([m.sigma_length * 1e3 for m in chosen], [m.scale for m in chosen], **style)
    left.set_xlabel("share of points explained")
    left.set_ylabel("share in free space")
    left.legend(fontsize=8)
    right.set_xlabel("standard deviation of the position [mm]")
    right.set_ylabel("residuals over noise")
    top = max(left.get_ylim()[1], 0.02)
    left.set_ylim(-0.03 * top, top)
    spread = [m.sigma_length for m in matching.matches]
    if spread and max(spread) > 30 * min(spread):  # a judgement: else the small are one dot
        right.set_xscale("log")
    for axes in (left, right):
        axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    return figure


def convergence_figure(curves: Mapping[tuple[str, str], Array]) -> Figure:
    """Best fitness by generation: all pairs in grey, their median in colour."""
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    lengths = {len(curve) for curve in curves.values()}
    for curve in curves.values():
        axes.plot(np.maximum(curve, 1e-9), color=GREY, linewidth=0.5, alpha=0.4)
    if len(lengths) == 1:
        middle = np.median(np.array(list(curves.values())), axis=0)
        axes.plot(np.maximum(middle, 1e-9), color=COLOURS[0], linewidth=2, label="median")
        axes.legend(fontsize=8)
    axes.set_yscale("log")
    axes.set_xlabel("generation")
    axes.set_ylabel("best fitness [m²]")
    axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    return figure


def overlay_picture(
    shown: Sequence[tuple[tuple[str, str], Mapping[str, Array], Mapping[str, float]]],
    sweeps: Mapping[str, Prepared],
) -> Figure:
    """Scans laid over each other: a row for each pair, a column for each way.

    AD2.3's own check: if poses and mount are right, the two scans come to lie on each other.

    Parameters
    ----------
    shown : sequence of (pair, poses, gaps)
        Pose of the second scan in the first one's frame, and the gap between them in metres, each
        by the way that it came about.
    sweeps : mapping of str to Prepared
        The scans of each stop.
    """
    ways = list(dict.fromkeys(way for _, poses, _ in shown for way in poses))
    figure = Figure(figsize=(4 * max(len(ways), 1), 3.7 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), max(len(ways), 1), squeeze=False)
    for row, ((first, second), poses, gaps) in zip(grid, shown, strict=True):
        for axes, way in zip(row, ways, strict=True):
            if way not in poses:
                axes.set_axis_off()
                continue
            draw_pair(axes, sweeps[first], sweeps[second], poses[way])
            axes.set_title(f"{first} - {second}, {way}: gap {1e3 * gaps[way]:.0f} mm", fontsize=9)
    return figure
