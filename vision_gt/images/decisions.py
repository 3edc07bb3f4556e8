"""What a person decided about images: an append-only CSV that runs obey.

Columns: time, image (relative to the campaign folder), decision (leave-out, use, corner,
no-corner), x, y, axis_x, axis_y (pixels), by, note. 'leave-out' keeps an image from every step;
'use' takes that back. 'corner' is a pixel near the first inner corner of the reference pattern in
that image, with another one along its rows, towards their end, if stated; 'no-corner' takes that
back. The last decision about an image counts, of each of the two kinds.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, CsvTable, is_cell, read_csv
from validation.text_files.reading import is_empty
from validation.text_files.writing import append_rows

OF_USE, OF_CORNER = ("leave-out", "use"), ("corner", "no-corner")
"""What an image is for, and where the pattern in it begins: the first of each holds something."""
KINDS = (*OF_USE, *OF_CORNER)
MOST_PIXELS = 1e5
_PLACES = ("x", "y", "axis_x", "axis_y")
COLUMNS = (
    Column("time", required=False, blank=True),
    Column("image"),
    Column("decision"),
    *(
        Column(name, "number", required=False, blank=True, low=-1, high=MOST_PIXELS, unit="px")
        for name in _PLACES
    ),
    Column("by", required=False, blank=True),
    Column("note", required=False, blank=True),
)
HEADER = tuple(column.name for column in COLUMNS)


@dataclass(frozen=True)
class ImageDecision:
    """What was decided about an image.

    Parameters
    ----------
    image : str
        Its file, relative to the campaign folder, with slashes.
    kind : {"leave-out", "use", "corner", "no-corner"}
        What.
    places : (k, 2) array
        Of a corner: the pixel near it, and with k = 2 another along the rows; else k = 0.
    by, note : str
        Who or what decided, and why.
    """

    image: str
    kind: str
    places: Array
    by: str = ""
    note: str = ""

    @property
    def about(self) -> tuple[str, bool]:
        """What decides again about the same is about the same."""
        return self.image, self.kind in OF_CORNER

    @property
    def told(self) -> str:
        """Who decided, and why: 'by ann: blurred'."""
        return ": ".join(part for part in (f"by {self.by}" if self.by else "", self.note) if part)


NO_PLACE = np.zeros((0, 2))


@dataclass(frozen=True)
class Decided:
    """The decisions that count.

    Parameters
    ----------
    left_out : mapping of str to ImageDecision
        By image: those that no step uses.
    corners : mapping of str to ImageDecision
        By image: where the reference pattern begins.
    """

    left_out: Mapping[str, ImageDecision]
    corners: Mapping[str, ImageDecision]

    def paths(self, folder: Path) -> frozenset[Path]:
        """The images of a campaign folder that are left out."""
        return frozenset(folder / image for image in self.left_out)


def decided(history: Sequence[tuple[str, ImageDecision]]) -> Decided:
    """What counts of all decisions with their times."""
    last = {one.about: one for _, one in history}
    left = {one.image: one for one in last.values() if one.kind == "leave-out"}
    return Decided(left, {one.image: one for one in last.values() if one.kind == "corner"})


def image_decisions(path: Path) -> list[tuple[str, ImageDecision]]:
    """All decisions with their times, in the order made; none without the file.

    Raises
    ------
    InputError
        Naming every bad place: words that are none, a corner without a pixel, an image that is
        not named relative to the campaign.
    """
    if is_empty(path):
        return []
    table = read_csv(path, COLUMNS)
    rows = [(table.text["time"][row], _decision(table, row)) for row in range(len(table))]
    table.raise_problems()
    return [(time, one) for time, one in rows if one is not None]


def _decision(table: CsvTable, row: int) -> ImageDecision | None:
    """The decision of a row; None if it is bad, which is recorded."""
    count = len(table.problems)
    numbers = np.array([table.numbers[name][row] for name in _PLACES]).reshape(2, 2)
    stated = ~np.isnan(numbers).all(1)
    text = {name: table.text[name][row] for name in table.text}
    places = numbers[: 2 if stated[1] else int(stated[0])]
    one = ImageDecision(text["image"], text["decision"], places, text["by"], text["note"])
    for name, expected in faults_of(one):
        table.flag(row, name, expected)
    return None if len(table.problems) > count else one


def faults_of(one: ImageDecision) -> Iterator[tuple[str, str]]:
    """Columns of a decision that are bad, and what is expected there."""
    name = PurePosixPath(one.image)
    if name.is_absolute() or ".." in name.parts or str(name) != one.image:
        yield "image", "expected a file below the campaign folder, such as vision/poses/1/pose7.png"
    elif not is_cell(one.image):
        yield "image", "no table can hold this name; rename the file"
    if one.kind not in KINDS:
        yield "decision", f"expected one of {', '.join(KINDS)}"
    places = one.places
    if one.kind == "corner":
        if not len(places) or not np.isfinite(places).all() or np.abs(places).max() > MOST_PIXELS:
            yield "x", "a corner needs its pixel: x and y; axis_x and axis_y are both there or none"
        elif len(places) == 2 and np.allclose(*places):
            yield "axis_x", "the same pixel twice; expected one further along the row"
    elif len(places):
        yield "x", "only a corner has pixels; leave them blank, or write 'corner'"


def append_image_decisions(path: Path, made: Sequence[ImageDecision], time: str) -> None:
    """Add decisions to the end of the file, which is made if missing, all at once.

    They are on the disk when this returns.

    Raises
    ------
    GtvalError
        If a decision is not one that `image_decisions` would take, or the file cannot be written.
    """
    problems, rows = [], []
    for one in made:
        problems += [Problem(path, expected, None, name) for name, expected in faults_of(one)]
        numbers = [f"{value:.2f}" for value in one.places.ravel()]
        said = [" ".join(text.split()) for text in (one.by, one.note)]
        rows.append([time, one.image, one.kind, *numbers, *[""] * (4 - len(numbers)), *said])
    if problems:
        raise InputError(problems)
    append_rows(path, HEADER, rows)
