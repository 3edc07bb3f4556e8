"""Ground truth at the times of a sensor's own data."""

from pathlib import Path

import numpy as np

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.path.composition import compose, published_composition
from rtk_gt.path.interpolation import PUBLISHED, Interpolated, interpolate
from rtk_gt.receivers.fix_csv import NO_TIME, seconds_of
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import SPATIAL, PoseTable
from validation.text_files.csv_tables import Column, read_csv

VEHICLE = "vehicle"
MAX_BYTES = 500_000_000


def read_times(path: Path) -> Array:
    """(m,) seconds since 1970 of the column ``time`` of a CSV file; see `seconds_of`.

    Raises
    ------
    InputError
        Naming every cell that is no time, and times given twice.
    """
    table = read_csv(path, [Column("time")], max_bytes=MAX_BYTES)
    times = np.array([seconds_of(text) for text in table.text["time"]])
    for row in np.flatnonzero(np.isnan(times)):
        table.flag(int(row), "time", NO_TIME)
    table.flag_duplicates(["time"])
    table.raise_problems()
    if len(times) == 0:
        raise InputError([Problem(path, "no times below the header")])
    return times


def path_at(outcome: RtkOutcome, times: Array, *, published: bool = False) -> Interpolated:
    """Vehicle poses at any times, by the methods that do best on this drive or as published."""
    methods = PUBLISHED
    if not published and outcome.hold_out is not None:
        methods = outcome.hold_out.chosen
    return interpolate(
        outcome.path,
        times,
        max_gap=outcome.settings.max_gap,
        methods=methods,
        errors=outcome.hold_out,
    )


def sensor_poses(
    outcome: RtkOutcome,
    sensor: str,
    times: Array,
    *,
    published: bool = False,
    additive_angles: bool = False,
) -> tuple[PoseTable, int]:
    """Poses of a sensor at the times of its data, and how many times are in gaps.

    Parameters
    ----------
    outcome : RtkOutcome
        The solved drive.
    sensor : str
        A sensor of campaign.toml, or 'vehicle'.
    times : (m,) array
        Seconds since 1970.
    published : bool
        Interpolate as published.
    additive_angles : bool
        Compose as published, by adding angles; the sources of the poses then say so.

    Raises
    ------
    GtvalError
        If there is no such sensor.
    """
    known = {one.name: one for one in outcome.settings.sensors}
    if sensor != VEHICLE and sensor not in known:
        names = ", ".join([VEHICLE, *known])
        raise GtvalError(f"no sensor '{sensor}' in {outcome.campaign.toml}; there are: {names}")
    found = path_at(outcome, times, published=published)
    rows = found.available
    poses, covariances = found.poses[rows], found.covariances[rows]
    source = "interpolated"
    if sensor != VEHICLE:
        one = known[sensor]
        own = np.diag(np.square(one.sigmas))
        composed = published_composition if additive_angles else compose
        poses, covariances = composed(poses, covariances, np.array(one.pose), own)
        source = "interpolated, angles added" if additive_angles else source
    table = PoseTable(
        system="rtk" if sensor == VEHICLE else f"rtk_{sensor}",
        ids=tuple(f"{time:.6f}" for time in times[rows]),
        poses=poses,
        covariances=covariances,
        components=SPATIAL,
        sources=(source,) * int(rows.sum()),
        provenance={"methods": dict(found.methods)},
    )
    return table, int((~rows).sum())
