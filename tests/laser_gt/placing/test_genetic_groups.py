"""The genetic aligner joins what its first pairs leave in groups, and what it cannot is named."""

from itertools import combinations

import numpy as np
import pytest
from laser_rooms import solved, write_campaign

from laser_gt.campaign.findings import laser_findings
from laser_gt.campaign.sections import fitness_table
from laser_gt.logs.decision_file import append_decision
from laser_gt.logs.decisions import Decision
from laser_gt.placing.pairs import bridges, connected_stops, nearest_pairs, parts_of

BOTH = ("scanmatch", "genetic")
QUICK = "generations = 10\npopulation = 20\n"
"""From guesses as good as these, ten generations are enough."""


def random_pairs(rng, count, share):
    every = np.array(list(combinations(range(count), 2)))
    return every[rng.random(len(every)) < share]


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_the_stops_that_chains_of_pairs_join(seed):
    rng = np.random.default_rng(seed)
    pairs = random_pairs(rng, 12, 0.1)
    parts = parts_of(12, pairs)
    for stop in range(12):
        assert ((parts == parts[stop]) == connected_stops(12, pairs, [stop])).all()


@pytest.mark.parametrize("seed", range(20))
def test_adding_bridges_until_there_are_none_joins_all_that_the_pairs_join(seed):
    rng = np.random.default_rng(seed)
    poses, pairs = rng.uniform(0, 10, (14, 3)), random_pairs(rng, 14, 0.3)
    chosen = np.zeros(len(pairs), dtype=bool)
    chosen[nearest_pairs(poses, pairs, 1)] = True
    while len(more := bridges(poses, pairs, parts_of(14, pairs[chosen]), 2)):
        assert not chosen[more].any()
        chosen[more] = True
    assert (parts_of(14, pairs[chosen]) == parts_of(14, pairs)).all()


def room_with(folder, settings, seed=9, stops=8):
    write_campaign(folder, seed=seed, stops=stops)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("[laser]\n", f"[laser]\n{QUICK}{settings}"))


def rows_of(outcome, matches):
    number = {stop: row for row, stop in enumerate(outcome.inputs.stops)}
    return [(number[one.reference], number[one.moving]) for one in matches]


def test_stops_that_the_nearest_pairs_leave_in_groups_are_joined(tmp_path):
    room_with(tmp_path, "genetic_pairs = 1\n", seed=13)
    outcome = solved(tmp_path, BOTH)
    poses = outcome.trajectory.poses
    pairs = np.sort(rows_of(outcome, outcome.matchings["scanmatch"].matches), axis=1)
    nearest = pairs[nearest_pairs(poses, pairs, 1)]
    assert len(set(parts_of(8, nearest))) > 1
    scanmatch, genetic = (outcome.solutions[engine] for engine in BOTH)
    assert scanmatch.lost == genetic.lost == ()
    assert len(genetic.matching.matches) < len(scanmatch.matching.matches)
    # the two engines end at the same poses: those that the scans determine, to the millimetre
    assert np.abs(scanmatch.placement.poses - genetic.placement.poses).max() < 0.002
    # fitness is told of every match, and more of a wrong pose than of the right one
    for match in genetic.matching.accepted:
        assert match.fitness > 0
        assert not match.rival_fitness < match.fitness


def test_a_wrong_pose_fits_worse_by_far_than_the_accepted_matches(tmp_path):
    # In twelve rooms a wrong pose was found of 0 to 4 of the accepted pairs, in this one of four.
    room_with(tmp_path, "genetic_pairs = 1\n", seed=3)
    matching = solved(tmp_path, BOTH).solutions["genetic"].matching
    accepted, wrong = fitness_table(matching).rows
    assert accepted[:2] == ["accepted", len(matching.accepted)]
    assert accepted[5] == 1
    assert wrong[1] > 1
    assert wrong[5] > 5


def test_stops_in_a_group_of_their_own_are_named_with_what_is_so(tmp_path):
    room_with(tmp_path, "", stops=7)
    stops = tuple(str(number) for number in range(1, 8))
    decisions = tmp_path / "laser" / "decisions.csv"
    alone = {"5", "7"}
    for first, second in combinations(stops, 2):
        if (first in alone) != (second in alone):
            made = Decision(first, second, "reject")
            append_decision(decisions, made, stops, "2026-01-01T00:00:00+00:00")
    outcome = solved(tmp_path, BOTH)
    assert set(outcome.surveyed.stops) == set(stops)  # so each group has a surveyed stop
    told = [one for one in laser_findings(outcome) if one.code == "groups"]
    assert [one.subject for one in told] == ["laser_scanmatch", "laser_genetic"]
    for finding, solution in zip(told, outcome.solutions.values(), strict=True):
        assert "in 2 groups, each by its own surveyed stops: 1, 2, 3, 4, 6; 5, 7." in finding.text
        assert solution.stops == stops
        assert solution.lost == ()


@pytest.mark.full
@pytest.mark.parametrize("room", range(40))
def test_in_clean_rooms_it_places_every_stop_that_scan_matching_places(tmp_path, room):
    stops = 12 + room % 15
    write_campaign(tmp_path, seed=14_000 + room, stops=stops)
    outcome = solved(tmp_path, BOTH)
    scanmatch, genetic = (outcome.solutions[engine] for engine in BOTH)
    assert set(scanmatch.stops) <= set(genetic.stops)
    difference = genetic.placement.poses - scanmatch.placement.poses
    # millimetres, as the two share their noise and the survey that places them
    assert len(difference) == len(scanmatch.stops)
    assert np.abs(difference[:, :2]).max() < 0.005
