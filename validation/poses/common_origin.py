"""Two tables of which one took its frame or its mount from the other, as independent parts."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.factored import Factored, least_variances
from validation.poses.follows import Follows
from validation.poses.joint import LARGEST_WHOLE
from validation.poses.pose_table import PoseTable, in_common
from validation.poses.shared_errors import shared_errors
from validation.text_files.csv_tables import Column, header_of, read_csv
from validation.text_files.csv_text import csv_text

LEAST_SHARE = 1e-4
"""Part of a variance below which a direction of errors counts as zero by construction. What is left
there is a hundredth of the noise, and the curvature of the poses (2 mm at 1 m: a thousandth of
the noise) must stay below it."""
CONSTRUCTED_MEAN = 0.05
"""Share of the variance that independent errors of the survey would give a mean, below which the
mean is zero by construction: the mean then shows less than a quarter of an even error. A frame
placed by all n compared stops keeps nothing, one placed by half of them as much as before."""
MAX_BYTES = 100_000_000
"""Two thousand numbers of a factor of six columns have 0.2 MB."""


Indices = npt.NDArray[np.intp]


class Apart(NamedTuple):
    """Two tables at their common stops, whose errors are independent of each other.

    ``validation`` has what is left of its errors in the differences, ``gt`` what it errs itself;
    ``constructed`` are stops whose difference is zero by construction, ``mean_share`` (k,) is the
    share of its variance that a mean difference keeps, NaN where nothing is taken over, and
    ``depends`` says whether covariances allow for it.
    """

    validation: PoseTable
    gt: PoseTable
    constructed: tuple[str, ...]
    mean_share: Array
    depends: bool


def apart(validation: PoseTable, gt: PoseTable) -> Apart:
    """Both tables at their common stops, with the errors that cancel taken out.

    Parameters
    ----------
    validation, gt : PoseTable
        Of the same components. The GT poses L may follow the validation poses S: L = G s + g,
        with G of `Follows`, the errors s of S, and errors g of the system itself.

    Raises
    ------
    InputError
        If no stop is in common.

    Notes
    -----
    The difference is S - L = (1 - G) s - g. With the joint covariances of S and of L its two
    independent parts have (1 - G) cov(S) (1 - G)' and cov(L) - G cov(S) G'; their sum is
    cov(S) + cov(L) - cov(L, S) - cov(S, L).
    """
    ids = in_common([validation, gt])
    ours, theirs = validation.select(ids), gt.select(ids)
    follows, k = gt.follows, len(gt.components)
    unknown = np.full(k, np.nan)
    if not _applies(follows, validation, k):
        return Apart(ours, theirs, (), unknown, depends=False)
    assert follows is not None
    assert theirs.follows is not None
    both = set(ids)
    every = [*ids, *(name for name in follows.ids if name not in both)]
    known = validation.select(every)
    row = {name: number for number, name in enumerate(every)}
    used = _flat([row[name] for name in follows.ids], k)
    by, of = theirs.follows.by, theirs.follows.of
    constructed = _constructed(by, of, used, ids)
    share = _mean_share(by, of, used, known, len(ids))
    if not (known.has_covariance.all() and theirs.has_covariance.all()):
        return Apart(ours, theirs, constructed, share, depends=False)
    if _in_few_numbers(known, theirs):
        rest = Factored.of(known).without(by, of, used, len(ids))
        return Apart(
            rest.given_to(ours),
            _less(theirs, by, of, known.select(follows.ids)),
            constructed,
            share,
            depends=True,
        )
    whole, gain = joint_of(known), by @ of
    left = np.eye(len(ids) * k, len(every) * k)
    left[:, used] -= gain
    own = joint_of(theirs) - gain @ whole[np.ix_(used, used)] @ gain.T
    return Apart(
        _with_joint(ours, left @ whole @ left.T, _floor(ours)),
        _with_joint(theirs, own, _floor(theirs)),
        constructed,
        share,
        depends=True,
    )


def own_part(validation: PoseTable, gt: PoseTable) -> PoseTable:
    """The GT poses with the covariances of what they err themselves; as they are if unknown."""
    follows, k = gt.follows, len(gt.components)
    if not _applies(follows, validation, k):
        return gt
    assert follows is not None
    known = validation.select(follows.ids)
    if not (known.has_covariance.all() and gt.has_covariance.all()):
        return gt
    if _in_few_numbers(gt):
        return _less(gt, follows.by, follows.of, known)
    own = joint_of(gt) - follows.gain @ joint_of(known) @ follows.gain.T
    return _with_joint(gt, own, _floor(gt))


def _less(table: PoseTable, by: Array, of: Array, known: PoseTable) -> PoseTable:
    """A table without what ``by`` gives of the errors of another by ``of``."""
    return Factored.of(table).less(by, of, Factored.of(known)).given_to(table)


def _applies(follows: Follows | None, validation: PoseTable, k: int) -> bool:
    """Whether poses of k numbers follow this validation table."""
    if follows is None or follows.system != validation.system:
        return False
    fits = len(validation.components) == k and follows.of.shape[1] == len(follows.ids) * k
    return fits and set(follows.ids) <= set(validation.ids)


def joint_of(table: PoseTable) -> Array:
    """(n k, n k) covariance of all poses together; zero between poses where it is not stated."""
    whole = table.joint_covariance
    if whole is not None:
        return whole
    n, k = table.poses.shape
    blocks = np.zeros((n, k, n, k))
    rows = np.arange(n)
    blocks[rows, :, rows, :] = table.covariances
    return blocks.reshape(n * k, n * k)


def _flat(rows: Sequence[int], k: int) -> Indices:
    """Where the numbers of some poses are."""
    return np.asarray((np.array(rows, dtype=int)[:, None] * k + np.arange(k)).ravel())


def _with_joint(table: PoseTable, joint: Array, floor: Array) -> PoseTable:
    """The table with another joint covariance, made positive where rounding has taken it."""
    n, k = table.poses.shape
    joint = (joint + joint.T) / 2
    joint = joint + np.diag(floor + np.maximum(floor - np.diagonal(joint), 0.0))
    blocks = joint.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)]
    for row in range(n):
        least = float(np.linalg.eigvalsh(_scaled(blocks[row]))[0])
        if least < 1e-9:
            added = np.diag((1e-9 - least) * np.diagonal(blocks[row]))
            blocks[row] += added
            at = slice(row * k, row * k + k)
            joint[at, at] += added
    return replace(table, covariances=blocks, joint=joint, factor=None, signs=None, net=None)


def _scaled(matrix: Array) -> Array:
    size = np.sqrt(np.diagonal(matrix))
    return np.asarray(matrix / size[:, None] / size)


def _floor(table: PoseTable) -> Array:
    """(n k,) variances that rounding may take."""
    return least_variances(table).ravel()


def _constructed(by: Array, of: Array, used: Indices, ids: Sequence[str]) -> tuple[str, ...]:
    """Stops at which nothing of the validation's error is left: the system took it over whole.

    Left are the rows of 1 - by of, whose squares are 1 - 2 by_i of_i + by_i of of' by_i'.
    """
    square = np.einsum("ir,rs,is->i", by, of @ of.T, by) + 1
    inside = used < len(by)
    square[used[inside]] -= 2 * np.einsum("ir,ri->i", by[used[inside]], of[:, inside])
    each = square.reshape(len(ids), -1).sum(1)
    return tuple(name for name, size in zip(ids, each, strict=True) if size < LEAST_SHARE)


def _mean_share(by: Array, of: Array, used: Indices, known: PoseTable, n: int) -> Array:
    """(k,) variance of the mean difference over that of n independent errors of the validation.

    By its stated covariances; where none are stated, as if all were a metre and a radian.
    """
    count, k = known.poses.shape
    covariances: Array = np.broadcast_to(np.eye(k), (count, k, k))
    flat = np.zeros((k, count * k))
    flat[:, : n * k] = np.tile(np.eye(k) / n, n)
    flat[:, used] -= by.reshape(n, k, -1).mean(0) @ of
    means = flat.reshape(k, count, k)
    if known.has_covariance.all():
        covariances = known.covariances
    square = np.einsum("anj,njl,bnl->ab", means, covariances, means)
    together = shared_errors([known]) if known.has_covariance.all() else None
    if together is not None:
        square = square + together.seen_by(means)
    alone = np.diagonal(covariances, axis1=1, axis2=2)[:n].sum(0) / n**2
    return np.asarray(np.diagonal(square) / alone)


def _in_few_numbers(*tables: PoseTable) -> bool:
    """Whether no matrix of all poses is there, nor is one small enough to be made."""
    whole = any(table.joint is not None for table in tables)
    return not whole and max(table.poses.size for table in tables) > LARGEST_WHOLE


def placed_by(
    table: PoseTable,
    validation: PoseTable,
    stops: Sequence[str],
    *,
    mount: bool = False,
    headings: bool = True,
) -> PoseTable:
    """A table whose frame, or frame and mount, was fitted to surveyed stops.

    Parameters
    ----------
    table : PoseTable
        Planar poses, or positions in the plane, as they came out of that fit. Covariances that it
        states are of the system in its own frame. As it is where the survey has other components.
    validation : PoseTable
        The survey.
    stops : sequence of str
        Those that were used; the table has them too.
    mount : bool
        Whether the mount was fitted as well.
    headings : bool
        Whether headings took part in the fit.

    Notes
    -----
    Least squares with the same weight for all positions, and for all headings by the ratio of
    their stated variances; a metre to a radian where none is stated.
    """
    k = len(table.components)
    if validation.components != table.components:
        return table
    by = _lever(table.poses, mount=mount and k > 2)
    n, r = len(table), by.shape[1]
    row = {name: number for number, name in enumerate(table.ids)}
    rows = _flat([row[name] for name in stops], k)
    known = validation.select(stops)
    weights = np.ones(k)
    if known.has_covariance.all():
        weights = 1 / np.diagonal(known.covariances, axis1=1, axis2=2).mean(0)
    if k > 2 and not headings:
        weights[2] = 0.0
    root = np.sqrt(np.tile(weights, len(stops)))
    of = np.asarray(np.linalg.pinv(by[rows] * root[:, None]) * root, dtype=float)
    follows = Follows(
        validation.system, tuple(stops), by, of, "frame and mount" if r > 3 else "frame"
    )
    if not (known.has_covariance.all() and table.has_covariance.all()):
        return replace(table, follows=follows)
    if _in_few_numbers(table):
        own = Factored.of(table).without(by, of, rows, n)
        return replace(own.more(by, of, Factored.of(known)).given_to(table), follows=follows)
    left = np.eye(n * k)
    left[:, rows] -= follows.gain
    whole = left @ joint_of(table) @ left.T
    whole += follows.gain @ joint_of(known) @ follows.gain.T
    return replace(_with_joint(table, whole, _floor(table)), follows=follows)


def _lever(poses: Array, *, mount: bool) -> Array:
    """(n k, 3 or 6) how planar poses, or positions, follow their frame, and their mount."""
    n, k = poses.shape
    by = np.zeros((n, k, 6 if mount else 3))
    by[:, 0, 0] = by[:, 1, 1] = 1.0
    by[:, 0, 2], by[:, 1, 2] = -poses[:, 1], poses[:, 0]
    if k > 2:
        by[:, 2, 2] = 1.0
    if mount:
        cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        by[:, 0, 3] = by[:, 1, 4] = cosine
        by[:, 0, 4], by[:, 1, 3] = -sine, sine
        by[:, 2, 5] = 1.0
    return by.reshape(n * k, -1)


def follows_path(path: Path) -> Path:
    """follows_<system>.csv beside poses_<system>.csv."""
    return path.with_name("follows_" + path.name.removeprefix("poses_"))


def follows_files(table: PoseTable) -> dict[str, str]:
    """``follows_<system>.csv`` of a table that took its frame or mount from another; else none.

    A row for every number of its own poses says how it follows the unknowns (the columns), and a
    row for every number of the other table that was used, how the unknowns follow that.
    """
    follows = table.follows
    if follows is None:
        return {}
    names = [one.name for one in table.components]
    rows = [
        [system, f"{stop}.{name}", *values]
        for system, stops, matrix in (
            (table.system, table.ids, follows.by),
            (follows.system, follows.ids, follows.of.T),
        )
        for (stop, name), values in zip(
            ((stop, name) for stop in stops for name in names), matrix.tolist(), strict=True
        )
    ]
    what = follows.what.replace(" and ", "_")
    header = ["table", "number", *(f"{what}_{one + 1}" for one in range(follows.by.shape[1]))]
    path = follows_path(Path(f"poses_{table.system}.csv"))
    return {path.name: csv_text(header, rows)}


def with_stored_follows(table: PoseTable, path: Path) -> PoseTable:
    """The table with what it took over from another, if a file beside it says so.

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
    beside = follows_path(path)
    if not path.name.startswith("poses_") or not beside.exists():
        return table
    columns = header_of(beside, max_bytes=MAX_BYTES)[2:]
    wanted = [Column("table"), Column("number"), *(Column(name, "number") for name in columns)]
    cells = read_csv(beside, wanted, max_bytes=MAX_BYTES)
    cells.raise_problems()
    names = [one.name for one in table.components]
    own = [f"{stop}.{name}" for stop in table.ids for name in names]
    n, k = len(own), len(names)
    numbers, systems = cells.text["number"], cells.text["table"]
    rest = numbers[n:]
    stops = tuple(number.removesuffix(f".{names[0]}") for number in rest[::k])
    fits = numbers[:n] == own and rest == [f"{stop}.{name}" for stop in stops for name in names]
    fits = fits and set(systems[:n]) == {table.system} and len(set(systems[n:])) == 1
    if not (fits and columns and stops):
        said = f"its rows are not the poses of {path.name}; run the campaign again"
        raise InputError([Problem(beside, said)])
    matrix = np.column_stack([cells.numbers[name] for name in columns])
    what = columns[0].rpartition("_")[0].replace("_", " and ")
    return replace(table, follows=Follows(systems[n], stops, matrix[:n], matrix[n:].T.copy(), what))
