"""Figures of the explanation, with matplotlib's object interface.

Colours and markers are those of `validation.figures.errors`; nothing is told by colour alone.
"""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle
from matplotlib.ticker import MultipleLocator
from scipy import special

from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.fitting.models import Motion, correct
from validation.explain.fitting.noise import Mask
from validation.explain.fitting.settled import Settled
from validation.explain.sources.verdicts import CELLS, Arbitration
from validation.figures.errors import COLOURS, GREY, MOST_NAMES, arrow_scale
from validation.poses.angles import Array, wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NAMES = ("x [mm]", "y [mm]", "theta [mrad]")
_SCORES = LinearSegmentedColormap.from_list("scores", ["#FFFFFF", "#F6D9A8", "#D55E00"])
_FULL_SCORE = 8.0
"""Standard deviations at which the colour ends: beyond them all are gross."""
_NAME_WIDTH = 45.0
"""Degrees of heading that the name of a flagged pose takes up at most: an eighth of the width."""


def error_with_curve(one: SystemExplanation) -> Figure:
    """Errors against the heading with the fitted curve; flagged cells as crosses."""
    settled = _settled(one)
    headings = wrap(settled.pairs.validation[:, 2])
    figure = Figure(figsize=(7, 7), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    grid = np.linspace(-np.pi, np.pi, 181)
    curve = 1000 * _predicted(settled, grid)
    errors = 1000 * settled.before
    for column, axes in enumerate(panels):
        used = settled.cells[:, 0 if column < 2 else 1]
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.plot(
            np.degrees(grid), curve[:, column], color=COLOURS[1], linewidth=1.5, label="fitted"
        )
        axes.plot(
            np.degrees(headings[used]), errors[used, column], "o", color=COLOURS[0],
            markersize=4, label="error",
        )  # fmt: skip
        axes.plot(
            np.degrees(headings[~used]), errors[~used, column], "x", color="black",
            markersize=6, label="flagged",
        )  # fmt: skip
        _limit(axes, errors[used, column], curve[:, column])
        _name_flagged(axes, settled, headings, errors[:, column], used)
        axes.set_ylabel(f"error in {_NAMES[column]}")
        axes.grid(visible=True, linewidth=0.3)
    panels[0].legend(loc="upper right", fontsize=8, ncols=3)
    panels[0].set_title(
        f"{one.system}: errors (validation minus GT)\nfitted by {settled.fit.model.words}",
        fontsize=10,
    )
    panels[2].set_xlabel("heading of the validation pose [degrees]")
    panels[2].xaxis.set_major_locator(MultipleLocator(45))
    panels[2].set_xlim(-185, 185)
    return figure


def _settled(one: SystemExplanation) -> Settled:
    assert one.settled is not None
    return one.settled


def _limit(axes: "Axes", used: Array, curve: Array) -> None:
    """Limits by what is not flagged, so that one gross error does not flatten the rest."""
    values = np.concatenate([used, curve, [0.0]])
    low, high = float(values.min()), float(values.max())
    room = 0.25 * max(high - low, 1.0)
    axes.set_ylim(low - room, high + room)


def _name_flagged(
    axes: "Axes", settled: Settled, headings: Array, errors: Array, used: Mask
) -> None:
    """Names of the flagged poses; those outside the axes are named at the edge with an arrow."""
    low, high = axes.get_ylim()
    rows = np.flatnonzero(~used)
    rows = rows[np.argsort(-np.abs(errors[rows]), kind="stable")[:MOST_NAMES]]
    rows = rows[np.argsort(headings[rows], kind="stable")]
    last = -np.inf
    lines = 0
    for row in rows:
        value, name = errors[row], settled.pairs.ids[row]
        at = float(np.clip(value, low, high))
        beyond = value != at
        text = f"{name} ({value:+.0f})" if beyond else name
        # Names near the top hang below their mark, clear of the title; of neighbours there, each
        # hangs lower than the one before.
        drop = 4
        heading = float(np.degrees(headings[row]))
        if at > low + 0.9 * (high - low):
            lines = lines + 1 if heading - last < _NAME_WIDTH else 0
            last = heading
            drop = -10 - 9 * lines
        axes.annotate(
            text,
            (heading, at),
            (-4 if heading > 180 - _NAME_WIDTH else 4, drop),
            textcoords="offset points",
            ha="right" if heading > 180 - _NAME_WIDTH else "left",
            fontsize=7,
        )
        if beyond:
            axes.plot(
                np.degrees(headings[row]), at, "^" if value > high else "v", color="black",
                markersize=6, clip_on=False,
            )  # fmt: skip


def _predicted(settled: Settled, headings: Array) -> Array:
    """(m, 3) errors that the explanation makes at the middle of the poses, by heading."""
    middle = settled.pairs.gt[:, :2].mean(0)
    poses = np.column_stack([np.broadcast_to(middle, (len(headings), 2)), headings])
    motion = None
    if settled.pairs.motion is not None:
        typical = np.broadcast_to(settled.pairs.motion.velocities.mean(0), poses.shape)
        motion = Motion.steady(typical)
    made = correct(
        settled.fit.model,
        settled.fit.parameters[0],
        poses,
        settled.pairs.reference_pose,
        motion,
    )
    change = np.broadcast_to(made.poses, poses.shape) - poses
    change[:, 2] = wrap(change[:, 2])
    return np.asarray(change)


def arrows_before_after(one: SystemExplanation) -> Figure:
    """Position errors on the floor before and after, both enlarged by the same factor."""
    settled = _settled(one)
    positions = settled.pairs.validation[:, :2]
    extent = float(np.ptp(positions, axis=0).max())
    used = settled.cells[:, 0]
    lengths = np.linalg.norm(settled.before[:, :2], axis=1)
    scale = arrow_scale(lengths, extent)
    figure = Figure(figsize=(9, 6), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, errors, what in zip(
        panels, (settled.before, settled.after), ("as it came", "systematic part out"), strict=True
    ):
        arrows = -scale * errors[:, :2]
        for mask, colour in ((used, COLOURS[1]), (~used, "black")):
            if mask.any():
                axes.quiver(
                    *positions[mask].T, *arrows[mask].T, angles="xy", scale_units="xy", scale=1,
                    color=colour, width=0.005,
                )  # fmt: skip
        axes.plot(*positions.T, "o", color=COLOURS[0], markersize=3)
        axes.update_datalim(positions + arrows)
        for row in _named_rows(used, lengths):
            name = settled.pairs.ids[row]
            axes.annotate(
                name if used[row] else f"{name} (flagged)", positions[row], (3, 3),
                textcoords="offset points", fontsize=7,
            )  # fmt: skip
        axes.autoscale_view()
        axes.set_aspect("equal")
        axes.margins(0.05)
        axes.grid(visible=True, linewidth=0.3)
        axes.set_title(f"{one.system}, {what}", fontsize=10)
        axes.set_xlabel("x [m], GTV frame")
    panels[0].set_ylabel("y [m], GTV frame")
    figure.suptitle(f"From validation to GT, enlarged {scale} times", fontsize=11)
    return figure


def _named_rows(used: Mask, sizes: Array) -> npt.NDArray[np.intp]:
    """Rows of poses to be named: all of a few, else of those that are flagged the farthest off."""
    if len(used) <= MOST_NAMES:
        return np.arange(len(used))
    flagged = np.flatnonzero(~used)
    return flagged[np.argsort(-sizes[flagged], kind="stable")[:MOST_NAMES]]


def source_matrix(explanation: Explanation) -> Figure:
    """Every source at every pose: distance from the others in standard deviations, and flags."""
    result = explanation.arbitration
    stops = _shown_stops(result)
    count, n = len(result.sources), len(stops)
    width = max(7.0, 2.5 + 0.3 * n)
    figure = Figure(figsize=(width, 1.6 + 0.75 * count), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    picture = None
    for kind, axes in enumerate(panels):
        scores = result.scores[..., kind]
        picture = axes.imshow(
            np.ma.masked_invalid(scores[:, stops]),
            cmap=_SCORES,
            vmin=0,
            vmax=_FULL_SCORE,
            aspect="auto",
        )
        axes.set_facecolor("#E4E4E4")
        for s in range(count):
            for place, stop in enumerate(stops):
                _mark_cell(axes, result, (s, stop, kind), place)
        axes.set_yticks(range(count), result.sources, fontsize=8)
        axes.set_title(CELLS[kind], fontsize=9, loc="left")
    names = [result.ids[stop] for stop in stops]
    panels[1].set_xticks(range(n), names, fontsize=7, rotation=90 if n > 30 else 0)
    left = len(result.ids) - n
    panels[1].set_xlabel(f"pose ({left} more, nothing flagged there)" if left else "pose")
    assert picture is not None
    bar = figure.colorbar(picture, ax=list(panels), shrink=0.9, extend="max")
    bar.set_label("distance from the other sources [standard deviations]", fontsize=8)
    figure.suptitle(
        "Sources against poses: X wrong, ? perhaps wrong, s look again, grey: no pose",
        fontsize=10,
    )
    return figure


def _shown_stops(result: Arbitration) -> list[int]:
    """All stops; of many, those with anything flagged, then the farthest off, in their order."""
    n = len(result.ids)
    if n <= MOST_STOPS:
        return list(range(n))
    named = {one.stop for one in (*result.verdicts, *result.suspects)}
    flagged = [stop for stop in range(n) if result.ids[stop] in named]
    far = np.nan_to_num(result.scores, nan=-1.0).max((0, 2))
    far[flagged] = np.inf
    most = max(MOST_STOPS, len(flagged))
    return sorted(np.argsort(-far, kind="stable")[:most].tolist())


MOST_STOPS = 100
"""Columns of the matrix of sources and poses: one takes 0.3 inches, so that names can be read;
a hundred are 32 inches, four screens to scroll through. More than that only if all are flagged."""


def _mark_cell(axes: "Axes", result: Arbitration, cell: tuple[int, int, int], place: int) -> None:
    """A frame and a letter on a flagged cell, a letter on a suspect, at its place on the axis."""
    s, stop, kind = cell
    name, where = result.sources[s], (result.ids[stop], CELLS[kind])
    suspect = any((v.stop, v.cell) == where and name in v.blamed for v in result.suspects)
    flagged = result.bad[cell] or result.doubtful[cell]
    if not flagged:
        if suspect:
            axes.text(place, s, "s", ha="center", va="center", fontsize=8)
        return
    axes.add_patch(
        Rectangle((place - 0.5, s - 0.5), 1, 1, fill=False, edgecolor="black", linewidth=1.2)
    )
    dark = result.scores[cell] > _FULL_SCORE / 2
    axes.text(
        place, s, "X" if result.bad[cell] else "?", ha="center", va="center", fontsize=8,
        fontweight="bold", color="white" if dark else "black",
    )  # fmt: skip


def residual_ellipses(explanation: Explanation) -> Figure:
    """Position errors before and after, with the ellipse that holds 95 % of normal errors."""
    shown = [one for one in explanation.systems if one.settled is not None]
    figure = Figure(figsize=(3.2 * len(shown) + 0.6, 6.2), layout="constrained")
    panels = figure.subplots(2, len(shown), squeeze=False)
    for column, one in enumerate(shown):
        settled = _settled(one)
        used = settled.cells[:, 0]
        for row, (errors, what) in enumerate(
            ((settled.before, "before"), (settled.after, "after"))
        ):
            axes = panels[row, column]
            points = 1000 * errors[:, :2]
            axes.plot(*points[used].T, "o", color=COLOURS[0], markersize=3.5)
            axes.plot(*points[~used].T, "x", color="black", markersize=5)
            reach = 1.15 * max(float(np.abs(points[used]).max(initial=1.0)), 1.0)
            if used.sum() > 2:
                _ellipse(axes, points[used])
            axes.set_xlim(-1.3 * reach, 1.3 * reach)
            axes.set_ylim(-1.3 * reach, 1.3 * reach)
            axes.set_aspect("equal")
            axes.axhline(0, color=GREY, linewidth=0.5)
            axes.axvline(0, color=GREY, linewidth=0.5)
            outside = int((np.abs(points).max(1) > 1.3 * reach).sum())
            more = f", {outside} outside" if outside else ""
            axes.set_title(f"{one.system}\n{what}{more}", fontsize=9)
            axes.set_xlabel("x [mm]", fontsize=8)
            axes.set_ylabel("y [mm]", fontsize=8)
            axes.tick_params(labelsize=7)
    figure.suptitle(
        "Position errors with 95 % ellipses; crosses: flagged. Note the scales", fontsize=10
    )
    return figure


def _ellipse(axes: "Axes", points: Array) -> None:
    """The 95 % ellipse of normal errors with the points' mean and covariance."""
    values, vectors = np.linalg.eigh(np.cov(points.T))
    size = 2 * np.sqrt(np.maximum(values, 0) * float(special.chdtri(2, 0.05)))
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    axes.add_patch(
        Ellipse(
            (float(points[:, 0].mean()), float(points[:, 1].mean())),
            float(size[1]),
            float(size[0]),
            angle=angle,
            fill=False,
            edgecolor=COLOURS[1],
            linewidth=1.5,
        )
    )
