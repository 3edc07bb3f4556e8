"""The joint adjustment beside dense least squares of its own equations and derivatives."""

import numpy as np
import pytest
from sparse_rooms import oracle, pose_error, sparse_room

from survey.estimation.solve import solve_survey


def agrees(seed, **room_kind):
    """A room solved by both; what differs most in millimetres, in sigmas, and in w."""
    room = sparse_room(seed, rough="none", **room_kind)
    solution = solve_survey(room.vframe, room.rig, room.readings, room.world_names)
    assert len(solution.used) == len(room.readings)
    dense, adjustment, table = oracle(room), solution.adjustment, solution.pose_table()
    names = adjustment.network.points
    places = np.array([dense.places[name] for name in names])
    off = 1e3 * np.abs(adjustment.parameters.points - places)
    poses = np.array([dense.poses[name] for name in table.ids])
    # 1 m away a milliradian is a millimetre.
    off_pose = 1e3 * np.abs(pose_error(table.poses, poses))
    variance = adjustment.cofactors.variances
    sigma = np.sqrt(variance[: 2 * len(names)]).reshape(-1, 2)
    ratio = sigma / np.array([dense.place_sigma[name] for name in names])
    own = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))
    ratio_pose = own / np.array([dense.sigma[name] for name in table.ids])
    assert adjustment.m0 == pytest.approx(np.sqrt(dense.cost / dense.freedom), rel=1e-5)
    assert adjustment.degrees_of_freedom == dense.freedom
    return (
        max(off.max(), off_pose.max()),
        max(np.abs(ratio - 1).max(), np.abs(ratio_pose - 1).max()),
        np.nanmax(np.abs(solution.reliability.w - dense.w)),
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_places_sigmas_and_test_values_are_those_of_dense_least_squares(seed):
    millimetres, sigmas, w = agrees(seed, stops=5, marks=12, missing=0.4)
    assert millimetres < 0.01
    assert sigmas < 0.01
    assert w < 0.01


@pytest.mark.full
@pytest.mark.parametrize("seed", range(20, 40))
def test_they_are_in_rooms_of_many_kinds(seed):
    millimetres, sigmas, w = agrees(seed, repeat=1 + seed % 2)
    assert millimetres < 0.01
    assert sigmas < 0.01
    assert w < 0.01
