"""Errors by time, speed, turn rate and distance."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.statistics.dependence import SeriesMean, SeriesRms, mean_of_series, rms_of_series
from validation.trajectories.comparison import TimeComparison

By = Literal["time", "speed", "turn_rate", "distance"]
UNITS: dict[By, str] = {"time": "s", "speed": "m/s", "turn_rate": "rad/s", "distance": "m"}
BINS = 5
"""Of a breakdown. A judgement: a table of five lines is read at one glance."""


@dataclass(frozen=True)
class Part:
    """The errors where a quantity lies in a range.

    Parameters
    ----------
    low, high : float
        Of the quantity; the last range holds its high end.
    rms : SeriesRms
        Of the position error.
    along : SeriesMean
        In the direction of motion, where it moves.
    rms_rotation : float
        Radians; NaN for positions only.
    """

    low: float
    high: float
    rms: SeriesRms
    along: SeriesMean
    rms_rotation: float


def quantity(comparison: TimeComparison, by: By) -> Array:
    """(n,) what the errors are sorted by; turn rates and speeds without sign."""
    motion = comparison.motion
    found: dict[By, Array] = {
        "time": comparison.times - comparison.start,
        "speed": motion.speed,
        "turn_rate": np.abs(motion.turn_rate),
        "distance": motion.travelled,
    }
    return found[by]


def breakdown(comparison: TimeComparison, by: By, bins: int = BINS) -> tuple[Part, ...]:
    """The errors in ranges of a quantity.

    Parameters
    ----------
    comparison : TimeComparison
        The errors.
    by : {"time", "speed", "turn_rate", "distance"}
        What.
    bins : int
        Ranges: of equal length for time and distance, of equal numbers of poses for speed and
        turn rate. Empty ones are left out.

    Returns
    -------
    tuple of Part
        None if the quantity is not known.

    Raises
    ------
    GtvalError
        For another quantity.
    """
    if by not in get_args(By):
        raise GtvalError(f"'{by}' is none of {', '.join(get_args(By))}")
    values = quantity(comparison, by)
    if not np.isfinite(values).all() or not len(values):
        return ()
    if by in {"time", "distance"}:
        edges = np.linspace(values.min(), values.max(), bins + 1)
    else:
        edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)))
    if len(edges) < 2 or edges[0] == edges[-1]:
        edges = np.array([values.min(), values.max()])
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    return tuple(
        _part(comparison, edges[number], edges[number + 1], which == number)
        for number in range(len(edges) - 1)
        if (which == number).any()
    )


def _part(comparison: TimeComparison, low: float, high: float, rows: Array) -> Part:
    along = comparison.along_across[0][rows]
    along = along[np.isfinite(along)]
    return Part(
        float(low),
        float(high),
        rms_of_series(comparison.distances[rows], comparison.confidence),
        mean_of_series(along, comparison.confidence),
        float(np.sqrt(np.square(comparison.rotation_angles[rows]).mean())),
    )
