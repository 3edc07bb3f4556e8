"""Trajectories as text and files in the formats of others, and in gtval's own."""

import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.text_files.writing import write_files
from validation.trajectories.formats.bags import mcap_bytes
from validation.trajectories.formats.bare_columns import TUM, TUM_COVARIANCE
from validation.trajectories.formats.named_columns import CODES, MARK, upper_triangle
from validation.trajectories.formats.stamps import texts_of

ENDINGS = {".csv": "csv", ".tum": "tum", ".kitti": "kitti", ".mcap": "mcap"}
"""Formats that the ending of a name tells."""
FORMATS = ("csv", "tum", "tum_covariance", "kitti", "euroc", "mcap")
"""Formats that can be written."""

_COLUMNS = {
    "plane": ["x", "y", "theta"],
    "space": ["x", "y", "z", "qx", "qy", "qz", "qw"],
    "points_plane": ["x", "y"],
    "points_space": ["x", "y", "z"],
}
_EUROC = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []"
)


def trajectory_text(trajectory: Trajectory, format: str = "csv") -> str:  # noqa: A002
    """A trajectory as the text of a file.

    Parameters
    ----------
    trajectory : Trajectory
        The poses.
    format : {"csv", "tum", "tum_covariance", "kitti", "euroc"}
        Only 'csv' keeps all there is; `read_trajectory` reads it back to the last bit. 'kitti' has
        no times: `times_text` gives these.

    Raises
    ------
    GtvalError
        If the format cannot hold these poses.
    """
    if format not in _WRITERS:
        raise GtvalError(f"'{format}' is no format of text; there are {', '.join(_WRITERS)}")
    if format not in {"csv", "euroc"} and not trajectory.has_orientation:
        raise GtvalError(
            f"'{trajectory.system}' has positions without orientation, which {format} cannot hold; "
            "write csv, euroc or mcap"
        )
    return _WRITERS[format](trajectory)


def times_text(trajectory: Trajectory) -> str:
    """The times, one a line, in seconds."""
    return "".join(f"{one}\n" for one in texts_of(trajectory.times, trajectory.epoch))


def _lines(header: str, first: Sequence[str], numbers: Array, separator: str) -> str:
    """Rows of text: a header, and a first cell with numbers to the last bit behind it."""
    columns = [[*map(repr, column.tolist())] for column in numbers.T]
    cells = zip(first, *columns, strict=True) if first else zip(*columns, strict=True)
    rows = map(separator.join, cells)
    return "\n".join([*([header] if header else []), *rows]) + "\n"


def _csv_text(trajectory: Trajectory) -> str:
    """The table of gtval's own: what is known of the whole in comments, then named columns."""
    clock = trajectory.clock
    told = {
        "system": trajectory.system,
        "frame": trajectory.frame or None,
        "child_frame": trajectory.child_frame or None,
        "epoch": trajectory.epoch,
        "stamps": clock.stamps,
        "rate": clock.rate,
        "exposure": clock.exposure,
        "longest_interval": trajectory.longest_interval,
    }
    comments = [
        f"# {name} = {json.dumps(value)}" for name, value in told.items() if value is not None
    ]
    names = ["time", *_COLUMNS[trajectory.kind]]
    numbers = trajectory.poses
    known = trajectory.has_covariance
    if known.any():
        codes = CODES[trajectory.kind]
        names += [a + b for a, b in combinations_with_replacement(codes, 2)]
        numbers = np.column_stack([numbers, upper_triangle(trajectory.covariances)])
    header = "\n".join([MARK, *comments, ",".join(names)])
    text = _lines(header, texts_of(trajectory.times, trajectory.epoch), numbers, ",")
    return text if known.all() or not known.any() else text.replace("nan", "")


def _space(trajectory: Trajectory) -> Array:
    """(n, 7) position and quaternion x, y, z, w."""
    if trajectory.kind == "space":
        return trajectory.poses
    positions = np.zeros((len(trajectory), 3))
    positions[:, : trajectory.dimensions] = trajectory.positions
    return np.column_stack([positions, trajectory.rotations.as_quat()])


def _tum_text(trajectory: Trajectory) -> str:
    times = texts_of(trajectory.times, trajectory.epoch)
    names = ("timestamp", "tx", "ty", "tz", *TUM[4:])
    return _lines("# " + " ".join(names), times, _space(trajectory), " ")


