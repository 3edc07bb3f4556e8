import numpy as np
import pytest
from scipy.optimize import least_squares
from surveys import case, simulated

from survey.estimation.adjustment import adjust
from survey.estimation.network import Parameters, build_network, design, start_parameters
from survey.estimation.solve import solve_survey
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.errors import GtvalError


def stacked(parameters):
    return np.concatenate(
        [parameters.points.ravel(), parameters.poses.ravel(), parameters.rig.ravel()]
    )


def test_design_matrix_is_that_of_finite_differences():
    adjustment = case(0, 2).solution.adjustment
    network, at = adjustment.network, adjustment.parameters
    rng = np.random.default_rng(1)
    # Away from the solution, where every term matters.
    at = at.moved(0.05 * rng.standard_normal(sum(network.sizes)))
    _, jacobian = design(network, at)
    step = 1e-6
    for column in rng.choice(sum(network.sizes), 60, replace=False):
        move = np.zeros(sum(network.sizes))
        move[column] = step
        ahead = design(network, at.moved(move))[0]
        back = design(network, at.moved(-move))[0]
        slope = -(ahead - back) / (2 * step)
        # Third derivatives 1e-12 over sigma 1e-3, and rounding 1e-16 / 1e-6 / 1e-6.
        assert jacobian[:, [column]].toarray().ravel() == pytest.approx(slope, abs=2e-3, rel=1e-5)


def test_the_solution_is_that_of_an_independent_solver():
    adjustment = case(0, 2).solution.adjustment
    network = adjustment.network
    p, f, _ = network.sizes

    def residuals(u):
        at = Parameters(
            u[:p].reshape(-1, 2), u[p : p + f].reshape(-1, 3), u[p + f :].reshape(-1, 2)
        )
        return design(network, at)[0]

    rng = np.random.default_rng(2)
    start = stacked(adjustment.parameters) + 0.02 * rng.standard_normal(sum(network.sizes))
    oracle = least_squares(residuals, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert stacked(adjustment.parameters) == pytest.approx(oracle.x, abs=1e-6)
    covariance = np.linalg.inv(oracle.jac.T @ oracle.jac)
    assert np.diag(adjustment.covariance) == pytest.approx(np.diag(covariance), rel=1e-4)


def test_redundancy_numbers_add_up_to_the_degrees_of_freedom():
    adjustment = case(0).solution.adjustment
    assert adjustment.redundancy.sum() == pytest.approx(adjustment.degrees_of_freedom)
    assert (adjustment.redundancy > -1e-9).all()
    assert (adjustment.redundancy < 1 + 1e-9).all()


def test_the_joint_adjustment_is_no_less_certain_than_single_poses():
    solved = case(0)
    _, joint, _ = solved.joint_errors()
    _, single = solved.single_errors()
    # Derivatives are taken at different estimates of the rig, millimetres on arms of 400 mm.
    assert (np.linalg.eigvalsh(single - joint) > -0.01 * np.abs(single).max()).all()


def test_poses_of_one_survey_are_correlated():
    table = case(0).solution.pose_table()
    sigma = np.sqrt(np.diag(table.joint))
    correlation = table.joint / np.outer(sigma, sigma)
    assert correlation[0, 3] > 0.1


def test_the_order_of_the_readings_does_not_matter():
    room, survey = simulated(3, 2)
    order = np.random.default_rng(0).permutation(len(survey.readings))
    a = solve_survey(room.vframe, survey.robot_frame, survey.readings, room.world_names)
    b = solve_survey(
        room.vframe, survey.robot_frame, survey.readings.select(order), room.world_names
    )
    one, two = a.pose_table(), b.pose_table()
    assert two.select(one.ids).poses == pytest.approx(one.poses, abs=1e-8)


def test_the_robust_option_shrugs_off_blunders():
    room, survey = simulated(4, 3, blunders=6, blunder_size=0.3)
    truth = survey.truth.poses
    off = {}
    for robust in (False, True):
        table = solve_survey(
            room.vframe, survey.robot_frame, survey.readings, room.world_names, robust=robust
        ).pose_table()
        off[robust] = np.abs(table.poses - truth.select(table.ids).poses)[:, :2].max()
    assert off[True] < off[False] / 2


def test_a_mistyped_side_of_the_rig_is_named():
    rig = RobotFrame(sides={"O-Q": 0.6})
    with pytest.raises(GtvalError, match="O-Q"):
        build_network(Vframe(), rig, Readings((), (), np.empty(0), 1.0), [], [])


def test_a_point_without_readings_is_named():
    vframe, rig = Vframe(), RobotFrame()
    network, _ = build_network(vframe, rig, Readings((), (), np.empty(0), 1.0), ["lost"], [])
    start = start_parameters(network, network.nominal, {"lost": np.array([3.0, 4.0])}, {})
    with pytest.raises(GtvalError, match="point lost"):
        adjust(network, start)
