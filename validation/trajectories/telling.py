"""Comparisons in time as tables, as JSON, and as blocks of a report."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, get_args

import numpy as np

from validation.errors import GtvalError
from validation.results import Figure, Section, Table, Text
from validation.statistics.dependence import UNSEEN, SeriesMean, SeriesRms
from validation.trajectories.breakdown import UNITS, By, Part, breakdown
from validation.trajectories.comparison import ComponentInTime, TimeComparison
from validation.trajectories.findings import limit_sentence
from validation.trajectories.relative import MOST_MOTIONS, RelativeErrors, Unit, relative_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

Cell = str | int | float | None
LENGTHS = (1.0, 5.0, 20.0, 100.0)
TIMES = (1.0, 10.0, 60.0)
MOST_HOLES = 20
"""Stretches without pairs that are told, the longest of them."""
BYS: tuple[By, ...] = get_args(By)


def overview_in_time(comparisons: Sequence[TimeComparison], limit: float) -> Table:
    """One row a source, and whether it is good enough for the limit."""
    rows: list[list[Cell]] = []
    for one in comparisons:
        rms = one.rms_position
        along, across = (_rms(values) for values in one.along_across)
        row: list[Cell] = [
            one.system,
            len(one),
            100 * one.coverage.share,
            rms.rms,
            rms.low,
            rms.high,
        ]
        rows.append([*row, rms.n_effective, along, across, _rms(one.rotation_angles)])
    return Table(
        "Errors in time (reference minus source)",
        [
            *("source", "pairs", "of time [%]", "rms position [m]", "low", "high"),
            *("effective", "along [m]", "across [m]", "rotation [rad]"),
        ],
        rows,
        ["", "d", ".1f", ".4f", ".4f", ".4f", ".0f", ".4f", ".4f", ".4f"],
        " ".join(limit_sentence(one, one.answer(limit)) for one in comparisons)
        + f" Intervals allow for errors that neighbours share; {UNSEEN}.",
    )


def statistics_in_time(comparison: TimeComparison, limit: float) -> Table:
    """Errors of a source, a component a row."""
    rows: list[list[Cell]] = []
    notes = set()
    for one in comparison.statistics(limit):
        mean = one.mean
        low, high = (np.nan, np.nan) if one.note else (mean.low, mean.high)
        rows.append(
            [
                *(f"{one.component.name} [{one.component.unit}]", mean.n, mean.n_effective),
                *(mean.mean, low, high, mean.std, one.rms, one.max_abs),
                one.bias.smallest_limit if not one.note else np.nan,
            ]
        )
        notes |= {note for note in (one.note, mean.reason) if note}
    percent = f"{100 * comparison.confidence:g} %"
    return Table(
        f"Statistics of the errors of {comparison.system} in time",
        [
            *("component", "n", "effective", "mean", f"{percent} low", f"{percent} high"),
            *("std", "rms", "max abs", "bias below"),
        ],
        rows,
        ["", "d", ".0f", *[".4f"] * 7],
        "Effective: independent poses that would tell as much of the mean. "
        + "".join(f"{note[0].upper()}{note[1:]}. " for note in sorted(notes))
        + f"Note that {UNSEEN}.",
    )


def alignment_table(comparison: TimeComparison) -> Table:
    """What was fitted, with standard deviations."""
    found = comparison.alignment
    rows: list[list[Cell]] = [
        [name, value, found.sigmas.get(name, np.nan)] for name, value in found.numbers.items()
    ]
    return Table(
        f"Fitted to {comparison.system} before it was compared",
        ["what", "value", "sigma"],
        rows,
        ["", ".5f", ".5f"],
        "Metres, radians, seconds. The delay is what is added to the source's stamps.",
    )


def breakdown_table(comparison: TimeComparison, by: By) -> Table:
    """Errors in ranges of time, speed, turn rate or distance."""
    rows: list[list[Cell]] = [
        [
            *(f"{part.low:.3g} to {part.high:.3g}", part.rms.n, part.rms.n_effective),
            *(part.rms.rms, part.rms.low, part.rms.high),
            *(part.along.mean, part.along.low, part.along.high, part.rms_rotation),
        ]
        for part in breakdown(comparison, by)
    ]
    return Table(
        f"Errors of {comparison.system} by {by.replace('_', ' ')}",
        [
            *(f"{by.replace('_', ' ')} [{UNITS[by]}]", "n", "effective", "rms position [m]"),
            *("low", "high", "mean along [m]", "low ", "high ", "rotation [rad]"),
        ],
        rows,
        ["", "d", ".0f", *[".4f"] * 7],
    )


def worst_table(comparison: TimeComparison) -> Table:
    """Where the source is worst."""
    rows: list[list[Cell]] = [
        [one.start_s - comparison.start, one.end_s - comparison.start, one.n, one.rms_m, one.max_m]
        for one in comparison.worst_stretches()
    ]
    return Table(
        f"Worst stretches of {comparison.system}",
        ["from [s]", "to [s]", "n", "rms position [m]", "max [m]"],
        rows,
        [".1f", ".1f", "d", ".4f", ".4f"],
        "Seconds after the first pose of the reference.",
    )


def drift_errors(comparison: TimeComparison) -> list[RelativeErrors]:
    """Errors over those lengths and times that the pairs have."""
    found = []
    wanted: list[tuple[float, Unit]] = [*((d, "m") for d in LENGTHS), *((d, "s") for d in TIMES)]
    for delta, unit in wanted:
        try:
            found.append(relative_errors(comparison.pairs, delta, unit, most=MOST_MOTIONS))
        except GtvalError:
            continue
    return found


def drift_table(comparison: TimeComparison) -> Table:
    """Errors of the motions over lengths and times."""
    rows: list[list[Cell]] = [
        [
            *(f"{one.delta:g} {one.unit}", len(one.start), one.rms.rms, one.rms.low),
            *(one.rms.high, _rms(one.rotations)),
        ]
        for one in drift_errors(comparison)
    ]
    return Table(
        f"Drift of {comparison.system}: errors of its motions",
        ["over", "motions", "rms translation [m]", "low", "high", "rms rotation [rad]"],
        rows,
        ["", "d", ".4f", ".4f", ".4f", ".4f"],
    )


def coverage_table_in_time(comparison: TimeComparison) -> Table:
    """What has no pair."""
    rows: list[list[Cell]] = [
        [start - comparison.start, end - comparison.start, end - start]
        for start, end in comparison.coverage.holes[:MOST_HOLES]
    ]
    covered = comparison.coverage
    return Table(
        f"Stretches without pairs of {comparison.system}",
        ["from [s]", "to [s]", "length [s]"],
        rows,
        [".1f", ".1f", ".1f"],
        f"{covered.paired} of {covered.asked} poses of the {covered.at} have a pair: "
        f"{covered.covered_s:.1f} of the reference's {covered.span_s:.1f} s. Nothing is "
        "interpolated across a gap. Seconds after the first pose of the reference.",
    )


def tables_in_time(comparison: TimeComparison, limit: float) -> list[Table]:
    """All tables of one source; those without a row are left out."""
    found = [
        statistics_in_time(comparison, limit),
        alignment_table(comparison),
        worst_table(comparison),
        *(breakdown_table(comparison, by) for by in BYS),
        drift_table(comparison),
        coverage_table_in_time(comparison),
    ]
    return [table for table in found if table.rows]


def section_in_time(comparison: TimeComparison, limit: float) -> Section:
    """The part of a report about one source."""
    system = comparison.system
    blocks: list[Table | Figure | Text] = [
        Text(limit_sentence(comparison, comparison.answer(limit))),
        Figure(
            f"errors_in_time_{system}",
            "Errors over time, with the mean of each fifth of the record and its interval. Grey: "
            "stretches without pairs.",
            f"Errors of {system} over time, a component each; the numbers are in the tables.",
            partial(_draw, "errors_over_time", comparison),
        ),
        Figure(
            f"errors_by_speed_{system}",
            "Errors along the motion and across it against the speed. The line is what the delay "
            "fitted to them would do; level points have no delay.",
            f"Scatter plot of the errors of {system} along and across over the speed.",
            partial(_draw, "error_against_speed", comparison),
        ),
        Figure(
            f"trajectories_{system}",
            "Both trajectories from above, where they have pairs; the colour is the position "
            "error.",
            f"Map of the reference and of {system}.",
            partial(_draw, "trajectories_on_map", comparison),
        ),
        Figure(
            f"coverage_{system}",
            "When the reference and the source have pairs.",
            f"Bars over time: the pairs of {system}, and what has none.",
            partial(_draw, "coverage_over_time", comparison),
        ),
    ]
    return Section(f"{system} in time", [*blocks, *tables_in_time(comparison, limit)])


def _draw(name: str, comparison: TimeComparison) -> "MatplotlibFigure":
    from validation.trajectories.figures import comparison as figures  # noqa: PLC0415  (half a second)

    figure: MatplotlibFigure = getattr(figures, name)(comparison)
    return figure


def comparison_json(comparison: TimeComparison, limit: float) -> dict[str, object]:
    """Everything known of one source's errors in time; lengths in metres, angles in radians.

    Stamps are as in the reference's file.
    """
    epoch, rms = comparison.pairs.reference.epoch, comparison.rms_position
    answer, covered = comparison.answer(limit), comparison.coverage
    along, across = comparison.along_across
    delay, spread = comparison.delay_by_speed
    return {
        "rms_position_m": rms.rms,
        "rms_position_interval_m": [rms.low, rms.high],
        "rms_position_reason": rms.reason,
        "max_position_m": float(comparison.distances.max()),
        "rms_rotation_rad": _rms(comparison.rotation_angles),
        "n": len(comparison),
        "pairs": covered.paired,
        "n_effective": rms.n_effective,
        "confidence": comparison.confidence,
        "record_is_short": rms.short,
        "assumes": UNSEEN,
        "compared_in": comparison.pairs.reference.kind,
        "shared": comparison.pairs.shared,
        "coverage": {
            **{name: getattr(covered, name) for name in ("at", "asked", "paired", "share")},
            "span_s": covered.span_s,
            "covered_s": covered.covered_s,
            "holes": [[a + epoch, b + epoch] for a, b in covered.holes[:MOST_HOLES].tolist()],
        },
        "components": {
            one.component.name: _component_json(one) for one in comparison.statistics(limit)
        },
        "along_rms_m": _rms(along),
        "across_rms_m": _rms(across),
        "aligned": _alignment_json(comparison),
        "delay_by_speed_s": {
            "value": delay,
            "low": spread.low if spread else None,
            "high": spread.high if spread else None,
        },
        "nees_test": comparison.nees_test,
        "nees_not_available": comparison.unavailable,
        "limit": {
            "limit_m": limit,
            "share_below": answer.share,
            "verdict": answer.verdict,
            "sentence": limit_sentence(comparison, answer),
        },
        "verdict": answer.verdict,
        "worst": [
            {
                "from": one.start_s + epoch,
                "to": one.end_s + epoch,
                "n": one.n,
                "rms_m": one.rms_m,
                "max_m": one.max_m,
            }
            for one in comparison.worst_stretches()
        ],
        "by": {by: [_part_json(part) for part in breakdown(comparison, by)] for by in BYS},
        "relative": [
            {
                "delta": one.delta,
                "unit": one.unit,
                "motions": len(one.start),
                "translation": _rms_json(one.rms),
                "rms_rotation_rad": _rms(one.rotations),
            }
            for one in drift_errors(comparison)
        ],
    }


def _alignment_json(comparison: TimeComparison) -> dict[str, object]:
    """What was fitted, by part: frame, scale, mount, delay_s."""
    found = comparison.alignment
    told: dict[str, object] = {"parts": list(found.parts), "freedoms": found.freedoms}
    for name, value in found.numbers.items():
        number = {"value": value, "sigma": found.sigmas.get(name)}
        part, _, rest = name.partition("_")
        if part in {"frame", "mount"}:
            group = told.setdefault(part, {})
            assert isinstance(group, dict)
            group[rest] = number
        else:
            told[name] = number
    return told


def _component_json(one: ComponentInTime) -> dict[str, object]:
    return {
        "unit": one.component.unit,
        **_mean_json(one.mean),
        "rms": one.rms,
        "max_abs": one.max_abs,
        "bias": one.bias,
        "bias_below_limit": None if one.note else one.bias.holds,
        "note": one.note,
    }


def _mean_json(mean: SeriesMean) -> dict[str, object]:
    names = ("n", "n_effective", "mean", "std", "low", "high", "method", "short", "reason")
    return {name: getattr(mean, name) for name in names}


def _rms_json(rms: SeriesRms) -> dict[str, object]:
    return rms._asdict()


def _part_json(part: Part) -> dict[str, object]:
    return {
        "low": part.low,
        "high": part.high,
        "position": _rms_json(part.rms),
        "along": _mean_json(part.along),
        "rms_rotation_rad": part.rms_rotation,
    }


def _rms(values: "np.typing.ArrayLike") -> float:
    """Of those that there are; NaN if none."""
    array = np.asarray(values, dtype=float)
    array = array[np.isfinite(array)]
    return float(np.sqrt(np.square(array).mean())) if len(array) else float("nan")
