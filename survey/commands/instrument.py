"""The commands ``gtval instrument-check`` and ``gtval walls-check``."""

from math import degrees, isfinite, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, FIGURE, PATH, STRICT

if TYPE_CHECKING:
    from survey.studies.instrument_check import InstrumentCheck
    from survey.studies.walls import WallPair
    from validation.campaign.folder import Instrument
    from validation.poses.angles import Array
    from validation.results import Table
    from validation.text_files.csv_tables import CsvTable

_SPECIFICATION = click.option(
    "--campaign", type=PATH, help="Take the specification from this campaign folder."
)
_TOLERANCE = click.option(
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="Half width that the maker states, metres; needed without --campaign.",
)


@click.command("instrument-check")
@click.argument("readings", type=PATH)
@_SPECIFICATION
@_TOLERANCE
@click.option("--resolution", type=click.FloatRange(min=0), help="Last digit shown, metres.")
@FIGURE
@AS_JSON
@STRICT
def instrument_check(
    *,
    readings: Path,
    campaign: Path | None,
    tolerance: float | None,
    resolution: float | None,
    figure: Path | None,
    as_json: bool,
    strict: bool,
) -> None:
    """Offset, scale and noise of a hand laser over known lengths.

    READINGS is a CSV file with the columns true and reading in metres, and optionally sigma, the
    standard deviation of each reading. What the maker states comes from --campaign or
    --tolerance.
    """
    from survey.studies.instrument_check import check_instrument
    from survey.studies.instrument_verdict import settings_snippet, verdict
    from validation.commands.output import tell_check

    instrument = _specification(campaign, tolerance, resolution)
    length, reading, sigma, lines = _read_lengths(readings, instrument)
    check = check_instrument(length, reading, instrument, sigma)
    findings = verdict(check, lines)
    snippet = settings_snippet(check, instrument)
    if figure is not None:
        from survey.figures.studies import instrument_figure
        from validation.figures.writing import write_figure

        write_figure(figure, instrument_figure(length, reading, check, instrument))
    tell_check(
        {"check": check, "settings": snippet or None},
        [_instrument_table(check)],
        findings,
        as_json=as_json,
        strict=strict,
        more=f"For campaign.toml:\n\n{snippet}".rstrip()
        if snippet
        else "No lines for campaign.toml: see above.",
    )


def _specification(
    folder: Path | None, tolerance: float | None, resolution: float | None = None
) -> "Instrument":
    """The instrument of the campaign, with what the options change."""
    from survey.readings.hardware import missing_hardware
    from validation.campaign.folder import Instrument, load_campaign
    from validation.errors import InputError

    base = Instrument()
    if folder is not None:
        campaign = load_campaign(folder)
        base = campaign.settings.instrument
        missing = missing_hardware(campaign, frame=False, rig=False)
        if missing and tolerance is None:
            raise InputError(missing)
    elif tolerance is None:
        raise click.UsageError(
            "state the tolerance of the distance meter, in metres, as its maker does: for example "
            "--tolerance 0.0015; or name a campaign folder that states it: --campaign DIR"
        )
    for name, value in (("tolerance", tolerance), ("resolution", resolution)):
        if value is not None and not isfinite(value):
            raise click.BadParameter(f"{name} is not a finite number")
    changes = {"tolerance": tolerance, "resolution": resolution}
    return base.model_copy(update={k: v for k, v in changes.items() if v is not None})


def _read_lengths(
    path: Path, instrument: "Instrument"
) -> tuple["Array", "Array", "Array | None", list[int]]:
    """Known lengths, readings, their sigmas where the file states them, and their lines.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    import numpy as np

    from survey.readings.instrument import reading_sigma
    from validation.text_files.csv_tables import Column, read_csv

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
    _flag_empty(table, "reading")
    table.raise_problems()
    sigma = np.array(table.numbers["sigma"])
    if np.isnan(sigma).all():
        return true, read, None, table.lines
    bare = instrument.model_copy(update={"setup_sigma": 0.0})
    sigma = np.where(np.isnan(sigma), reading_sigma(bare, true), sigma)
    return true, read, sigma, table.lines


def _flag_empty(table: "CsvTable", column: str) -> None:
    """Record that a file has a header but no row."""
    from validation.errors import Problem

    if len(table) == 0 and not table.problems:
        table.problems.append(
            Problem(table.path, "the file has a header but no reading", 1, column)
        )


def _instrument_table(check: "InstrumentCheck") -> "Table":
    """Estimates with their standard deviations and tests."""
    from survey.studies.instrument_verdict import SHOWN_ROUNDING
    from validation.results import Table

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


@click.command("walls-check")
@click.argument("distances", type=PATH)
@_SPECIFICATION
@_TOLERANCE
@AS_JSON
@STRICT
def walls_check(
    distances: Path, campaign: Path | None, tolerance: float | None, as_json: bool, strict: bool
) -> None:
    """Whether walls are parallel, from distances between them.

    DISTANCES is a CSV file with the columns wall_a, wall_b, position and distance in metres: the
    distance from wall a to wall b, at right angles to wall a, at a position along wall a.
    """
    from survey.studies.walls import wall_findings
    from validation.commands.output import tell_check

    pairs = _read_walls(distances, _specification(campaign, tolerance))
    findings = [finding for pair in pairs for finding in wall_findings(pair)]
    tables = [_walls_table(pairs)]
    tell_check({"walls": pairs}, tables, findings, as_json=as_json, strict=strict)


def _read_walls(path: Path, instrument: "Instrument") -> "list[WallPair]":
    """Every pair of walls of a file, compared.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    import numpy as np

    from survey.readings.instrument import reading_sigma
    from survey.studies.walls import compare_walls
    from validation.text_files.csv_tables import Column, read_csv

    table = read_csv(
        path,
        [
            Column("wall_a"),
            Column("wall_b"),
            Column("position", "number", low=-1000.0, high=1000.0, unit="m"),
            Column(
                "distance", "number", low=instrument.range_min, high=instrument.range_max, unit="m"
            ),
        ],
    )
    names = list(zip(table.text["wall_a"], table.text["wall_b"], strict=True))
    for row, (a, b) in enumerate(names):
        if a and a == b:
            table.flag(row, "wall_b", "the two walls are the same")
        elif (b, a) in names[:row]:
            table.flag(
                row,
                "wall_a",
                f"line {table.lines[names.index((b, a))]} has these walls the other way round; "
                "give positions along one and the same wall",
            )
    _flag_empty(table, "distance")
    table.raise_problems()
    position = np.array(table.numbers["position"])
    distance = np.array(table.numbers["distance"])
    pairs = []
    for a, b in dict.fromkeys(names):
        rows = np.array([name == (a, b) for name in names])
        sigma = reading_sigma(instrument, distance[rows])
        pairs.append(compare_walls(a, b, position[rows], distance[rows], sigma))
    return pairs


def _walls_table(pairs: "list[WallPair]") -> "Table":
    """One row for each pair of walls."""
    from validation.results import Table

    return Table(
        "Angles between walls",
        ["wall a", "wall b", "readings", "span [m]", "angle [°]", "sigma [°]", "p-value"],
        [
            [
                *(pair.wall_a, pair.wall_b, pair.readings, pair.span),
                *(degrees(pair.angle), degrees(pair.sigma), pair.p_value),
            ]
            for pair in pairs
        ],
        ["", "", "", ".2f", "+.3f", ".3f", ".2g"],
        "Positive where the walls move apart as the position grows.",
    )
