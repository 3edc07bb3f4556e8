"""The covariance kept in blocks and a factor is the inverse of the normal matrix."""

import time

import numpy as np
import pytest
from scipy.sparse import csr_array
from sparse_rooms import sparse_room

from survey.estimation.least_squares.split_covariance import NotDeterminedError, split_inverse
from survey.estimation.solve import solve_survey


def design(rng, groups=(2, 3, 3, 1, 4), shared=5):
    """A design matrix whose groups of unknowns hang together only through the shared ones."""
    u = sum(groups) + shared
    rows = []
    column = shared
    for size in groups:
        own = rng.normal(size=(3 * size, u)) * 0.0
        own[:, column : column + size] = rng.normal(size=(3 * size, size))
        own[:, :shared] = rng.normal(size=(3 * size, shared))
        rows.append(own)
        column += size
    rows.append(np.eye(u)[:shared])
    order = rng.permutation(u)
    is_shared = np.arange(u) < shared
    return csr_array(np.concatenate(rows)[:, order]), is_shared[order]


@pytest.fixture(params=range(3))
def made(request):
    J, is_shared = design(np.random.default_rng(request.param))
    return J, split_inverse(J, is_shared), np.linalg.inv((J.T @ J).toarray())


def test_it_is_the_inverse_in_whole_and_in_parts(made):
    J, split, inverse = made
    assert np.allclose(split.dense, inverse, rtol=1e-9, atol=1e-12)
    assert np.allclose(split.variances, np.diagonal(inverse), rtol=1e-9)
    rows = np.array([3, 0, 7, 11])
    assert np.allclose(split.block(rows), inverse[np.ix_(rows, rows)], rtol=1e-9, atol=1e-12)
    groups = np.array([[1, 2], [5, 9], [12, 4]])
    wanted = [inverse[np.ix_(group, group)] for group in groups]
    assert np.allclose(split.blocks(groups), wanted, rtol=1e-9, atol=1e-12)
    right = np.arange(len(split), dtype=float)
    assert np.allclose(split.times(right), inverse @ right)
    leverage = np.einsum("ij,jk,ik->i", J.toarray(), inverse, J.toarray())
    assert np.allclose(split.leverage(J), leverage)


def test_between_and_less_are_what_they_say(made):
    J, split, inverse = made
    weights = np.random.default_rng(9).uniform(0.2, 1.0, J.shape[0])
    middle = csr_array(J.T @ J.multiply(weights[:, None]))
    wanted = inverse @ middle.toarray() @ inverse
    assert np.allclose(split.between(middle).dense, wanted, rtol=1e-8, atol=1e-12)
    along = split.times(J[[0]].toarray()[0])
    less = split.less(along, 2.5).dense
    assert np.allclose(less, inverse - np.outer(along, along) / 2.5, rtol=1e-9, atol=1e-12)


def test_what_is_not_determined_is_named():
    J, is_shared = design(np.random.default_rng(4))
    lost = int(np.flatnonzero(~is_shared)[3])
    whole = J.toarray()
    whole[:, lost] = 0.0
    with pytest.raises(NotDeterminedError) as told:
        split_inverse(csr_array(whole), is_shared)
    assert lost in told.value.columns


def solved(stops):
    """The processor time of a survey of so many stops, with all pairs read, and its solution."""
    room = sparse_room(1, stops=stops, marks=16, missing=0.0, rough="none")
    began = time.process_time()
    solution = solve_survey(room.vframe, room.rig, room.readings, room.world_names)
    table = solution.pose_table()
    return time.process_time() - began, solution, table


def test_many_stops_take_as_much_more_time_as_they_are_more():
    solved(20)  # what is loaded at first use
    few, _, _ = solved(60)
    many, solution, table = solved(240)
    # Four times the stops: linear is 4, quadratic 16; the machine may be busy.
    assert many < 9 * few
    assert table.joint is None
    rows = solution.adjustment.pose_rows(table.ids)
    whole = solution.adjustment.cofactors.block(rows)
    assert np.allclose(table.joint_covariance, whole, rtol=1e-6, atol=1e-12)


@pytest.mark.full
def test_five_hundred_stops_take_seconds():
    taken, solution, _ = solved(500)
    assert len(solution.used) > 24_000
    assert taken < 4.0
