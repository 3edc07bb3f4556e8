"""The covariance kept in blocks and a factor is the inverse of the normal matrix."""

import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from sparse_rooms import sparse_room

from survey.causes.diagnosis import diagnose
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


def test_nothing_of_the_square_of_the_stops_is_allocated():
    room = sparse_room(1, stops=150, marks=16, missing=0.5, rough="none")
    distance = room.readings.distance.copy()
    distance[[700, 1100, 1500]] += [0.3, -0.2, 0.1]
    readings = replace(room.readings, distance=distance)
    tracemalloc.start()
    solution = solve_survey(room.vframe, room.rig, readings, room.world_names)
    diagnosis = diagnose(solution, room.vframe, room.rig, readings)
    assert solution.pose_table().joint is None
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert {int(r) for r in diagnosis.rest.ranking.best.what.rows} == {700, 1100, 1500}
    # It is 18 MB; the square of 1,440 unknowns has 17 MB, that of 3,600 readings 100 MB.
    assert peak < 28e6


PEAK = {500: (4.0, 400e3), 2000: (30.0, 1e6)}
"""Seconds of processor time and kilobytes of memory by the number of stops."""


@pytest.mark.full
@pytest.mark.parametrize("stops", PEAK)
def test_a_large_survey_takes_seconds_and_little_memory(stops, tmp_path):
    folder = tmp_path / "campaign"
    gtval = str(Path(sys.executable).with_name("gtval"))
    run = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=-3); "
    run += "u = resource.getrusage(resource.RUSAGE_CHILDREN); "
    run += "print(u.ru_utime + u.ru_stime, u.ru_maxrss)"

    def taken(*command):
        told = subprocess.run(
            [sys.executable, "-c", run, *command], check=True, capture_output=True, text=True
        )
        return [float(word) for word in told.stdout.split()]

    taken(gtval, "simulate", str(folder), "--stops", str(stops), "--seed", "1")
    libraries, _ = taken(sys.executable, "-c", "import numpy, pydantic, scipy.sparse.linalg")
    seconds, kilobytes = taken(gtval, "survey", str(folder))
    most, memory = PEAK[stops]
    # A machine on which the libraries take more than half a second is slow, or busy.
    assert seconds < most * max(libraries / 0.5, 1.0)
    assert kilobytes < memory
    results = sum(path.stat().st_size for path in (folder / "results").rglob("*.*"))
    assert results < 20e6
