"""Straight roads and standing records: right, or refused with the reason."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from trials.straight_roads import (
    KNOWLEDGE,
    ROADS,
    STANDING,
    knowledge_of,
    prior_of,
    road_of,
    sizes,
    solved,
)

from data_samples.drives.drive import ANTENNAS
from rtk_gt.campaign.solve import offsets_of, prepare
from rtk_gt.path.antennas import Places
from rtk_gt.path.motion_check import forward_share, motion_check
from rtk_gt.settings import RtkSettings
from validation.errors import GtvalError


def trial(seed, what, **kind):
    """Sizes of the errors, or None where it was refused."""
    road = road_of(seed, **kind)
    try:
        return sizes(road, *solved(road.steps, prior_of(*knowledge_of(road, what, seed))))
    except GtvalError:
        return None


def judge(kinds, seeds):
    """Errors of accepted records, and how many were accepted by what was known."""
    errors, accepted = [], Counter()
    for kind in kinds:
        for what in KNOWLEDGE:
            for seed in seeds:
                found = trial(seed, what, **kind)
                if found is not None:
                    accepted[what] += 1
                    errors.append(max(found))
    return np.array(errors), accepted


def test_what_is_accepted_is_right():
    roads = [{"degrees": d, "interval": 2.0, "slope": s} for d, s in ((2, 1.0), (10, 0.0))]
    errors, accepted = judge([*roads, {**STANDING, "interval": 2.0}], range(1))
    assert (errors > 3).sum() == 0
    # Stated offsets are enough for any record; one that stands tells nothing by itself.
    assert accepted["offsets"] == accepted["both"] == 3
    assert 0 < accepted["distances"] <= 2


def test_heights_that_nothing_holds_hide_no_heading():
    # One start came to antennas half a metre too low, and stood for the right heading.
    assert max(trial(9005, "two distances", degrees=1, slope=0.0)) < 3


@pytest.mark.full
def test_roads_of_1_to_20_degrees_and_standing_records_with_all_that_may_be_known():
    errors, accepted = judge(ROADS, range(20))
    assert np.mean(errors > 3) < 0.01
    assert (errors < 5).all()
    assert accepted["offsets"] == accepted["both"] == 20 * len(ROADS)


@pytest.mark.parametrize("seed", range(4))
def test_half_a_turn_is_told_by_the_motion_and_said(seed):
    """Two degrees of heading: turned by half a turn the antennas do nearly the same."""
    road = road_of(seed, degrees=1.0, interval=1.0)
    chosen, path = solved(road.steps, prior_of(*knowledge_of(road, "distances", seed)))
    assert len(chosen.left) == 1
    away = (chosen.left[0].offsets.values - road.offsets)[1:]
    # Half a turn about the rear antenna moves the front ones by twice their arms of 1.82 m.
    np.testing.assert_allclose(np.linalg.norm(away[:, :2], axis=1), 2 * 1.82, atol=0.1)
    assert forward_share(path, 2.0) > 0.99


def test_a_vehicle_that_stands_has_any_heading():
    road = road_of(0, moving=False, interval=1.0)
    for what in ("none", "distances", "two distances"):
        with pytest.raises(GtvalError, match="known_offsets"):
            solved(road.steps, prior_of(*knowledge_of(road, what, 0)))


def test_correct_zero_offsets_of_a_standing_record_are_accepted():
    road = road_of(3, moving=False, bases=False, interval=1.0)
    chosen, path = solved(road.steps, prior_of(np.zeros((3, 3)), None, offset_sigma=0.003))
    assert max(sizes(road, chosen, path)) < 3
    np.testing.assert_allclose(chosen.offsets.distances, road.distances, atol=0.01)


def test_offsets_that_make_another_vehicle_than_the_distances_are_refused():
    road = road_of(3, moving=False, interval=1.0)
    _, distances = knowledge_of(road, "both", 3)
    wrong = road.offsets + np.array([[0, 0, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    with pytest.raises(GtvalError, match="contradict"):
        solved(road.steps, prior_of(wrong, distances))


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_exchanged_receivers_are_named(pair):
    road = road_of(1, degrees=90.0, slope=6.0, interval=1.0)
    order = np.arange(3)
    order[list(pair)] = pair[::-1]
    steps = replace(road.steps, positions=road.steps.positions[:, order])
    names = [road.steps.receivers[k] for k in pair]
    with pytest.raises(GtvalError, match=f"files of {names[0]} and {names[1]} are exchanged"):
        solved(steps, prior_of(None, None))


def test_a_nose_against_the_motion_is_seen_at_any_rate():
    """At 20 Hz single steps are shorter than half a metre; a drive in reverse is no drive ahead."""
    road = road_of(2, degrees=90.0, slope=6.0, seconds=60.0, interval=0.05)
    _, path = solved(road.steps, prior_of(road.offsets, None))
    ahead = motion_check(path, 2.0)
    assert abs(ahead.left) < 0.05
    back = motion_check(replace(path, poses=path.poses[::-1]), 2.0)
    assert abs(abs(back.left) - np.pi) < 0.05


SLOW = {"seconds": 600.0, "interval": 1.0, "sigma": 0.004, "slow": 0.005}


@pytest.mark.parametrize(
    ("seed", "degrees", "what"),
    [(2, 5.0, "distances"), (1, 10.0, "one offset"), (1, 5.0, "distances")],
)
def test_slow_errors_on_a_straight_road_are_not_taken_for_what_it_shows(seed, degrees, what):
    found = trial(seed, what, degrees=degrees, **SLOW)
    assert found is None or max(found) < 3


def test_slow_errors_show_where_distances_are_stated():
    road = road_of(1, degrees=10.0, **SLOW)
    prior = prior_of(*knowledge_of(road, "distances", 1))
    ready = prepare(road.steps, RtkSettings())
    assert ready.model is None  # the road alone tells no distances
    _, _, model = offsets_of(ready, prior, RtkSettings(), Places(ANTENNAS[:, 2]))
    assert 0.5 < model.slow_sigma / 0.005 < 1.5
    assert 10 < model.lasting < 90


@pytest.mark.parametrize("what", ["none", "one offset", "distances"])
def test_what_a_road_hardly_shows_lies_on_an_arc_whatever_is_stated(what):
    """Heights known to some centimetres turn antennas about their distances by millimetres.

    Of this road they are three standard deviations off, as of one in some hundred.
    """
    found = trial(7004, what, degrees=20.0, slope=1.0)
    assert found is not None
    assert max(found) < 3
