"""Figures of the RTK system."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from rtk_gt.path.consistency import Consistency
from rtk_gt.path.interpolation import segments
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, RTK_FLOAT, Fixes
from validation.figures.errors import COLOURS, GREY
from validation.figures.thinning import PLACES, rows_shown
from validation.poses.angles import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KIND_COLOURS: Mapping[int, str] = {RTK_FIXED: COLOURS[2], RTK_FLOAT: COLOURS[4], 2: COLOURS[3]}
CHI_95_OF_2 = 2.4477
"""95 % radius of a Gaussian in the plane, in standard deviations: the root of -2 ln 0.05."""


def kind_colour(kind: int) -> str:
    """The colour of a kind of fix in all figures."""
    return KIND_COLOURS.get(kind, COLOURS[1])


def fix_modes(records: Sequence[Fixes], posed: Array, max_gap: float) -> Figure:
    """Fix kind of each receiver over time, with the stretches that have ground truth below.

    As subfigures (d) of Figures 7 to 12 of Blanco 2009.
    """
    start = min(record.times[0] for record in records)
    figure = Figure(figsize=(7, 1.3 + 0.45 * len(records)), layout="constrained")
    axes = figure.add_subplot()
    used: set[int] = set()
    for row, record in enumerate(records):
        for kind, first, lasting in _runs(record):
            axes.broken_barh([(first - start, lasting)], (row - 0.35, 0.7), color=kind_colour(kind))
            used.add(kind)
    stretches = [
        (posed[s[0]] - start, max(posed[s[-1]] - posed[s[0]], 0.2))
        for s in segments(posed, max_gap)
        if len(s)
    ]
    axes.broken_barh(stretches, (len(records) - 0.35, 0.7), color=COLOURS[0])
    axes.set_yticks(
        range(len(records) + 1), [*(record.receiver for record in records), "ground truth"]
    )
    # The row of the ground truth is there where there is none, too.
    axes.set_ylim(len(records) + 0.5, -0.5)
    axes.set_xlabel("time from the start of the record [s]")
    for kind in sorted(used):
        axes.plot([], [], color=kind_colour(kind), linewidth=6, label=FIX_NAMES[kind])
    figure.legend(loc="outside upper right", ncols=4, fontsize=8, frameon=False)
    return figure


def _runs(record: Fixes) -> list[tuple[int, float, float]]:
    """Kind, start and length in seconds of each stretch of one kind without a break."""
    usual = float(np.median(np.diff(record.times))) if len(record) > 1 else 1.0
    after = np.diff(record.times, append=record.times[-1] + usual)
    ends = (after > 1.5 * usual) | (np.diff(record.kinds, append=-1) != 0)
    last = np.flatnonzero(ends)
    first = np.append(0, last[:-1] + 1)
    until = record.times[last] + np.minimum(after[last], 1.5 * usual)
    lasting = until - record.times[first]
    return [
        (int(kind), float(begin), float(length))
        for kind, begin, length in zip(
            record.kinds[first], record.times[first], lasting, strict=True
        )
    ]


def quality_over_time(found: Consistency, times: Array) -> Figure:
    """The measure q_t of each pose with its bound, as Figure 20 of Blanco 2009."""
    figure = Figure(figsize=(7, 2.6), layout="constrained")
    axes = figure.add_subplot()
    elapsed = times - times[0]
    axes.plot(elapsed, found.q, ".", color=COLOURS[0], ms=4, label="q of each pose")
    beyond = found.q > found.bound
    axes.plot(elapsed[beyond], found.q[beyond], "s", color=COLOURS[1], ms=4, label="beyond")
    axes.axhline(
        found.bound, color="black", linewidth=1, linestyle="--",
        label=f"{100 * found.confidence:.0f} % bound, {found.bound:.2f}",
    )  # fmt: skip
    axes.set_ylim(0, 1.35 * max(found.bound, float(np.quantile(found.q, 0.995))))
    axes.set_xlabel("time from the first pose [s]")
    axes.set_ylabel("q, Mahalanobis distance")
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(fontsize=8, ncols=3, loc="upper right")
    return figure


def pose_over_time(path: VehiclePath, max_gap: float) -> Figure:
    """Height and angles of the vehicle with their 95 % bands; gaps stay empty."""
    labels = ("z [m]", "yaw [deg]", "pitch [deg]", "roll [deg]")
    figure = Figure(figsize=(7, 6.5), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    values = path.poses[:, 2:].copy()
    values[:, 1:] = np.degrees(np.unwrap(values[:, 1:], axis=0))
    parts = segments(path.times, max_gap)
    # Places of the figure go to the stretches by their length, and one line is drawn of all.
    places = [max(round(PLACES * len(rows) / len(path)), 1) for rows in parts]
    shown = [one[rows_shown(values[one], most)] for one, most in zip(parts, places, strict=True)]
    rows, broken = np.concatenate(shown), np.cumsum([len(one) for one in shown])[:-1]
    sigmas = np.sqrt(np.diagonal(path.select(rows).covariances, axis1=1, axis2=2))[:, 2:]
    sigmas *= [1, *3 * [np.degrees(1.0)]]
    elapsed = np.insert(path.times[rows] - path.times[0], broken, np.nan)
    for column, (axes, label) in enumerate(zip(panels, labels, strict=True)):
        value, band = (
            np.insert(some[:, column], broken, np.nan) for some in (values[rows], 1.96 * sigmas)
        )
        axes.fill_between(elapsed, value - band, value + band, color=COLOURS[5], alpha=0.5)
        axes.plot(elapsed, value, ".-", color=COLOURS[0], ms=3, linewidth=0.8)
        axes.set_ylabel(label)
        axes.grid(visible=True, linewidth=0.3)
    panels[-1].set_xlabel("time from the first pose [s]")
    return figure


def reference_ellipses(reference: Array) -> Figure:
    """95 % ellipses of W*, positions and angles, as Figure 19 of Blanco 2009 in projections."""
    figure = Figure(figsize=(7, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    _ellipses(
        left, 100 * 100 * reference[:3, :3], [(0, 1, "x, y"), (0, 2, "x, z"), (1, 2, "y, z")], "cm"
    )
    _ellipses(
        right,
        np.degrees(np.degrees(reference[3:, 3:])),
        [(0, 1, "yaw, pitch"), (0, 2, "yaw, roll"), (1, 2, "pitch, roll")],
        "degrees",
    )
    left.set_title("position, 95 %", fontsize=9)
    right.set_title("angles, 95 %", fontsize=9)
    return figure


def _ellipses(
    axes: "Axes", covariance: Array, pairs: Sequence[tuple[int, int, str]], unit: str
) -> None:
    largest = CHI_95_OF_2 * np.sqrt(np.diagonal(covariance).max())
    for number, (first, second, name) in enumerate(pairs):
        axes.add_patch(
            ellipse(covariance[np.ix_([first, second], [first, second])], COLOURS[number], number)
        )
        axes.plot([], [], color=COLOURS[number], linestyle=_DASHES[number], label=name)
    axes.set_xlim(-1.15 * largest, 1.15 * largest)
    axes.set_ylim(-1.15 * largest, 1.15 * largest)
    axes.set_aspect("equal")
    axes.set_xlabel(f"first named [{unit}]")
    axes.set_ylabel(f"second named [{unit}]")
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(fontsize=8, loc="upper right")


_DASHES = ("-", "--", ":")


def ellipse(covariance: Array, colour: str, number: int, centre: Array | None = None) -> Ellipse:
    """The 95 % ellipse of a covariance (2, 2), with the line style of a number."""
    values, vectors = np.linalg.eigh(covariance)
    width, height = 2 * CHI_95_OF_2 * np.sqrt(np.maximum(values[::-1], 0))
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    x, y = (0.0, 0.0) if centre is None else centre
    return Ellipse(
        (float(x), float(y)), width, height, angle=float(angle),
        fill=False, edgecolor=colour, linestyle=_DASHES[number % 3], linewidth=1.3,
    )  # fmt: skip


def reception(records: Sequence[Fixes]) -> Figure:
    """Satellites used and horizontal dilution of precision over time."""
    start = min(record.times[0] for record in records)
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for number, record in enumerate(records):
        style = {"color": COLOURS[number % 6], "linewidth": 1.2, "linestyle": _DASHES[number % 3]}
        known = np.flatnonzero(record.satellites >= 0)
        known = known[rows_shown(record.satellites[known].astype(float))]
        above.step(
            record.times[known] - start, record.satellites[known], where="post",
            label=record.receiver, **style,
        )  # fmt: skip
        shown = rows_shown(record.hdop)
        below.step(record.times[shown] - start, record.hdop[shown], where="post", **style)
    above.set_ylabel("satellites")
    above.yaxis.set_major_locator(MaxNLocator(integer=True))
    below.set_ylabel("HDOP")
    below.set_xlabel("time from the start of the record [s]")
    for axes in (above, below):
        axes.grid(visible=True, linewidth=0.3)
    figure.legend(loc="outside upper right", ncols=3, fontsize=8, frameon=False)
    return figure


def stated_ellipses(records: Sequence[Fixes]) -> Figure:
    """Typical error ellipses as the receivers state them, fixed beside float (AD2.3)."""
    figure = Figure(figsize=(7, 3.4), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, kind in zip(panels, (RTK_FIXED, RTK_FLOAT), strict=True):
        largest = 0.0
        for number, record in enumerate(records):
            stated = record.covariances[record.kinds == kind][:, :2, :2]
            stated = stated[np.isfinite(stated).all((1, 2))]
            if len(stated) == 0:
                continue
            middle = np.median(stated, axis=0) * 1e4
            axes.add_patch(ellipse(middle, COLOURS[number % 6], number))
            axes.plot([], [], color=COLOURS[number % 6], linestyle=_DASHES[number % 3],
                      label=record.receiver)  # fmt: skip
            largest = max(largest, CHI_95_OF_2 * float(np.sqrt(np.diagonal(middle).max())))
        axes.set_title(f"{FIX_NAMES[kind]}, median 95 % ellipse", fontsize=9)
        axes.set_xlabel("east [cm]")
        if largest > 0:
            axes.set_xlim(-1.2 * largest, 1.2 * largest)
            axes.set_ylim(-1.2 * largest, 1.2 * largest)
            axes.legend(fontsize=8, loc="upper right")
        else:
            axes.text(0.5, 0.5, "none stated", ha="center", transform=axes.transAxes, color=GREY)
        axes.set_aspect("equal")
        axes.grid(visible=True, linewidth=0.3)
    panels[0].set_ylabel("north [cm]")
    return figure
