from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from surveys import case

from survey.estimation.geometry import rotate
from survey.estimation.iterated_ekf import iterated_ekf
from survey.estimation.robot_frames import (
    full_model,
    pose_readings,
    refined,
    solve_robot_frames,
)
from survey.estimation.world_points import WorldPoint, WorldPoints
from survey.published.as_published import robot_frame_filter
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame

EXACT = RobotFrame(marking_sigma=1e-6)


def known_world(points, sigma=1e-6):
    located = tuple(
        WorldPoint(
            name, np.array(p, dtype=float), np.eye(2) * sigma**2, 0.0, 2, None, np.zeros((2, 8)), 1
        )
        for name, p in points.items()
    )
    return WorldPoints(located, np.eye(2 * len(located)) * sigma**2, ())


def exact_readings(pose, points, rig, pairs=None):
    start, end, distance = [], [], []
    for r, body in rig.points.items():
        mark = np.array(pose[:2]) + rotate(np.array(pose[2]), np.array(body))
        for name, p in points.items():
            if pairs is None or (r, name) in pairs:
                start.append(f"1/{r}")
                end.append(name)
                distance.append(np.linalg.norm(mark - p))
    return Readings(tuple(start), tuple(end), distance, 0.001)


ROOM = {"a": (5, 0), "b": (0, 5), "c": (-4, 1), "d": (1, -4), "e": (4, 4)}


@pytest.mark.parametrize("pose", [(0.3, 0.2, 0.1), (-2, 3, 3.1), (3.5, 3.0, -2.0)])
def test_exact_readings_give_the_exact_pose_without_a_guess(pose):
    found, missing = solve_robot_frames(
        ["1"], exact_readings(pose, ROOM, EXACT), known_world(ROOM), EXACT, {}
    )
    assert not missing
    assert found[0].state == pytest.approx(pose, abs=1e-6)
    assert found[0].redundancy == 12


def test_a_guess_half_a_metre_off_changes_nothing():
    pose = np.array([0.3, 0.2, 0.1])
    readings = exact_readings(pose, ROOM, EXACT)
    guess = {"1": pose + np.array([0.35, -0.35, 0.5])}
    found, _ = solve_robot_frames(["1"], readings, known_world(ROOM), EXACT, guess)
    assert found[0].state == pytest.approx(pose, abs=1e-6)


@pytest.mark.parametrize(
    ("pairs", "reason"),
    [
        ([("O", "a"), ("X", "b")], "2 usable"),
        ([("O", n) for n in ROOM], "one rig point"),
        ([(r, "a") for r in "OXY"], "one world point"),
    ],
)
def test_what_cannot_be_determined_is_said(pairs, reason):
    readings = exact_readings((0.3, 0.2, 0.1), ROOM, EXACT, pairs)
    found, missing = solve_robot_frames(["1"], readings, known_world(ROOM), EXACT, {})
    assert not found
    assert reason in missing[0].reason


def test_three_readings_that_fit_several_poses_are_an_ambiguity():
    pairs = [("O", "a"), ("X", "b"), ("Y", "c")]
    readings = exact_readings((0.3, 0.2, 0.1), ROOM, EXACT, pairs)
    found, missing = solve_robot_frames(["1"], readings, known_world(ROOM), EXACT, {})
    assert not found
    assert len(missing[0].candidates) > 1


def test_two_rig_points_and_world_points_on_a_line_leave_a_mirror_image():
    rig = RobotFrame(points={"O": (0, 0), "X": (0.6, 0)}, marking_sigma=1e-6)
    line = {"a": (-3, 0), "b": (0, 0), "c": (4, 0)}
    readings = exact_readings((1.0, 2.0, 0.4), line, rig)
    found, missing = solve_robot_frames(["1"], readings, known_world(line), rig, {})
    assert not found
    candidates = missing[0].candidates[np.argsort(missing[0].candidates[:, 1])]
    assert candidates == pytest.approx(np.array([[1, -2, -0.4], [1, 2, 0.4]]), abs=1e-5)


