"""The checks as chapters of the report, tables and files."""

from collections.abc import Sequence

import numpy as np

from validation.results import Section, Table, TableColumn
from validation.text_files.csv_text import csv_text
from vision_gt.campaign.checks import Checks
from vision_gt.checks.displacement import Displacement
from vision_gt.checks.known_places import COMPONENTS, PlaceReading

MM = 1e3
_UNITS = ("x [mm]", "y [mm]", "z [mm]", "heading [mrad]")


def check_sections(checks: Checks) -> list[Section]:
    """A chapter for each check that was made."""
    sections = []
    if checks.survey:
        sections.append(Section("Vision: cross-check of the survey", [survey_table(checks.survey)]))
    if checks.displacement:
        table = displacement_table(checks.displacement)
        sections.append(Section("Vision: known displacement", [table]))
    if checks.table:
        blocks = [reading_table(checks.table), statistics_table(checks.table)]
        sections.append(Section("Vision: things on a table", blocks))
    return sections


def check_files(checks: Checks) -> dict[str, str | bytes]:
    """The checks as files below results/."""
    files: dict[str, str | bytes] = {}
    for name, readings in (("table", checks.table), ("survey", checks.survey)):
        if readings:
            files[f"vision_{name}_check.csv"] = readings_csv(readings)
    if checks.displacement:
        header = ["camera", "measured", "sigma", "expected", "expected_sigma", "angle", "p_value"]
        rows = [[*vars(one).values(), one.p_value] for one in checks.displacement]
        files["vision_displacement.csv"] = csv_text(header, rows)
    return files


def readings_csv(readings: Sequence[PlaceReading]) -> str:
    """Every reading with its standard deviations."""
    header = ["place", "camera", "kind"]
    for what in ("known", "seen", "difference", "sigma"):
        header += [f"{what}_{name}" for name in COMPONENTS]
    rows = []
    for one in readings:
        numbers = np.concatenate([one.validation, one.seen, one.difference, one.sigmas]).tolist()
        rows.append([one.pose, one.camera, one.kind, *numbers, one.p_value])
    return csv_text([*header, "p_value"], rows)


def reading_table(
    readings: Sequence[PlaceReading], title: str = "Boards and markers on the table"
) -> Table:
    """The document's table: each pose with its differences, validation minus what is seen."""
    rows: list[list[str | int | float | None]] = []
    for one in readings:
        row: list[str | int | float | None] = [one.pose, one.camera, one.kind]
        for k in range(3):
            row += [float(one.validation[k]), float(one.seen[k])]
            row += [MM * float(one.difference[k]), MM * float(one.sigmas[k])]
        row += [MM * float(one.difference[3]), MM * float(one.sigmas[3]), one.p_value]
        rows.append(row)
    columns = ["pose", "camera", "what"]
    for name in "xyz":
        columns += [f"{name} known [m]", f"{name} seen [m]", f"d{name} [mm]", "sigma"]
    return Table(
        title,
        [*columns, "dheading [mrad]", "sigma", "p"],
        rows,
        ["", "", "", *[".4f", ".4f", "+.1f", ".1f"] * 3, "+.1f", ".1f", ".2g"],
        "Differences: known minus seen, with standard deviations; p: how likely all four are so "
        "large by chance. A camera is said to be wrong below 0.001.",
    )


def survey_table(readings: Sequence[PlaceReading]) -> Table:
    """Known places beside those that a camera sees."""
    return reading_table(readings, "A board at known places, seen by a camera")


def statistics_table(readings: Sequence[PlaceReading]) -> Table:
    """Mean, standard deviation and largest absolute value of the differences, by camera and all."""
    rows: list[list[str | int | float | None]] = []
    for kind in dict.fromkeys(one.kind for one in readings):
        own = [one for one in readings if one.kind == kind]
        cameras = [*dict.fromkeys(one.camera for one in own), ""]
        for camera in cameras if len(cameras) > 2 else [""]:
            off = np.array([one.difference for one in own if camera in ("", one.camera)])
            for k, unit in enumerate(_UNITS):
                column = MM * off[:, k]
                spread = float(column.std(ddof=1)) if len(column) > 1 else None
                most = float(np.abs(column).max())
                average = float(column.mean())
                rows.append([kind, camera or "all", unit, len(column), average, spread, most])
    return Table(
        "Differences on the table",
        ("what", "camera", "component", "n", "average", "standard deviation", "largest absolute"),
        rows,
        ("", "", "", "", "+.2f", ".2f", ".2f"),
        "AD2.3 reports averages of 2.9 mm and -0.1 mm in x and y for its chessboard, and of 21.5 "
        "mm and 54.9 mm for its marker.",
    )


def displacement_table(moved: Sequence[Displacement]) -> Table:
    """Measured and expected distances of a board in two places."""
    columns: list[TableColumn] = [
        ("camera", "", [one.camera for one in moved]),
        ("measured [m]", ".4f", [one.measured for one in moved]),
        ("expected [m]", ".4f", [one.expected for one in moved]),
        ("off [mm]", "+.2f", [MM * one.off for one in moved]),
        ("sigma [mm]", ".2f", [MM * one.off_sigma for one in moved]),
        ("turned [mrad]", ".1f", [MM * one.angle for one in moved]),
        ("p", ".2g", [one.p_value for one in moved]),
    ]
    note = "Sigma: of the corners, of the lens where its sigmas are known, and of the distance."
    return Table.of_columns("A board in two places at a known distance", columns, note)
