import numpy as np
import pytest

from data_samples.rooms.scanners import (
    FULL_TURN,
    Floor,
    Scanner,
    box,
    corridor,
    furnished_room,
    panels,
    polyline,
    take_scan,
    uneven_floor,
)

SQUARE = polyline(np.array([[-3, -2], [3, -2], [3, 2], [-3, 2]]), closed=True)
EXACT = Scanner(360, 2 * np.pi, sigma=1e-12, resolution=0.0)


def _scan(room, scanner=EXACT, pose=(0, 0, 0), **more):
    return take_scan(room, scanner, pose, np.random.default_rng(0), **more)


def test_ranges_in_a_rectangle_are_those_of_geometry():
    scan = _scan(SQUARE, pose=(0.5, 0.2, 0.3))
    angle = scan.angles + 0.3
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(angle) > 0, 2.5, 3.5) / np.abs(np.cos(angle))
        up = np.where(np.sin(angle) > 0, 1.8, 2.2) / np.abs(np.sin(angle))
    assert np.allclose(scan.ranges, np.minimum(across, up), atol=1e-9)


def test_noise_and_rounding_are_as_stated():
    noisy = Scanner(3600, 2 * np.pi, sigma=0.01, resolution=0.0)
    exact = Scanner(3600, 2 * np.pi, sigma=1e-12, resolution=0.0)
    residual = _scan(SQUARE, noisy).ranges - _scan(SQUARE, exact).ranges
    # 3600 draws: the standard deviation of the standard deviation is 1.2 %
    assert abs(residual.std() - 0.01) < 0.0005
    rounded = _scan(SQUARE, Scanner(90, 2 * np.pi, resolution=0.01)).ranges
    assert np.allclose(rounded * 100, np.round(rounded * 100), atol=1e-9)


def test_a_tilted_plane_lengthens_ranges_on_upright_walls_to_second_order_only():
    tilt = 0.02
    tilted = Scanner(360, 2 * np.pi, sigma=1e-12, resolution=0.0, tilt=(tilt, 0.0), height=1.0)
    factor = _scan(SQUARE, tilted).ranges / _scan(SQUARE).ranges
    lift = np.cos(EXACT.angles) * tilt
    assert np.allclose(factor, np.sqrt(1 + lift**2), atol=1e-9)


def test_leaning_walls_and_a_tilted_plane_move_ranges_to_first_order():
    leaning = polyline(np.array([[-3, -2], [3, -2], [3, 2], [-3, 2]]), closed=True, lean=0.1)
    flat = Scanner(4, 2 * np.pi, sigma=1e-12, resolution=0.0, height=0.5)
    # walls lean into the room: at half a metre they are nearer by 0.5 tan 0.1
    assert np.isclose(_scan(leaning, flat).ranges[2], 3 - 0.5 * np.tan(0.1))


def test_a_floor_with_waves_tilts_the_robot_by_its_slope():
    floor = Floor(np.array([0.01]), np.array([[2.0, 0.0]]), np.array([0.3]))
    point, step = np.array([0.4, 0.1]), np.array([1e-6, 0])

    def height(p):
        return 0.01 * np.cos(2.0 * p[0] + 0.3)

    slope = (height(point + step) - height(point - step)) / 2e-6
    assert np.allclose(floor.slope(point), [slope, 0.0], atol=1e-8)
    assert np.abs(uneven_floor(np.random.default_rng(1)).slope(point)).max() < 0.06


def test_glass_answers_only_when_hit_squarely_and_lets_the_rest_through():
    room = SQUARE + panels([[2.0, 2.0]], [[2.0, -2.0]], glass=True)
    scan = _scan(room)
    ahead = np.abs(scan.angles) < 0.1
    beside = (np.abs(scan.angles) > 0.3) & (np.abs(scan.angles) < 0.5)
    assert np.allclose(scan.ranges[ahead] * np.cos(scan.angles[ahead]), 2.0)
    assert (scan.ranges[beside] * np.cos(scan.angles[beside]) > 2.9).all()


def test_wide_beams_mix_ranges_at_edges_only():
    room = SQUARE + box((2.0, 0, 0), 0.3, 0.3)
    wide = Scanner(720, 2 * np.pi, sigma=1e-12, resolution=0.0, divergence=0.02)
    narrow = Scanner(720, 2 * np.pi, sigma=1e-12, resolution=0.0)
    mixed = np.abs(_scan(room, wide).ranges - _scan(room, narrow).ranges) > 1e-6
    assert 0 < mixed.sum() < 12


def test_what_is_out_of_reach_does_not_come_back():
    short = Scanner(360, 2 * np.pi, range_max=2.5)
    scan = _scan(SQUARE, short)
    assert np.isinf(scan.ranges).any()
    assert (scan.ranges[scan.returned] < 2.5).all()
    lossy = _scan(SQUARE, Scanner(3600, 2 * np.pi, drop_rate=0.1))
    assert 0.08 < 1 - lossy.returned.mean() < 0.12


@pytest.mark.parametrize("make", [furnished_room, corridor])
def test_rooms_are_closed(make):
    for seed in range(5):
        room = make(np.random.default_rng(seed))
        pose = (4, 3, 0) if make is furnished_room else (0, 0, 0)
        assert _scan(room, FULL_TURN, pose).returned.all() or make is corridor
