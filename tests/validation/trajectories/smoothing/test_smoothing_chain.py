"""The chain's equations against dense matrices, a smoother of filterpy, and counted coverage."""

import numpy as np
import pytest
from filterpy.common import Q_discrete_white_noise  # noqa: F401  (the peer must be there)
from filterpy.kalman import KalmanFilter
from fusion_drives import drive, score
from scipy.linalg import block_diag

from validation.errors import GtvalError
from validation.poses.trajectory import Trajectory
from validation.trajectories.smoothing.asked import at_times
from validation.trajectories.smoothing.chain import Band
from validation.trajectories.smoothing.equations import Weights, solve
from validation.trajectories.smoothing.fusion import fuse
from validation.trajectories.smoothing.gathering import gathered, stamped
from validation.trajectories.smoothing.geometry import advance, difference, step_jacobians
from validation.trajectories.smoothing.problem import State, residuals
from validation.trajectories.smoothing.source import Source


def brownian(times, strength):
    """Covariance of position and rate of white noise on acceleration, started far and fast."""
    T = np.minimum.outer(times, times)
    S = np.maximum.outer(times, times)
    position = strength * (T**2 * S / 2 - T**3 / 6)
    crossed = np.empty((len(times), len(times)))
    for i, a in enumerate(times):
        for j, b in enumerate(times):
            u = min(a, b)
            crossed[i, j] = strength * (a * u - u**2 / 2)
    return position, crossed, strength * T


def linear_problem(rng, n=12, strength=0.3, sigma=0.02):
    times = np.cumsum(rng.uniform(0.05, 0.3, n))
    seen = np.cumsum(rng.normal(0, 0.1, (n, 2)), axis=0)
    source = Source(Trajectory("one", times, seen, "points_plane"))
    problem = gathered([source], [stamped(source, 0, smooth=False)], None)
    state = State(seen * 0, seen * 0, np.zeros(0))
    found = residuals(problem, state)
    W = np.broadcast_to(np.eye(2) / sigma**2, (n, 2, 2))
    weights = Weights(W, np.full(2, strength), None)
    solved = solve(problem, found, weights, state.shared)
    return times, seen, problem, state.moved(problem.kind, solved.changes, solved.shared), solved


def test_the_chain_is_dense_conditioning(monkeypatch):
    # So wide that the smoother, and so narrow that the dense matrices, keep their digits.
    monkeypatch.setattr("validation.trajectories.smoothing.equations.FAR", 3.0)
    monkeypatch.setattr("validation.trajectories.smoothing.equations.FAST", 1.0)
    rng = np.random.default_rng(1)
    n, strength, sigma = 12, 0.3, 0.02
    times, seen, problem, state, solved = linear_problem(rng, n, strength, sigma)
    asked = np.sort(rng.uniform(times[0], times[-1], 20))
    together = np.concatenate([times, asked]) - times[0]
    position, _, _ = brownian(together, strength)
    prior = position + 3.0**2 + 1.0**2 * np.outer(together, together)
    K, k = prior[:n, :n] + sigma**2 * np.eye(n), prior[n:, :n]
    mean = k @ np.linalg.solve(K, seen)
    variance = np.diag(prior[n:, n:] - k @ np.linalg.solve(K, k.T))
    poses, _, covariances = at_times(problem, state, solved, np.full(2, strength), asked)
    assert np.abs(poses - mean).max() < 1e-9
    assert np.abs(covariances[:, 0, 0] - variance).max() < 1e-9


def test_marginals_and_solution_are_those_of_the_inverse():
    rng = np.random.default_rng(2)
    n, b = 9, 4
    root = np.zeros((n * b, n * b))
    for k in range(n):
        root[k * b : (k + 1) * b, k * b : (k + 1) * b] = rng.normal(size=(b, b)) + 3 * np.eye(b)
        if k:
            root[k * b : (k + 1) * b, (k - 1) * b : k * b] = rng.normal(size=(b, b))
    A = root @ root.T
    block = lambda i, j: A[i * b : (i + 1) * b, j * b : (j + 1) * b]  # noqa: E731
    band = Band(n, b)
    below = [block(k + 1, k) for k in range(n - 1)] + [np.zeros((b, b))]
    band.fill(0, np.array([block(k, k) for k in range(n)]), np.array(below))
    factor = band.factor()
    inverse = np.linalg.inv(A)
    right = rng.normal(size=(n * b, 3))
    assert np.allclose(factor.solve(right), inverse @ right, atol=1e-9, rtol=0)
    assert factor.log_determinant == pytest.approx(np.linalg.slogdet(A)[1], abs=1e-9)
    _, own, beside = next(factor.covariances())
    for k in range(n):
        assert np.allclose(own[k], inverse[k * b : (k + 1) * b, k * b : (k + 1) * b], atol=1e-9)
        if k + 1 < n:
            expected = inverse[k * b : (k + 1) * b, (k + 1) * b : (k + 2) * b]
            assert np.allclose(beside[k], expected, atol=1e-9)


