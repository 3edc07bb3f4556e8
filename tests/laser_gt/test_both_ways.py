import numpy as np
from laser_rooms import error, pair_of, prepared

from data_samples.scanners import HALF_TURN
from laser_gt import both_ways as module
from laser_gt.both_ways import both_ways
from laser_gt.matching import align
from laser_gt.planar import inverse, inverse_covariance_of
from validation.angles import wrap


def _one_way(reference, moving, guess):
    found = align(reference, moving, guess)
    return found.pose[0], found.covariance[0]


def test_the_result_does_not_depend_on_which_sweep_is_the_reference():
    for seed in range(5):
        pair = pair_of(seed, scanner=HALF_TURN)
        one, other = (part.surface for part in prepared(pair))
        there, covariance = both_ways(one, other, *_one_way(one, other, pair.guess))
        back, back_covariance = both_ways(other, one, *_one_way(other, one, inverse(pair.guess)))
        # to the steps at which the iterations end, and the first order of the covariance
        assert np.abs(there - inverse(back)).max() < 1e-4
        turned = inverse_covariance_of(back, back_covariance)
        assert np.abs(turned - covariance).max() < 0.02 * np.abs(covariance).max()


def test_both_ways_are_no_worse_than_one_and_covered():
    one_way, two_way, nees = [], [], []
    for seed in range(120):
        pair = pair_of(seed, scanner=HALF_TURN, apart=0.3, turned=0.35)
        reference, moving = (part.surface for part in prepared(pair))
        first = _one_way(reference, moving, pair.guess)
        pose, covariance = both_ways(reference, moving, *first)
        one_way.append(error(first[0], pair.truth)[0])
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
    pose, covariance = _one_way(one, other, pair.guess)
    monkeypatch.setattr(module, "CONTRADICTION", 0.0)
    kept, wider = both_ways(one, other, pose, covariance)
    assert np.array_equal(kept, pose)
    assert np.linalg.eigvalsh(wider - covariance)[-1] > 0
    assert np.linalg.eigvalsh(wider - covariance)[0] > -1e-12


def test_a_way_that_determines_nothing_is_not_used():
    pair = pair_of(2)
    one, other = (part.surface for part in prepared(pair))
    pose = pair.truth.copy()
    kept, covariance = both_ways(one, other, pose, np.full((3, 3), np.inf))
    assert kept is pose
    assert np.isinf(covariance).all()
