"""Figures of the vision system. Nothing is told by colour alone."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY, MARKERS, Walls
from validation.poses.angles import Array
from vision_gt.network.adjustment import Network
from vision_gt.network.intrinsics import Calibration
from vision_gt.network.solution import NetworkSolution
from vision_gt.network.steadiness import Steadiness
from vision_gt.optics.camera import Camera, undistort
from vision_gt.robot.layout import LayoutFit
from vision_gt.robot.marker_poses import Layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 5.6
_MAP_WIDTH, _MAP_MARGIN = 4.8, 1.1
"""Inches of the camera map that show the floor, and those that labels and legend need."""
_SMALL: dict[str, Any] = {"fontsize": 8, "ha": "center", "va": "center"}
"""Of a label on a line or a node."""
_FARTHEST = 6.5
"""Metres from a camera that are drawn of what it sees."""
_RIM = 24
"""Points on each side of an image's rim that are drawn: distortion bends it."""


def field_of_view(camera: Camera, T_gtv_camera: Array) -> Array:
    """(n, 2) outline of what a camera sees of the floor, in the GTV frame, metres.

    Rays that do not meet the floor within 6.5 m of the camera are cut there.
    """
    width, height = camera.size
    s = np.linspace(0, 1, _RIM)
    one, nil = np.ones_like(s), np.zeros_like(s)
    rim = np.concatenate(
        [
            np.column_stack([s, nil]),
            np.column_stack([one, s]),
            np.column_stack([1 - s, one]),
            np.column_stack([nil, 1 - s]),
        ]
    ) * [width - 1, height - 1]
    directions = undistort(rim, camera.parameters)
    rays = np.column_stack([directions, np.ones(len(rim))]) @ T_gtv_camera[:3, :3].T
    rays = rays[np.isfinite(rays).all(1)]
    eye = T_gtv_camera[:3, 3]
    with np.errstate(all="ignore"):
        along = np.where(rays[:, 2] < -1e-6, -eye[2] / rays[:, 2], np.inf)
    flat = np.linalg.norm(rays[:, :2], axis=1)
    along = np.minimum(along, _FARTHEST / np.maximum(flat, 1e-9))
    return np.asarray(eye[:2] + along[:, None] * rays[:, :2])


