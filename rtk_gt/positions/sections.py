"""Tables and figures of one receiver's record for the report and the terminal."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from rtk_gt.campaign.sections import coverage_table, gap_table
from rtk_gt.positions.outcome import PositionsOutcome
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, RTK_FLOAT
from validation.results import Figure, Section, Table, Text

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure


def positions_sections(outcome: PositionsOutcome) -> list[Section]:
    """Parts of the report, in reading order."""
    blocks: list[Table | Figure | Text] = [
        Text(
            "One receiver gives positions, no orientation. Ground truth is where it is RTK-fixed; "
            f"pauses of up to {outcome.settings.max_gap:g} s do not count as gaps."
        ),
        quality_table(outcome),
        _figure(
            outcome,
            "rtk_positions",
            "Where the receiver was, by the kind of its fixes.",
            "Map of all fixes in the local frame; their number is in the table.",
            "positions_map",
        ),
        _figure(
            outcome,
            "rtk_kinds",
            "Kind of fix over time, and where that is ground truth.",
            "A bar coloured by fix kind; the shares are in the table.",
            "kinds_over_time",
        ),
    ]
    if outcome.overlay is not None:
        blocks.append(
            _figure(
                outcome,
                "rtk_odometry",
                "Odometry laid over the RTK-fixed positions.",
                "Map of the positions with the way of the odometry; how far they are apart is in "
                "the findings.",
                "odometry_map",
            )
        )
    if outcome.areas:
        blocks.append(area_table(outcome))
    if outcome.coverage.gaps:
        blocks.append(gap_table(outcome.coverage))
    if any(one.horizontal for one in outcome.kinds):
        blocks.append(
            _figure(
                outcome,
                "rtk_errors",
                "Stated errors over time: longer axis of the ellipse, and height (1 sigma).",
                "Points over time on a logarithmic scale, coloured by kind of fix; medians are in "
                "the table.",
                "errors_over_time",
            )
        )
        blocks.append(
            _figure(
                outcome,
                "rtk_ellipses",
                "Stated 95 % error ellipses at moments of the record, RTK fixed above float.",
                "Two rows of ellipses over time, north up; the medians of their longer axes are in "
                "the table.",
                "ellipses_over_time",
            )
        )
    reception = _figure(
        outcome,
        "rtk_reception",
        "Satellites used and horizontal dilution of precision (HDOP).",
        "Curves of the number of satellites and of HDOP over time.",
        "reception_over_time",
    )
    return [Section("RTK-GPS: positions of one receiver", [*blocks, reception])]


def positions_overview(outcome: PositionsOutcome) -> list[Table]:
    """What the terminal shows of a record that is solved by itself."""
    areas = [area_table(outcome)] if outcome.areas else []
    coverage = [coverage_table(outcome.coverage), gap_table(outcome.coverage)]
    return [quality_table(outcome), *areas, *coverage]


def quality_table(outcome: PositionsOutcome) -> Table:
    """Epochs and stated errors of each kind of fix."""
    rows: list[list[str | int | float | None]] = []
    for one in outcome.kinds:
        level = one.horizontal or (None, None)
        up = one.vertical or (None, None)
        rows.append([one.kind, one.epochs, 100 * one.share, *level, *up, one.satellites, one.hdop])
    return Table(
        f"Fixes of receiver {outcome.record.receiver} by kind",
        [
            *("kind", "epochs", "share [%]", "sigma level [m]", "95 % below [m]"),
            *("sigma up [m]", "95 % below [m]", "satellites", "HDOP"),
        ],
        rows,
        ["", "", ".1f", ".3f", ".3f", ".3f", ".3f", ".0f", ".1f"],
        f"Of {outcome.record.epochs} epochs. Sigmas are those that the receiver states: medians, "
        "and what 95 of 100 epochs stay below; level is the longer axis of the ellipse.",
    )


def area_table(outcome: PositionsOutcome) -> Table:
    """How the fixes of each named area are."""
    rows: list[list[str | int | float | None]] = []
    for one in outcome.areas:
        total = sum(kind.epochs for kind in one.kinds)
        share = {kind.kind: 100 * kind.share for kind in one.kinds}
        best = one.kinds[0] if one.kinds else None
        level = best.horizontal[0] if best is not None and best.horizontal else None
        rows.append(
            [
                *(one.area, total, share.get(FIX_NAMES[RTK_FIXED], 0.0)),
                *(share.get(FIX_NAMES[RTK_FLOAT], 0.0), None if best is None else best.kind, level),
            ]
        )
    return Table(
        "Quality by area",
        ["area", "fixes", "RTK fixed [%]", "RTK float [%]", "best kind", "its sigma level [m]"],
        rows,
        ["", "", ".1f", ".1f", "", ".3f"],
        "Shares of the fixes with a position in the area; epochs without one are in none.",
    )


def _figure(
    outcome: PositionsOutcome, name: str, caption: str, alternative: str, function: str
) -> Figure:
    return Figure(name, caption, alternative, partial(_draw, function, outcome))


def _draw(function: str, outcome: PositionsOutcome) -> "MatplotlibFigure":
    """A figure of `rtk_gt.positions.figures`, imported only when something is drawn."""
    from rtk_gt.positions import figures  # noqa: PLC0415

    draw: Callable[[PositionsOutcome], MatplotlibFigure] = getattr(figures, function)
    return draw(outcome)