def _tum_covariance_text(trajectory: Trajectory) -> str:
    """As OpenVINS writes it: orientation in the moving frame, then position; 0 where not known."""
    covariances = trajectory.covariances
    if trajectory.kind == "plane":
        whole = np.zeros((len(trajectory), 6, 6))
        whole[np.ix_(range(len(trajectory)), [0, 1, 5], [0, 1, 5])] = covariances
        covariances = whole
    covariances = np.where(trajectory.has_covariance[:, None, None], covariances, 0.0)
    matrices = trajectory.rotations.as_matrix()
    own = matrices.transpose(0, 2, 1) @ covariances[:, 3:, 3:] @ matrices
    numbers = [_space(trajectory), upper_triangle(own), upper_triangle(covariances[:, :3, :3])]
    times = texts_of(trajectory.times, trajectory.epoch)
    names = ("timestamp(s)", "tx", "ty", "tz", *TUM_COVARIANCE[4:])
    return _lines("# " + " ".join(names), times, np.column_stack(numbers), " ")


def _kitti_text(trajectory: Trajectory) -> str:
    positions = _space(trajectory)[:, :3]
    matrices = np.concatenate([trajectory.rotations.as_matrix(), positions[:, :, None]], axis=2)
    return _lines("", [], matrices.reshape(-1, 12), " ")


def _euroc_text(trajectory: Trajectory) -> str:
    """With the header of EuRoC's files; stamps are rounded to nanoseconds."""
    times = texts_of(trajectory.times, trajectory.epoch, "ns")
    if not trajectory.has_orientation:
        positions = np.zeros((len(trajectory), 3))
        positions[:, : trajectory.dimensions] = trajectory.positions
        return _lines(_EUROC.partition(",q")[0], times, positions, ",")
    return _lines(_EUROC, times, _space(trajectory)[:, [0, 1, 2, 6, 3, 4, 5]], ",")


_WRITERS: Mapping[str, Callable[[Trajectory], str]] = {
    "csv": _csv_text,
    "tum": _tum_text,
    "tum_covariance": _tum_covariance_text,
    "kitti": _kitti_text,
    "euroc": _euroc_text,
}


def format_to_write(path: Path) -> str:
    """The format that a file's name tells.

    Raises
    ------
    GtvalError
        If it tells none.
    """
    name = path.name.lower().removesuffix(".gz")
    suffix = Path(name).suffix
    if suffix not in ENDINGS:
        known = ", ".join(ENDINGS)
        raise GtvalError(
            f"the name {path.name} does not tell the format; end it with {known}, or say --to "
            f"{', '.join(FORMATS)}"
        )
    return ENDINGS[suffix]


def trajectory_files(
    trajectory: Trajectory,
    path: Path,
    format: str | None = None,  # noqa: A002
) -> dict[str, str | bytes]:
    """The content of each file, by its name beside the path; KITTI's times are one of their own.

    Raises
    ------
    GtvalError
        If the name does not tell the format, or it cannot hold these poses.
    """
    form = format or format_to_write(path)
    if form not in FORMATS:
        raise GtvalError(f"'{form}' cannot be written; there are {', '.join(FORMATS)}")
    if form == "mcap":
        return {path.name: mcap_bytes(trajectory)}
    files: dict[str, str | bytes] = {path.name: trajectory_text(trajectory, form)}
    if form == "kitti":
        stem, dot, ending = path.name.partition(".")
        files[f"{stem}_times{dot}{ending}"] = times_text(trajectory)
    if path.name.lower().endswith(".gz"):
        packed = {name: str(text).encode() for name, text in files.items()}
        return {name: gzip.compress(text, mtime=0) for name, text in packed.items()}
    return files


def write_trajectory(
    trajectory: Trajectory,
    path: Path,
    format: str | None = None,  # noqa: A002
) -> list[Path]:
    """Write a trajectory, whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
        The poses.
    path : Path
        The file; '.gz' at its end compresses it.
    format : str, optional
        One of `FORMATS`; by default told from the name.

    Returns
    -------
    list of Path
        The files written: two for KITTI.

    Raises
    ------
    GtvalError
        If the format is not told or cannot hold these poses, or the file cannot be written.
    """
    path = Path(path)
    return write_files(path.parent, trajectory_files(trajectory, path, format))


def losses(trajectory: Trajectory, format: str) -> list[str]:  # noqa: A002
    """What a format does not hold of a trajectory, in words."""
    lost = []
    known = trajectory.has_covariance.any()
    if known and format in {"tum", "kitti", "euroc"}:
        lost.append(f"covariances are not written: {format} has none")
    if known and format == "mcap" and not trajectory.has_orientation:
        lost.append("covariances are not written: points in a bag have none")
    if format == "tum_covariance" and known:
        lost.append("covariances between position and orientation are not written")
    if format != "csv" and trajectory.dimensions == 2:
        lost.append("poses in the plane are written with z = 0")
    if format in {"euroc", "mcap"}:
        lost.append("stamps are rounded to nanoseconds")
    if format not in {"csv", "mcap"} and (trajectory.frame or trajectory.child_frame):
        lost.append(f"names of frames are not written: {format} has none")
    return lost
