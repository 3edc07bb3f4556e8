"""A board and a marker on a table over stops, as a document printed them, and what they show.

AD2.3, "Calibration of the camera network" and "ARToolkit": a chessboard, and a marker beside it, on
a table put over six of the validation poses.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.campaign.toml_files import line_of
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.results import Finding, Section, Severity, Size, SystemResult, Table, Text
from validation.statistics.error_statistics import mean_interval
from validation.statistics.printed import (
    Judged,
    PrintedNumbers,
    cells_that_give,
    errors_finding,
    judged_numbers,
    load_printed,
    load_printed_errors,
    printed_table,
)
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.csv_text import csv_text
from vision_gt.settings import PrintedSettings

AXES = "xyz"
BOARD, MARKER = "table_chessboard", "table_marker"
KEYS = {BOARD: "table_board", MARKER: "table_marker"}
"""Keys of [vision.printed]."""


@dataclass(frozen=True)
class OnTable:
    """One thing on the table, at every stop that it was put over.

    Parameters
    ----------
    what : str
        'table_chessboard' or 'table_marker'.
    poses : tuple of str
        The stops.
    places : (n, 2 or 3) array
        Where the cameras saw it, metres, GTV frame.
    differences : (n, 2 or 3) array
        Validation minus that; in z the table's height minus that.
    """

    what: str
    poses: tuple[str, ...]
    places: Array
    differences: Array

    def judged(self, printed: list[PrintedNumbers]) -> list[Judged]:
        """The printed statistics of this thing beside the computed ones.

        A document may print them twice: whatever begins with the name of the thing is of it.
        """
        own = dict.fromkeys(one.system for one in printed if one.system.startswith(self.what))
        computed = {
            (name, axis, kind): float(value)
            for name in own
            for axis, column in zip(AXES, self.differences.T, strict=False)
            for kind, value in (
                ("mean", column.mean()),
                ("std", column.std(ddof=1)),
                ("max_abs", np.abs(column).max()),
            )
        }
        return judged_numbers(printed, computed)

    @property
    def cells(self) -> tuple[Array, list[str]]:
        """All differences, and the name of each: 'x2' is that in x at stop 2."""
        axes = AXES[: self.differences.shape[1]]
        names = [f"{axis}{pose}" for axis in axes for pose in self.poses]
        return self.differences.T.ravel(), names


def on_tables(
    campaign: Campaign, settings: PrintedSettings, validation: PoseTable | None
) -> list[OnTable]:
    """What was printed of a board and of a marker on the table; nothing without validation poses.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    if validation is None:
        return []
    known = dict(zip(validation.ids, validation.poses, strict=True))
    return [
        _on_table(what, path, known, settings.table_height)
        for what, path in _files(campaign, settings).items()
    ]


def check_tables(campaign: Campaign, settings: PrintedSettings) -> None:
    """Read the files without the validation poses.

    Raises
    ------
    InputError
        Naming every bad place of the first bad file.
    """
    for path in _files(campaign, settings).values():
        _read(path).raise_problems()


def _files(campaign: Campaign, settings: PrintedSettings) -> dict[str, Path]:
    """The files that are named, by what they are of; an error for those that are not there."""
    files: dict[str, Path] = {}
    problems = []
    for what, key in KEYS.items():
        file, keys = getattr(settings, key), ("vision", "printed", key)
        if file and not (campaign.folder / file).exists():
            said, line = "there is no such file", line_of(campaign.toml, keys)
            problems.append(Problem(campaign.toml, said, line, ".".join(keys), file))
        if file:
            files[what] = campaign.folder / file
    if problems:
        raise InputError(problems)
    return files


def _read(path: Path) -> CsvTable:
    """One of the files: pose, x, y and, of a board, z."""
    columns = [Column(axis, "number", required=axis != "z", unit="m") for axis in AXES]
    table = read_csv(path, [Column("pose"), *columns])
    table.flag_duplicates(["pose"])
    return table


def _on_table(what: str, path: Path, known: Mapping[str, Array], height: float | None) -> OnTable:
    """What one of the files says, beside the validation poses."""
    table = _read(path)
    for row, pose in enumerate(table.text["pose"]):
        if pose not in known:
            table.flag(row, "pose", "there is no validation pose of this name")
    table.raise_problems()
    places = np.column_stack([table.numbers[axis] for axis in AXES])
    wanted = np.array([[*known[pose][:2], np.nan] for pose in table.text["pose"]])
    has_height = height is not None and bool(np.isfinite(places[:, 2]).all())
    if has_height:
        wanted[:, 2] = height
    kept = 3 if has_height else 2
    names = tuple(table.text["pose"])
    return OnTable(what, names, places[:, :kept], (wanted - places)[:, :kept])


