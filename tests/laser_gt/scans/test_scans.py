import numpy as np
import pytest

from data_samples.rooms.scanners import FULL_TURN, HALF_TURN, furnished_room, take_scan
from laser_gt.scans.scan import Scan, merge, sweep
from validation.errors import GtvalError

ANGLES = np.linspace(-1, 1, 21)


@pytest.mark.parametrize(
    ("ranges", "angles", "said"),
    [
        ([], [], "no beams"),
        (np.full(21, np.nan), ANGLES, "not a number"),
        (np.full(21, -1.0), ANGLES, "negative"),
        (np.ones(20), ANGLES, "20,"),
        (np.ones(21), ANGLES[::-1], "do not increase"),
        (np.ones(21), np.where(ANGLES > 0.5, np.inf, ANGLES), "not finite"),
        (np.ones(21), 4 * ANGLES, "one turn"),
    ],
)
def test_what_is_no_scan_is_refused_in_words(ranges, angles, said):
    with pytest.raises(GtvalError, match=said):
        Scan(np.array(ranges), np.array(angles))


def test_a_scan_without_returns_is_kept_but_cannot_be_matched():
    scan = Scan(np.full(21, np.inf), ANGLES)
    assert len(scan) == 21
    assert len(scan.points) == 0
    with pytest.raises(GtvalError, match="0 returns of 21 beams"):
        sweep(scan, "7")


def test_scanners_on_different_clocks_are_not_merged():
    front = Scan(np.ones(21), ANGLES, time=100.0)
    rear = Scan(np.ones(21), ANGLES, time=103.5)
    with pytest.raises(GtvalError, match=r"3\.500 s apart"):
        merge([front, rear], [(0, 0, 0), (0, 0, np.pi)], "7")


def test_two_half_turns_see_all_around():
    room = furnished_room(np.random.default_rng(1))
    rng = np.random.default_rng(2)
    scan = take_scan(room, HALF_TURN, (4, 3, 0), rng)
    both = merge([scan, scan], [(0.2, 0, 0), (-0.2, 0, np.pi)])
    azimuth = np.sort(np.arctan2(*both.points.T[::-1]))
    assert np.diff(azimuth).max() < 0.2


def test_the_noise_is_found_from_the_scan_whatever_the_room_and_the_incidence():
    for beams in (FULL_TURN, HALF_TURN):
        found = [
            take_scan(
                furnished_room(np.random.default_rng(seed)),
                beams,
                (4, 3, 0.3 * seed),
                np.random.default_rng(seed),
            ).range_sigma
            for seed in range(40)
        ]
        # corners and edges widen the median by some per cent, never narrow it
        assert 0.0098 < np.mean(found) < 0.0115
