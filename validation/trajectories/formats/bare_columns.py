"""Rows of numbers whose meaning only their count and order tell: TUM, KITTI, RAWSEEDS, EuRoC."""

from collections.abc import Sequence

import numpy as np

from validation.errors import InputError
from validation.poses.angles import Array
from validation.trajectories.formats.covariances import last_digit, symmetric
from validation.trajectories.formats.records import Records
from validation.trajectories.formats.source import (
    MAX_PROBLEMS,
    Asked,
    Rows,
    Source,
    cells_of,
    read_rows,
    read_times_file,
    separator_of,
)

TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Source: Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012), file formats
of the data set; seconds."""
OPENVINS = ("11", "12", "13", "22", "23", "33")
TUM_COVARIANCE = (*TUM, *(f"Pr{one}" for one in OPENVINS), *(f"Pt{one}" for one in OPENVINS))
"""Orientation first, then position, as the loader of OpenVINS (ov_eval) reads them. That of the
orientation is of a small rotation in the moving frame, as its filter has it."""
KITTI = tuple(f"T{row}{column}" for row in "123" for column in "1234")
"""Geiger, Lenz and Urtasun (2012): the upper three rows of the transform, row by row."""
RAWSEEDS = ("time", "x", "y", "theta")
RAWSEEDS_COVARIANCE = (*RAWSEEDS, *(a + b for a in "xyt" for b in "xyt"))
EUROC = ("timestamp [ns]", "x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz")
EUROC_STATE = (*EUROC, *(f"b_{name}" for name in ("wx", "wy", "wz", "ax", "ay", "az")))
"""Burri et al., The EuRoC micro aerial vehicle datasets (2016): state_groundtruth_estimate."""

MOST_SKEW = 1e-3
"""Departure of a printed rotation matrix from orthonormal: numbers of three decimals still pass."""
MOST_THETA = 2 * np.pi + 1e-6
"""A heading of RAWSEEDS lies within a turn; what does not is another column, such as z."""


def first_row(source: Source) -> list[str]:
    """The cells of the first line that is neither blank nor a comment."""
    for line in source.lines:
        stripped = line.strip()
        if stripped and stripped[0] not in "#%":
            return _cells(stripped)
    return []


def separator_in(source: Source) -> str:
    """What separates the cells of the first row of numbers."""
    for line in source.lines:
        stripped = line.strip()
        if stripped and stripped[0] not in "#%":
            return separator_of(stripped)
    return " "


def _cells(line: str) -> list[str]:
    cells = cells_of(line, separator_of(line))
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _rows(source: Source, *choices: tuple[str, ...]) -> Rows:
    """The rows, called as the choice of the right width says, or the first."""
    width = len(first_row(source))
    names = next((one for one in choices if len(one) == width), choices[0])
    return read_rows(source, 0, separator_in(source), names)


def read_tum(source: Source, asked: Asked) -> Records:
    """Rows of t x y z qx qy qz qw, seconds unless the digits of a date say otherwise."""
    del asked
    rows = _rows(source, TUM)
    values = rows.numbers(range(8))
    return Records(
        source,
        "tum",
        rows.lines,
        rows.text(0),
        values[:, 1:4],
        unit="s",
        quaternions=values[:, 4:],
        assumed=True,
    )


def read_tum_covariance(source: Source, asked: Asked) -> Records:
    """TUM with the covariances of orientation and position, as OpenVINS writes them."""
    del asked
    rows = _rows(source, TUM_COVARIANCE)
    values = rows.numbers(range(20))
    quaternions = values[:, 4:8]
    covariances = np.zeros((len(rows), 6, 6))
    covariances[:, :3, :3] = symmetric(values[:, 14:], 3)
    lengths = np.linalg.norm(quaternions, axis=1)
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

    turned = Rotation.from_quat(np.where(lengths[:, None] > 0, quaternions, 1.0)).as_matrix()
    own = symmetric(values[:, 8:14], 3)
    if own.any():
        own = turned @ own @ turned.transpose(0, 2, 1)
    covariances[:, 3:, 3:] = own
    records = Records(
        source,
        "tum_covariance",
        rows.lines,
        rows.text(0),
        values[:, 1:4],
        unit="s",
        quaternions=quaternions,
        covariances=covariances,
        digit=last_digit(rows.columns[8:]),
        assumed=True,
    )
    records.notes.append("position and orientation have no covariance with each other in the file")
    return records


def read_kitti(source: Source, asked: Asked) -> Records:
    """Twelve numbers a row, with the times of another file.

    Raises
    ------
    InputError
        If there is no file of times, or one of another length; for matrices that do not turn.
    """
    rows = _rows(source, KITTI)
    values = rows.numbers(range(12)).reshape(-1, 3, 4)
    if asked.times is None:
        raise source.error(
            "KITTI poses have no times: give the file that has one a line with --times times.txt"
        )
    stamps, _ = read_times_file(asked.times)
    if len(stamps) != len(rows):
        raise source.error(f"{len(rows)} poses, but {asked.times} has {len(stamps)} times")
    return Records(
        source,
        "kitti",
        rows.lines,
        stamps,
        values[:, :, 3],
        unit="s",
        quaternions=quaternions_of(values[:, :, :3], source, rows.lines),
        facts={"times": asked.times.name},
        assumed=True,
    )


def quaternions_of(matrices: Array, source: Source, lines: Sequence[int]) -> Array:
    """(n, 4) quaternions of rotation matrices as printed.

    Raises
    ------
    InputError
        With every matrix that is no rotation.
    """
    off = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max((1, 2), initial=0.0)
    wrong = (off > MOST_SKEW) | (np.linalg.det(matrices) < 0)
    if wrong.any():
        raise InputError(
            source.problem(f"not a rotation matrix: off by {off[row]:.2g}", lines[row], "rotation")
            for row in np.flatnonzero(wrong)[:MAX_PROBLEMS].tolist()
        )
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

    return np.asarray(Rotation.from_matrix(matrices).as_quat())


def read_rawseeds(source: Source, asked: Asked) -> Records:
    """Rows of t, x, y, theta, with or without the nine numbers of the covariance.

    Raises
    ------
    InputError
        For a heading of more than a turn.
    """
    rows = _rows(source, RAWSEEDS_COVARIANCE, RAWSEEDS)
    width = len(rows.names)
    values = rows.numbers(range(width))
    far = np.abs(values[:, 3]) > MOST_THETA
    if far.any() and asked.degrees is None:
        raise InputError(
            source.problem("not a heading in radians", rows.lines[row], "theta", rows.text(3)[row])
            for row in np.flatnonzero(far)[:MAX_PROBLEMS]
        )
    covariances = values[:, 4:].reshape(-1, 3, 3) if width == len(RAWSEEDS_COVARIANCE) else None
    return Records(
        source,
        "rawseeds",
        rows.lines,
        rows.text(0),
        values[:, 1:3],
        unit="s",
        angles=values[:, 3],
        degrees=False,
        covariances=covariances,
        digit=last_digit(rows.columns[4:]),
        assumed=True,
    )


def read_bare_euroc(source: Source, asked: Asked) -> Records:
    """Rows of EuRoC's ground truth without their header: t, position, qw qx qy qz, and more."""
    del asked
    rows = _rows(source, EUROC_STATE, EUROC[:8], EUROC)
    values = rows.numbers(range(8))
    return Records(
        source,
        "euroc",
        rows.lines,
        rows.text(0),
        values[:, 1:4],
        unit="ns",
        quaternions=values[:, [5, 6, 7, 4]],
        assumed=True,
    )
