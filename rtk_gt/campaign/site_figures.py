"""Figures of the site: maps over an aerial image, areas, stated errors over time, distances."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D

from rtk_gt.campaign.figures import kind_colour
from rtk_gt.offsets.estimate import Offsets, distance_names
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.antennas import Antennas
from rtk_gt.path.interpolation import segments
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, Fixes
from rtk_gt.receivers.quality import semi_axes
from rtk_gt.receivers.steps import Steps, pair_differences
from rtk_gt.settings import RtkSettings
from validation.errors import InputError, Problem
from validation.figures.errors import COLOURS, GREY, MARKERS
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PIXELS = 1600
"""Of an aerial image along a side: a map of 7 inches shows no more."""
MOST = 3000
"""Points of one kind and receiver that a figure over time shows."""


def track_map(
    records: Sequence[Fixes],
    steps: Steps,
    offsets: Offsets,
    path: VehiclePath,
    settings: RtkSettings,
    folder: Path,
) -> Figure:
    """The drive from above: where all receivers are fixed together, and where they are not."""
    record = max(records, key=lambda one: np.ptp(one.times))
    column = steps.receivers.index(record.receiver)
    track = steps.frame.from_geodetic(record.geodetic)
    track = track + offsets.offsets.within(steps.frame)[column]
    east, north = np.ptp(track[:, :2], axis=0)
    # As high as the drive is at this width, within what a page takes.
    height = float(np.clip(6.2 * north / max(east, 1.0) + 1.6, 3.0, 7.0))
    figure = Figure(figsize=(7, height), layout="constrained")
    axes = figure.add_subplot()
    for kind in np.unique(record.kinds):
        rows = record.kinds == kind
        axes.plot(
            *track[rows, :2].T,
            linestyle="none",
            marker="." if kind == RTK_FIXED else MARKERS[int(kind) % len(MARKERS)],
            color=kind_colour(int(kind)),
            ms=3,
            label=f"{steps.receivers[column]}: {FIX_NAMES[int(kind)]}",
        )
    lines = [path.poses[s, :2] for s in segments(path.times, settings.max_gap) if len(s) > 1]
    axes.add_collection(
        LineCollection(
            lines, colors=COLOURS[0], linewidths=2.5, label="ground truth of the vehicle"
        )
    )
    axes.plot(*path.poses[:, :2].T, ".", color=COLOURS[0], ms=3)
    axes.set_xlabel("east [m], local frame")
    axes.set_ylabel("north [m], local frame")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(visible=True, linewidth=0.3)
    draw_site(axes, settings, steps.frame, folder)
    axes.legend(fontsize=8, loc="best")
    return figure


def draw_site(axes: "Axes", settings: RtkSettings, frame: LocalFrame, folder: Path) -> None:
    """The aerial image under a map, and the outlines of the named areas on it.

    The limits are those of what is drawn else. The image is taken as plane and north up: over a
    kilometre meridians turn by some hundredths of a degree.
    """
    if settings.aerial is not None:
        (west, north), (east, south) = (
            frame.from_geodetic(np.array([*np.radians(corner), frame.height]))[:2]
            for corner in (settings.aerial.north_west, settings.aerial.south_east)
        )
        extent = float(west), float(east), float(south), float(north)
        image = AxesImage(axes, extent=extent, interpolation="bilinear", origin="upper")
        image.set_data(aerial_image(folder / settings.aerial.file))
        image.set(zorder=-1, alpha=0.75)
        axes.add_artist(image)  # which leaves the limits alone
        image.set_clip_path(axes.patch)
    for area in settings.areas:
        corners = np.array([*area.corners, area.corners[0]])
        axes.add_artist(Line2D(*corners.T, color=GREY, linewidth=1.2, linestyle="--"))
        axes.annotate(area.name, corners[:-1].mean(0), ha="center", fontsize=8, color="black")


def aerial_image(path: Path) -> Array:
    """An image (h, w, 3) of 0 to 1, no larger than is shown.

    Raises
    ------
    InputError
        If it is missing or no image.
    """
    import cv2  # noqa: PLC0415  (only where there is one)

    image = cv2.imread(str(path)) if path.is_file() else None
    if image is None:
        said = "no image that can be read; name a PNG or a JPEG of the site"
        raise InputError([Problem(path, said, field="rtk.aerial.file")])
    shrink = max(image.shape[:2]) / MOST_PIXELS
    if shrink > 1:
        size = round(image.shape[1] / shrink), round(image.shape[0] / shrink)
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.asarray(image[:, :, ::-1] / 255.0)


def stated_over_time(records: Sequence[Fixes]) -> Figure:
    """Sigmas that the receivers state over time, RTK fixed beside float (AD2.3's GST)."""
    start = min(record.times[0] for record in records)
    figure = Figure(figsize=(7, 4.2), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    named: set[int] = set()
    for number, record in enumerate(records):
        axes_of = semi_axes(record.covariances)
        for kind in sorted({int(one) for one in record.kinds}):
            rows = np.flatnonzero((record.kinds == kind) & np.isfinite(axes_of[:, 0]))
            rows = rows[:: max(len(rows) // MOST, 1)]
            if len(rows) == 0:
                continue
            for panel, column in zip(panels, (0, 2), strict=True):
                panel.semilogy(
                    record.times[rows] - start, axes_of[rows, column], MARKERS[number % 6],
                    ms=2.5, color=kind_colour(kind), rasterized=True,
                    label=FIX_NAMES[kind] if kind not in named and column == 0 else None,
                )  # fmt: skip
            named.add(kind)
    for panel, label in zip(panels, ("level", "up"), strict=True):
        panel.set_ylabel(f"sigma {label} [m]")
        panel.grid(visible=True, linewidth=0.3)
    for number, record in enumerate(records):
        panels[1].plot([], [], MARKERS[number % 6], color=GREY, ms=4, label=record.receiver)
    panels[1].legend(fontsize=8, ncols=3, loc="best")
    panels[1].set_xlabel("time from the start of the record [s]")
    figure.legend(loc="outside upper right", ncols=5, fontsize=8, frameon=False, markerscale=3,
                  handles=panels[0].get_legend_handles_labels()[0])  # fmt: skip
    return figure


def residual_histograms(offsets: Offsets, noise: GpsNoise, antennas: Antennas) -> Figure:
    """Distances and their squares minus the constant values, with the densities of the noise.

    As Figure 18 of Blanco 2009; its lower row are the squares. Their standard deviation is
    sqrt(8) sigma sqrt(l^2 + eta^2 h^2) of a line of length l level and h upwards (after Eq. 25).
    """
    names = distance_names(offsets.receivers)
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    panels = figure.subplots(2, len(names), sharey="row", squeeze=False)
    rods = pair_differences(antennas.positions)
    reach = np.hypot(np.hypot(rods[:, 0], rods[:, 1]), noise.eta * rods[:, 2])
    good = offsets.residuals[offsets.weights > 0]
    squares = (good + offsets.distances) ** 2 - offsets.distances**2
    rows = (
        (1000 * good, 1000 * np.sqrt(2) * noise.sigma * reach / offsets.distances, "d [mm]"),
        (squares, np.sqrt(8) * noise.sigma * reach, "d² [m²]"),
    )
    for line, (values, scales, label) in zip(panels, rows, strict=True):
        for axes, name, column, scale in zip(line, names, values.T, scales, strict=True):
            grid = np.linspace(-5 * scale, 5 * scale, 200)
            axes.hist(
                column, np.linspace(-5 * scale, 5 * scale, 31), density=True, color=COLOURS[5]
            )
            axes.plot(
                grid, np.exp(-0.5 * (grid / scale) ** 2) / scale / np.sqrt(2 * np.pi),
                color="black", linewidth=1,
            )  # fmt: skip
            axes.set_title(name if line is panels[0] else "", fontsize=8)
            axes.set_xlabel(f"residual of {label}", fontsize=8)
            axes.tick_params(labelsize=7)
            axes.set_yticks([])
        line[0].set_ylabel("density")
    return figure
