"""Least squares over parameters and a frame that wanders slowly, by nodes along the path."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve_banded, cholesky_banded

from validation.poses.angles import Array

RIDGE = 1e-6
"""Information that each node's three numbers have by themselves, 1/m^2 and 1/rad^2: a standard
deviation of a kilometre, so that a node with nothing to hold it has a solution."""


@dataclass(frozen=True)
class Links:
    """What ties each node's frame to the next.

    Parameters
    ----------
    back : (k-1, 3, 3) array
        Change of the next frame's prediction with this frame.
    errors : (k-1, 3) array
        Next frame minus its prediction.
    variances : (k-1, 3) array
        Of the errors; infinite where two nodes are not tied.
    """

    back: Array
    errors: Array
    variances: Array


@dataclass(frozen=True)
class Solved:
    """One step of least squares.

    Parameters
    ----------
    change : (p,) array
        Of the parameters.
    node_changes : (k, 3) array
        Of the nodes' frames.
    information : (p, p) array
        Of the parameters, with all frames free; their priors are in it.
    gradient : (p,) array
        Half the gradient of the cost in the parameters, frames at their best.
    cost : float
        Sum of the weighted squares at the solution.
    determinant : float
        Log determinants that belong to the likelihood, but for those of the rows.
    """

    change: Array
    node_changes: Array
    information: Array
    gradient: Array
    cost: float
    determinant: float


def solve_chain(
    rows: Array,
    frames: Array,
    weights: Array,
    starts: npt.NDArray[np.intp],
    links: Links,
    prior: tuple[Array, Array],
) -> Solved:
    """Parameters and frames with the least weighted squares.

    Parameters
    ----------
    rows : (n, 3, p + 1) array
        Change of each row's three residuals with the parameters, and the residuals.
    frames : (n, 3, 3) array
        Change of the residuals with the frame of the row's node.
    weights : (n, 3, 3) array
        Inverse covariance of the residuals.
    starts : (k,) array of int
        First row of each node.
    links : Links
        Between neighbours.
    prior : tuple of (p,) arrays
        Information of each parameter by itself, and the parameter's distance from its prior mean.
    """
    chain = _assembled(rows, frames, weights, starts, links)
    p = rows.shape[2] - 1
    total = np.tensordot(rows, chain.weighted, axes=((0, 1), (0, 1)))
    solved = chain.solved
    reduced = total - chain.right.reshape(-1, p + 1).T @ solved.reshape(-1, p + 1)
    information = reduced[:p, :p] + np.diag(prior[0])
    gradient = reduced[:p, p] + prior[0] * prior[1]
    change = -np.linalg.solve(information, gradient)
    nodes = -(solved[:, :, p] + solved[:, :, :p] @ change)
    cost = reduced[p, p] + float(np.sum(chain.link_costs))
    cost += float(np.sum(prior[0] * prior[1] ** 2)) + float(gradient @ change)
    determinant = chain.determinant + float(np.linalg.slogdet(information)[1])
    return Solved(np.asarray(change), nodes, information, gradient, float(cost), determinant)


def block_equations(
    rows: Array,
    frames: Array,
    weights: Array,
    starts: npt.NDArray[np.intp],
    links: Links,
    blocks: npt.NDArray[np.intp],
) -> tuple[Array, Array]:
    """(b, p, p) information and (b, p) gradient of each block by itself.

    Parameters
    ----------
    rows, frames, weights, starts, links
        See `solve_chain`; no link may count between two blocks.
    blocks : (b,) array of int
        First node of each block.
    """
    chain = _assembled(rows, frames, weights, starts, links)
    p = rows.shape[2] - 1
    totals = np.add.reduceat(np.swapaxes(rows, 1, 2) @ chain.weighted, starts[blocks], axis=0)
    taken = np.swapaxes(chain.right, 1, 2) @ chain.solved
    reduced = totals - np.add.reduceat(taken, blocks, axis=0)
    return reduced[:, :p, :p], reduced[:, :p, p]


@dataclass(frozen=True)
class _Chain:
    """Normal equations of the nodes, solved for each parameter and for the residuals."""

    weighted: Array
    right: Array
    solved: Array
    link_costs: Array
    determinant: float


def _assembled(
    rows: Array, frames: Array, weights: Array, starts: npt.NDArray[np.intp], links: Links
) -> _Chain:
    p = rows.shape[2] - 1
    weighted = weights @ rows
    turned = np.swapaxes(frames, 1, 2)
    own = np.add.reduceat(turned @ weights @ frames, starts, axis=0)
    right = np.add.reduceat(turned @ weighted, starts, axis=0)
    inverse = 1 / links.variances
    scaled = inverse[:, :, None] * links.back
    own[:-1] += np.swapaxes(links.back, 1, 2) @ scaled
    own[1:] += inverse[:, :, None] * np.eye(3)
    own += RIDGE * np.eye(3)
    pulled = inverse * links.errors
    right[1:, :, p] += pulled
    right[:-1, :, p] -= np.einsum("kij,ki->kj", links.back, pulled)
    factor = cholesky_banded(_bands(own, -scaled), lower=True, check_finite=False)
    flat = right.reshape(-1, p + 1)
    solved = cho_solve_banded((factor, True), flat, check_finite=False).reshape(-1, 3, p + 1)
    determinant = 2 * float(np.log(factor[0]).sum())
    determinant += float(np.log(links.variances[np.isfinite(links.variances)]).sum())
    return _Chain(weighted, right, solved, pulled * links.errors, determinant)


def _bands(diagonal: Array, below: Array) -> Array:
    """Lower bands of a matrix of 3 x 3 blocks on and below the diagonal."""
    k = len(diagonal)
    bands = np.zeros((6, 3 * k))
    for i in range(3):
        for j in range(3):
            if i >= j:
                bands[i - j, j::3] = diagonal[:, i, j]
            bands[3 + i - j, j : 3 * (k - 1) : 3] = below[:, i, j]
    return bands