def camera_map(
    solution: NetworkSolution, walls: Walls = (), stops: Mapping[str, Array] | None = None
) -> Figure:
    """Cameras with their fields of view, the chain that links them, and the robot's stops.

    Parameters
    ----------
    solution : NetworkSolution
        The network.
    walls : sequence of polylines
        In the GTV frame, metres.
    stops : mapping of str to (3,) array, optional
        Poses by name.
    """
    figure = Figure(figsize=(WIDTH, 6.4), layout="constrained")
    axes = figure.add_subplot()
    for wall in walls:
        axes.plot(*np.array(wall).T, color=GREY, linewidth=1.2)
    network = solution.network
    places = {}
    for i, camera in enumerate(network.cameras):
        T = network.T_gtv_camera[i].as_matrix()
        places[camera.name] = T[:2, 3]
        colour = COLOURS[i % len(COLOURS)]
        outline = field_of_view(camera, T)
        axes.fill(*outline.T, facecolor=colour, alpha=0.10)
        axes.plot(*np.vstack([outline, outline[:1]]).T, color=colour, linewidth=1)
        marker = MARKERS[i % len(MARKERS)]
        label = f"camera {camera.name}"
        axes.plot(*T[:2, 3], marker, color=colour, markersize=8, linestyle="none", label=label)
    _draw_chain(axes, solution, places)
    axes.annotate("", (0.6, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": "black"})
    axes.annotate("", (0, 0.6), (0, 0), arrowprops={"arrowstyle": "->", "color": "black"})
    axes.annotate("GTV", (0, 0), (-4, -11), textcoords="offset points", fontsize=7)
    for name, pose in (stops or {}).items():
        tip = 0.25 * np.array([np.cos(pose[2]), np.sin(pose[2])])
        axes.plot(*np.array([pose[:2], pose[:2] + tip]).T, color="black", linewidth=1)
        axes.plot(*pose[:2], ".", color="black", markersize=4)
        axes.annotate(name, (pose[0], pose[1]), (2, 2), textcoords="offset points", fontsize=6)
    axes.set_aspect("equal")
    # As high as the map needs at this width, with its labels and the legend.
    across, up = axes.dataLim.width, axes.dataLim.height
    height = float(np.clip(_MAP_WIDTH * up / across, 2.0, 6.0)) if across > 0 else WIDTH
    figure.set_size_inches(WIDTH, height + _MAP_MARGIN)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.legend(loc="outside upper center", ncols=4, fontsize=8, frameon=False)
    return figure


def _draw_chain(axes: "Axes", solution: NetworkSolution, places: Mapping[str, Array]) -> None:
    counts = {frozenset((link.first, link.second)): len(link.snapshots) for link in solution.links}
    for child, parent in solution.chain.parents.items():
        ends = np.array([places[parent], places[child]])
        axes.plot(*ends.T, "--", color="black", linewidth=1)
        count = counts.get(frozenset((parent, child)), 0)
        middle = ends.mean(0)
        box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "black", "lw": 0.6}
        axes.annotate(f"{count}", (middle[0], middle[1]), bbox=box, **_SMALL)


def residual_plot(network: Network) -> Figure:
    """Reprojection residuals of each camera, pixels."""
    names = network.names
    figure = Figure(figsize=(WIDTH, 1.7 * -(-len(names) // 2) + 0.6), layout="constrained")
    limit = 0.05
    by_camera = {}
    for name in names:
        rows = [
            r for v, r in zip(network.views, network.residuals, strict=True) if v.camera == name
        ]
        by_camera[name] = np.concatenate(rows) if rows else np.zeros((0, 2))
        if len(by_camera[name]):
            limit = max(limit, float(np.quantile(np.abs(by_camera[name]), 0.995)))
    grid = figure.subplots(-(-len(names) // 2), 2, squeeze=False, sharex=True, sharey=True)
    for axes, name in zip(grid.ravel(), names, strict=False):
        residual = by_camera[name]
        axes.plot(*residual.T, ".", color=COLOURS[0], markersize=1.5, alpha=0.5)
        rms = float(np.sqrt((residual**2).mean())) if len(residual) else 0.0
        axes.set_title(f"camera {name}: rms {rms:.3f} px", fontsize=8)
        axes.set_aspect("equal")
        axes.set_xlim(-limit, limit)
        axes.set_ylim(limit, -limit)
        axes.tick_params(labelsize=7)
    for axes in grid.ravel()[len(names) :]:
        axes.set_axis_off()
    figure.supxlabel("x [px]", fontsize=8)
    figure.supylabel("y [px]", fontsize=8)
    return figure


def coverage_plot(calibrations: Mapping[str, Calibration]) -> Figure:
    """How often each part of each camera's image saw a corner of the calibration board."""
    count = len(calibrations)
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(WIDTH, 1.6 * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (name, calibration) in zip(grid.ravel(), calibrations.items(), strict=False):
        counts = calibration.coverage.counts
        axes.imshow(np.sqrt(counts), cmap="Greys", aspect="equal", vmin=0)
        for (row, column), value in np.ndenumerate(counts):
            # A judgement: on greys darker than this, white digits are read better.
            dark = np.sqrt(value) > 0.6 * np.sqrt(max(counts.max(), 1))
            colour = "white" if dark else "black"
            axes.text(column, row, f"{value}", ha="center", va="center", fontsize=5, color=colour)
        share = 100 * calibration.coverage.share
        axes.set_title(f"camera {name}: {share:.0f} % of the image", fontsize=7)
        axes.set_xticks([])
        axes.set_yticks([])
    for axes in grid.ravel()[count:]:
        axes.set_axis_off()
    return figure


def detection_matrix(
    detected: npt.NDArray[np.bool_], rows: Sequence[str], columns: Sequence[str]
) -> Figure:
    """Which markers (columns) were recognised in which image (rows): filled where they were."""
    figure = Figure(
        figsize=(0.45 * len(columns) + 1.6, 0.14 * len(rows) + 0.9), layout="constrained"
    )
    axes = figure.add_subplot()
    axes.imshow(np.where(detected, 0.25, 1.0), cmap="gray", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(columns)), columns, fontsize=7)
    axes.set_yticks(range(len(rows)), rows, fontsize=6)
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
    axes.grid(which="minor", color=GREY, linewidth=0.3)
    axes.tick_params(which="minor", length=0)
    axes.xaxis.tick_top()
    axes.set_xlabel("marker", fontsize=8)
    axes.xaxis.set_label_position("top")
    return figure


def layout_graph(fit: LayoutFit) -> Figure:
    """Markers seen together, with the number of images on each edge; chains are drawn thick."""
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    axes = figure.add_subplot()
    numbers = fit.layout.numbers
    turn = 2 * np.pi * np.arange(len(numbers)) / len(numbers)
    places = {n: np.array([np.cos(t), np.sin(t)]) for n, t in zip(numbers, turn, strict=True)}
    used = {frozenset(chain[:2]) for chain in fit.chains.values() if len(chain) > 1}
    for pair in fit.pairs:
        ends = np.array([places[pair.first], places[pair.second]])
        in_chain = frozenset((pair.first, pair.second)) in used
        width = 2.5 if in_chain else 0.8
        axes.plot(*ends.T, "-" if in_chain else ":", color=COLOURS[0], linewidth=width, zorder=1)
        # Not in the middle, where many edges cross.
        spot = 0.62 * ends[0] + 0.38 * ends[1]
        box = {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none"}
        axes.annotate(f"{pair.images}", (spot[0], spot[1]), bbox=box, zorder=2, **_SMALL)
    dima = next(n for n, chain in fit.chains.items() if len(chain) == 1)
    for number, place in places.items():
        style = "square,pad=0.4" if number == dima else "circle,pad=0.35"
        frame: dict[str, Any] = {"boxstyle": style, "fc": "white", "ec": "black", "lw": 1.5}
        label = {**_SMALL, "fontsize": 10}
        axes.annotate(f"{number}", (place[0], place[1]), bbox=frame, zorder=3, **label)
    axes.set_xlim(-1.35, 1.35)
    axes.set_ylim(-1.3, 1.3)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure


def layout_map(layout: Layout, hand: Mapping[int, Array]) -> Figure:
    """Middles of the markers in the robot frame: crosses estimated, triangles by hand."""
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    places = layout.T_robot_marker.translation
    for axes, (i, j), names in zip(
        figure.subplots(1, 2), ((0, 1), (0, 2)), (("x", "y"), ("x", "z")), strict=True
    ):
        axes.plot(places[:, i], places[:, j], "x", color=COLOURS[0], label="from the images")
        for number, place in hand.items():
            label = "by hand" if number == min(hand) else None
            axes.plot(place[i], place[j], "^", mfc="none", color=COLOURS[1], label=label)
        for number, place in zip(layout.numbers, places, strict=True):
            axes.annotate(
                f"{number}", (place[i], place[j]), (4, 4), textcoords="offset points", fontsize=8
            )
        axes.set_xlabel(f"{names[0]} [m]", fontsize=8)
        axes.set_ylabel(f"{names[1]} [m]", fontsize=8)
        axes.set_aspect("equal", adjustable="datalim")
        axes.tick_params(labelsize=7)
        axes.margins(0.12)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8, frameon=False)
    return figure


def overlay(check: Steadiness) -> Figure:
    """Before and after, and one over the other: edges of before red, of after cyan."""
    figure = Figure(figsize=(WIDTH, 2.0), layout="constrained")
    before, after = (image.astype(float) / 255 for image in (check.before, check.after))
    both = np.stack([before, after, after], -1)
    titles = ("before", "after", "overlay")
    for axes, picture, title in zip(
        figure.subplots(1, 3), (before, after, both), titles, strict=True
    ):
        axes.imshow(picture[::2, ::2], cmap="gray", vmin=0, vmax=1)
        axes.set_title(title, fontsize=8)
        axes.set_axis_off()
    return figure
