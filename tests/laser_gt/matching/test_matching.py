import numpy as np
import pytest
from laser_rooms import error, pair_of, prepared
from scipy.spatial import cKDTree
from trials.scan_pairs import draw_pair

from data_samples.rooms.scanners import FULL_TURN, HALF_TURN
from laser_gt.matching.local import align
from laser_gt.scans.nearest import NearestGrid


def _many(scanner, count, **settings):
    errors, nees = [], []
    for seed in range(count):
        pair = pair_of(seed, scanner=scanner, apart=0.3, turned=0.35, **settings)
        reference, moving = prepared(pair)
        found = align(reference.surface, moving.surface, pair.guess)
        difference = found.pose[0] - pair.truth
        errors.append(error(found.pose[0], pair.truth)[0])
        nees.append(difference @ np.linalg.solve(found.covariance[0], difference))
    return np.array(errors), np.array(nees)


@pytest.mark.parametrize(("scanner", "limit"), [(FULL_TURN, 0.0011), (HALF_TURN, 0.0019)])
def test_the_median_error_is_below_that_of_plicp_and_covered(scanner, limit):
    errors, nees = _many(scanner, 120)
    assert np.median(errors) < limit
    # mean of 120 chi-squared values with 3 degrees of freedom: 3 +- 3 sqrt(6 / 120)
    assert 3 - 0.67 < nees.mean() < 3 + 0.67


def test_the_same_scan_twice_gives_the_identity():
    pair = pair_of(3)
    reference, _ = prepared(pair)
    found = align(reference.surface, reference.surface, [0.05, -0.04, 0.03])
    # a point may be paired with the line of a neighbour in its cell: small against its deviation
    assert (np.abs(found.pose[0]) < 0.6 * np.sqrt(np.diag(found.covariance[0]))).all()


def test_many_starts_at_once_give_what_each_gives_alone():
    pair = pair_of(4)
    reference, moving = prepared(pair)
    starts = pair.truth + np.random.default_rng(0).normal(0, 0.03, (5, 3))
    together = align(reference.surface, moving.surface, starts)
    for row, start in enumerate(starts):
        alone = align(reference.surface, moving.surface, start)
        assert np.allclose(alone.pose[0], together.pose[row], atol=1e-4)


def test_the_table_finds_the_nearest_point_to_within_a_cell():
    rng = np.random.default_rng(1)
    points = rng.uniform(-3, 3, (300, 2))
    asked = rng.uniform(-3, 3, (1000, 2))
    grid = NearestGrid(points)
    found = np.sqrt(grid.squared_distance(asked[:, 0], asked[:, 1]))
    exact, _ = cKDTree(points).query(asked)
    assert (found >= exact - 1e-12).all()
    # label and query are each up to half a cell diagonal off; the transform is a 5x5 mask's
    assert (found - exact).max() < 2 * grid.cell * np.sqrt(2) + 0.03 * exact.max()


def test_the_simulated_pair_is_reproducible():
    one, two = (draw_pair(np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(one.moving.points, two.moving.points)
