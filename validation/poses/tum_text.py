"""Poses as a TUM trajectory, the number of the stop or its time being the stamp."""

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.pose_table import PLANAR, ROWS, SPATIAL, PoseTable

Indices = npt.NDArray[np.intp]


def to_tum(table: PoseTable, times: Mapping[str, float] | None = None) -> str:
    """A planar or spatial table in the TUM trajectory format: t x y z qx qy qz qw.

    Parameters
    ----------
    table : PoseTable
        Poses with components x, y, theta, or x, y, z, yaw, pitch, roll.
    times : mapping of str to float, optional
        Time stamp in seconds of each id. Without it the number in the id is used, so that the
        same stop has the same stamp in every system's file.

    Raises
    ------
    GtvalError
        If an id has no time and is not a number; if the poses have other components.
    """
    return "\n".join(tum_lines(table, times)()) + "\n"


def tum_lines(
    table: PoseTable, times: Mapping[str, float] | None = None
) -> Callable[[], Iterator[str]]:
    """What makes the lines of `to_tum` without their ends; a GtvalError at once as there."""
    if times is None:
        times = {name: _number_or_nan(name) for name in table.ids}
    if not all(math.isfinite(times.get(name, math.nan)) for name in table.ids):
        raise GtvalError(
            f"system '{table.system}' has stops that are not numbered; give their times"
        )
    if table.components not in {PLANAR, SPATIAL}:
        raise GtvalError(f"system '{table.system}' has poses that the TUM format cannot hold")
    stamps = np.array([times[name] for name in table.ids])

    def lines() -> Iterator[str]:
        order = np.argsort(stamps, kind="stable")
        for start in range(0, len(order), ROWS):
            rows = order[start : start + ROWS]
            cells = np.column_stack([stamps[rows], *_positions_and_quaternions(table, rows)])
            for row in cells.tolist():
                yield " ".join(map(repr, row))

    return lines


def _number_or_nan(name: str) -> float:
    try:
        return float(name)
    except ValueError:
        return math.nan


def _positions_and_quaternions(table: PoseTable, rows: Indices) -> tuple[Array, Array]:
    """x, y, z (n, 3) and the quaternions (n, 4), x, y, z, w, of some poses."""
    none = np.zeros(len(rows))
    names = (one.name for one in table.components)
    named = dict(zip(names, table.poses[rows].T, strict=True))
    position = np.column_stack([named["x"], named["y"], named.get("z", none)])
    if "theta" in named:
        half = named["theta"] / 2
        return position, np.column_stack([none, none, np.sin(half), np.cos(half)])
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (planar tables do without)

    angles = np.column_stack([named["yaw"], named["pitch"], named["roll"]])
    return position, np.asarray(Rotation.from_euler("ZYX", angles).as_quat())
