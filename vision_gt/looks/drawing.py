"""Looks drawn on their images: whole, with a part of them enlarged, and small for a report."""

import io
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from string import ascii_lowercase
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from validation.figures.errors import COLOURS
from validation.poses.angles import Array
from vision_gt.images.files import Image
from vision_gt.looks.look import Look, Outline
from vision_gt.patterns.rejections import Rejection

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 8.0, 6.0
"""Inches of each of a picture's images, one above the other: so letters can be read on a phone."""
DOTS_PER_INCH = 125
_LINE, _LETTERS, _POINTS = 0.27, 78, 14
"""Inches of a line of text, its length, and the size of its letters: 9 pixels where the picture is
390 wide."""
FOUND, EXPECTED, LEFT = COLOURS[5], COLOURS[4], COLOURS[3]
_ABOVE = 3.4
"""Lines above the images: two of the heading and one of the key."""
_MARGIN, _LEAST, _WHOLE = 0.25, 60.0, 0.6
"""Around what is enlarged, as a share of it; pixels that are shown at least; share of the image's
width from which on the whole image is enough. A judgement."""
_FAR = 3.0
"""Pixels between found and expected from which on it is said, and seen. A judgement."""
_SMALL_WIDTH = 5.6
_SMALL_DOTS = 160
"""Of thumbnails an inch: they are read on a screen of many dots."""
_EDGE = [withStroke(linewidth=2.5, foreground="black")]
"""Lines and letters are read on black and on white."""


def picture(look: Look, image: Image) -> Figure:
    """An image with all outlines, and beside it the part that holds them, enlarged.

    Parameters
    ----------
    look : Look
        What is drawn.
    image : (h, w) array of uint8
        Grey levels.
    """
    look = _with_places(look)
    letters = _letters(look.rejections)
    lines = _lines(look, letters)
    box = _part(look, image)
    panels = [None] if box is None else [None, box]
    height = HEIGHT * len(panels) + _LINE * (len(lines) + _ABOVE)
    figure = Figure(figsize=(WIDTH, height), facecolor="white")
    top, share = 1 - _ABOVE * _LINE / height, HEIGHT / height
    for place, part in enumerate(panels):
        axes = figure.add_axes((0.005, top - share * (place + 1), 0.99, share - 0.05 / height))
        _draw(axes, look, image, part, letters, named=part is not None or box is None)
        if part is None and box is not None:
            _name_outside(axes, look.rejections, letters, box)
        if part is None and box is not None:
            x, y, dx, dy = box
            frame = np.array([[x, y], [x + dx, y], [x + dx, y + dy], [x, y + dy], [x, y]])
            axes.plot(*frame.T, "-", color="white", linewidth=0.8, path_effects=_EDGE)
    for number, line in enumerate(lines):
        at = _LINE * (len(lines) - number - 0.75) / height
        figure.text(0.005, at, line, fontsize=_POINTS)
    heading = f"{look.title} ({look.image})"
    for number, line in enumerate(textwrap.wrap(heading, _LETTERS - 10)[:2]):
        at = 1 - (number + 0.8) * _LINE / height
        figure.text(0.005, at, line, fontsize=_POINTS, weight="bold")
    figure.legend(
        handles=_key(),
        loc="upper left",
        bbox_to_anchor=(0.0, 1 - 1.95 * _LINE / height),
        ncols=4,
        frameon=False,
        fontsize=_POINTS,
        borderpad=0.0,
        columnspacing=1.0,
    )
    return figure


def _key() -> list[Line2D]:
    """What the lines mean."""
    return [
        Line2D([], [], color=FOUND, linestyle="-", marker="+", label="found"),
        Line2D([], [], color=EXPECTED, linestyle="--", label="expected"),
        Line2D([], [], color=LEFT, linestyle=":", marker="x", label="not used, or rough"),
    ]


