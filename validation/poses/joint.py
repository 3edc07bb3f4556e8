"""The covariance of all poses of a table together, as a file beside the table."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from validation.errors import FaultyResultError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.nets import Net, inverse_blocks, sparse_factor
from validation.poses.pose_table import PoseTable
from validation.text_files.csv_tables import Column, header_of, read_csv
from validation.text_files.csv_text import csv_text, harmless
from validation.text_files.writing import Content, text_of

LARGEST_WHOLE = 300
"""Numbers of all poses up to which the matrix is written whole, also where it has a factor: 90,000
cells, under 2 MB, which a spreadsheet shows. It grows with the square: the 201 poses of a drive of
four minutes have 1,206 numbers and a matrix of 11.7 MB, their factor of 9 columns has 0.2 MB."""
OTHER = "other"
"""Begins the names of numbers of a net that are of no pose."""
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


def net_path(path: Path) -> Path:
    """joint_net_<system>.csv beside poses_<system>.csv."""
    return path.with_name("joint_net_" + path.name.removeprefix("poses_"))


def joint_files(table: PoseTable) -> dict[str, Content]:
    """The files of a table's joint covariance by their names; none where the table has none.

    ``joint_<system>.csv`` has a row and a column for every number of every pose,
    ``joint_factor_<system>.csv`` a row for every number and a column for every shared error,
    ``joint_net_<system>.csv`` a row for every two numbers of a net whose information is not zero.
    Factor and net are written where the whole matrix would have more than `LARGEST_WHOLE` numbers
    a side.
    """
    path = Path(f"poses_{table.system}.csv")
    factor, net = table.factor, table.net
    if (factor is not None or net is not None) and table.poses.size > LARGEST_WHOLE:
        files: dict[str, Content] = {}
        if factor is not None:
            lines = partial(_factor_lines, table, factor)
            files[factor_path(path).name] = text_of(lines, factor.size)
        if net is not None:
            lines = partial(_net_lines, _names(table), net)
            files[net_path(path).name] = text_of(lines, 3 * net.information.nnz)
        return files
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


def _net_lines(names: list[str], net: Net) -> Iterator[str]:
    """The lines of a net's file: its information, each two numbers once."""
    from scipy import sparse  # noqa: PLC0415  (loaded where there is a net)

    by, upper = net.by.tocoo(), sparse.triu(net.information).tocoo()
    unknowns = [f"{OTHER}_{column}" for column in range(1, by.shape[1] + 1)]
    if (by.data != 1.0).any() or len(set(by.coords[0])) != by.nnz or by.nnz != by.shape[0]:
        raise FaultyResultError("a net whose numbers are sums of others cannot be written")
    for row, column in zip(*by.coords, strict=True):
        unknowns[column] = harmless(names[row])
    yield "number,other,information"
    order = np.lexsort(upper.coords[::-1])
    for row, column, value in zip(
        *(cells[order].tolist() for cells in (*upper.coords, upper.data)), strict=True
    ):
        yield f"{unknowns[row]},{unknowns[column]},{value!r}"


def _stored_net(beside: Path, table: PoseTable, path: Path) -> Net:
    """The net of a file."""
    from scipy import sparse  # noqa: PLC0415

    columns = [Column("number"), Column("other"), Column("information", "number")]
    cells = read_csv(beside, columns, max_bytes=MAX_BYTES)
    cells.flag_duplicates(["number", "other"])
    cells.raise_problems()
    names, k = _names(table), len(table.components)
    ends = cells.text["number"], cells.text["other"]
    where = {name: row for row, name in enumerate(dict.fromkeys([*names, *ends[0], *ends[1]]))}
    size, own = len(where), len(names)
    first, second = (np.array([where[name] for name in one], dtype=np.intp) for one in ends)
    values = np.asarray(cells.numbers["information"])
    if any(not name.startswith(f"{OTHER}_") for name in list(where)[own:]):
        said = f"its numbers are not those of the poses of {path.name}; run the campaign again"
        raise InputError([Problem(beside, said)])
    half = sparse.coo_array((values, (first, second)), shape=(size, size)).tocsc()
    diagonal = half.diagonal()
    information = (half + half.T - sparse.diags_array(diagonal)).tocsc()
    wrong = InputError([Problem(beside, "it is not positive definite; run the campaign again")])
    if not (diagonal > 0).all():
        raise wrong
    try:
        blocks = inverse_blocks(sparse_factor(information), size, own // k, k)
    except RuntimeError:
        raise wrong from None
    if not (np.linalg.eigvalsh(blocks) > 0).all():
        raise wrong
    return Net(information, sparse.eye_array(own, size, format="csr"), blocks)


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
    whole, factor, net = joint_path(path), factor_path(path), net_path(path)
    few = [beside for beside in (factor, net) if beside.exists()]
    if not path.name.startswith("poses_"):
        return table
    if whole.exists():
        if few:
            raise InputError(
                [Problem(few[0], f"{whole.name} states the same; delete the older one")]
            )
        matrix = _matrix(whole, _names(table), path, square=True)
        _check_whole(table, matrix, whole, path)
        return replace(table, joint=matrix)
    if factor in few:
        names = header_of(factor, max_bytes=MAX_BYTES)[1:]
        signs = np.array([-1.0 if name.startswith(LESS) else 1.0 for name in names])
        matrix = _matrix(factor, _names(table), path, square=False)
        table = replace(table, factor=matrix, signs=None if (signs > 0).all() else signs)
    if net in few:
        table = replace(table, net=_stored_net(net, table, path))
    if few:
        _check_own(table, few, path)
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


def _check_whole(table: PoseTable, matrix: Array, beside: Path, path: Path) -> None:
    """Raise where the file and the covariances of single poses cannot both be right."""
    n, k = table.poses.shape
    own = matrix.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)]
    if not np.allclose(own, table.covariances, rtol=1e-6, atol=0.0, equal_nan=False):
        raise _contradicting(beside, path)


def _check_own(table: PoseTable, few: list[Path], path: Path) -> None:
    """The same of few numbers: what a pose shares is a part of its covariance."""
    scale = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))[:, :, None]
    rest = table.own_covariances() / scale / np.swapaxes(scale, 1, 2)
    if not (np.isfinite(rest).all() and (np.linalg.eigvalsh(rest) > -1e-6).all()):
        raise _contradicting(few[-1], path, *few[:-1])


def _contradicting(beside: Path, path: Path, *others: Path) -> InputError:
    given = "".join(f", beside {other.name}" for other in others)
    said = f"it contradicts the covariances of {path.name}{given}; run again"
    return InputError([Problem(beside, said)])


def _names(table: PoseTable) -> list[str]:
    """'7.x', '7.y', '7.theta' for every pose."""
    return [f"{name}.{component.name}" for name in table.ids for component in table.components]
