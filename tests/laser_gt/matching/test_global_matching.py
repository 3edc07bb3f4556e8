from itertools import product

import numpy as np
from laser_rooms import error, pair_of, prepared

from laser_gt.matching.gpm import associate
from laser_gt.matching.search import SearchSettings, global_match, search


def test_any_heading_and_two_metres_are_found():
    right = 0
    for seed in range(25):
        pair = pair_of(1000 + seed, apart=1.4, turned=np.pi)
        found = global_match(*prepared(pair))
        length, angle = error(found.pose, pair.truth)
        right += length < 0.05 and angle < np.deg2rad(2)
    assert right == 25


def test_branch_and_bound_finds_the_best_of_the_whole_lattice():
    pair = pair_of(7)
    reference, moving = prepared(pair)
    settings = SearchSettings(window=0.4, heading_window=0.1, levels=2, points=60)
    found = search(reference, moving, pair.truth, settings)
    assert found.complete
    # with a tree of one level every leaf of the lattice is looked at
    every = search(
        reference,
        moving,
        pair.truth,
        SearchSettings(window=0.4, heading_window=0.1, levels=1, points=60),
    )
    assert found.score[0] == every.score[0]
    offsets = np.round((found.pose[0, :2] - pair.truth[:2]) / settings.cell, 9)
    assert all(float(offset).is_integer() for offset in offsets)


def test_a_search_that_is_cut_off_says_so():
    pair = pair_of(8)
    found = search(*prepared(pair), pair.truth, SearchSettings(max_nodes=45_000, window=6.0))
    assert not found.complete or found.nodes <= 45_000 + 6000


def test_the_normals_alone_give_a_pose_near_enough_for_the_local_matcher():
    for seed, heading in product(range(4), (0.5, -0.5)):
        pair = pair_of(50 + seed)
        found = associate(*prepared(pair), pair.truth + np.array([0.4, -0.3, heading]))
        assert min(error(pose, pair.truth)[0] for pose in found) < 0.3