def small_pictures(looks: Sequence[Look], images: Sequence[Image]) -> Figure:
    """The enlarged parts of some images, two in a row.

    The figure is one image, as thousands of corners and lines take more bytes.
    """
    rows = -(-len(looks) // 2)
    figure = Figure(figsize=(_SMALL_WIDTH, 2.35 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, squeeze=False).ravel()
    for axes, look, image in zip(grid, map(_with_places, looks), images, strict=False):
        _draw(axes, look, image, _part(look, image), {}, named=True, cross=2.0)
        axes.set_title(textwrap.shorten(look.title, 48), fontsize=7)
    for axes in grid[len(looks) :]:
        axes.set_axis_off()
    stream = io.BytesIO()
    figure.savefig(stream, format="raw", dpi=_SMALL_DOTS)
    across, down = figure.get_size_inches()
    pixels = np.frombuffer(stream.getvalue(), np.uint8).reshape(round(down * _SMALL_DOTS), -1, 4)
    flat = Figure(figsize=(across, down))
    whole = flat.add_axes((0, 0, 1, 1))
    whole.imshow(pixels[..., :3], interpolation="none", aspect="auto")
    whole.set_axis_off()
    return flat


def _with_places(look: Look) -> Look:
    """The look with only the points that can be drawn: a pose far off projects to none."""

    def known(points: Array) -> Array:
        return points if np.isfinite(points).all() else points[:0]

    outlines = [
        replace(
            one,
            found=known(one.found),
            corners=known(one.corners),
            expected=known(one.expected),
            axes=known(one.axes),
        )
        for one in look.outlines
    ]
    return replace(look, outlines=tuple(outlines))


def _letters(rejections: Sequence[Rejection]) -> dict[str, str]:
    """A letter for each reason that has a place, in the order of the rejections."""
    placed = [one.reason for one in rejections if np.isfinite(one.place).all()]
    return dict(zip(dict.fromkeys(placed), ascii_lowercase, strict=False))


def _lines(look: Look, letters: dict[str, str]) -> list[str]:
    """What is said below the images."""
    said = [] if look.verdict in letters else [look.verdict]
    far = [f"{one.name} by {one.off:.0f} px" for one in look.outlines if one.off > _FAR]
    said += [f"Not where expected: {', '.join(far)}"] * bool(far)
    for one in look.rejections:
        if one.kind == "image" and one.reason not in look.verdict:
            said.append(one.reason)
    lines = textwrap.wrap(". ".join(said), _LETTERS)
    for reason, letter in letters.items():
        some = [one for one in look.rejections if one.reason == reason]
        named = ", ".join(f"{one.number}" for one in some if one.number is not None)
        what = f"{some[0].kind}{'s' if len(some) > 1 else ''} {named or len(some)}"
        lines += textwrap.wrap(f"{letter}: {what}: {reason}", _LETTERS)
    return lines


def _part(look: Look, image: Image) -> tuple[float, float, float, float] | None:
    """The part (x, y, width, height) of the image that holds what was found; None for all of it."""
    height, width = image.shape
    some = [a for one in look.outlines for a in (one.found, one.corners, one.expected) if len(a)]
    some = some or [one.outline for one in look.rejections if len(one.outline)]
    if not some:
        return None
    points = np.clip(np.concatenate(some), [0, 0], [width - 1, height - 1])
    low, high = points.min(0), points.max(0)
    span = (1 + 2 * _MARGIN) * np.maximum(high - low, _LEAST)
    shape = WIDTH / HEIGHT
    span = np.array([max(span[0], shape * span[1]), max(span[1], span[0] / shape)])
    if span[0] > _WHOLE * width or span[1] > _WHOLE * width / shape:
        return None
    x, y = np.clip((low + high - span) / 2, -0.5, [width - 0.5, height - 0.5] - span)
    return float(x), float(y), float(span[0]), float(span[1])


def _draw(
    axes: "Axes",
    look: Look,
    image: Image,
    part: tuple[float, float, float, float] | None,
    letters: dict[str, str],
    *,
    named: bool,
    cross: float = 5.0,
) -> None:
    """An image, or a part of it, with outlines; named ones have their words beside them.

    Corners are crosses of ``cross`` points.
    """
    height, width = image.shape
    x, y, dx, dy = part or (-0.5, -0.5, float(width), float(height))
    left, upper = max(int(x), 0), max(int(y), 0)
    right, lower = min(int(x + dx) + 2, width), min(int(y + dy) + 2, height)
    shown = image[upper:lower, left:right]
    extent = (left - 0.5, right - 0.5, lower - 0.5, upper - 0.5)
    how = "nearest" if part else "antialiased"
    axes.imshow(shown, cmap="gray", vmin=0, vmax=255, extent=extent, interpolation=how)
    for outline in look.outlines:
        _draw_outline(axes, outline, cross, named=named)
    for one in look.rejections:
        _draw_rejection(axes, one, letters.get(one.reason, ""), named=named)
    axes.set_xlim(x, x + dx)
    axes.set_ylim(y + dy, y)
    axes.set_facecolor("#DDDDDD")
    axes.set_xticks([])
    axes.set_yticks([])


def _draw_outline(axes: "Axes", outline: Outline, cross: float, *, named: bool) -> None:
    if len(outline.found):
        ring = np.concatenate([outline.found, outline.found[:1]])
        axes.plot(*ring.T, "-", color=FOUND, linewidth=1.0, path_effects=_EDGE)
    if len(outline.corners):
        axes.plot(*outline.corners.T, "+", color=FOUND, markersize=cross, markeredgewidth=cross / 5)
    if len(outline.expected):
        axes.plot(*outline.expected.T, "--", color=EXPECTED, linewidth=1.1)
        if outline.off > _FAR and named:
            top = outline.expected[np.argmin(outline.expected[:, 1])]
            _say(axes, f"{outline.name} expected", top)
    for tip, word, line in zip(outline.axes[1:], ("x", "y", "-z"), ("-", "--", ":"), strict=False):
        ends = np.array([outline.axes[0], tip])
        axes.plot(*ends.T, line, color="white", linewidth=1.5, path_effects=_EDGE)
        if named:
            _say(axes, word, tip)
    shape = next((a for a in (outline.found, outline.expected, outline.corners) if len(a)), None)
    if shape is None or not named:
        return
    seen = len(outline.found) or len(outline.corners)
    words = outline.name if seen else f"{outline.name}: not read"
    _say(axes, words, shape[np.argmin(shape[:, 1])])


def _draw_rejection(axes: "Axes", one: Rejection, letter: str, *, named: bool) -> None:
    if not len(one.outline):
        return
    if len(one.outline) == 1:
        axes.plot(*one.outline.T, "x", color=LEFT, markersize=6, markeredgewidth=1.2)
    else:
        ring = np.concatenate([one.outline, one.outline[:1]])
        axes.plot(*ring.T, ":", color=LEFT, linewidth=1.3, path_effects=_EDGE)
    if letter and named:
        _say(axes, letter, one.outline[np.argmax(one.outline[:, 1])], below=True)


def _name_outside(
    axes: "Axes",
    rejections: Sequence[Rejection],
    letters: dict[str, str],
    box: tuple[float, float, float, float],
) -> None:
    """Letters of what is not in the part that is enlarged."""
    low, span = np.array(box[:2]), np.array(box[2:])
    for one in rejections:
        letter = letters.get(one.reason, "")
        if letter and ((one.place < low) | (one.place > low + span)).any():
            _say(axes, letter, one.outline[np.argmax(one.outline[:, 1])], below=True)


def _say(axes: "Axes", words: str, place: Array, *, below: bool = False) -> None:
    figure = axes.get_figure(root=True)
    small = figure is not None and figure.get_size_inches()[0] < WIDTH
    axes.annotate(
        words,
        (float(place[0]), float(place[1])),
        xytext=(0, -3 if below else 3),
        textcoords="offset points",
        ha="center",
        va="top" if below else "bottom",
        fontsize=8 if small else _POINTS,
        color="white",
        path_effects=_EDGE,
        annotation_clip=True,
    )
