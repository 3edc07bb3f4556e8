"""Patterns are printed to scale, and what is printed is what is detected."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import cv2
import numpy as np
import pytest

from data_samples.rooms.cameras import CHESSBOARD
from validation.errors import GtvalError
from vision_gt.commands.patterns import example_settings, pattern_files
from vision_gt.images.boards import find_board
from vision_gt.images.markers import detect_markers
from vision_gt.patterns.dictionaries import ARTOOLKITPLUS, Family
from vision_gt.patterns.drawing import board_print, marker_print, pattern_bytes
from vision_gt.settings import VisionSettings


def drawn(svg: bytes, per_mm: float = 1.0) -> np.ndarray:
    """The black boxes of an SVG as an image."""
    root = ET.fromstring(svg)
    width, height = (float(root.get(k).removesuffix("mm")) for k in ("width", "height"))
    image = np.full((round(height * per_mm), round(width * per_mm)), 255, dtype=np.uint8)
    for box in root.findall("{*}rect")[1:]:
        x, y, w, h = (float(box.get(k)) * per_mm for k in ("x", "y", "width", "height"))
        image[round(y) : round(y + h), round(x) : round(x + w)] = 0
    return image


def test_a_marker_is_as_large_as_asked_and_is_detected():
    pattern = marker_print(Family(ARTOOLKITPLUS), 14, 0.160)
    image = drawn(pattern_bytes(".svg", pattern), 4.0)
    views = detect_markers(image, Family(ARTOOLKITPLUS)).views
    assert [view.number for view in views] == [14]
    side = np.linalg.norm(views[0].corners[1] - views[0].corners[0])
    assert side == pytest.approx(4 * 160, abs=0.5)


@pytest.mark.parametrize("family", ["", "4X4_100"])
def test_a_board_is_as_large_as_asked_and_is_detected(family):
    board = replace(CHESSBOARD, family=Family(family) if family else None)
    image = drawn(pattern_bytes(".svg", board_print(board)))
    image = cv2.copyMakeBorder(image, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    found = find_board(image, board, "classic")
    assert len(found.ids) == 45
    grid = found.pixels.reshape(5, 9, 2)
    np.testing.assert_allclose(np.linalg.norm(grid[0, 8] - grid[0, 0]), 800, atol=0.5)


def test_the_pdf_has_the_size_of_the_sheet():
    pattern = board_print(CHESSBOARD)
    pdf = pattern_bytes(".pdf", pattern)
    box = re.search(rb"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
    width, height = (float(v) / 72 * 0.0254 for v in box.groups())
    assert (width, height) == pytest.approx(pattern.size, abs=1e-5)
    table = int(re.search(rb"startxref\n(\d+)", pdf)[1])
    assert pdf[table:].startswith(b"xref")


def test_all_patterns_of_a_campaign():
    files = pattern_files(example_settings(), ".svg")
    assert "bar_second_board.svg" in files
    assert sum(name.startswith("marker_") for name in files) == 4
    assert pattern_bytes(".svg", board_print(CHESSBOARD)) == files["calibration_board.svg"]


def test_no_patterns_are_printed_that_nobody_stated():
    with pytest.raises(GtvalError, match="states no boards and no markers"):
        pattern_files(VisionSettings(), ".svg")


def test_another_ending_is_refused():
    with pytest.raises(GtvalError, match=r"\.svg or \.pdf"):
        pattern_bytes(".png", board_print(CHESSBOARD))
