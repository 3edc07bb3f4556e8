"""Whether several systems point to the same mount error, and which one it is together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.explain.fitting.noise import masked_precision, precision, regular
from validation.explain.fitting.settled import Settled
from validation.poses.angles import Array

MOUNT = ("mount_x", "mount_y", "mount_theta")


@dataclass(frozen=True)
class Agreement:
    """The mount errors of systems that share a sensor (or a rig).

    Parameters
    ----------
    sensor : str
        What they share.
    systems : tuple of str
        The m systems.
    mounts : (m, 3) array
        Mount correction of each, in metres and radians, in the robot frame.
    covariance : (3 m, 3 m) array
        Of all together: errors of the common validation poses make them correlated.
    joint : (3,) array
        The common mount error, if there is one.
    joint_covariance : (3, 3) array
        Its covariance.
    dof : float
        Degrees of freedom of the noise level; infinite where it is stated.
    p_value : float
        Chance of mounts so different if they were the same.
    """

    sensor: str
    systems: tuple[str, ...]
    mounts: Array
    covariance: Array
    joint: Array
    joint_covariance: Array
    dof: float
    p_value: float

    def interval_factor(self, confidence: float = 0.95) -> float:
        """Half width of an interval in standard deviations."""
        if np.isinf(self.dof):
            return float(special.ndtri((1 + confidence) / 2))
        return float(special.stdtrit(self.dof, (1 + confidence) / 2))

    def differences(self, confidence: float = 0.95) -> Array:
        """(m - 1, 3, 3) difference of each from the first: value, low and high end."""
        m = len(self.systems)
        rows = []
        for other in range(1, m):
            pick = np.zeros((3, 3 * m))
            pick[:, :3], pick[:, 3 * other : 3 * other + 3] = -np.eye(3), np.eye(3)
            sigma = np.sqrt(np.maximum(np.diagonal(pick @ self.covariance @ pick.T), 0.0))
            value = self.mounts[other] - self.mounts[0]
            half = self.interval_factor(confidence) * sigma
            rows.append(np.stack([value, value - half, value + half], -1))
        return np.array(rows)


def agreement(sensor: str, fits: Sequence[Settled]) -> Agreement:
    """Whether the fits share a mount error; each must have a mount among its parameters.

    Parameters
    ----------
    sensor : str
        What they share.
    fits : sequence of Settled
        Two or more.

    Notes
    -----
    The mounts are combined by generalised least squares with all their correlations, which comes
    to the same as fitting all systems at once with a common mount. The test is Wald's.
    """
    m = len(fits)
    mounts = np.stack([_mount(one)[0] for one in fits])
    covariance = np.zeros((3 * m, 3 * m))
    for i in range(m):
        for j in range(m):
            block = _mount(fits[i])[1] if i == j else _cross(fits[i], fits[j])
            covariance[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block
    weight = np.linalg.inv(regular(covariance))
    stack = np.tile(np.eye(3), (m, 1))
    joint_covariance = np.linalg.inv(regular(stack.T @ weight @ stack))
    joint = joint_covariance @ stack.T @ weight @ mounts.ravel()
    left = mounts.ravel() - stack @ joint
    square = float(left @ weight @ left)
    freedom = 3 * (m - 1)
    estimated = any(one.fit.estimated for one in fits)
    dof = min(float(one.dof.sum()) for one in fits) if estimated else np.inf
    p_value = (
        float(special.fdtrc(freedom, max(dof, 1.0), square / freedom))
        if estimated
        else float(special.chdtrc(freedom, square))
    )
    names = tuple(one.pairs.system for one in fits)
    return Agreement(
        sensor, names, mounts, covariance, joint, np.asarray(joint_covariance), dof, p_value
    )


def _columns(one: Settled) -> list[int]:
    return [one.fit.model.fitted.index(name) for name in MOUNT]


def _mount(one: Settled) -> tuple[Array, Array]:
    """Mount parameters and their covariance."""
    columns = _columns(one)
    return one.fit.parameters[0, columns], one.fit.covariance[0][np.ix_(columns, columns)]


def _cross(a: Settled, b: Settled) -> Array:
    """(3, 3) covariance between two systems' mounts from their common validation poses."""
    rows_a = {name: row for row, name in enumerate(a.pairs.ids)}
    common = [(rows_a[name], row) for row, name in enumerate(b.pairs.ids) if name in rows_a]
    if not common:
        return np.zeros((3, 3))
    left, right = (np.array(rows) for rows in zip(*common, strict=True))
    gain_a, gain_b = _gains(a)[:, left], _gains(b)[:, right]
    shared = _shared_noise(a, b, left, right)
    full = np.einsum("knj,njl,mnl->km", gain_a, shared, gain_b)
    return np.asarray(full[np.ix_(_columns(a), _columns(b))])


def _gains(one: Settled) -> Array:
    """(k, n, 3) how each fitted parameter follows each error."""
    n, k = len(one.pairs), one.fit.parameters.shape[1]
    slopes = np.broadcast_to(one.fit.corrected.by_parameters, (1, n, 3, k))[0]
    used = masked_precision(precision(one.fit.covariances[0]), one.cells)
    return np.asarray(np.einsum("kl,nil,nij->knj", one.fit.covariance[0], slopes, used))


def _shared_noise(a: Settled, b: Settled, left: Array, right: Array) -> Array:
    """(m, 3, 3) noise of the common validation poses.

    Where it is not stated, the products of both systems' residuals show it, one value for
    positions and one for headings, never below zero.
    """
    if a.pairs.stated and b.pairs.stated:
        return np.asarray(a.pairs.validation_covariances[left])
    products = a.fit.residuals[0][left] * b.fit.residuals[0][right]
    used = a.cells[left] & b.cells[right]
    values = []
    for kind, columns in enumerate(([0, 1], [2])):
        part = products[used[:, kind]][:, columns]
        values.append(max(float(part.mean()), 0.0) if part.size else 0.0)
    return np.broadcast_to(np.diag([values[0], values[0], values[1]]), (len(left), 3, 3))
