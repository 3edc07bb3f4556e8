"""The joint adjustment: one least-squares problem over everything that was measured.

Unknowns are the Vframe points, the world points, the marks of every stop, the robot frames and
the shape of the rig. Observations are the distances, the nominal places of the Vframe points,
the marks against their rig points, and the rig's own shape and sides. What two poses share (a
world point, a Vframe point, the rig) makes their errors correlated, and the full covariance says
how much.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from survey.estimation.geometry import rotate
from survey.readings.point_names import robot_point
from survey.readings.readings import Mask, Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.errors import GtvalError
from validation.poses.angles import Array

_FIXED = 1e-6
"""Standard deviation, in metres, that stands for 'exactly known': a thousandth of a reading's."""

Index = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Network:
    """What is unknown and what was measured, as arrays.

    Parameters
    ----------
    points : tuple of str, length p
        Names of all points: Vframe, world, marks ('7/O').
    poses : tuple of str, length f
        Ids of the robot frames.
    rig_names : tuple of str, length k
        Names of the rig points.
    first, second : (n,) array of int
        Rows in ``points`` of the ends of each distance.
    distance, sigma : (n,) array
        Metres.
    fixed : (v,) array of int
        Rows of the Vframe points, with nominal places ``nominal`` (v, 2) and ``nominal_sigma``.
    mark, mark_pose, mark_rig : (q,) array of int
        For each mark its row in ``points``, in ``poses`` and in ``rig_names``.
    rig, rig_sigma, marking_sigma :
        (k, 2) nominal rig points, metres, robot frame, and their standard deviations.
    side, side_length, side_sigma :
        (s, 2) int, (s,) and float: the rig's measured sides.
    """

    points: tuple[str, ...]
    poses: tuple[str, ...]
    rig_names: tuple[str, ...]
    first: Index
    second: Index
    distance: Array
    sigma: Array
    fixed: Index
    nominal: Array
    nominal_sigma: float
    mark: Index
    mark_pose: Index
    mark_rig: Index
    rig: Array
    rig_sigma: float
    marking_sigma: float
    side: Index
    side_length: Array
    side_sigma: float

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of coordinates of points, poses and rig points."""
        return 2 * len(self.points), 3 * len(self.poses), 2 * len(self.rig_names)


@dataclass(frozen=True)
class Parameters:
    """Values of all unknowns: points (p, 2), poses (f, 3), rig points (k, 2)."""

    points: Array
    poses: Array
    rig: Array

    def moved(self, step: Array) -> "Parameters":
        """The same with a stacked step added."""
        p, f = self.points.size, self.poses.size
        return Parameters(
            self.points + step[:p].reshape(-1, 2),
            self.poses + step[p : p + f].reshape(-1, 3),
            self.rig + step[p + f :].reshape(-1, 2),
        )


def build_network(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    world_points: Sequence[str],
    poses: Sequence[str],
) -> tuple[Network, Mask]:
    """The network of the named points and poses, and which of the readings (n,) are in it.

    Readings with an end that is neither are not, in particular those to points that could not
    be located.
    """
    rig_names = tuple(rig.points)
    used_marks = {n for n in {*readings.start, *readings.end} if robot_point(n) is not None}
    marks = [f"{p}/{r}" for p in poses for r in rig_names if f"{p}/{r}" in used_marks]
    points = (*vframe.points, *world_points, *marks)
    place = {name: i for i, name in enumerate(points)}
    ends = zip(readings.start, readings.end, strict=True)
    inside = np.array([a in place and b in place for a, b in ends], dtype=bool)
    used = readings.select(inside)
    owner = [robot_point(mark) or ("", "") for mark in marks]
    pose_row = {pose: i for i, pose in enumerate(poses)}
    sides = _sides(rig)
    network = Network(
        points=points,
        poses=tuple(poses),
        rig_names=rig_names,
        first=np.array([place[name] for name in used.start], dtype=np.intp),
        second=np.array([place[name] for name in used.end], dtype=np.intp),
        distance=used.distance,
        sigma=used.sigma,
        fixed=np.arange(len(vframe.points)),
        nominal=np.array(list(vframe.points.values()), dtype=float),
        nominal_sigma=vframe.sigma,
        mark=np.array([place[mark] for mark in marks], dtype=np.intp),
        mark_pose=np.array([pose_row[pose] for pose, _ in owner], dtype=np.intp),
        mark_rig=np.array([rig_names.index(point) for _, point in owner], dtype=np.intp),
        rig=np.array(list(rig.points.values()), dtype=float),
        rig_sigma=max(rig.shape_sigma, _FIXED),
        marking_sigma=max(rig.marking_sigma, _FIXED),
        side=np.array([pair for pair, _ in sides], dtype=np.intp).reshape(-1, 2),
        side_length=np.array([length for _, length in sides]),
        side_sigma=rig.sides_sigma,
    )
    return network, inside


def _sides(rig: RobotFrame) -> list[tuple[tuple[int, int], float]]:
    """Measured sides of the rig as pairs of rows with their lengths."""
    names = list(rig.points)
    sides = []
    for key, length in rig.sides.items():
        ends = key.split("-")
        if len(ends) != 2 or not set(ends) <= set(names) or ends[0] == ends[1]:
            raise GtvalError(
                f"campaign.toml, [robot_frame.sides] '{key}': expected two different rig points "
                f"of {', '.join(names)} joined by '-', as in \"O-X\""
            )
        sides.append(((names.index(ends[0]), names.index(ends[1])), length))
    return sides


def design(network: Network, at: Parameters) -> tuple[Array, csr_array]:
    """Standardised residuals and their design matrix.

    Parameters
    ----------
    network : Network
        The problem.
    at : Parameters
        Where to linearise.

    Returns
    -------
    residual : (o,) array
        (measured - computed) / sigma: distances, Vframe places, marks, rig points, rig sides.
    jacobian : (o, u) sparse array
        Derivative of computed / sigma by points, poses and rig.
    """
    parts = [
        _distance_rows(network, at),
        _place_rows(network, at),
        _mark_rows(network, at),
        _rig_rows(network, at),
        _side_rows(network, at),
    ]
    residual = np.concatenate([part.residual.ravel() for part in parts])
    offset = 0
    rows, columns, values = [], [], []
    for part in parts:
        rows.append(part.row.ravel() + offset)
        columns.append(part.column.ravel())
        values.append(part.value.ravel())
        offset += part.residual.size
    shape = (offset, sum(network.sizes))
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return residual, csr_array(entries, shape=shape)


@dataclass(frozen=True)
class _Rows:
    """A kind of observation: residuals, and entries (row, column, value) of its design matrix."""

    residual: Array
    row: Index
    column: Index
    value: Array


def distance_entries(first: Array, second: Array) -> Array:
    """(n, 4) derivative of |first - second| by the x, y of the first and of the second point."""
    delta = first - second
    # Two points that start at one place have no direction yet: each is moved by its other readings.
    unit = delta / np.maximum(np.linalg.norm(delta, axis=-1, keepdims=True), 1e-12)
    return np.concatenate([unit, -unit], axis=-1)


def _distance_rows(network: Network, at: Parameters) -> _Rows:
    a, b = at.points[network.first], at.points[network.second]
    n = len(network.distance)
    columns = np.concatenate(
        [
            2 * network.first[:, None] + np.arange(2),
            2 * network.second[:, None] + np.arange(2),
        ],
        axis=1,
    )
    computed = np.linalg.norm(a - b, axis=-1)
    return _Rows(
        (network.distance - computed) / network.sigma,
        np.repeat(np.arange(n), 4).reshape(n, 4),
        columns,
        distance_entries(a, b) / network.sigma[:, None],
    )


def _place_rows(network: Network, at: Parameters) -> _Rows:
    """Vframe points against their nominal places."""
    column = 2 * network.fixed[:, None] + np.arange(2)
    value = np.full(column.shape, 1 / network.nominal_sigma)
    residual = (network.nominal - at.points[network.fixed]) / network.nominal_sigma
    return _Rows(residual, np.arange(column.size).reshape(column.shape), column, value)


def _mark_rows(network: Network, at: Parameters) -> _Rows:
    """Marks, seen in their robot frame, against the rig points."""
    p, f, _ = network.sizes
    q = len(network.mark)
    pose = at.poses[network.mark_pose]
    theta = pose[:, 2]
    seen = rotate(-theta, at.points[network.mark] - pose[:, :2])
    residual = (at.rig[network.mark_rig] - seen) / network.marking_sigma
    c, s = np.cos(theta), np.sin(theta)
    back = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], axis=-2)
    by_heading = np.stack([seen[:, 1], -seen[:, 0]], axis=-1)[..., None]
    minus = np.broadcast_to(-np.eye(2), (q, 2, 2))
    value = np.concatenate([back, -back, by_heading, minus], axis=-1) / network.marking_sigma
    columns = np.concatenate(
        [
            2 * network.mark[:, None] + np.arange(2),
            p + 3 * network.mark_pose[:, None] + np.arange(3),
            p + f + 2 * network.mark_rig[:, None] + np.arange(2),
        ],
        axis=1,
    )
    column = np.broadcast_to(columns[:, None, :], (q, 2, 7))
    row = np.broadcast_to(np.arange(2 * q).reshape(q, 2, 1), (q, 2, 7))
    return _Rows(residual, row, column, value)


def _rig_rows(network: Network, at: Parameters) -> _Rows:
    """Rig points against their nominal places in the robot frame."""
    p, f, k = network.sizes
    column = p + f + np.arange(k)
    residual = (network.rig - at.rig).ravel() / network.rig_sigma
    return _Rows(residual, np.arange(k), column, np.full(k, 1 / network.rig_sigma))


def _side_rows(network: Network, at: Parameters) -> _Rows:
    """Measured sides of the rig."""
    p, f, _ = network.sizes
    a, b = at.rig[network.side[:, 0]], at.rig[network.side[:, 1]]
    s = len(network.side_length)
    column = (p + f + 2 * network.side[..., None] + np.arange(2)).reshape(s, 4)
    residual = (network.side_length - np.linalg.norm(a - b, axis=-1)) / network.side_sigma
    row = np.repeat(np.arange(s), 4).reshape(s, 4)
    return _Rows(residual, row, column, distance_entries(a, b) / network.side_sigma)


def start_parameters(
    network: Network,
    vframe_points: Array,
    world: Mapping[str, Array],
    poses: Mapping[str, Array],
) -> Parameters:
    """Approximate values from the single solutions; marks are put where the rig says."""
    pose_values = np.array([poses[name] for name in network.poses]).reshape(-1, 3)
    v = len(network.fixed)
    middle = [world[name] for name in network.points[v : len(network.points) - len(network.mark)]]
    own = pose_values[network.mark_pose]
    marks = own[:, :2] + rotate(own[:, 2], network.rig[network.mark_rig])
    points = np.concatenate([vframe_points, np.array(middle).reshape(-1, 2), marks])
    return Parameters(points, pose_values, network.rig.copy())