def test_the_documents_listing_with_variances_instead_of_sigmas_agrees():
    solved = case(0)
    for frame in solved.solution.frames:
        own = pose_readings(
            frame.pose,
            solved.simulated.readings,
            solved.solution.world,
            solved.simulated.robot_frame,
        )
        literal = robot_frame_filter(
            own.distance,
            own.known,
            own.body,
            frame.state + np.array([0.2, -0.2, 0.2]),
            variances=(float(own.sigma[0]) ** 2, 1e-12, 1e-12),
        )
        plain = least_squares(
            lambda s, own=own: (
                np.linalg.norm(own.known - s[:2] - rotate(s[2], own.body), axis=1) - own.distance
            ),
            frame.state,
            xtol=1e-14,
            ftol=1e-14,
        )
        # Both weigh all readings alike; relinearising after every reading moves 0.05 mm.
        assert literal.x == pytest.approx(plain.x, abs=1e-4)


def test_the_filter_is_generalised_least_squares_with_shared_errors():
    solved = case(1)
    world, rig = solved.solution.world, solved.simulated.robot_frame
    frame = solved.solution.frames[0]
    own = pose_readings(frame.pose, solved.simulated.readings, world, rig)
    m, w = len(own), len(world.points)
    root_w = np.linalg.cholesky(world.covariance)
    mark_sigma = np.hypot(rig.marking_sigma, rig.shape_sigma)

    def residuals(u):
        state, dw, dm = u[:3], u[3 : 3 + 2 * w], u[3 + 2 * w :]
        known = (world.positions + (root_w @ dw).reshape(-1, 2))[own.world_index]
        body = own.body + mark_sigma * dm.reshape(-1, 2)[own.rig_index]
        off = np.linalg.norm(known - state[:2] - rotate(state[2], body), axis=1) - own.distance
        return np.concatenate([off / own.sigma, dw, dm])

    u0 = np.concatenate([frame.state, np.zeros(2 * w + 6)])
    oracle = least_squares(residuals, u0, xtol=1e-14, ftol=1e-14)
    covariance = np.linalg.inv(oracle.jac.T @ oracle.jac)[:3, :3]
    sigma = np.sqrt(np.diag(covariance))
    # Errors as unknowns against errors in R: the same to first order in millimetres over metres.
    assert np.abs((frame.state - oracle.x[:3]) / sigma).max() < 0.02
    assert np.sqrt(np.diag(frame.covariance)) == pytest.approx(sigma, rel=0.01)
    assert m - 3 == frame.redundancy


def test_many_poses_at_once_are_each_what_the_filter_gives_alone():
    rng = np.random.default_rng(8)
    rig = RobotFrame()
    known = known_world(ROOM, sigma=2e-3)
    fits = []
    for k, pose in enumerate([(0.3, 0.2, 0.1), (-2.0, 3.0, 3.1), (1.0, 1.0, -2.0)]):
        exact = exact_readings(pose, ROOM, rig)
        noisy = replace(exact, distance=exact.distance + rng.normal(0, 2e-3, len(exact)))
        rows = rng.permutation(len(noisy))[: 15 - 3 * k]  # each with another number of them
        fits.append(pose_readings("1", noisy.select(np.sort(rows)), known, rig))
    starts = np.array([(0.3, 0.2, 0.1), (-2.0, 3.0, 3.1), (1.0, 1.0, -2.0)])
    together = refined(fits, starts, known, rig)
    for own, start, estimate in zip(fits, starts, together, strict=True):
        alone = iterated_ekf(full_model(own, known, rig), start, own.prior_sigma)
        assert estimate.state == pytest.approx(alone.state, abs=1e-9)
        # Covariances are those of the last pass, which moved the state by 1e-9 or less.
        assert estimate.covariance == pytest.approx(alone.covariance, rel=1e-6)
        assert estimate.cost == pytest.approx(alone.cost, rel=1e-6)
        assert estimate.converged
        assert estimate.passes == alone.passes
