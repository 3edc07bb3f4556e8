"""Trajectories of plain CSV files: named columns, or those of RAWSEEDS without a header."""

import gzip
import re
from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.trajectory import FREEDOMS, Kind, Trajectory

TIMES = ("time", "t", "timestamp", "stamp")
FORMS: tuple[tuple[Kind, tuple[str, ...]], ...] = (
    ("space", ("x", "y", "z", "qx", "qy", "qz", "qw")),
    ("plane", ("x", "y", "theta")),
    ("plane", ("x", "y", "yaw")),
    ("points_space", ("x", "y", "z")),
    ("points_plane", ("x", "y")),
)
BARE = {4: False, 13: True}
"""Columns of RAWSEEDS, and whether they have a covariance: t, x, y, theta, then 3x3 row by row."""


def _head(path: Path) -> list[str]:
    """Cells of the first line; none if it cannot be read."""
    try:
        with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as stream:
            return [cell.strip() for cell in stream.readline(10_000).lstrip("\ufeff").split(",")]
    except (OSError, UnicodeDecodeError, EOFError):
        return []


def is_trajectory(path: Path) -> bool:
    """Whether a file holds poses at times, not a table of named stops."""
    head = _head(path)
    if "pose" in head:
        return False
    return bool(set(TIMES) & set(head)) or (len(head) in BARE and all(map(_is_number, head)))


def read_trajectory(path: Path, system: str | None = None) -> Trajectory:
    """Poses of a file.

    Raises
    ------
    InputError
        If it is none of the forms, or has a bad number.
    """
    head = _head(path)
    bare = len(head) in BARE and all(map(_is_number, head))
    try:
        rows = np.loadtxt(path, delimiter=",", skiprows=0 if bare else 1, ndmin=2)
    except (ValueError, OSError, EOFError) as error:
        line = re.search(r"row (\d+)", str(error))
        at = int(line.group(1)) + (1 if bare else 2) if line else None
        raise InputError([Problem(path, f"not a table of numbers: {error}", at)]) from None
    name = system or system_of(path)
    if bare:
        return _trajectory(path, name, rows[:, 0], rows[:, 1:4], "plane", rows[:, 4:])
    stamp = next((one for one in TIMES if one in head), None)
    for kind, columns in FORMS:
        if stamp is not None and set(columns) <= set(head):
            poses = rows[:, [head.index(one) for one in columns]]
            nothing = np.empty((len(rows), 0))
            return _trajectory(path, name, rows[:, head.index(stamp)], poses, kind, nothing)
    raise InputError([Problem(path, f"no time and position among {', '.join(head)}", 1)])


def _trajectory(
    path: Path, name: str, stamps: Array, poses: Array, kind: Kind, covariance: Array
) -> Trajectory:
    epoch = int(np.floor(stamps[0])) if len(stamps) else 0
    m = FREEDOMS[kind]
    matrices = covariance.reshape(-1, m, m) if covariance.size else np.empty(0)
    try:
        return Trajectory(name, stamps - epoch, poses, kind, covariances=matrices, epoch=epoch)
    except GtvalError as error:
        raise InputError([Problem(path, str(error))]) from None


def system_of(path: Path) -> str:
    """'GT-extended' for GT-extended.csv.gz."""
    name = path.name.removesuffix(".gz")
    return re.sub(r"^poses_", "", name.rsplit(".", 1)[0] if "." in name else name)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
