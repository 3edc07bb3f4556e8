"""Files of the RTK system under results/."""

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np

from rtk_gt.offsets import distance_names
from rtk_gt.outcome import RtkOutcome
from rtk_gt.path import pose_table
from validation.poses import SPATIAL, PoseTable


def rtk_tables(outcome: RtkOutcome) -> list[PoseTable]:
    """The vehicle's path as ``rtk``, each sensor's as ``rtk_<sensor>``."""
    path = outcome.path
    vehicle = pose_table(path)
    sensors = [
        PoseTable(
            system=f"rtk_{name}",
            ids=vehicle.ids,
            poses=composed.poses,
            covariances=composed.covariances,
            components=SPATIAL,
            sources=vehicle.sources,
            provenance={"frame": str(path.frame)},
        )
        for name, composed in outcome.sensors.items()
    ]
    return [vehicle, *sensors]


def rtk_files(outcome: RtkOutcome) -> dict[str, str | bytes]:
    """Offsets, antennas, quality and gaps by their names; pose tables are written by the run."""
    return {
        "rtk_offsets.csv": _offsets(outcome),
        "rtk_distances.csv": _distances(outcome),
        "rtk_quality.csv": _quality(outcome),
        "rtk_gaps.csv": _gaps(outcome),
    }


def _text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(
        [repr(float(cell)) if isinstance(cell, float | np.floating) else cell for cell in row]
        for row in rows
    )
    return stream.getvalue()


def _offsets(outcome: RtkOutcome) -> str:
    offsets = outcome.offsets
    header = ["receiver", "x", "y", "z", "sigma_x", "sigma_y", "sigma_z"]
    header += ["antenna_x", "antenna_y", "antenna_z"]
    values = zip(
        offsets.receivers,
        offsets.offsets.values,
        offsets.offset_sigmas,
        outcome.antennas.positions,
        strict=True,
    )
    return _text(header, ([name, *a, *b, *c] for name, a, b, c in values))


def _distances(outcome: RtkOutcome) -> str:
    offsets = outcome.offsets
    names = distance_names(offsets.receivers)
    rows = zip(names, offsets.distances, offsets.distance_sigmas, strict=True)
    return _text(["pair", "distance", "sigma"], rows)


def _quality(outcome: RtkOutcome) -> str:
    """One row for each time at which all receivers are RTK-fixed."""
    offsets, found = outcome.offsets, outcome.consistency
    times = outcome.steps.times[outcome.steps.complete]
    header = ["time", "q", "weight", *(f"residual {n}" for n in distance_names(offsets.receivers))]
    q: list[object] = [""] * len(times)  # a step with a false fix has no pose and no q
    for row, value in zip(np.flatnonzero(offsets.weights > 0), found.q, strict=True):
        q[int(row)] = float(value)
    rows = zip(times, q, offsets.weights, offsets.residuals, strict=True)
    return _text(header, ([time, one, weight, *residual] for time, one, weight, residual in rows))


def _gaps(outcome: RtkOutcome) -> str:
    gaps = sorted(outcome.coverage.gaps, key=lambda gap: gap.start)
    return _text(["start", "duration", "length"], ([g.start, g.duration, g.length] for g in gaps))
