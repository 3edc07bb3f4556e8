"""The mount's stated uncertainty where the matches of a stop share the noise of its scan."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from data_samples.rooms.scanners import FULL_TURN, furnished_room, take_sweep
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.placing.anchors import edge_of
from laser_gt.placing.graph import Edge
from laser_gt.placing.mounts import MountCheck, mount_of
from laser_gt.placing.pairs import PairSettings, candidate_pairs
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose, inverse_covariance_of, wrapped
from validation.poses.factored import Factored

MOUNT = np.array([0.178, 0.1915, np.pi / 2])
SCAN = np.array([1e-3, 1e-3, 4e-4])
"""Noise of a scan as a pose of the laser, metres and radians."""
SURVEYS = (0.0003, 0.001, 0.003)
STOPS = 20


def _stops(rng, heading=np.pi):
    return np.column_stack([rng.uniform([1.5, 1.5, -heading], [6.5, 5.2, heading], (STOPS, 3))])


def _drawn(rng, own, heading=np.pi):
    """True poses, and edges of which a share of the noise is each edge's own."""
    poses = _stops(rng, heading)
    laser = compose(poses, np.broadcast_to(MOUNT, poses.shape))
    seen = compose(laser, rng.normal(0, 1, poses.shape) * SCAN * np.sqrt(1 - own))
    edges = []
    for i in range(STOPS):
        for j in range(i + 1, min(i + 4, STOPS)):
            pose = between(seen[i], seen[j])
            noise = np.diag(SCAN**2)
            covariance = noise + inverse_covariance_of(between(seen[j], seen[i]), noise)
            pose = pose + rng.multivariate_normal(np.zeros(3), own * covariance)
            edges.append(Edge(i, j, pose, covariance))
    return poses, edges


def _found(rng, poses, edges, sigma):
    """The mount by poses that are surveyed to a sigma, metres and radians."""
    covariance = np.diag([sigma, sigma, sigma]) ** 2
    surveyed = wrapped(poses + rng.normal(0, sigma, poses.shape))
    return mount_of(surveyed, Factored.alone(np.tile(covariance, (STOPS, 1, 1))), edges, MOUNT)


def _squared(rng, poses, edges, sigma):
    """Squared error of the mount in units of its covariance, over three."""
    found = _found(rng, poses, edges, sigma)
    off = wrapped(found.mount - MOUNT)
    return float(off @ np.linalg.solve(found.covariance, off)) / 3


@pytest.mark.parametrize("own", [0.05, 1.0])
@pytest.mark.parametrize("sigma", SURVEYS)
def test_the_mount_is_as_uncertain_as_it_is_off_however_good_the_survey(sigma, own):
    seeds = 12
    squared = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        squared.append(_squared(rng, *_drawn(rng, own), sigma))
    low, high = stats.chi2.ppf([0.0005, 0.9995], 3 * seeds) / (3 * seeds)
    assert low < np.mean(squared) < high


@pytest.mark.parametrize(("heading", "sigma", "tells"), [(0.17, 0.01, False), (1.6, 0.003, True)])
def test_a_check_says_how_wrong_a_mount_would_have_to_be_to_show(heading, sigma, tells):
    """Stops within ten degrees of each other, and up to half a turn apart."""
    seeds = 24
    shown, twice, right = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 9])
        found = _found(rng, *_drawn(rng, 0.5, heading), sigma)
        # as a tape measure has it, 5 mm off by as much
        tape = MountCheck(MOUNT + rng.normal(0, 0.005, 3), np.full(3, 0.005), found)
        assert tape.tells == tells
        right.append(tape.agrees)
        for factor, times in ((1, shown), (2, twice)):
            wrong = replace(tape, stated=tape.stated + factor * tape.least_shown * [1, 0, 0])
            times.append(not wrong.agrees)
    assert all(right)  # of 24 none by chance, at one in a thousand
    assert all(twice)
    # The place of the mount follows its angle, so that what is wrong in one number shows more.
    assert np.mean(shown) > 0.5 - 3 * np.sqrt(0.25 / seeds)


def _matched(seed):
    """True poses of stops in a furnished room, and the matches of their scans, 20 mm of noise."""
    rng = np.random.default_rng([seed, 77])
    room = furnished_room(rng)
    scanner = replace(FULL_TURN, sigma=0.02, mount=tuple(MOUNT))
    poses = _stops(rng)
    sweeps = [
        Prepared(take_sweep(room, [scanner], pose, rng, name=str(stop)))
        for stop, pose in enumerate(poses)
    ]
    laser = compose(poses, np.broadcast_to(MOUNT, poses.shape))
    limits = MatchSettings(guess_length=0.05, guess_angle=0.04)
    pairs = candidate_pairs(laser, [one.sweep for one in sweeps], PairSettings(most=5))
    matches = []
    for i, j in pairs.tolist():
        guess = between(laser[i], laser[j]) + rng.normal(0, [0.03, 0.03, 0.02])
        matches.append(match(sweeps[i], sweeps[j], guess, limits))
    where = {str(stop): stop for stop in range(STOPS)}
    return poses, [edge_of(where, one) for one in matches if one.used]


@pytest.mark.full
def test_so_it_is_with_matches_of_scans():
    seeds = 30
    drawn = [_matched(seed) for seed in range(seeds)]
    low, high = stats.chi2.ppf([0.0005, 0.9995], 3 * seeds) / (3 * seeds)
    for sigma in SURVEYS:
        squared = [
            _squared(np.random.default_rng([seed, 5]), *one, sigma)
            for seed, one in enumerate(drawn)
        ]
        assert low < np.mean(squared) < high
