"""Typing errors at a rate of 1 %: how many are noticed at once, in the end, and how falsely.

`benchmarks/entry_errors.py` prints the shares by kind of error, of any seeds.
"""

import numpy as np
import pytest
from entry_simulation import KINDS, Tally, simulate_entry


def entered(seeds, stops):
    tally = Tally()
    for seed in seeds:
        tally.add(simulate_entry(seed, stops=stops, rate=0.01))
    return tally


def check(tally: Tally) -> None:
    after_third = tally.large(of_stop=True, earlier=3)
    assert np.mean([slip.at_once for slip in after_third]) >= 0.95
    assert tally.false_alarms / tally.readings < 0.01
    first = tally.first_of_marks()
    assert sum(slip.unnoticed for slip in first) <= 0.1 * len(first)
    # What is not noticed at once is noticed with the next readings, or by the adjustment.
    large = [slip for slip in tally.slips if slip.is_large]
    assert sum(slip.end == "left" for slip in large) <= 0.01 * len(large) + 1


def test_errors_of_a_few_campaigns_are_noticed_at_once():
    check(entered(range(2000, 2004), stops=1))


def found_before_the_stop_is_left(seeds):
    tally = Tally()
    for seed in seeds:
        tally.add(simulate_entry(seed, stops=1, rate=0.15, first=True))
    first = tally.first_of_marks()
    assert len(first) >= 0.5 * len(seeds)
    assert sum(slip.unnoticed for slip in first) <= 0.1 * len(first)


def test_errors_in_the_first_readings_of_a_mark_are_found_before_the_stop_is_left():
    found_before_the_stop_is_left(range(3000, 3008))


@pytest.mark.full
def test_errors_in_the_first_readings_of_many_marks_are_found_before_the_stop_is_left():
    found_before_the_stop_is_left(range(4000, 4300))


@pytest.mark.full
def test_errors_of_a_thousand_campaigns_are_noticed_at_once():
    tally = entered(range(1000), stops=2)
    assert len(tally.large(of_stop=True, earlier=3)) > 300
    check(tally)
    for kind in KINDS:
        late = [s for s in tally.large(of_stop=True, earlier=3) if s.kind == kind]
        assert np.mean([slip.at_once for slip in late]) >= 0.95, kind
