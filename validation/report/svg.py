"""Figures as SVG that can stand inline in one page, the same bytes every time.

What is drawn stays lines and text, so that it can be enlarged, searched and read out. Clouds of
points do not: thousands of dots are an image of the size shown, a hundredth of the bytes.
"""

import base64
import io
import re
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import matplotlib.figure
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import Collection, LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from validation.figures.writing import web_image
from validation.results import Figure

_PROLOGUE = re.compile(r"^.*?(?=<svg)", re.DOTALL)
_IDENTIFIER = re.compile(r'\bid="([^"]+)"')
_PLACES = re.compile(r'(?<=\s)(d|x|y|points)="([^"]*)"')
_DECIMALS = re.compile(r"(\.\d\d)\d+")
_FIRST = r"\1"
_PNG = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")
DENSE = 300
"""Points of one kind beyond which they are an image. A dot takes a hundred bytes: so many of them
take as much as their image."""
LONG = 5000
"""Corners of a line, or of areas, beyond which they are an image: a corner takes a dozen bytes."""
DOTS_PER_INCH = 160
"""Of images in figures: sharp on a screen with two dots a pixel, where the page shows a figure of 9
inches 736 pixels wide."""
LEAST = 0.7
"""Least size at which a figure is shown, in pixels a point: one of 7 inches then fills a phone of
390 pixels, and its text of 8 to 10 points can be read there. A wider one is moved sideways."""


@dataclass(frozen=True)
class DrawnFigure(Figure):
    """A figure that has been drawn.

    Parameters
    ----------
    name, caption, alternative, draw
        As of `Figure`.
    svg : str
        As `drawn_svg` gives it.
    """

    svg: str = ""


def drawn_svg(figure: Figure) -> str:
    """The figure as an <svg> element. No date and no random ids: same figure, same bytes."""
    stream = io.StringIO()
    # Text stays text: it can be searched, copied, and read out.
    with mpl.rc_context({"svg.hashsalt": figure.name, "svg.fonttype": "none"}):
        drawn = figure.draw()
        _clouds_as_images(drawn)
        drawn.set_dpi(DOTS_PER_INCH)
        # Not by savefig, which draws everything twice to find the size, which is known.
        FigureCanvasSVG(drawn).print_svg(  # type: ignore[no-untyped-call]
            stream, metadata={"Date": None, "Creator": None}
        )
    svg = _PROLOGUE.sub("", stream.getvalue(), count=1)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    svg = _PLACES.sub(_rounded, svg)
    return _PNG.sub(_small_image, svg)


def _clouds_as_images(drawn: matplotlib.figure.Figure) -> None:
    """Artists of many points, and of lines with many corners, are to be drawn as images."""
    for axes in drawn.axes:
        for artist in (*axes.lines, *axes.collections):
            if _points_of(artist) > DENSE or _corners_of(artist) > LONG:
                artist.set_rasterized(True)


def _points_of(artist: Any) -> int:
    """Dots, arrows or pieces of line that an artist draws one by one."""
    if isinstance(artist, Line2D):
        marked = artist.get_marker() not in {"None", "none", None, " ", ""}
        return int(np.size(artist.get_xdata())) if marked else 0
    if isinstance(artist, LineCollection):
        return len(artist.get_paths())
    if isinstance(artist, Quiver):
        return len(np.asarray(artist.get_offsets()))
    return len(np.asarray(artist.get_offsets())) if isinstance(artist, PathCollection) else 0


def _corners_of(artist: Any) -> int:
    """Corners of the lines, or of the areas, that an artist draws."""
    if isinstance(artist, Line2D):
        return int(np.size(artist.get_xdata()))
    if isinstance(artist, Collection):
        return sum(len(np.asarray(path.vertices)) for path in artist.get_paths())
    return 0


def _rounded(found: re.Match[str]) -> str:
    """Places to a hundredth of a point, without line ends."""
    return f'{found[1]}="{_DECIMALS.sub(_FIRST, " ".join(found[2].split()))}"'


def _small_image(found: re.Match[str]) -> str:
    """A PNG image in the form that takes fewer bytes."""
    return web_image(base64.b64decode(found[1]))


def inline_svg(figure: Figure, prefix: str) -> str:
    """The figure as an <svg> element with title and description for those who cannot see it.

    Parameters
    ----------
    figure : Figure
        Drawn here, unless it has been.
    prefix : str
        Put before every id, so that figures on one page do not use each other's parts.

    Returns
    -------
    str
        Without size: the page decides.
    """
    svg = figure.svg if isinstance(figure, DrawnFigure) else drawn_svg(figure)
    svg = _unique_ids(svg, prefix)
    return _labelled(svg, figure, prefix)


def _unique_ids(svg: str, prefix: str) -> str:
    """The prefix before every id and every reference to one."""
    svg = _IDENTIFIER.sub(rf'id="{prefix}-\1"', svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{prefix}-\1"', svg)
    return re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", svg)


def _labelled(svg: str, figure: Figure, prefix: str) -> str:
    """The root element without size but the least one, with a name and a description."""
    head, rest = svg.split(">", 1)
    wide = re.search(r'\swidth="([\d.]+)pt"', head)
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    if wide:
        head += f' style="--least: {LEAST * float(wide[1]):.0f}px"'
    head += f' role="img" aria-labelledby="{prefix}-title {prefix}-desc"'
    return (
        f'{head}>\n <title id="{prefix}-title">{_escaped(figure.caption)}</title>\n'
        f' <desc id="{prefix}-desc">{_escaped(figure.alternative)}</desc>{rest}'
    )


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
