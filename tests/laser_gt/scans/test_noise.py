"""A scanner's noise from scans laid over each other, in its independent and its shared part."""

from dataclasses import replace

import numpy as np
import pytest
from trials.scan_pairs import draw_pair

from data_samples.rooms.scanners import FULL_TURN
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.local import align, residuals
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.noise import RangeNoise, noise_from, smeared, type_limits
from laser_gt.scans.scan import Scan, Sweep

LIMITS = MatchSettings(guess_length=0.06, guess_angle=0.06)


def _shared(rng, count, sigma, beams):
    """Errors of the stated deviation whose correlation falls as exp(-beams)."""
    errors = rng.normal(0, 1, count)
    keep = np.exp(-1 / beams)
    for at in range(1, count):
        errors[at] = keep * errors[at - 1] + np.sqrt(1 - keep**2) * errors[at]
    return sigma * errors


def _sweep(sweep, rng, shared, beams):
    """The sweep with shared errors; nothing is known of its noise."""
    (view,) = sweep.views
    old = view.scan
    ranges = old.ranges + _shared(rng, len(old), shared, beams)
    scan = Scan(ranges, old.angles, old.range_min, old.range_max)
    return Sweep((replace(view, scan=scan),))


def _pair(seed, sigma, shared, beams):
    rng = np.random.default_rng(seed)
    pair = draw_pair(rng, "room", FULL_TURN, sigma=sigma, apart=0.5, turned=0.4, guess_length=0.05)
    return pair, [_sweep(one, rng, shared, beams) for one in (pair.reference, pair.moving)]


def _found(sigma, shared, beams, pairs=6):
    off = []
    for seed in range(pairs):
        pair, both = _pair(9000 + seed, sigma, shared, beams)
        reference, moving = (Prepared(one).surface for one in both)
        pose = align(reference, moving, pair.guess).pose[0]
        off.append(residuals(reference, moving, pose))
    return noise_from(off, (0.001, 0.05))


@pytest.mark.parametrize(
    ("sigma", "shared", "beams"), [(0.003, 0.002, 10), (0.003, 0.005, 8), (0.01, 0.005, 8)]
)
def test_both_parts_are_told_from_each_other(sigma, shared, beams):
    found = _found(sigma, shared, beams)
    assert found.independent == pytest.approx(sigma, rel=0.25)
    # What a pose sees is the variance times the length; both trade against each other. Six pairs
    # have some 70 independent stretches each: to 7 %, and the lines of the other scan take up some.
    assert found.shared**2 * found.length == pytest.approx(shared**2 * beams, rel=0.5)


def test_of_independent_noise_hardly_any_is_taken_for_shared():
    found = _found(0.01, 0.0, 1.0)
    assert found.independent == pytest.approx(0.01, rel=0.1)
    assert found.shared < 0.003


def _nees(sigma, shared, beams, known):
    """Mean normalised squared error of matches whose scans know their noise."""
    values = []
    for seed in range(24):
        pair, both = _pair(5000 + seed, sigma, shared, beams)
        ready = [Prepared(_knowing(one, known)) for one in both]
        found = match(*ready, pair.guess, LIMITS)
        off = found.pose - pair.truth
        values.append(off @ np.linalg.solve(found.covariance, off) / 3)
    return np.mean(values)


def _knowing(sweep, noise):
    (view,) = sweep.views
    facts = {"sigma": noise.total, "shared_sigma": noise.shared, "shared_beams": noise.length}
    return Sweep((replace(view, scan=replace(view.scan, **facts)),))


def test_matches_of_scans_with_shared_errors_state_what_they_are_off_by():
    noise = RangeNoise(0.003, 0.005, 8.0)
    # 24 times 3 degrees of freedom: 99.9 % of right ones lie in 0.53 to 1.63
    assert 0.53 < _nees(0.003, 0.005, 8.0, noise) < 1.63
    # taken for independent, the same errors are ten times what is stated
    assert _nees(0.003, 0.005, 8.0, RangeNoise(noise.total)) > 3


def test_limits_are_those_of_the_scanners_type():
    beams = np.linspace(-2, 2, 400)
    small = Scan(np.full(400, 2.0), beams, range_max=5.6)
    large = Scan(np.full(400, 2.0), beams, range_max=30.0)
    stated = Scan(np.full(400, 2.0), beams, range_max=30.0, sigma=0.01)
    assert type_limits(small) == (0.005, 0.03)
    assert type_limits(large) == (0.001, 0.05)
    assert type_limits(stated) == (0.005, 0.02)
    assert noise_from([], (0.001, 0.05)) is None


def test_smearing_is_the_product_with_the_matrix_of_correlations():
    values = np.random.default_rng(1).normal(0, 1, (3, 50))
    apart = np.abs(np.subtract.outer(np.arange(50), np.arange(50)))
    correlations = np.where(apart <= 12, np.exp(-apart / 3.0), 0.0)
    assert np.allclose(smeared(values, 3.0), values @ correlations)
