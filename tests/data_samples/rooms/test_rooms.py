import dataclasses

import numpy as np
import pytest
from matplotlib.path import Path as Outline

from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.sight import outline_segments
from validation.campaign.folder import Vframe
from validation.errors import GtvalError

SEEDS = range(40)
ROUNDING = 1e-9  # metres; far above the 1e-15 of the arithmetic, far below anything that matters


def rooms(settings=RoomSettings()):  # noqa: B008  (frozen)
    return [make_room(settings, np.random.default_rng(seed)) for seed in SEEDS]


def distance_to(points, segments):
    """(n, m) distances of points from segments."""
    a, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    share = ((points[:, None] - a) * along).sum(-1) / (along**2).sum(-1)
    nearest = a + np.clip(share, 0, 1)[..., None] * along
    return np.hypot(*(points[:, None] - nearest).transpose(2, 0, 1))


def blocked_by_sampling(start, end, obstacles, step=0.002):
    """Metres of a line that lie inside obstacles, by walking along it."""
    length = np.hypot(*(end - start))
    walk = start + np.arange(step, length, step)[:, None] / length * (end - start)
    return step * sum(Outline(box).contains_points(walk).sum() for box in obstacles)


def test_world_points_lie_on_the_walls():
    for room in rooms():
        assert (
            distance_to(room.world_points, outline_segments(room.outline)).min(1).max() < ROUNDING
        )


def test_world_points_are_seen_from_every_vframe_point():
    vframe = np.array(list(Vframe().points.values()))
    for room in rooms(RoomSettings(pillars=2))[:8]:
        for start in vframe:
            for end in room.world_points:
                assert blocked_by_sampling(start, end, room.obstacles) == 0


def test_world_points_are_all_around_the_room():
    for room in rooms():
        sides = distance_to(room.world_points, outline_segments(room.outline)).argmin(1)
        assert set(sides) == {0, 1, 2, 3}


def test_stops_are_inside_and_keep_their_distance():
    settings = RoomSettings(pillars=2)
    for room in rooms(settings):
        places = room.stops[:, :2]
        assert Outline(room.outline).contains_points(places).all()
        assert distance_to(places, room.segments).min() > settings.clearance - ROUNDING


def test_the_path_runs_up_and_down_along_the_long_side():
    room = make_room(RoomSettings(turn=0.0), np.random.default_rng(0))
    legs = np.diff(room.path, axis=0)
    long = legs[np.abs(legs[:, 1]) > np.abs(legs[:, 0])]
    assert np.array_equal(np.sign(long[:, 1]), [1, -1, 1, -1, 1, -1])
    upwards = np.abs(room.stops[:, 2] - np.pi / 2) < np.pi / 4
    downwards = np.abs(room.stops[:, 2] + np.pi / 2) < np.pi / 4
    assert upwards.sum() >= 6
    assert downwards.sum() >= 6


def test_the_short_walls_are_not_parallel_by_what_was_asked():
    room = make_room(RoomSettings(skew=0.01), np.random.default_rng(3))
    first, _, third, _ = np.diff(np.vstack([room.outline, room.outline[:1]]), axis=0)
    turn = np.arctan2(*first[::-1]) - np.arctan2(*(-third)[::-1])
    assert np.isclose(abs(np.tan(turn)), 0.01, rtol=1e-6)


def test_the_turn_of_the_room_is_as_asked():
    room = make_room(RoomSettings(turn=0.4), np.random.default_rng(3))
    along = room.outline[1] - room.outline[0]
    assert np.isclose(np.arctan2(along[1], along[0]), 0.4)


def test_obstacles_lie_inside_the_room():
    for room in rooms(RoomSettings(pillars=1)):
        walls = outline_segments(room.outline)
        along = walls[:, 1] - walls[:, 0]
        inwards = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
        corners = room.obstacles.reshape(-1, 1, 2)
        assert ((corners - walls[:, 0]) * inwards).sum(-1).min() > -ROUNDING


def test_the_same_seed_gives_the_same_room_and_another_seed_another():
    a, b, c = (make_room(RoomSettings(), np.random.default_rng(seed)) for seed in (7, 7, 8))
    for field in ("outline", "obstacles", "world_points", "stops"):
        assert np.array_equal(getattr(a, field), getattr(b, field))
        assert not np.array_equal(getattr(a, field), getattr(c, field))


def test_counts_are_as_asked_and_names_count_from_one():
    settings = RoomSettings(world_points=9, stops=5, heaters=0, runs=1)
    room = make_room(settings, np.random.default_rng(0))
    assert room.world_names == tuple("123456789")
    assert room.stop_names == tuple("12345")
    assert room.world_points.shape == (9, 2)
    assert room.stops.shape == (5, 3)
    assert room.obstacles.shape == (0, 4, 2)
    assert (np.abs(room.stops[:, 2]) <= np.pi).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"width": 2.0}, "too small for Vframe"),
        ({"clearance": 4.0}, "no place for a robot"),
        ({"pillars": 500}, "no place for 500 pillars"),
        ({"stops": 0}, "at least one stop"),
        ({"heaters": 60, "heater_width": (6.0, 7.0)}, "places on the walls"),
    ],
)
def test_a_room_that_cannot_be_is_refused_in_plain_words(changes, said):
    settings = dataclasses.replace(RoomSettings(), **changes)
    with pytest.raises(GtvalError, match=said):
        make_room(settings, np.random.default_rng(0))
