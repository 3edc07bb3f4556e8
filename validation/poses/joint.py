"""The covariance of all poses of a table together, as a file beside the table."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.text_files.csv_tables import Column, header_of, read_csv
from validation.text_files.csv_text import csv_text, harmless
from validation.text_files.writing import Content, text_of

LARGEST_WHOLE = 300
"""Numbers of all poses up to which the matrix is written whole, also where it has a factor: 90,000
cells, under 2 MB, which a spreadsheet shows. It grows with the square: the 201 poses of a drive of
four minutes have 1,206 numbers and a matrix of 11.7 MB, their factor of 9 columns has 0.2 MB."""
LESS = "less"
"""Begins the names of columns of a factor that are taken away."""
MAX_BYTES = 500_000_000
"""A factor of 20 columns of a million numbers."""


def joint_path(path: Path) -> Path:
    """joint_<system>.csv beside poses_<system>.csv."""
    return path.with_name("joint_" + path.name.removeprefix("poses_"))


def factor_path(path: Path) -> Path:
    """joint_factor_<system>.csv beside poses_<system>.csv."""
    return path.with_name("joint_factor_" + path.name.removeprefix("poses_"))


def joint_files(table: PoseTable) -> dict[str, Content]:
    """The file of a table's joint covariance by its name; none where the table has none.

    ``joint_<system>.csv`` has a row and a column for every number of every pose,
    ``joint_factor_<system>.csv`` a row for every number and a column for every shared error. The
    factor is written where the whole matrix would have more than `LARGEST_WHOLE` numbers a side.
    """
    path = Path(f"poses_{table.system}.csv")
    if table.factor is not None and table.poses.size > LARGEST_WHOLE:
        return {
            factor_path(path).name: text_of(
                partial(_factor_lines, table, table.factor), table.factor.size
            )
        }
    joint = table.joint_covariance
    if joint is None:
        return {}
    lines = partial(_matrix_lines, _names(table), joint)
    return {joint_path(path).name: text_of(lines, joint.size)}


def _factor_lines(table: PoseTable, factor: Array) -> Iterator[str]:
    """The lines of a factor's file; floats keep their last bit."""
    _, signs = table.shared_part()
    names = [_column(column, sign) for column, sign in enumerate(signs.tolist(), 1)]
    yield ",".join(["number", *names])
    k = len(table.components)
    parts = [component.name for component in table.components]
    for row, stop in enumerate(table.ids):
        own = factor[row * k : (row + 1) * k].tolist()
        for part, numbers in zip(parts, own, strict=True):
            yield ",".join([harmless(f"{stop}.{part}"), *map(repr, numbers)])


def _column(number: int, sign: float) -> str:
    """'shared_3', or 'less_3' of what is taken away."""
    return f"{LESS if sign < 0 else 'shared'}_{number}"


def _matrix_lines(names: list[str], matrix: Array) -> Iterator[str]:
    """The lines of a matrix's file: one row at a time, as they are long."""
    yield csv_text(["number", *names], []).rstrip("\n")
    for name, row in zip(names, matrix, strict=True):
        yield csv_text([name], []).rstrip("\n") + "," + ",".join(map(repr, row.tolist()))


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
    whole, factor = joint_path(path), factor_path(path)
    found = [beside for beside in (whole, factor) if beside.exists()]
    if not path.name.startswith("poses_") or not found:
        return table
    if len(found) > 1:
        raise InputError([Problem(factor, f"{whole.name} states the same; delete the older one")])
    square = found == [whole]
    matrix = _matrix(found[0], _names(table), path, square=square)
    if square:
        table = replace(table, joint=matrix)
    else:
        names = header_of(factor, max_bytes=MAX_BYTES)[1:]
        signs = np.array([-1.0 if name.startswith(LESS) else 1.0 for name in names])
        table = replace(table, factor=matrix, signs=None if (signs > 0).all() else signs)
    _check_own(table, matrix, found[0], path)
    return table


def _matrix(beside: Path, names: list[str], path: Path, *, square: bool) -> Array:
    """The numbers of a file; an InputError where its rows are not those of the poses."""
    columns = header_of(beside, max_bytes=MAX_BYTES)[1:]
    fits = columns == names if square else bool(columns)
    if fits:
        wanted = [Column("number"), *(Column(name, "number") for name in columns)]
        cells = read_csv(beside, wanted, max_bytes=MAX_BYTES)
        cells.raise_problems()
        fits = cells.text["number"] == names
    if not fits:
        said = f"its rows are not the poses of {path.name}; run the campaign again"
        raise InputError([Problem(beside, said)])
    return np.column_stack([cells.numbers[name] for name in columns])


def _check_own(table: PoseTable, matrix: Array, beside: Path, path: Path) -> None:
    """Raise where the file and the covariances of single poses cannot both be right."""
    n, k = table.poses.shape
    if table.factor is None:
        own = matrix.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)]
        fits = np.allclose(own, table.covariances, rtol=1e-6, atol=0.0, equal_nan=False)
    else:
        # What a pose shares is a part of its covariance: the rest is a covariance, too.
        scale = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))[:, :, None]
        rest = table.own_covariances() / scale / np.swapaxes(scale, 1, 2)
        fits = bool(np.isfinite(rest).all() and (np.linalg.eigvalsh(rest) > -1e-6).all())
    if not fits:
        raise InputError(
            [Problem(beside, f"it contradicts the covariances of {path.name}; run again")]
        )


def _names(table: PoseTable) -> list[str]:
    """'7.x', '7.y', '7.theta' for every pose."""
    return [f"{name}.{component.name}" for name in table.ids for component in table.components]
