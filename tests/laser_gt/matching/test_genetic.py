import numpy as np
from laser_rooms import error, pair_of, prepared
from scipy.spatial import cKDTree

from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.scans.planar import transform


def test_seeded_with_odometry_it_finds_the_pose_to_a_millimetre():
    errors = []
    for seed in range(12):
        pair = pair_of(seed)
        found = genetic_match(*prepared(pair), np.random.default_rng(seed), [pair.guess])
        errors.append(error(found.pose, pair.truth)[0])
    assert np.median(errors) < 0.002


def test_without_any_guess_it_finds_the_place_in_the_room():
    right = 0
    for seed in range(20):
        pair = pair_of(100 + seed, turned=np.pi)
        found = genetic_match(*prepared(pair), np.random.default_rng(seed))
        right += error(found.pose, pair.truth)[0] < 0.05
    assert right >= 19


def test_the_same_seed_gives_the_same_pose_and_fitness_never_gets_worse():
    pair = pair_of(5)
    one, two = (
        genetic_match(*prepared(pair), np.random.default_rng(9), [pair.guess]) for _ in range(2)
    )
    assert np.array_equal(one.pose, two.pose)
    assert (np.diff(one.convergence) <= 0).all()
    assert len(one.convergence) == 301


def test_the_published_fitness_is_the_sum_of_squares_without_the_worst_five():
    pair = pair_of(6)
    reference, moving = prepared(pair)
    settings = GeneticSettings(as_published=True, generations=1, population=10, elite=10)
    found = genetic_match(reference, moving, np.random.default_rng(1), [pair.guess], settings)
    points = transform(found.pose, moving.sweep.points)
    squared = np.sort(cKDTree(reference.sweep.points).query(points)[0] ** 2)
    # the table's closest point is at most two cell diagonals further away than the true one
    exact = squared[:-5].sum()
    furthest = ((np.sqrt(squared[:-5]) + 2 * np.sqrt(2) * 0.02) ** 2).sum()
    assert exact <= found.fitness + 1e-12
    assert found.fitness < furthest
