"""Figures written to files."""

import base64
import io
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from validation.errors import GtvalError
from validation.text_files.writing import write_files

FORMATS = (".png", ".svg")
PNG_DOTS_PER_INCH = 160
"""Sharp on a screen at the size of the report, 7 inches: 1120 pixels."""

COLOURS = 256
"""An image of more colours is a photograph, of fewer a drawing. A judgement: a cloud of dots has
its colour and the steps of its edges."""
QUALITY = 85
"""Of photographs, in WebP and JPEG. A judgement: no trace of the compression shows at the size
shown."""

MOST_PIXELS = 16383
"""Along a side of a WebP image, by its format; a map of hundreds of stops may have more."""


def write_figure(path: Path, figure: Figure) -> None:
    """Write one figure; the ending chooses between PNG and SVG.

    Raises
    ------
    GtvalError
        For another ending, or if the file cannot be written.
    """
    write_files(path.parent, {path.name: figure_bytes(figure, path.suffix.lower(), str(path))})


def figure_bytes(
    figure: Figure, suffix: str, name: str, dots_per_inch: int = PNG_DOTS_PER_INCH
) -> bytes:
    """The figure as a PNG or SVG file, the same bytes every time.

    Parameters
    ----------
    figure : Figure
        What is drawn.
    suffix : str
        '.png' or '.svg'.
    name : str
        The file, for the message.
    dots_per_inch : int
        Of a PNG file.

    Raises
    ------
    GtvalError
        For another suffix.
    """
    if suffix not in FORMATS:
        raise GtvalError(f"{name}: a figure can be written as {' or '.join(FORMATS)} only")
    stream = io.BytesIO()
    metadata = {"Date": None, "Creator": None} if suffix == ".svg" else {"Software": None}
    with mpl.rc_context({"svg.hashsalt": "gtval", "svg.fonttype": "none"}):
        figure.savefig(stream, format=suffix[1:], dpi=dots_per_inch, metadata=metadata)
    return stream.getvalue()


def photo_bytes(figure: Figure, dots_per_inch: int) -> bytes:
    """A figure that holds photographs as a JPEG file, the same bytes every time."""
    stream = io.BytesIO()
    figure.savefig(stream, format="jpg", dpi=dots_per_inch, pil_kwargs={"quality": QUALITY})
    return stream.getvalue()


def web_image(png: bytes) -> str:
    """A PNG image as an address that holds it, in the form that takes fewer bytes.

    Parameters
    ----------
    png : bytes
        The file.

    Returns
    -------
    str
        ``data:image/webp;base64,...``: drawings as they are, photographs compressed. Where PNG is
        smaller, that.
    """
    from PIL import Image  # noqa: PLC0415  (few figures hold an image)

    image = Image.open(io.BytesIO(png)).convert("RGBA")
    drawing = image.getcolors(COLOURS) is not None
    forms = [("png", png)]
    if max(image.size) <= MOST_PIXELS:
        stream = io.BytesIO()
        image.save(stream, "WEBP", lossless=drawing, quality=QUALITY, method=4)
        forms.insert(0, ("webp", stream.getvalue()))
    kind, held = min(forms, key=lambda one: len(one[1]))
    return f"data:image/{kind};base64,{base64.b64encode(held).decode()}"
