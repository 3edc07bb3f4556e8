"""Pose tables from arrays and files, and how a notebook shows them."""

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtval.arguments import said_plainly
from validation.campaign.stored import read_tables
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.pose_table import PLANAR, SPATIAL, PoseTable, to_csv
from validation.report.cells import Value
from validation.report.html import html_blocks
from validation.results import Table
from validation.shown import html_of
from validation.text_files.writing import write_files

__all__ = ["PoseTable", "pose_table", "read_poses", "write_poses"]

MOST_ROWS = 100
"""A judgement: a reader of a notebook looks at no more rows; how many are left is told."""


@said_plainly
def pose_table(
    system: str,
    poses: npt.ArrayLike,
    *,
    ids: Sequence[str] = (),
    covariances: npt.ArrayLike | None = None,
    sigmas: Sequence[float] | None = None,
) -> PoseTable:
    """Poses of one system at named stops.

    Parameters
    ----------
    system : str
        Name of the system: 'vision', 'mocap', ...; 'survey' has the validation poses.
    poses : (n, 3) or (n, 6) array_like
        One pose a row in the GTV frame: x, y, theta, or x, y, z, yaw, pitch, roll; metres and
        radians.
    ids : sequence of str, optional
        Names of the n stops, unique; '1' to 'n' by default.
    covariances : (n, k, k) array_like, optional
        Of each pose, in the order of its numbers.
    sigmas : (k,) sequence of float, optional
        Standard deviations of every pose, instead of covariances.

    Returns
    -------
    PoseTable
        Frozen, with arrays of its own.

    Raises
    ------
    GtvalError
        For wrong shapes, repeated ids, numbers that are not finite and matrices that are no
        covariances.

    Examples
    --------
    >>> gtval.pose_table("rig", [[0.0, 0.0, 0.1], [1.0, 0.5, 1.5]], sigmas=[0.002, 0.002, 0.001])
    PoseTable(system='rig', ids=('1', '2'), poses=(2, 3) array, ...)
    """
    if not isinstance(system, str) or isinstance(ids, str) or not isinstance(ids, Iterable):
        raise GtvalError(f"expected a name and a list of ids, not {system!r} and {ids!r}")
    places = _numbers("poses", poses)
    if places.ndim != 2:
        raise GtvalError(f"poses: expected one row of numbers a pose, got {poses!r}")
    components = SPATIAL if places.shape[1] == len(SPATIAL) else PLANAR
    spread = _numbers("covariances", () if covariances is None else covariances)
    if sigmas is not None:
        sizes = _numbers("sigmas", sigmas)
        if sizes.shape != places.shape[1:] or not (sizes > 0).all():
            raise GtvalError(f"sigmas: expected a number above 0 a component, got {sigmas!r}")
        spread = np.tile(np.diag(np.square(sizes)), (len(places), 1, 1))
    for array in (places, spread):
        array.setflags(write=False)
    names = tuple(ids) or tuple(str(number) for number in range(1, len(places) + 1))
    return PoseTable(system, names, places, spread, components)


def _numbers(name: str, given: npt.ArrayLike) -> Array:
    """An array of floats; a GtvalError where it is none."""
    try:
        return np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise GtvalError(f"{name}: expected numbers in rows of equal length: {error}") from error


@said_plainly
def read_poses(path: str | PathLike[str], system: str = "") -> PoseTable:
    """Poses from a CSV file, with the joint covariance that lies beside it.

    Parameters
    ----------
    path : path
        Columns pose, x, y, theta (metres, radians) and, where known, the covariance xx, xy, xt,
        yy, yt, tt; poses in space have x, y, z, yaw, pitch, roll.
    system : str
        Its name; by default that of the file: 'vision' of vision.csv and poses_vision.csv.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.

    Examples
    --------
    >>> gtval.write_poses(gtval.pose_table("rig", [[0.0, 0.0, 0.1]]), folder / "poses_rig.csv")
    >>> gtval.read_poses(folder / "poses_rig.csv").poses
    array([[0. , 0. , 0.1]])
    """
    return read_tables([Path(path)], [system] if system else ()).tables[0]


@said_plainly
def write_poses(table: PoseTable, path: str | PathLike[str]) -> None:
    """Write a table as a CSV file, which `read_poses` reads back to the last bit.

    Parameters
    ----------
    table : PoseTable
        Its joint covariance is not written.
    path : path
        The file.

    Raises
    ------
    GtvalError
        If it cannot be written; an old file is then untouched.

    Examples
    --------
    >>> gtval.write_poses(gtval.pose_table("rig", [[0.0, 0.0, 0.1]]), folder / "rig.csv")
    >>> (folder / "rig.csv").read_text().splitlines()[0]
    'pose,x,y,theta,xx,xy,xt,yy,yt,tt,source'
    """
    write_files(Path(path).parent, {Path(path).name: to_csv(table)})


@html_of.register
def _(table: PoseTable) -> str:
    """Names, poses and standard deviations."""
    own = table.components
    sigmas = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))
    columns = ["pose", *(f"{c.name} [{c.unit}]" for c in own)]
    columns += [f"sigma {c.name} [{c.unit}]" for c in own]
    rows: list[list[Value]] = [
        [name, *map(float, pose), *map(float, sigma)]
        for name, pose, sigma in zip(table.ids, table.poses, sigmas, strict=True)
    ]
    left = len(rows) - MOST_ROWS
    note = f"{left} more poses are not shown." if left > 0 else ""
    formats = ["", *[".4f"] * (2 * len(own))]
    shown = Table(f"Poses of {table.system}", columns, rows[:MOST_ROWS], formats, note)
    return html_blocks([shown], "poses")