def test_a_filter_and_smoother_of_filterpy_agree():
    rng = np.random.default_rng(3)
    strength, sigma = 0.3, 0.02
    times, seen, _, state, solved = linear_problem(rng, 30, strength, sigma)
    peer = KalmanFilter(dim_x=2, dim_z=1)
    peer.x, peer.P = np.zeros((2, 1)), np.diag([1e8, 1e4])
    peer.H, peer.R = np.array([[1.0, 0.0]]), np.array([[sigma**2]])
    means, covariances, moves, noises = [], [], [], []
    for k, step in enumerate(np.diff(times, prepend=times[0])):
        F = np.array([[1.0, step], [0.0, 1.0]])
        Q = strength * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
        peer.predict(F=F, Q=Q)
        peer.update(seen[k, 0])
        means.append(peer.x.copy())
        covariances.append(peer.P.copy())
        moves.append(F)
        noises.append(Q)
    smooth, spread, _, _ = peer.rts_smoother(
        np.array(means), np.array(covariances), np.array(moves), np.array(noises)
    )
    _, inverse, _ = next(solved.factor.covariances())
    # The filter subtracts 1e8 from 1e8 at its first sample: eight digits remain.
    assert np.abs(smooth[:, 0, 0] - state.poses[:, 0]).max() < 1e-6
    assert np.abs(smooth[:, 1, 0] - state.rates[:, 0]).max() < 1e-5
    assert np.abs(spread[:, 0, 0] - inverse[:-1, 0, 0]).max() < 1e-7


def test_jacobians_of_a_step_in_space_are_those_of_small_changes():
    rng = np.random.default_rng(4)
    start = np.concatenate([rng.normal(size=3), rng.normal(size=4)])[None]
    start[:, 3:] /= np.linalg.norm(start[:, 3:])
    motion = np.array([[0.1, 0.2, -0.1, 0.05, -0.1, 0.08]])
    end = advance("space", start, motion)
    ends, starts = step_jacobians("space", difference("space", end, start))
    for place in range(6):
        small = np.zeros((1, 6))
        small[0, place] = 1e-6
        by_end = difference("space", advance("space", end, small), start) - motion
        by_start = difference("space", end, advance("space", start, small)) - motion
        # The fourth order of an angle of 0.14 rad is left out: 0.14^4 / 720.
        assert np.abs(by_end / 1e-6 - ends[:, :, place]).max() < 1e-5
        assert np.abs(by_start / 1e-6 - starts[:, :, place]).max() < 1e-5


def test_a_chain_without_enough_data_is_told():
    with pytest.raises(GtvalError, match="do not determine"):
        Band(3, 2).factor()


def test_positions_in_space_are_smoothed():
    rng = np.random.default_rng(6)
    times = np.arange(0, 60, 0.05)
    truth = np.column_stack([np.sin(times / 3), np.cos(times / 4), 0.1 * np.sin(times)])
    seen = truth + rng.normal(0, 0.01, truth.shape)
    fused = fuse([Source(Trajectory("points", times, seen, "points_space"))])
    error = fused.trajectory.poses - truth
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fused.trajectory.covariances), error)
    assert fused.noise[0].position == pytest.approx(0.01, rel=0.1)
    assert np.sqrt((error**2).mean()) < 0.006
    assert 2.0 < nees.mean() < 4.2


def test_poses_in_space_are_those_in_the_plane_where_the_motion_is():
    made = drive(11, 1, seconds=60.0, cameras=2)
    rng = np.random.default_rng(7)
    sources = []
    for source in made.sources:
        own = source.trajectory
        n = len(own)
        half = own.poses[:, 2] / 2
        poses = np.zeros((n, 7))
        poses[:, :2], poses[:, 5], poses[:, 6] = own.positions, np.sin(half), np.cos(half)
        noise = rng.normal(0, 1, (n, 6)) * [0, 0, 0.008, 0.005, 0.005, 0]
        poses = advance("space", poses, noise)
        sources.append(Source(Trajectory(own.system, own.times, poses, "space"), *_clock(source)))
    plane, space = fuse(made.sources), fuse(sources)
    inside = plane.supported & space.supported
    apart = (space.trajectory.planar().poses - plane.trajectory.poses)[inside]
    apart[:, 2] = (apart[:, 2] + np.pi) % (2 * np.pi) - np.pi
    # Both see the same noise in x, y and heading; noise and weights are estimated apart.
    assert np.sqrt((apart[:, :2] ** 2).mean()) < 0.002
    assert np.sqrt((apart[:, 2] ** 2).mean()) < 0.002


def _clock(source):
    return (
        source.delay_s,
        source.delay_sigma_s,
        source.drift_ppm,
        source.drift_sigma_ppm,
        source.at_s,
    )


def test_fused_at_times_asked_for():
    made = drive(12, 0, seconds=60.0, cameras=2)
    times = np.arange(5.0, 55.0, 0.037)
    fused = fuse(made.sources, times=times)
    assert (fused.trajectory.times == times).all()
    rms, nees, share = score(made, fused)
    assert rms < 3.5
    assert 1.5 < nees < 4.5
    assert share > 0.5


def test_block_diag_is_what_the_prior_starts_from():
    from validation.trajectories.smoothing.prior import information, log_determinants

    steps, strengths = np.array([0.1, 0.3]), np.array([0.2, 0.5, 0.7])
    for step, inverse in zip(steps, information(steps, strengths), strict=True):
        one = np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
        together = block_diag(*[q * one for q in strengths])
        order = [0, 2, 4, 1, 3, 5]
        assert np.allclose(inverse @ together[np.ix_(order, order)], np.eye(6), atol=1e-9)
    dense = [np.linalg.slogdet(np.linalg.inv(one))[1] for one in information(steps, strengths)]
    assert log_determinants(steps, strengths) == pytest.approx(sum(dense), abs=1e-9)
