"""Frames of a drive in which markers have each other's prints are the same but for that."""

import numpy as np
import pytest

from data_samples.rendering.drive import DriveSettings, film
from data_samples.rendering.files import make_room_with_cameras
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.rooms import RoomSettings


@pytest.fixture(scope="module")
def filmed():
    """A drive as it is, and with every second frame spoilt."""
    room = RoomSettings(stops=4, runs=1, clearance=2.3, world_points=8)
    _, truth = make_room_with_cameras(room, VisionSettings(cameras=2), np.random.default_rng(11))
    return [
        film(truth, DriveSettings(seconds=8.0, spurious=share), np.random.default_rng(1))
        for share in (0.0, 0.5)
    ]


def prints(photograph):
    """What is printed on each sheet, in the order of their places."""
    sheets = sorted(photograph.sheets, key=lambda sheet: tuple(sheet.T_world_sheet.translation))
    return [sheet.cells.tobytes() for sheet in sheets]


def test_only_the_frames_that_are_named_have_two_prints_exchanged(filmed):
    good, spoilt = filmed
    assert [one.name for one in good.photographs] == [one.name for one in spoilt.photographs]
    assert "truth/drive_spurious.csv" not in good.files
    head, *named = spoilt.files["truth/drive_spurious.csv"].split()
    assert head == "frame"
    # Half of the frames: within four standard deviations of a binomial distribution.
    count = len(good.photographs)
    assert abs(len(named) - count / 2) < 2 * np.sqrt(count)
    for one, other in zip(good.photographs, spoilt.photographs, strict=True):
        changed = sum(a != b for a, b in zip(prints(one), prints(other), strict=True))
        assert changed == (2 if one.name in named else 0)
