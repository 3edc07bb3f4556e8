"""Figures of one receiver's record."""

import numpy as np
from matplotlib.figure import Figure

from rtk_gt.campaign.figures import CHI_95_OF_2, ellipse, fix_modes, kind_colour, reception
from rtk_gt.campaign.site_figures import draw_site
from rtk_gt.positions.odometry import Overlay
from rtk_gt.positions.outcome import PositionsOutcome
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, RTK_FLOAT, Ints
from rtk_gt.receivers.quality import semi_axes
from validation.figures.errors import COLOURS, GREY
from validation.figures.maps import in_metres
from validation.figures.thinning import rows_shown

_MOST = 4000
"""Points a figure shows of one kind; more cannot be told apart at a page's width."""
ELLIPSES = 12
"""Moments at which an ellipse is drawn."""


def _thinned(rows: Ints) -> Ints:
    return rows[:: max(len(rows) // _MOST, 1)]


def _kinds(outcome: PositionsOutcome) -> list[int]:
    """Kinds of the record's fixes, the RTK-fixed ones last, so that they lie on top."""
    kinds = [int(kind) for kind in np.unique(outcome.record.kinds)]
    return sorted(kinds, key=lambda kind: (kind == RTK_FIXED, kind == 5, kind))


def positions_map(outcome: PositionsOutcome, overlay: Overlay | None = None) -> Figure:
    """All fixes from above, coloured by kind, with odometry laid over them if wanted."""
    east, north = np.ptp(outcome.positions[:, :2], axis=0)
    height = float(np.clip(6.2 * north / max(east, 1.0) + 1.6, 3.0, 7.0))
    figure = Figure(figsize=(7, height), layout="constrained")
    axes = figure.add_subplot()
    for kind in _kinds(outcome):
        rows = _thinned(np.flatnonzero(outcome.record.kinds == kind))
        axes.plot(
            *outcome.positions[rows, :2].T, ".", ms=3, color=kind_colour(kind),
            label=FIX_NAMES[kind], rasterized=True,
        )  # fmt: skip
    if overlay is not None:
        shown = rows_shown(overlay.places)
        axes.plot(*overlay.places[shown].T, color=COLOURS[0], linewidth=1.2, label="odometry")
    in_metres(axes)
    axes.set_xlabel("east [m], local frame")
    axes.set_ylabel("north [m], local frame")
    draw_site(axes, outcome.settings, outcome.frame, outcome.campaign.folder)
    axes.legend(fontsize=8, loc="best")
    return figure


def odometry_map(outcome: PositionsOutcome) -> Figure:
    """The way of the odometry over the positions."""
    return positions_map(outcome, outcome.overlay)


def errors_over_time(outcome: PositionsOutcome) -> Figure:
    """Stated sigmas over time, fixed beside float."""
    axes_of = semi_axes(outcome.covariances)
    elapsed = outcome.record.times - outcome.record.times[0]
    figure = Figure(figsize=(7, 4.2), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    for column, panel, label in zip((0, 2), panels, ("level [m]", "up [m]"), strict=True):
        for kind in _kinds(outcome):
            rows = _thinned(np.flatnonzero(outcome.record.kinds == kind))
            panel.semilogy(
                elapsed[rows], axes_of[rows, column], ".", ms=2.5, color=kind_colour(kind),
                label=FIX_NAMES[kind], rasterized=True,
            )  # fmt: skip
        panel.set_ylabel(f"sigma {label}")
        panel.grid(visible=True, linewidth=0.3)
    panels[1].set_xlabel("time from the first fix [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper right", ncols=5, fontsize=8, frameon=False,
        markerscale=3,
    )  # fmt: skip
    return figure


def ellipses_over_time(outcome: PositionsOutcome) -> Figure:
    """Stated 95 % ellipses at moments of the record, fixed above float; north is up (AD2.3)."""
    record = outcome.record
    stated = np.isfinite(outcome.covariances).all((1, 2))
    elapsed = record.times - record.times[0]
    figure = Figure(figsize=(7, 2.6), layout="constrained")
    panels = figure.subplots(2, 1)
    for axes, kind in zip(panels, (RTK_FIXED, RTK_FLOAT), strict=True):
        rows = np.flatnonzero(stated & (record.kinds == kind))
        if len(rows) > ELLIPSES:
            rows = rows[np.linspace(0, len(rows) - 1, ELLIPSES).astype(int)]
        axes.set_title(FIX_NAMES[kind], fontsize=9)
        axes.set_yticks([])
        if len(rows) == 0:
            axes.text(0.5, 0.5, "none stated", ha="center", transform=axes.transAxes, color=GREY)
            axes.set_xticks([])
            continue
        largest = CHI_95_OF_2 * float(np.nanmax(semi_axes(outcome.covariances[rows])[:, 0]))
        for place, row in enumerate(rows):
            cov = outcome.covariances[row, :2, :2] / largest**2
            axes.add_patch(ellipse(cov, kind_colour(kind), 0, np.array([2.3 * place, 0.0])))
        axes.set_xlim(-1.5, 2.3 * (ELLIPSES - 1) + 1.5)
        axes.set_ylim(-1.2, 1.2)
        axes.set_aspect("equal")
        axes.set_xticks(2.3 * np.arange(len(rows)), [f"{elapsed[row]:.0f}" for row in rows])
        height = 2.4 * largest
        said = f"{height:.1f} m" if height > 1 else f"{100 * height:.0f} cm"
        axes.set_ylabel(f"full height:\n{said}", fontsize=8)
        axes.tick_params(labelsize=8)
    panels[1].set_xlabel("time from the first fix [s]")
    return figure


def kinds_over_time(outcome: PositionsOutcome) -> Figure:
    """Kind of fix over time, with the stretches that are ground truth."""
    posed = outcome.record.times[outcome.fixed]
    return fix_modes([outcome.record], posed, outcome.settings.max_gap)


def reception_over_time(outcome: PositionsOutcome) -> Figure:
    """Satellites and HDOP over time."""
    return reception([outcome.record])
