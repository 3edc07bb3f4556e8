from dataclasses import replace

import numpy as np
from laser_rooms import error, pair_of, prepared

from data_samples.rooms.scanners import HALF_TURN
from laser_gt.matching import both_ways as module
from laser_gt.matching.both_ways import both_ways, independent_part
from laser_gt.matching.local import align, influence
from laser_gt.scans.planar import inverse, inverse_covariance_of
from validation.poses.angles import wrap


def test_the_result_does_not_depend_on_which_sweep_is_the_reference():
    for seed in range(5):
        pair = pair_of(seed, scanner=HALF_TURN)
        one, other = (part.surface for part in prepared(pair))
        there, covariance = both_ways(one, other, align(one, other, pair.guess))
        back, back_covariance = both_ways(other, one, align(other, one, inverse(pair.guess)))
        # to the steps at which the iterations end, and the first order of the covariance
        assert np.abs(there - inverse(back)).max() < 1e-4
        turned = inverse_covariance_of(back, back_covariance)
        assert np.abs(turned - covariance).max() < 0.02 * np.abs(covariance).max()


def test_both_ways_are_no_worse_than_one_and_covered():
    one_way, two_way, nees = [], [], []
    for seed in range(120):
        pair = pair_of(seed, scanner=HALF_TURN, apart=0.3, turned=0.35)
        reference, moving = (part.surface for part in prepared(pair))
        first = align(reference, moving, pair.guess)
        pose, covariance = both_ways(reference, moving, first)
        one_way.append(error(first.pose[0], pair.truth)[0])
        two_way.append(error(pose, pair.truth)[0])
        difference = pose - pair.truth
        difference[2] = wrap(difference[2])
        nees.append(difference @ np.linalg.solve(covariance, difference))
    assert np.sum(np.square(two_way)) < np.sum(np.square(one_way))
    # mean of 120 chi-squared values with 3 degrees of freedom: 3 +- 3 sqrt(6 / 120)
    assert 3 - 0.67 < np.mean(nees) < 3 + 0.67


def test_ways_that_contradict_each_other_leave_the_pose_and_widen_it(monkeypatch):
    pair = pair_of(2)
    one, other = (part.surface for part in prepared(pair))
    found = align(one, other, pair.guess)
    monkeypatch.setattr(module, "CONTRADICTION", 0.0)
    kept, wider = both_ways(one, other, found)
    assert np.array_equal(kept, found.pose[0])
    assert np.linalg.eigvalsh(wider - found.covariance[0])[-1] > 0
    assert np.linalg.eigvalsh(wider - found.covariance[0])[0] > -1e-12


def test_a_way_that_determines_nothing_is_not_used():
    pair = pair_of(2)
    one, other = (part.surface for part in prepared(pair))
    far = pair.truth + np.array([100.0, 0.0, 0.0])
    found = align(one, other, far)
    kept, covariance = both_ways(one, other, found)
    assert np.array_equal(kept, found.pose[0])
    assert np.isinf(covariance).all()


def test_the_covariance_of_one_way_is_what_the_noise_of_all_points_does_to_the_pose():
    pair = pair_of(3, scanner=HALF_TURN)
    reference, moving = (part.surface for part in prepared(pair))
    found = align(reference, moving, pair.guess)
    by = influence(reference, moving, found)
    covariance = by.covariance
    # The last step, below 0.02 mm, may pair a few of the hundreds of points otherwise.
    scale = np.sqrt(np.diagonal(covariance))
    assert np.abs((covariance - found.covariance[0]) / np.outer(scale, scale)).max() < 0.01


def test_the_influence_of_the_moving_points_is_how_the_pose_answers_to_them():
    """A pattern of shifts along the normals, against the match done again."""
    pair = pair_of(4, scanner=HALF_TURN)
    reference, moving = (part.surface for part in prepared(pair))
    found = align(reference, moving, pair.guess)
    at = found.pose[0]
    by = influence(reference, moving, found)
    shifts = 1e-3 * np.random.default_rng(0).normal(size=(40, len(moving)))
    shifted = [
        replace(moving, points=moving.points + shift[:, None] * moving.normals) for shift in shifts
    ]
    answer = np.array([align(reference, one, at).pose[0] - at for one in shifted])
    expected = shifts @ by.moving.T
    # Outlier weights and pairings change with the shifts, which first order leaves out.
    slope = (answer * expected).sum(0) / (expected**2).sum(0)
    left = (answer - slope * expected).std(0) / expected.std(0)
    assert (left < 0.5).all()
    assert (np.abs(slope - 1) < 4 * left / np.sqrt(len(shifts))).all()


def test_noise_that_no_points_share_is_what_is_left_of_all_of_it_and_never_negative():
    """In a real scan residuals were half of the noise that its neighbours share."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        left, shared = (part @ part.T for part in rng.normal(size=(2, 3, 6)))
        own = left + 2 * shared  # half of it at most is shared
        assert np.abs(independent_part(own, shared) - (own - shared)).max() < 1e-9
        assert np.linalg.eigvalsh(independent_part(0.5 * shared, shared))[0] > 0
