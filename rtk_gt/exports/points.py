"""Points on the Earth with their quality, from the results of a run."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.campaign.provenance import earlier_record, earlier_steps, out_of_date
from validation.campaign.stored import ANEW
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame, Up
from validation.results import Finding
from validation.text_files.csv_tables import Column, read_csv

POSITIONS = "rtk_positions.csv"
"""What one or two receivers leave: all fixes with their place on the Earth."""
POSES = "poses_rtk.csv"
"""What three and more leave: poses in the local frame of the run."""
PLACES = "rtk_places.csv"
"""Beside `POSES`: satellites and HDOP of each pose."""
_FRAME = re.compile(
    r"latitude (\S+), longitude (\S+) degrees, height (\S+) m, up: (normal|line) .*"
)
_LENGTHS = [Column(name, "number") for name in ("x", "y", "z")]
_VARIANCES = [
    Column(name, "number", required=False, blank=True) for name in ("xx", "xy", "yy", "zz")
]
_MAX_BYTES = 2_000_000_000


@dataclass(frozen=True)
class Points:
    """A path on the Earth.

    Parameters
    ----------
    name : str
        Of the campaign.
    times : (n,) array
        Seconds since 1970 UTC.
    geodetic : (n, 3) array
        Latitude and longitude in degrees, height above the ellipsoid in metres.
    kinds : (n,) tuple of str
        'RTK fixed', 'RTK float', ...
    remarks : (n,) tuple of str
        'leaps' where a pose leaps against its neighbours; else empty.
    satellites, hdop : (n,) array
        NaN where not told.
    level_sigma, up_sigma : (n,) array
        Standard deviations along the longer axis of the level error ellipse, and upwards, metres.
        NaN where not told.
    """

    name: str
    times: Array
    geodetic: Array
    kinds: tuple[str, ...]
    remarks: tuple[str, ...]
    satellites: Array
    hdop: Array
    level_sigma: Array
    up_sigma: Array

    def __len__(self) -> int:
        return len(self.times)

    def every(self, seconds: float) -> "Points":
        """The first point, and each that is at least so much later than the last one taken."""
        taken, last = [], -np.inf
        for row, time in enumerate(self.times.tolist()):
            if time - last >= seconds - 1e-6:
                taken.append(row)
                last = time
        return self.select(np.array(taken, dtype=int))

    def select(self, rows: "np.ndarray[tuple[int, ...], np.dtype[np.int64]]") -> "Points":
        """The chosen rows."""
        return Points(
            self.name,
            self.times[rows],
            self.geodetic[rows],
            tuple(self.kinds[row] for row in rows),
            tuple(self.remarks[row] for row in rows),
            self.satellites[rows],
            self.hdop[rows],
            self.level_sigma[rows],
            self.up_sigma[rows],
        )


def stored_points(campaign: Campaign, sensor: str = "") -> tuple[Points, list[Finding]]:
    """The points of a run, and whether its results are out of date.

    Parameters
    ----------
    campaign : Campaign
        That was run.
    sensor : str
        A sensor of campaign.toml whose path is wanted; the vehicle by default.

    Raises
    ------
    GtvalError
        If there are no results, or not those of the sensor.
    InputError
        For bad cells.
    """
    whole = campaign.results / POSITIONS
    path = campaign.results / (f"sensor_path_{sensor}.csv" if sensor else POSES)
    if not sensor and whole.is_file():
        path = whole
    if not path.is_file():
        there = sorted(one.stem[12:] for one in campaign.results.glob("sensor_path_*.csv"))
        hint = f"; there are sensors: {', '.join(there)}" if sensor and there else ""
        raise GtvalError(
            f"there is no {path}: run `gtval rtk {campaign.folder}` first, without --dry-run{hint}"
        )
    points = _of_positions(campaign, path) if path == whole else _of_poses(campaign, path)
    old = out_of_date(campaign, earlier_steps(earlier_record(campaign)))
    late = [
        Finding(
            "warning", f"results/{path.name} is out of date: {one.reason}; {ANEW}", "rtk",
            "out_of_date",
        )
        for one in old
        if one.file == f"results/{path.name}"
    ]  # fmt: skip
    return points, late


def _of_positions(campaign: Campaign, path: Path) -> Points:
    """All fixes of one or two receivers."""
    columns = [
        Column("time", "number"),
        Column("latitude", "number", low=-90, high=90),
        Column("longitude", "number", low=-180, high=360),
        Column("height", "number"),
        Column("fix"),
        Column("satellites", "number", blank=True),
        Column("hdop", "number", blank=True),
        *_VARIANCES,
        Column("remark", required=False, blank=True),
    ]
    table = read_csv(path, columns, max_bytes=_MAX_BYTES)
    table.raise_problems()
    number = {name: np.array(values) for name, values in table.numbers.items()}
    return Points(
        campaign.settings.name,
        number["time"],
        np.column_stack([number["latitude"], number["longitude"], number["height"]]),
        tuple(table.text["fix"]),
        tuple(table.text["remark"]),
        number["satellites"],
        number["hdop"],
        *_sigmas(number),
    )


def _of_poses(campaign: Campaign, path: Path) -> Points:
    """Poses in the local frame of the run, which run.json tells."""
    columns = [Column("pose", "number"), *_LENGTHS, *_VARIANCES, Column("source", required=False)]
    table = read_csv(path, columns, max_bytes=_MAX_BYTES)
    table.raise_problems()
    number = {name: np.array(values) for name, values in table.numbers.items()}
    local = np.column_stack([number["x"], number["y"], number["z"]])
    geodetic = run_frame(campaign).to_geodetic(local)
    geodetic[:, :2] = np.degrees(geodetic[:, :2])
    satellites, hdop = _reception(campaign, number["pose"])
    told = [source.partition(", ") for source in table.text["source"]]
    return Points(
        campaign.settings.name,
        number["pose"],
        geodetic,
        tuple(kind for kind, _, _ in told),
        tuple(remark for _, _, remark in told),
        satellites,
        hdop,
        *_sigmas(number),
    )


def _reception(campaign: Campaign, times: Array) -> tuple[Array, Array]:
    """Least satellites and greatest HDOP of the receivers at each pose; NaN where not told."""
    unknown = np.full(len(times), np.nan)
    path = campaign.results / PLACES
    if not path.is_file():
        return unknown, unknown
    names = ("time", "satellites", "hdop")
    table = read_csv(
        path, [Column(name, "number", blank=True) for name in names], max_bytes=_MAX_BYTES
    )
    table.raise_problems()
    at, satellites, hdop = (np.array(table.numbers[name]) for name in names)
    rows = np.minimum(np.searchsorted(at, times - 1e-3), max(len(at) - 1, 0))
    if len(at) == 0:
        return unknown, unknown
    there = np.abs(at[rows] - times) < 2e-3
    return np.where(there, satellites[rows], np.nan), np.where(there, hdop[rows], np.nan)


def _sigmas(number: dict[str, Array]) -> tuple[Array, Array]:
    """Longer semi-axis of the level ellipse, and the vertical one, of one standard deviation."""
    xx, xy, yy = number["xx"], number["xy"], number["yy"]
    larger = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    return np.sqrt(larger), np.sqrt(number["zz"])


def run_frame(campaign: Campaign) -> LocalFrame:
    """The local frame of the last run.

    Raises
    ------
    GtvalError
        If results/run.json does not tell it.
    """
    systems = earlier_record(campaign).get("systems")
    told = systems.get("rtk", {}) if isinstance(systems, dict) else {}
    text = told.get("frame") if isinstance(told, dict) else None
    found = _FRAME.fullmatch(text) if isinstance(text, str) else None
    try:
        if found is not None:
            latitude, longitude, height = (float(one) for one in found.groups()[:3])
            up: Up = "ellipsoid" if found[4] == "normal" else "geocentric"
            return LocalFrame.from_degrees(latitude, longitude, height, up)
    except ValueError:
        pass
    raise GtvalError(
        f"{campaign.results / 'run.json'} does not tell the local frame; run `gtval rtk "
        f"{campaign.folder}` anew"
    )
