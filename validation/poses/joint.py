"""The covariance of all poses of a table together, as a file beside the table."""

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from validation.errors import InputError, Problem
from validation.poses.pose_table import PoseTable
from validation.text_files.csv_tables import Column, read_csv


def joint_path(path: Path) -> Path:
    """joint_<system>.csv beside poses_<system>.csv."""
    return path.with_name("joint_" + path.name.removeprefix("poses_"))


def joint_to_csv(table: PoseTable) -> str:
    """The joint covariance as CSV: a row and a column for every number of every pose.

    Parameters
    ----------
    table : PoseTable
        With a joint covariance.

    Raises
    ------
    ValueError
        If it has none.
    """
    if table.joint is None:
        raise ValueError(f"the table of '{table.system}' has no joint covariance")
    names = _columns(table)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["number", *names])
    for name, row in zip(names, table.joint, strict=True):
        writer.writerow([name, *(repr(float(value)) for value in row)])
    return stream.getvalue()


def with_stored_joint(table: PoseTable, path: Path) -> PoseTable:
    """The table with the joint covariance that lies beside its file, if there is one.

    Parameters
    ----------
    table : PoseTable
        As read from ``path``.
    path : Path
        Its file, poses_<system>.csv.

    Raises
    ------
    InputError
        If the file is bad or does not belong to the poses.
    """
    beside = joint_path(path)
    if not path.name.startswith("poses_") or not beside.exists():
        return table
    names = _columns(table)
    columns = [Column("number"), *(Column(name, "number", required=False) for name in names)]
    cells = read_csv(beside, columns)
    cells.raise_problems()
    if tuple(cells.text["number"]) != tuple(names):
        raise InputError(
            [Problem(beside, f"its rows are not the poses of {path.name}; run the campaign again")]
        )
    joint = np.column_stack([cells.numbers[name] for name in names])
    n, k = table.poses.shape
    own = joint.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)]
    if not np.allclose(own, table.covariances, rtol=1e-6, atol=0.0, equal_nan=False):
        raise InputError(
            [Problem(beside, f"it contradicts the covariances of {path.name}; run again")]
        )
    return replace(table, joint=joint)


def _columns(table: PoseTable) -> list[str]:
    """'7.x', '7.y', '7.theta' for every pose."""
    return [f"{name}.{component.name}" for name in table.ids for component in table.components]
