"""Patterns to print, to scale: boards and markers as SVG or PDF."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family

MARGIN = 0.02
"""Metres of white around a pattern, at least; markers have a quiet cell besides."""
_MM = 1000.0
_POINTS_PER_METRE = 72 / 0.0254
_RULER = 0.1
"""Metres of the line below a pattern, by which the print is checked."""
_SVG = "http://www.w3.org/2000/svg"


@dataclass(frozen=True)
class Print:
    """A pattern as cells on a sheet.

    Parameters
    ----------
    cells : (rows, columns) array
        1 where white, 0 where black.
    cell : float
        Side of a cell, metres.
    caption : str
        Printed below it.
    """

    cells: npt.NDArray[np.uint8]
    cell: float
    caption: str

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the whole sheet, metres."""
        rows, columns = self.cells.shape
        return columns * self.cell + 2 * MARGIN, rows * self.cell + 2 * MARGIN + 0.015

    def black_runs(self) -> list[tuple[float, float, float, float]]:
        """Black rectangles x, y, width, height in metres from the sheet's top left corner."""
        runs = []
        for row, line in enumerate(self.cells):
            edges = np.flatnonzero(np.diff(np.concatenate([[1], line, [1]])))
            for start, end in edges.reshape(-1, 2):
                x, y = MARGIN + start * self.cell, MARGIN + row * self.cell
                runs.append((x, y, (end - start) * self.cell, self.cell))
        return runs


def board_print(board: Board) -> Print:
    """A board as it is to be printed."""
    cells, cell = board.cells()
    kind = "chessboard" if board.family is None else f"ChArUco board {board.family.name}"
    ids = "" if board.family is None else f", ids from {board.first_id}"
    caption = (
        f"{kind} {board.columns} x {board.rows} squares of {_MM * board.square:g} mm{ids}. "
        f"Print at 100 %; the line is {_MM * _RULER:g} mm long."
    )
    return Print(cells, cell, caption)


def marker_print(family: Family, number: int, side: float) -> Print:
    """A marker with a white cell around it."""
    cells = np.pad(family.bits(number), 1, constant_values=1)
    caption = f"{family.name} {number}, side {_MM * side:g} mm; line {_MM * _RULER:g} mm."
    return Print(cells, side / family.cells, caption)


def pattern_bytes(suffix: str, pattern: Print) -> bytes:
    """The file of a pattern, the same bytes every time.

    Parameters
    ----------
    suffix : str
        '.svg' or '.pdf'.
    pattern : Print
        What is printed.

    Raises
    ------
    GtvalError
        For another suffix.
    """
    if suffix == ".svg":
        return _svg(pattern)
    if suffix == ".pdf":
        return _pdf(pattern)
    raise GtvalError(f"patterns are written as .svg or .pdf, not {suffix!r}")


def _svg(pattern: Print) -> bytes:
    width, height = (_MM * v for v in pattern.size)
    boxes = "".join(
        f'<rect x="{_MM * x:.4f}" y="{_MM * y:.4f}" width="{_MM * w:.4f}" height="{_MM * h:.4f}"/>'
        for x, y, w, h in pattern.black_runs()
    )
    low = height - 8
    ruler = f'<rect x="{_MM * MARGIN:.4f}" y="{low:.4f}" width="{_MM * _RULER:g}" height="0.5"/>'
    text = (
        f'<text x="{_MM * MARGIN:.4f}" y="{height - 3:.4f}" font-size="4" '
        f'font-family="sans-serif">{pattern.caption}</text>'
    )
    return (
        f'<svg xmlns="{_SVG}" width="{width:.4f}mm" height="{height:.4f}mm" '
        f'viewBox="0 0 {width:.4f} {height:.4f}" shape-rendering="crispEdges">'
        f'<rect width="100%" height="100%" fill="white"/>{boxes}{ruler}{text}</svg>\n'
    ).encode()


def _pdf(pattern: Print) -> bytes:
    """A PDF of one page, written by hand: rectangles and one line of text."""
    width, height = (_POINTS_PER_METRE * v for v in pattern.size)
    k = _POINTS_PER_METRE
    drawn = [
        f"{k * x:.4f} {height - k * (y + h):.4f} {k * w:.4f} {k * h:.4f} re"
        for x, y, w, h in pattern.black_runs()
    ]
    drawn.append(f"{k * MARGIN:.4f} {k * 0.008:.4f} {k * _RULER:.4f} 1.4 re")
    caption = pattern.caption.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    words = f"BT /F1 10 Tf {k * MARGIN:.4f} {k * 0.003:.4f} Td ({caption}) Tj ET"
    stream = "0 g\n" + "\n".join(drawn) + "\nf\n" + words
    page = (
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] "
        "/Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>"
    )
    objects = [
        "<< /Type /Catalog /Pages 2 0 R >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        page,
        f"<< /Length {len(stream.encode('latin-1'))} >>\nstream\n{stream}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    out = b"%PDF-1.4\n"
    places = []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += f"{number} 0 obj\n{body}\nendobj\n".encode("latin-1")
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    end = (
        f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}"
        f"trailer << /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(out)}\n%%EOF\n"
    )
    return out + end.encode("latin-1")
