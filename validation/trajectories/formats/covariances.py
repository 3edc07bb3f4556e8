"""Covariances as files have them: symmetric, positive definite, and printed with few digits."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.trajectories.formats.records import MAX_LOOKED_AT, Records
from validation.trajectories.formats.source import MAX_PROBLEMS


def checked_covariances(covariances: Array, records: Records) -> Array:
    """(n, m, m) symmetric, positive definite covariances, or NaN where nothing is stated.

    Notes
    -----
    A number printed with the last digit q is off by up to q/2, a matrix of m rows by a matrix of
    norm up to m q/2. Where all variances of a row are zero, nothing is stated: that is what
    software writes that knows none. Where one is zero, q/2 stands for it, the most that printing
    hides; if it is not printed with a last digit, the matrix is not used. Where a matrix is not
    positive definite but would be with m q/2 on its diagonal, this is added: an uncertainty that
    the true matrix does not exceed. What remains is wrong.
    """
    size = covariances.shape[1]
    diagonal = np.arange(size)
    digit = records.digit or 0.0
    variances = covariances[:, diagonal, diagonal]
    covariances[(variances == 0).all(1)] = np.nan
    stated = np.isfinite(covariances).all((1, 2))
    bad: list[tuple[int, str]] = [
        (int(row), "has numbers that are missing")
        for row in np.flatnonzero(~stated & np.isfinite(covariances).any((1, 2)))
    ]
    rows = np.flatnonzero(stated)
    matrices = covariances[rows]
    skew = np.abs(matrices - matrices.transpose(0, 2, 1)).max((1, 2), initial=0.0)
    scale = np.abs(matrices).max((1, 2), initial=0.0)
    bad += [
        (int(row), "is not symmetric") for row in rows[skew > np.maximum(2 * digit, 1e-6 * scale)]
    ]
    matrices = (matrices + matrices.transpose(0, 2, 1)) / 2
    hidden = matrices[:, diagonal, diagonal] == 0
    if hidden.any() and not digit:
        left = hidden.any(1)
        records.notes.append(f"{int(left.sum())} covariances with a variance of 0 are not used")
        covariances[rows[left]] = np.nan
        matrices, rows = matrices[~left], rows[~left]
    elif hidden.any():
        matrices[:, diagonal, diagonal] += np.where(hidden, digit / 2, 0.0)
        records.notes.append(
            f"{int(hidden.any(1).sum())} covariances had a variance printed as zero: half of the "
            f"last digit, {digit / 2:g}, stands for it"
        )
    matrices, wrong, mended = _positive_definite(matrices, digit * size / 2)
    if mended:
        records.notes.append(
            f"{mended} covariances lost positive definiteness in printing: {digit * size / 2:g} "
            "was added to their variances"
        )
    bad += [(int(row), "is not positive definite") for row in rows[wrong]]
    if bad and records.format == "bag":
        covariances[[row for row, _ in bad]] = np.nan
        records.notes.append(f"{len(bad)} covariances are not used: the first {bad[0][1]}")
        matrices, rows = matrices[~wrong], rows[~wrong]
        keep = np.isfinite(covariances[rows]).all((1, 2))
        matrices, rows = matrices[keep], rows[keep]
    elif bad:
        problems = [
            Problem(records.source.path, f"the covariance {what}", records.lines[row], "covariance")
            for row, what in sorted(bad)[:MAX_PROBLEMS]
        ]
        raise InputError(problems)
    covariances[rows] = matrices
    return covariances


def _positive_definite(matrices: Array, allowed: float) -> tuple[Array, npt.NDArray[np.bool_], int]:
    """The matrices, which are wrong, and how many got the allowed sum on their diagonal."""
    wrong = np.zeros(len(matrices), dtype=bool)
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        diagonal = np.arange(matrices.shape[1])
        variances = matrices[:, diagonal, diagonal]
        scale = np.sqrt(np.where(variances > 0, variances, 1.0))
        lowest = np.linalg.eigvalsh(matrices / scale[:, :, None] / scale[:, None, :])[:, 0]
        weak = (lowest <= 1e-12) | (variances <= 0).any(1)
        if not weak.any():
            return matrices, wrong, 0
        mended = matrices[weak] + allowed * np.eye(matrices.shape[1])
        # 1e-9: what is exactly singular is rounded to either side.
        still = np.linalg.eigvalsh(mended)[:, 0] <= -1e-9 * np.abs(mended).max((1, 2))
        wrong[weak] = still | (allowed == 0)
        matrices[weak] = mended
        return matrices, wrong, int((weak & ~wrong).sum())
    return matrices, wrong, 0


def last_digit(texts: Sequence[Sequence[str]]) -> float | None:
    """The last digit of numbers printed with a fixed number of decimals, such as 1e-6.

    None for numbers with an exponent, without decimals, or with as many as each needs: these are as
    exact as they are.
    """
    decimals = set()
    for column in texts:
        for text in column[:MAX_LOOKED_AT]:
            if "e" in text or "E" in text:
                return None
            decimals.add(len(text.rpartition(".")[2]) if "." in text else 0)
    return 10.0 ** -decimals.pop() if len(decimals) == 1 and 0 not in decimals else None


def symmetric(upper: Array, size: int) -> Array:
    """(n, m, m) matrices of the upper triangles (n, m (m + 1) / 2), row by row."""
    matrices = np.empty((len(upper), size, size))
    rows, columns = np.triu_indices(size)
    matrices[:, rows, columns] = upper
    matrices[:, columns, rows] = upper
    return matrices