def table_result(
    campaign: Campaign, settings: PrintedSettings, validation: PoseTable | None
) -> SystemResult:
    """The chapter of the report on what was printed of the table.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    things = on_tables(campaign, settings, validation)
    if not things:
        return SystemResult()
    printed: list[PrintedNumbers] = []
    name = campaign.settings.comparison.published_statistics
    if name:
        printed = load_printed(campaign.folder / name)
    judged = [number for one in things for number in one.judged(printed)]
    tables = [_differences(one) for one in things]
    tables += [printed_table(judged)] if judged else []
    findings = [finding for one in things for finding in _followed(one, judged, printed)]
    if campaign.settings.comparison.published_errors:
        path = campaign.folder / campaign.settings.comparison.published_errors
        errors = load_printed_errors(path, AXES)
        for one in things:
            cells = {
                (pose, axis): float(value)
                for pose, row in zip(one.poses, one.differences, strict=True)
                for axis, value in zip(AXES, row, strict=False)
            }
            findings += errors_finding(one.what, errors, cells)
    findings += _marker_against_board(things)
    return SystemResult(
        findings=findings,
        sections=[
            Section(
                "Vision: board and marker on a table, as printed",
                [*tables, *(Text(one.text) for one in findings)],
            )
        ],
        files={"vision_printed_table.csv": _csv(things)},
        facts={"table": {one.what: one.differences.tolist() for one in things}},
        overview=tables,
    )


def _differences(one: OnTable) -> Table:
    """The document's table: where it was seen, and the differences."""
    axes = AXES[: one.places.shape[1]]
    what = {BOARD: "Chessboard", MARKER: "Marker"}[one.what]
    rows: list[list[str | float]] = [
        [pose, *map(float, place), *map(float, off)]
        for pose, place, off in zip(one.poses, one.places, one.differences, strict=True)
    ]
    return Table(
        f"{what} on the table, as printed",
        ("pose", *(f"{axis} [m]" for axis in axes), *(f"d{axis} [m]" for axis in axes)),
        rows,
        ("", *(".4f",) * len(axes), *("+.4f",) * len(axes)),
        "d: validation minus camera; in z the height of the table minus camera.",
    )


def _followed(
    one: OnTable, judged: list[Judged], printed: list[PrintedNumbers]
) -> Iterator[Finding]:
    """Whether the printed statistics are those of the table, and of which cells if they are not."""
    every = [number for number in judged if number.numbers.system.startswith(one.what)]
    for name in dict.fromkeys(number.numbers.system for number in every):
        own = [number for number in every if number.numbers.system == name]
        off = sum(number.verdict == "differs" for number in own)
        if off:
            yield _not_followed(one, name, off, len(own), printed)
            continue
        text = f"All {len(own)} printed statistics of {name} follow from the printed table."
        size = Size("printed statistics that differ", 0, "numbers")
        yield Finding("good", text, name, "printed_statistics", (size,))


def _not_followed(
    one: OnTable, name: str, off: int, count: int, printed: list[PrintedNumbers]
) -> Finding:
    """Of which cells the printed statistics are."""
    cells, names = one.cells
    found = []
    for numbers in printed:
        if numbers.system != name or not all(numbers.texts[k] for k in ("mean", "std")):
            continue
        sets = cells_that_give(cells, numbers)
        said = " or ".join(" ".join(names[i] for i in rows) for rows in sets[:3])
        found.append(f"{numbers.component}: {said or 'no set of up to four cells'}")
    text = (
        f"{off} of {count} printed statistics of {name} do not follow from the columns "
        f"of the printed table. The fewest cells whose mean, standard deviation and largest "
        f"absolute value are the printed ones: {'; '.join(found)}."
    )
    size = Size("printed statistics that differ", off, "numbers")
    return Finding("note", text, name, "printed_statistics", (size,))


def _marker_against_board(things: list[OnTable]) -> list[Finding]:
    """Whether the marker was seen farther off than the board, at the same stops."""
    by_name = {one.what: one for one in things}
    if set(by_name) != {BOARD, MARKER}:
        return []
    board, marker = by_name[BOARD], by_name[MARKER]
    ids = [pose for pose in marker.poses if pose in board.poses]
    if len(ids) < 3:
        return []
    lengths = [
        np.linalg.norm([one.differences[one.poses.index(pose), :2] for pose in ids], axis=1)
        for one in (marker, board)
    ]
    off = lengths[0] - lengths[1]
    low, high = mean_interval(off.mean(), off.std(ddof=1), len(off))
    worse = bool(low > 0)
    text = (
        f"Seen over {len(ids)} stops, the marker is {1e3 * lengths[0].mean():.0f} mm off in the "
        f"plane and the board {1e3 * lengths[1].mean():.0f} mm: "
        f"{1e3 * off.mean():+.0f} mm, {1e3 * float(low):+.0f} to {1e3 * float(high):+.0f} mm "
        f"(95 %, in pairs). That the marker is worse is {'' if worse else 'not '}shown."
    )
    size = Size("marker less board", float(off.mean()), "m", float(low), float(high), 0.95)
    severity: Severity = "good" if worse else "note"
    return [Finding(severity, text, "vision", "marker_against_board", (size,))]


def _csv(things: list[OnTable]) -> str:
    """One row a thing and stop."""
    nothing = [float("nan")]
    rows = [
        [one.what, pose, *(place.tolist() + nothing)[:3], *(off.tolist() + nothing)[:3]]
        for one in things
        for pose, place, off in zip(one.poses, one.places, one.differences, strict=True)
    ]
    return csv_text(["what", "pose", "x", "y", "z", "dx", "dy", "dz"], rows)
