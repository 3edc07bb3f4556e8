"""Files of the RTK system under results/."""

import numpy as np

from rtk_gt.campaign.lasting_findings import jump_rows
from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.campaign.pose_tables import sensor_tables
from rtk_gt.offsets.estimate import distance_names
from validation.poses.pose_table import to_csv, to_tum
from validation.text_files.csv_text import csv_text


def rtk_files(outcome: RtkOutcome) -> dict[str, str | bytes]:
    """Offsets, quality, gaps and sensor paths by their names; the run writes the vehicle's path.

    Sensor paths are no poses of the vehicle: a run must not compare them with its validation
    poses, so that their files are not named like pose tables.
    """
    files: dict[str, str | bytes] = {
        "rtk_offsets.csv": _offsets(outcome),
        "rtk_distances.csv": _distances(outcome),
        "rtk_quality.csv": _quality(outcome),
        "rtk_gaps.csv": _gaps(outcome),
    }
    if outcome.lasting:
        header = ["receivers", "start", "end", "east", "north", "up"]
        header += ["sigma_east", "sigma_north", "sigma_up", "gain"]
        files["rtk_jumps.csv"] = csv_text(header, jump_rows(outcome))
    for name, table in sensor_tables(outcome).items():
        files[f"sensor_path_{name}.csv"] = to_csv(table)
        files[f"sensor_path_{name}.tum"] = to_tum(table)
    return files


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
    return csv_text(header, ([name, *a, *b, *c] for name, a, b, c in values))


def _distances(outcome: RtkOutcome) -> str:
    offsets = outcome.offsets
    names = distance_names(offsets.receivers)
    rows = zip(names, offsets.distances, offsets.distance_sigmas, strict=True)
    return csv_text(["pair", "distance", "sigma"], rows)


def _quality(outcome: RtkOutcome) -> str:
    """One row for each time at which all receivers are RTK-fixed."""
    offsets, found = outcome.offsets, outcome.consistency
    times = outcome.steps.times[outcome.steps.complete]
    header = ["time", "q", "weight", *(f"residual {n}" for n in distance_names(offsets.receivers))]
    q: list[object] = [""] * len(times)  # a step with a false fix has no pose and no q
    for row, value in zip(np.flatnonzero(offsets.weights > 0), found.q, strict=True):
        q[int(row)] = float(value)
    rows = zip(times, q, offsets.weights, offsets.residuals, strict=True)
    return csv_text(
        header, ([time, one, weight, *residual] for time, one, weight, residual in rows)
    )


def _gaps(outcome: RtkOutcome) -> str:
    gaps = sorted(outcome.coverage.gaps, key=lambda gap: gap.start)
    return csv_text(
        ["start", "duration", "length"], ([g.start, g.duration, g.length] for g in gaps)
    )
