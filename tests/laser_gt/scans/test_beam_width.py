"""Where in its step a beam is answered: told from the scatter about a scan's own lines."""

import numpy as np
import pytest

from data_samples.rooms.scanners import HALF_TURN, cast, furnished_room
from laser_gt.matching.local import align
from laser_gt.scans.planar import between, wrapped
from laser_gt.scans.scan import Scan, sweep
from laser_gt.scans.surfaces import WITHIN_BEAM, surface

SIGMA = 0.01


def _surface(rng, room, pose, wide):
    """Lines of a scan whose beams are answered at their middle, or anywhere in their step."""
    angles = HALF_TURN.angles
    step = angles[1] - angles[0]
    fired = pose[2] + angles + wide * rng.uniform(-0.5, 0.5, len(angles)) * step
    beams = np.column_stack([np.cos(fired), np.sin(fired), np.zeros(len(fired))])
    met = cast(room, np.array([*pose[:2], 0.2]), beams).ranges
    return surface(sweep(Scan(met + rng.normal(0, SIGMA, len(met)), angles, 0.02, 30.0)))


def _pair(seed, wide):
    rng = np.random.default_rng([seed, 31])
    room = furnished_room(rng)
    first = np.array([*rng.uniform([2.2, 2.0], [5.8, 4.6]), rng.uniform(-np.pi, np.pi)])
    second = first + rng.uniform(-1, 1, 3) * [0.3, 0.3, 0.3]
    found = [_surface(rng, room, pose, wide) for pose in (first, second)]
    return *found, between(first, second)


def _share(found):
    """Noise within the beam that a surface has been given, of all that there may be."""
    return float(np.median(found.widths / (WITHIN_BEAM * found.ranges * np.deg2rad(0.5))))


def test_the_noise_within_the_beam_is_found_where_it_is():
    shares = {
        wide: [_share(one) for seed in range(10) for one in _pair(seed, wide)[:2]]
        for wide in (False, True)
    }
    assert np.median(shares[False]) < 0.25
    assert np.median(shares[True]) > 0.9


@pytest.mark.parametrize("wide", [False, True])
def test_matches_are_as_uncertain_as_they_are_off_with_and_without_it(wide):
    squared = []
    for seed in range(40):
        reference, moving, truth = _pair(seed, wide)
        found = align(reference, moving, truth + np.array([0.03, -0.02, 0.02]))
        off = wrapped(found.pose[0] - truth)
        squared.append(off @ np.linalg.solve(found.covariance[0], off))
    # 40 chi-squared values with 3 degrees of freedom have their mean to sqrt(6 / 40)
    assert 3 - 3 * np.sqrt(6 / 40) < np.mean(squared) < 3 + 3 * np.sqrt(6 / 40)
