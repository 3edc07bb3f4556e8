"""Figures as SVG that can stand inline in one page, the same bytes every time."""

import io
import re
from dataclasses import dataclass

import matplotlib as mpl

from validation.results import Figure

_PROLOGUE = re.compile(r"^.*?(?=<svg)", re.DOTALL)
_IDENTIFIER = re.compile(r'\bid="([^"]+)"')


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
        figure.draw().savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    svg = _PROLOGUE.sub("", stream.getvalue(), count=1)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    return re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)


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
    """The root element without size, as an image with a name and a description."""
    head, rest = svg.split(">", 1)
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    head += f' role="img" aria-labelledby="{prefix}-title {prefix}-desc"'
    return (
        f'{head}>\n <title id="{prefix}-title">{_escaped(figure.caption)}</title>\n'
        f' <desc id="{prefix}-desc">{_escaped(figure.alternative)}</desc>{rest}'
    )


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
