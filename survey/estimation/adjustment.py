"""Least-squares solution of the survey's network, with covariance and reliability."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from survey.estimation.least_squares.split_covariance import (
    NotDeterminedError,
    SplitCovariance,
    split_inverse,
)
from survey.estimation.network import Index, Network, Parameters, design
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap

HUBER = 1.5
"""Standardised residual from which the robust option weighs a reading down: usual, and 96 % as
exact as least squares where nothing is wrong."""
_PASSES = 30
_STEP_TOLERANCE = 1e-9
"""Gauss-Newton ends at steps below a nanometre, after four or five passes where readings agree."""
_STEP_NEAR = 1e-3
"""Metres and radians of a step from which on the matrix of the pass before serves, too: it changes
by a part in a thousand, and the steps still end where the gradient does."""
_CHEAP = 5
"""Passes with such a matrix for each with one of its own: they take a fifth of the time."""
_MOST_TO_SEARCH = 3000
"""Unknowns among which the undetermined one is found by eigenvectors, in seconds; of more, the
first of its stop is named."""


class UnsettledError(GtvalError):
    """Readings contradict each other so much that no solution is reached."""


@dataclass(frozen=True)
class Adjustment:
    """The adjusted network.

    Parameters
    ----------
    network : Network
        What was adjusted.
    parameters : Parameters
        Estimates.
    cofactors : SplitCovariance
        Covariance of all u unknowns, in the order points, poses, rig.
    residual : (o,) array
        Standardised residuals (measured less computed, over sigma) of all observations, the n
        distances first.
    redundancy : (o,) array
        Share of each observation that the others check, 0 to 1; they add up to the degrees of
        freedom.
    weight : (n,) array
        Weights of the distances: 1, or less under the robust option.
    degrees_of_freedom : int
        Observations less unknowns.
    passes : int
        Passes of Gauss-Newton.
    jacobian : (o, u) sparse array
        Derivative of the computed observations over their sigma.
    """

    network: Network
    parameters: Parameters
    cofactors: SplitCovariance
    residual: Array
    redundancy: Array
    weight: Array
    degrees_of_freedom: int
    passes: int
    jacobian: csr_array

    @property
    def covariance(self) -> Array:
        """(u, u) covariance of all unknowns; grows with the square of the stops."""
        return self.cofactors.dense

    @property
    def chi_squared(self) -> float:
        """Sum of squared standardised residuals."""
        return float(self.residual @ self.residual)

    @property
    def m0(self) -> float:
        """Standard deviation of unit weight; near 1 if all stated sigmas hold."""
        return float(np.sqrt(self.chi_squared / max(self.degrees_of_freedom, 1)))

    def point_rows(self, names: Sequence[str]) -> Index:
        """Rows of the coordinates of named points among the unknowns."""
        place = {name: i for i, name in enumerate(self.network.points)}
        first = 2 * np.array([place[name] for name in names], dtype=np.intp)
        return (first[:, None] + np.arange(2)).ravel()

    def pose_rows(self, poses: Sequence[str]) -> Index:
        """Rows of x, y, theta of named poses among the unknowns."""
        place = {name: i for i, name in enumerate(self.network.poses)}
        first = 2 * len(self.network.points) + 3 * np.array(
            [place[name] for name in poses], dtype=np.intp
        )
        return (first[:, None] + np.arange(3)).ravel()


def adjust(network: Network, start: Parameters, *, robust: bool = False) -> Adjustment:
    """The least-squares solution of a network with its full covariance.

    Parameters
    ----------
    network : Network
        The problem.
    start : Parameters
        Approximate values, from the single solutions.
    robust : bool
        Weigh distances with large residuals down (Huber, by iterated reweighting).

    Raises
    ------
    GtvalError
        If something is not determined.
    UnsettledError
        If the iteration does not settle.

    Notes
    -----
    Gauss-Newton on a sparse design matrix, stops being eliminated each by itself. Residuals,
    redundancy numbers and covariance as in Ghilani, Adjustment Computations (2017), chapters 12
    and 21.
    """
    parameters, weight = start, np.ones(len(network.distance))
    passes, inverted, cofactors, settled = 0, 0, None, False
    while passes < _CHEAP * _PASSES:
        passes += 1
        residual, jacobian = design(network, parameters)
        scale = np.ones(len(residual))
        scale[: len(weight)] = np.sqrt(weight)
        if cofactors is None:
            inverted += 1
            cofactors = _inverted(network, start, jacobian, scale, inverted)
        step = cofactors.times(jacobian.T @ (scale**2 * residual))
        parameters = parameters.moved(step)
        previous = weight
        if robust:
            weight = _huber(design(network, parameters)[0][: len(weight)])
        size = np.abs(step).max()
        settled = bool(size < _STEP_TOLERANCE and np.abs(weight - previous).max(initial=0.0) < 1e-6)
        if settled or not np.isfinite(size) or inverted >= _PASSES * (3 if robust else 1):
            break
        if robust or size > _STEP_NEAR:
            cofactors = None
    if not settled:
        raise _unsettled(network, start)
    return _adjusted(network, parameters, weight, passes)


def _inverted(
    network: Network, start: Parameters, jacobian: csr_array, scale: Array, which: int
) -> SplitCovariance:
    """Inverse of the normal matrix of one pass.

    What is determined at the start and is not later has been thrown far away by wrong readings.
    """
    try:
        return _cofactors(jacobian, scale, network)
    except GtvalError:
        if which == 1:
            raise
        raise _unsettled(network, start) from None


def _unsettled(network: Network, start: Parameters) -> UnsettledError:
    return UnsettledError(
        "the joint adjustment does not settle: some readings are far off (wrong point names, "
        f"wrong labels, metres lost). The worst: {_worst_readings(network, start)}"
    )


def _worst_readings(network: Network, at: Parameters, most: int = 5) -> str:
    """The readings that fit the single solutions least, in words."""
    misfit = design(network, at)[0][: len(network.distance)] * network.sigma
    return "; ".join(
        f"{network.points[network.first[i]]}–{network.points[network.second[i]]}: "
        f"{network.distance[i]:.3f} m, off by {misfit[i]:+.3f} m"
        for i in np.argsort(-np.abs(misfit))[:most]
    )


def _adjusted(network: Network, parameters: Parameters, weight: Array, passes: int) -> Adjustment:
    """Covariance and reliability at the solution."""
    residual, jacobian = design(network, parameters)
    scale = np.ones(len(residual))
    scale[: len(weight)] = np.sqrt(weight)
    cofactors = _cofactors(jacobian, scale, network)
    leverage = cofactors.leverage(jacobian) * scale**2
    if (weight < 1).any():
        middle = csr_array(jacobian.multiply(scale[:, None] ** 2))
        cofactors = cofactors.between(csr_array(middle.T @ middle))
    heading = parameters.poses.copy()
    heading[:, 2] = wrap(heading[:, 2])
    return Adjustment(
        network=network,
        parameters=Parameters(parameters.points, heading, parameters.rig),
        cofactors=cofactors,
        residual=residual,
        redundancy=1 - leverage,
        weight=weight,
        degrees_of_freedom=len(residual) - jacobian.shape[1],
        passes=passes,
        jacobian=jacobian,
    )


def _cofactors(jacobian: csr_array, scale: Array, network: Network) -> SplitCovariance:
    """Inverse of the normal matrix."""
    weighted = csr_array(jacobian.multiply(scale[:, None]))
    size = np.asarray(weighted.power(2).sum(axis=0)).ravel()
    if (size == 0).any():
        raise GtvalError(
            f"the joint adjustment cannot determine {_unknown(network, int(size.argmin()))}"
        )
    p, f, k = network.sizes
    shared = np.repeat([True, False, True], [p, f, k])
    shared[(2 * network.mark[:, None] + np.arange(2)).ravel()] = False
    try:
        return split_inverse(weighted, shared)
    except NotDeterminedError as error:
        worst = error.columns[0]
        if len(size) < _MOST_TO_SEARCH:
            root = np.sqrt(size)
            normal = (weighted.T @ weighted).toarray() / np.outer(root, root)
            values, vectors = np.linalg.eigh(normal)
            worst = np.abs(vectors[:, values.argmin()]).argmax()
        raise GtvalError(
            f"the joint adjustment cannot determine {_unknown(network, int(worst))}: too few "
            "readings"
        ) from None


def _unknown(network: Network, row: int) -> str:
    """Name of an unknown for a message."""
    p, f, _ = network.sizes
    if row < p:
        return f"point {network.points[row // 2]}"
    if row < p + f:
        return f"pose {network.poses[(row - p) // 3]}"
    return f"rig point {network.rig_names[(row - p - f) // 2]}"


def _huber(residual: Array) -> Array:
    """Weights of standardised residuals."""
    return np.asarray(np.minimum(1.0, HUBER / np.maximum(np.abs(residual), 1e-12)))
