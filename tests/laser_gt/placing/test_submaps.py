"""Stops of half-turn scanners that look different ways, joined by their neighbours' scans."""

from dataclasses import replace

import numpy as np
import pytest

from data_samples.rooms.scanners import FULL_TURN, HALF_TURN, furnished_room, take_sweep
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.placing.anchors import edge_of
from laser_gt.placing.engines import EngineSettings, match_pairs
from laser_gt.placing.submaps import matched_as_submaps, sees_half
from laser_gt.placing.switches import graph_of
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, wrapped

SIGMAS = (0.15, 0.1)


def _two_views(seed):
    """True poses of three stops that look one way and three that look back, and their sweeps."""
    rng = np.random.default_rng([seed, 3])
    room = furnished_room(rng)
    heading, back = rng.uniform(-np.pi, np.pi), np.deg2rad(rng.uniform(140, 180))
    places = rng.uniform([2.2, 2.2], [5.8, 4.8], (2, 2)).repeat(3, 0)
    turns = heading + back * np.array([0, 0, 0, 1, 1, 1]) + np.deg2rad([-35, 0, 35] * 2)
    poses = wrapped(np.column_stack([places + rng.uniform(-0.3, 0.3, (6, 2)), turns]))
    scanner = replace(HALF_TURN, sigma=0.01)
    sweeps = [
        Prepared(take_sweep(room, [scanner], pose, rng, name=str(stop)))
        for stop, pose in enumerate(poses)
    ]
    return rng, poses, sweeps


def _joined(seed):
    """Matches of the middle stops: alone, and as submaps; None where the others join them."""
    rng, poses, sweeps = _two_views(seed)
    settings = MatchSettings(guess_length=SIGMAS[0], guess_angle=SIGMAS[1])
    matches = []
    for i, j in ((0, 1), (1, 2), (3, 4), (4, 5)):
        guess = between(poses[i], poses[j]) + rng.normal(0, [0.05, 0.05, 0.03])
        matches.append(match(sweeps[i], sweeps[j], guess, settings))
    where = {str(stop): stop for stop in range(6)}
    part = graph_of(poses, [edge_of(where, one) for one in matches if one.used], SIGMAS)
    truth = between(poses[1], poses[4])
    guess = truth + rng.normal(0, [0.15, 0.15, 0.1])
    alone = match(sweeps[1], sweeps[4], guess, settings)
    return truth, alone, matched_as_submaps(sweeps, part, (1, 4), guess, settings)


@pytest.mark.parametrize("seeds", [range(10), pytest.param(range(60), marks=pytest.mark.full)])
def test_submaps_join_what_single_scans_do_not_and_are_as_good_as_they_say(seeds):
    off, squared, used = [], [], []
    for seed in seeds:
        truth, alone, together = _joined(seed)
        used.append((alone.verdict == "accepted", together is not None and together.used))
        if together is not None and together.used:
            error = wrapped(together.pose - truth)
            off.append((np.hypot(*wrapped(alone.pose - truth)[:2]), np.hypot(*error[:2])))
            squared.append(error @ np.linalg.solve(together.covariance, error) / 3)
    alone, together = np.sum(used, axis=0)
    assert together >= alone + 0.4 * len(seeds)
    before, after = np.median(off, axis=0)
    assert after < 0.005 < before
    # right covariances have 16.3 / 3 in one of a thousand
    assert np.mean(squared) < 1.6
    assert max(squared) < 16.3 / 3


def test_the_engine_takes_submaps_only_where_matches_leave_stops_apart():
    _, poses, sweeps = _two_views(2)
    pairs = np.array([(0, 1), (1, 2), (3, 4), (4, 5), (1, 4)])
    settings = EngineSettings(SIGMAS)
    found = match_pairs(sweeps, poses, pairs, {}, settings, "scanmatch", lambda _what, _share: None)
    told = [any("as submaps of" in text for text in one.reasons) for one in found.matches]
    assert told == [False, False, False, False, True]
    assert found.matches[4].used


def test_only_scans_of_half_a_turn_or_less_are_merged():
    rng = np.random.default_rng(1)
    room = furnished_room(rng)
    assert sees_half(take_sweep(room, [HALF_TURN], [4, 3, 0], rng))
    assert not sees_half(take_sweep(room, [FULL_TURN], [4, 3, 0], rng))
    back = replace(HALF_TURN, mount=(0.0, 0.0, np.pi))
    assert not sees_half(take_sweep(room, [HALF_TURN, back], [4, 3, 0], rng))
