"""The hand laser over known lengths, as a campaign's file holds them.

AD2.3, "Hand-laser distance measuring device": the device's output was checked over comparable
distances.
"""

from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from survey.readings.instrument import reading_sigma
from survey.settings import SurveySettings
from survey.studies.instrument_check import InstrumentCheck, check_instrument
from survey.studies.instrument_verdict import SHOWN_ROUNDING, settings_snippet, verdict
from validation.campaign.folder import Campaign, Instrument
from validation.errors import Problem
from validation.poses.angles import Array
from validation.results import Figure, Section, SystemResult, Table, Text
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.csv_text import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure


def lengths_chapter(campaign: Campaign) -> SystemResult:
    """The instrument check of a campaign; nothing where it has no known lengths.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    path = campaign.folder / campaign.section("survey", SurveySettings).known_lengths
    if not path.exists():
        return SystemResult()
    instrument = campaign.settings.instrument
    length, reading, sigma, lines = read_lengths(path, instrument)
    check = check_instrument(length, reading, instrument, sigma)

    def draw() -> "MatplotlibFigure":
        from survey.figures.studies import instrument_figure  # noqa: PLC0415  (matplotlib is slow)

        return instrument_figure(length, reading, check, instrument)

    figure = Figure(
        "instrument",
        "Errors of the hand laser over known lengths.",
        "Errors over the length, with the fitted line and the stated tolerance.",
        draw,
    )
    snippet = settings_snippet(check, instrument)
    more = [Text(f"For campaign.toml: {' '.join(snippet.split())}")] if snippet else []
    rows = zip(length.tolist(), reading.tolist(), (reading - length).tolist(), strict=True)
    return SystemResult(
        findings=verdict(check, lines),
        sections=[Section("Instrument check", [instrument_table(check), *more, figure])],
        files={"instrument_check.csv": csv_text(["true", "reading", "error"], list(rows))},
    )


def read_lengths(
    path: Path, instrument: Instrument
) -> tuple[Array, Array, Array | None, list[int]]:
    """Known lengths, readings, and their sigmas where the file states them, their lines.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    table = read_csv(
        path,
        [
            Column("true", "number", low=1e-3, high=1000.0, unit="m"),
            Column(
                "reading", "number", low=instrument.range_min, high=instrument.range_max, unit="m"
            ),
            Column("sigma", "number", required=False, blank=True, low=1e-6, high=1.0, unit="m"),
        ],
    )
    true, read = np.array(table.numbers["true"]), np.array(table.numbers["reading"])
    # A judgement: fifty times the tolerance of such meters is another edge, unit or row.
    for row in np.flatnonzero(np.abs(read - true) > 0.1 + 0.01 * true):
        table.flag(int(row), "reading", f"more than 1 % and 10 cm from the true {true[row]:g} m")
    flag_empty(table, "reading")
    table.raise_problems()
    sigma = np.array(table.numbers["sigma"])
    if np.isnan(sigma).all():
        return true, read, None, table.lines
    bare = instrument.model_copy(update={"setup_sigma": 0.0})
    sigma = np.where(np.isnan(sigma), reading_sigma(bare, true), sigma)
    return true, read, sigma, table.lines


def flag_empty(table: CsvTable, column: str) -> None:
    """Record that a file has a header but no row."""
    if len(table) == 0 and not table.problems:
        table.problems.append(
            Problem(table.path, "the file has a header but no reading", 1, column)
        )


def instrument_table(check: InstrumentCheck) -> Table:
    """Estimates with their standard deviations and tests."""
    low, high = check.noise_interval
    rows: list[list[str | float | None]] = [
        [
            *("offset [mm]", check.offset * 1e3, sqrt(check.covariance[0, 0]) * 1e3),
            *(check.p_offset, "readings too long by this"),
        ],
        [
            *("scale error [ppm]", check.scale_error * 1e6, sqrt(check.covariance[1, 1]) * 1e6),
            *(check.p_scale, "and by this times the length"),
        ],
        ["both", None, None, check.p_joint, "joint test"],
        [
            "noise [mm]",
            check.noise * 1e3,
            None,
            check.p_noise,
            f"95 % interval {low * 1e3:.2f} to {high * 1e3:.2f} mm; expected "
            f"{check.expected_noise * 1e3:.2f} mm"
            if check.degrees_of_freedom
            else f"no redundancy; expected {check.expected_noise * 1e3:.2f} mm",
        ],
    ]
    if check.shared_rounding > SHOWN_ROUNDING:
        said = "the same for all readings of a length"
        rows.append(["rounding [mm]", None, check.shared_rounding * 1e3, None, said])
    return Table(
        f"Instrument check: {check.readings} reading(s), {check.shortest:.3f} to "
        f"{check.longest:.3f} m",
        ["", "estimate", "sigma", "p-value", ""],
        rows,
        ["", ".3f", ".3f", ".3g", ""],
    )
