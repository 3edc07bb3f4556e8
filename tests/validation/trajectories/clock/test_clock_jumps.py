"""A clock that jumps within a record: when, by how much, and never where it does not."""

from dataclasses import replace

import numpy as np
import pytest
from clock_drives import drive

from validation.trajectories.clock.estimate import sync
from validation.trajectories.clock.jumps import jump_place, sharpest_place
from validation.trajectories.clock.result import added, on_reference_clock
from validation.trajectories.clock.tables import Tolerance, clock_findings, clock_json


def jumping(seed, size):
    """A drive of 80 s, the source's stamps with a jump of the delay, and where it is."""
    rng = np.random.default_rng(seed)
    made = drive(rng, 0, cameras=1, duration=80.0, whole=True)
    (source,) = made.sources
    at = float(rng.uniform(0.35, 0.65) * source.times[-1])
    late = source.times > at
    stamps = source.times - size * late
    kept = ~late | (stamps > source.times[~late][-1])
    return made, replace(source.select(kept), times=stamps[kept]), stamps[late & kept][0]


@pytest.mark.parametrize(("seed", "size"), [(0, -0.3), (4, 0.1)])
def test_a_jump_is_found_with_its_place_and_size(seed, size):
    made, source, at = jumping(seed, size)
    told = sync(made.reference, [source], window=5.0)[source.system]
    (jump,) = told.jumps
    # Twice the half of a 95 % interval is missed once in ten thousand times.
    assert abs(jump.size_s - size) < jump.high_s - jump.low_s < 0.03
    before, after = told.pieces
    true = made.delays[0]
    assert abs(before.delay_s - true) < before.high_s - before.low_s
    assert abs(after.delay_s - true - size) < after.high_s - after.low_s
    # Some frames may be at rest, and fit both.
    assert abs(jump.stamp_s - at) < 1.0
    stamps = source.times_since(told.epoch)
    assert set(np.round(added(told, stamps) - true, 1)) == {0.0, round(size, 1)}
    right = on_reference_clock(source, told)
    assert (np.diff(right.times) > 0).all()
    assert len(right) > 0.97 * len(source)
    codes = [one.code for one in clock_findings(told, Tolerance(0.01, 0.01))]
    assert "clock_jump" in codes
    assert len(clock_json(told, Tolerance(0.01, 0.01))["pieces"]) == 2


def test_a_jump_where_there_are_no_poses_is_somewhere_between_those_there_are():
    made, source, at = jumping(0, -0.3)
    seen = np.abs(source.times - at) > 15.0
    told = sync(made.reference, [source.select(seen)], window=5.0)[source.system]
    (jump,) = told.jumps
    stamps = source.times_since(told.epoch)
    before, after = stamps[seen & (source.times < at)][-1], stamps[seen & (source.times >= at)][0]
    assert jump.place.first_s <= before + 0.1
    assert jump.place.last_s >= after - 0.1
    assert abs(jump.size_s + 0.3) < jump.high_s - jump.low_s
    (text,) = (
        one.text for one in clock_findings(told, Tolerance(0.01, 0.01)) if one.code == "clock_jump"
    )
    assert "between the stamps" in text
    (row,) = clock_json(told, Tolerance(0.01, 0.01))["jumps"]
    assert row["between_s"][1] - row["between_s"][0] > 29.0


def test_a_clock_that_does_not_jump_has_no_jump():
    for seed in (0, 4):
        made, source, _ = jumping(seed, 0.0)
        told = sync(made.reference, [source], window=5.0)[source.system]
        assert not told.jumps
        assert not told.pieces


def test_the_place_is_where_costs_change_over_and_frames_stay_in_order():
    rng = np.random.default_rng(1)
    costs = rng.chisquare(3, (3, 100))
    assert jump_place(costs) is None
    costs[0, 60:] += 10
    costs[1, :60] += 10
    costs[2] += 10
    assert jump_place(costs) == 59
    # Costs that are alike around the place leave it open; only one gap takes up the jump.
    costs[:2, 50:70] = 3.0
    times = 0.2 * np.arange(100.0)
    times[56:] += 0.3
    assert sharpest_place(costs[:2], times, -0.3)[0] == 55
