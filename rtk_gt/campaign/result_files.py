"""Files of the RTK system under results/."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import islice

import numpy as np

from rtk_gt.campaign.lasting_findings import JUMP_COLUMNS, jump_rows
from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.campaign.pose_tables import sensor_pieces
from rtk_gt.offsets.estimate import distance_names
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.settings import Sensor
from validation.poses.angles import Array
from validation.poses.pose_table import SPATIAL, PoseTable, csv_lines
from validation.poses.tum_text import tum_lines
from validation.text_files.csv_text import csv_text
from validation.text_files.writing import Content, text_of


def rtk_files(outcome: RtkOutcome) -> dict[str, Content]:
    """Offsets, quality, gaps and sensor paths by their names; the run writes the vehicle's path.

    Sensor paths are no poses of the vehicle: a run must not compare them with its validation
    poses, so that their files are not named like pose tables.
    """
    files: dict[str, Content] = {
        "rtk_offsets.csv": _offsets(outcome),
        "rtk_distances.csv": _distances(outcome),
        "rtk_quality.csv": _quality(outcome),
        "rtk_gaps.csv": _gaps(outcome),
        "rtk_places.csv": _places(outcome),
    }
    if outcome.lasting:
        files["rtk_jumps.csv"] = csv_text(JUMP_COLUMNS, jump_rows(outcome))
    numbers = len(outcome.path) * len(SPATIAL)
    for name, sensor in outcome.sensors.items():
        for ending, lines in (("csv", _csv_lines), ("tum", _tum_lines)):
            some = partial(_sensor_lines, outcome, sensor, lines)
            files[f"sensor_path_{name}.{ending}"] = text_of(some, numbers)
    return files


def _sensor_lines(
    outcome: RtkOutcome, sensor: Sensor, lines: Callable[[PoseTable, bool], Iterable[str]]
) -> Iterator[str]:
    """Lines of the path of a sensor."""
    for number, piece in enumerate(sensor_pieces(outcome, sensor)):
        yield from lines(piece, number == 0)


def _csv_lines(piece: PoseTable, first: bool) -> Iterable[str]:
    """Those of a piece of a table, of which the first has the header."""
    return islice(csv_lines(piece), 0 if first else 1, None)


def _tum_lines(piece: PoseTable, _first: bool) -> Iterable[str]:
    return tum_lines(piece)()


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


def _quality(outcome: RtkOutcome) -> Content:
    """One row for each time at which all receivers are RTK-fixed."""
    offsets, found = outcome.offsets, outcome.consistency
    times = outcome.steps.times[outcome.steps.complete]
    names = distance_names(offsets.receivers)
    header = ["time", "q", "weight", *(f"residual {name}" for name in names)]
    q = np.full(len(times), np.nan)  # a step with a false fix has no pose and no q
    q[offsets.weights > 0] = found.q
    columns = [times, q, offsets.weights, *offsets.residuals.T]
    return text_of(partial(_number_lines, header, columns), len(columns) * len(times))


def _number_lines(header: Sequence[str], columns: Sequence[Array]) -> Iterator[str]:
    """Lines of a table of numbers, blank where there is none; floats keep their last bit."""
    yield csv_text(header, []).rstrip("\n")
    for row in zip(*(column.tolist() for column in columns), strict=True):
        yield ",".join(["" if value != value else repr(value) for value in row])  # noqa: PLR0124


def _places(outcome: RtkOutcome) -> Content:
    """Of each pose the place on the Earth, and what its fixes had: satellites and HDOP.

    ``satellites`` is the least and ``hdop`` the greatest of the receivers; each has its own, too.
    """
    path, records = outcome.path, outcome.records
    geodetic = path.frame.to_geodetic(path.poses[:, :3])
    told = [_reception(one, path.times, outcome.settings.simultaneous) for one in records]
    satellites = np.array([one for one, _ in told])
    hdop = np.array([one for _, one in told])
    header = ["time", "latitude", "longitude", "height", "satellites", "hdop"]
    header += [f"{what} {one.receiver}" for one in records for what in ("satellites", "hdop")]
    each = [values for pair in zip(satellites, hdop, strict=True) for values in pair]
    # Not told by one receiver is not told of all: the least would be a guess.
    columns = [satellites.min(0), hdop.max(0), *each]
    place = [path.times, np.degrees(geodetic[:, 0]), np.degrees(geodetic[:, 1]), geodetic[:, 2]]
    return text_of(partial(_place_lines, header, place, columns), len(header) * len(path))


def _place_lines(
    header: Sequence[str], place: Sequence[Array], columns: Sequence[Array]
) -> Iterator[str]:
    """Lines of a table of places: 0.1 mm, and what was received."""
    yield csv_text(header, []).rstrip("\n")
    rows = zip(*(column.tolist() for column in (*place, *columns)), strict=True)
    for time, latitude, longitude, height, *told in rows:
        cells = ["" if value != value else f"{value:g}" for value in told]  # noqa: PLR0124
        yield ",".join([f"{time:.3f},{latitude:.9f},{longitude:.9f},{height:.4f}", *cells])


def _reception(record: Fixes, times: Array, tolerance: float) -> tuple[Array, Array]:
    """(n,) satellites and HDOP of a receiver at times; NaN where not told."""
    at = np.searchsorted(record.times, times - tolerance)
    at = np.minimum(at, len(record) - 1)
    there = np.abs(record.times[at] - times) <= tolerance
    satellites = np.where(there & (record.satellites[at] >= 0), record.satellites[at], np.nan)
    return satellites, np.where(there, record.hdop[at], np.nan)


def _gaps(outcome: RtkOutcome) -> str:
    gaps = sorted(outcome.coverage.gaps, key=lambda gap: gap.start)
    return csv_text(
        ["start", "duration", "length"], ([g.start, g.duration, g.length] for g in gaps)
    )
