"""Figures of what hangs on the vehicle: scanners, IMUs, clouds of points."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from rtk_gt.path.interpolation import segments
from rtk_gt.sensors.characterisation import RateErrors
from rtk_gt.sensors.clouds import Bytes
from rtk_gt.sensors.ground import KnownGround
from rtk_gt.sensors.pass_matching import height_histogram
from rtk_gt.sensors.scans import Cloud
from validation.figures.errors import COLOURS
from validation.figures.maps import in_metres
from validation.figures.thinning import rows_shown
from validation.poses.angles import Array, wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BESIDE = KnownGround.reach
"""Farther from the vehicle, in metres, hills take the ground out of its frame."""
_DASHES = ("-", "--", ":")
MOST_POINTS = 200_000
"""Points of a cloud that a picture shows: more lie on each other."""


def heights_before_and_after(cloud: Cloud, before: Array, after: Array) -> Figure:
    """Heights of the ground beside the vehicle, in its frame, for two places of a scanner.

    As Figure 15 of Blanco 2009: the better place has the narrower peak.
    """
    figure = Figure(figsize=(7, 2.8), layout="constrained")
    axes = figure.subplots()
    points = cloud.in_vehicle(after)
    near = np.linalg.norm(points[:, :2], axis=1) < BESIDE
    ground = float(np.median(points[near & (points[:, 2] < 0), 2])) if near.any() else 0.0
    bins = ground + np.arange(-0.5, 0.501, 0.02)
    middles = (bins[1:] + bins[:-1]) / 2
    for pose, name, colour, style in (
        (before, "place measured by hand", COLOURS[1], "--"),
        (after, "place found", COLOURS[0], "-"),
    ):
        share = 100 * height_histogram(cloud, pose, bins, reach=BESIDE)
        axes.step(middles, share, style, where="mid", color=colour, label=name)
    axes.set_xlabel("height in the vehicle frame [m]")
    axes.set_ylabel(f"points within {BESIDE:g} m [%]")
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(fontsize=8)
    return figure


def rates_over_time(
    found: Sequence[RateErrors],
    max_gap: float,
    yaws: tuple[tuple[Array, Array], tuple[Array, Array]] | None = None,
) -> Figure:
    """Yaw and yaw rate of the path and of an IMU, and the IMU's errors in all three rates.

    As Figure 17 of Blanco 2009.

    Parameters
    ----------
    found : sequence of RateErrors
        Of yaw, pitch and roll.
    max_gap : float
        No line leads over longer pauses, seconds.
    yaws : pair of (times, yaws), optional
        Of the path and of the IMU, radians; that of the IMU is drawn with the same middle, as where
        it counts from is its own.
    """
    yaw = found[0]
    figure = Figure(figsize=(7, 4.2 if yaws is None else 6.0), layout="constrained")
    panels = figure.subplots(2 if yaws is None else 3, 1, sharex=True)
    above, below = panels[-2:]
    if yaws is not None:
        _yaws(panels[0], yaws, yaw.times[0], max_gap)
    start = yaw.times[0]
    for name, rates, number in (("path", yaw.true, 0), ("IMU", yaw.true + yaw.errors, 1)):
        for row, part in enumerate(segments(yaw.times, max_gap)):
            above.plot(
                yaw.times[part] - start, np.degrees(rates[part]), _DASHES[number],
                color=COLOURS[number], linewidth=1.2, label=None if row else name,
            )  # fmt: skip
    for number, one in enumerate(found):
        below.plot(
            one.times - start, np.degrees(one.errors), ".", markersize=3, color=COLOURS[number],
            label=one.name,
        )  # fmt: skip
    above.set_ylabel("yaw rate [deg/s]")
    below.set_ylabel("error of the IMU [deg/s]")
    below.set_xlabel("time from the first interval [s]")
    for axes in panels:
        axes.grid(visible=True, linewidth=0.3)
        axes.legend(
            fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1, 1), frameon=False,
            borderaxespad=0,
        )  # fmt: skip
    return figure


def _yaws(
    axes: "Axes",
    yaws: tuple[tuple[Array, Array], tuple[Array, Array]],
    start: float,
    max_gap: float,
) -> None:
    """Yaw of the path and of the IMU over time."""
    (times, own), (imu_times, imu) = yaws
    imu = np.unwrap(imu)
    apart = own - np.interp(times, imu_times, imu)
    inside = (times >= imu_times[0]) & (times <= imu_times[-1])
    shift = float(np.angle(np.exp(1j * apart[inside]).mean())) if inside.any() else 0.0
    # Over a gap nobody counted the path's turns: those of the IMU are taken.
    own = own - apart + shift + wrap(apart - shift)
    for row, part in enumerate(segments(times, max_gap)):
        axes.plot(
            times[part] - start, np.degrees(own[part]), _DASHES[0], color=COLOURS[0],
            linewidth=1.2, label=None if row else "path",
        )  # fmt: skip
    shown = rows_shown(imu)
    axes.plot(
        imu_times[shown] - start, np.degrees(imu[shown] + shift), _DASHES[1], color=COLOURS[1],
        linewidth=1.2, label="IMU",
    )  # fmt: skip
    axes.set_ylabel("yaw [deg]")


def cloud_picture(points: Array, colours: Bytes | None = None) -> Figure:
    """A cloud of points from above and from the south, by height or in its own colours.

    Parameters
    ----------
    points : (n, 3) array
        In the local frame, metres.
    colours : (n, 3) array, optional
        Red, green, blue, 0 to 255.
    """
    chosen = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
    points = points[chosen]
    low, high = np.quantile(points[:, 2], [0.01, 0.99])
    east, north = np.ptp(points[:, :2], axis=0)
    tall = float(np.clip(6.0 * north / max(east, 1.0), 2.0, 6.0))
    figure = Figure(figsize=(7, tall + 2.2), layout="constrained")
    above, side = figure.subplots(2, 1, height_ratios=[tall, 1.4], sharex=True)
    shown = points[:, 2] if colours is None else np.asarray(colours)[chosen] / 255
    for axes, k in ((above, 1), (side, 2)):
        dots = axes.scatter(
            points[:, 0], points[:, k], c=shown, s=0.6, linewidths=0, rasterized=True,
            **({"vmin": low, "vmax": high, "cmap": "viridis"} if colours is None else {}),
        )  # fmt: skip
    in_metres(above)
    above.set_xlabel("")
    above.set_ylabel("north [m], local frame")
    side.set_ylabel("up [m]")
    side.set_xlabel("east [m], local frame")
    side.set_ylim(low - 1, high + 1)
    side.grid(visible=True, linewidth=0.4, alpha=0.5)
    if colours is None:
        figure.colorbar(dots, ax=[above, side], label="height [m]", shrink=0.7)
    return figure
