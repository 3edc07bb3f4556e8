"""Directions, dilution of precision and horizons against other libraries and known cases."""

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from skies import DAY, MILAN, almanac, both_systems, milan_plan, times

from rtk_gt.planning.horizon import (
    OPEN,
    Building,
    Horizon,
    read_horizon,
    roof_elevation,
    typed_horizon,
)
from rtk_gt.planning.plan import Place, Wanted
from rtk_gt.planning.visibility import dilution, directions
from validation.errors import GtvalError, InputError
from validation.poses.earth_frames import LocalFrame

DEGREE = np.pi / 180


@pytest.mark.parametrize("place", [(45.5, 9.2, 150.0), (-33.9, 151.2, 20.0), (89.9, 0.0, 0.0)])
def test_directions_are_those_of_pymap3d(tmp_path, place):
    ecef = almanac(tmp_path).ecef(times(3600.0))
    found = np.degrees(directions(LocalFrame.from_degrees(*place), ecef))
    expected = pymap3d.ecef2aer(*np.moveaxis(ecef, -1, 0), *place)
    off = np.abs(np.array(found) - np.array(expected[:2]))
    assert np.minimum(off, 360 - off).max() < 1e-6


def dop_by_inverse(place, ecef, used, systems):
    """PDOP, HDOP and VDOP at one time, with pymap3d's directions and numpy's inverse."""
    letters = sorted({one for one, taken in zip(systems, used, strict=True) if taken})
    rows = []
    for k in np.flatnonzero(used):
        east, north, up = pymap3d.ecef2enu(*ecef[k], *place)
        size = np.sqrt(east**2 + north**2 + up**2)
        clock = [1.0 if systems[k] == letter else 0.0 for letter in letters]
        rows.append([east / size, north / size, up / size, *clock])
    Q = np.linalg.inv(np.array(rows).T @ np.array(rows))
    return np.sqrt([np.trace(Q[:3, :3]), Q[0, 0] + Q[1, 1], Q[2, 2]])


@pytest.mark.parametrize(("form", "mask"), [("yuma", 10.0), ("tle", 5.0), ("rinex3", 30.0)])
def test_the_dilution_of_precision_is_that_of_an_inverse(tmp_path, form, mask):
    rows = None if form == "yuma" else both_systems()
    wanted = Wanted(mask * DEGREE, 5, 6.0)
    plan = milan_plan(tmp_path, at=times(1800.0), form=form, rows=rows, wanted=wanted)
    ecef = plan.almanac.ecef(plan.times)
    compared = 0
    for at in range(len(plan.times)):
        needed = 3 + len({plan.almanac.systems[k] for k in np.flatnonzero(plan.used[:, at])})
        found = [getattr(plan.dop, name)[at] for name in ("position", "horizontal", "vertical")]
        if plan.count[at] < needed:
            assert np.isnan(found).all()
            continue
        expected = dop_by_inverse((45.5, 9.2, 150.0), ecef[:, at], plan.used[:, at],
                                  plan.almanac.systems)  # fmt: skip
        assert found == pytest.approx(expected, rel=1e-6)  # 1 % was asked for
        compared += 1
    assert compared > 40


def test_three_satellites_around_and_one_above_have_a_known_dilution():
    """e, n: 3 cos^2(120 k) = 1.5 each; u and clock: [[1, 1], [1, 4]]; the inverse by hand."""
    azimuth = np.radians([[0.0], [120.0], [240.0], [0.0]])
    elevation = np.radians([[0.0], [0.0], [0.0], [90.0]])
    found = dilution(azimuth, elevation, np.ones((4, 1), dtype=bool), ("G",) * 4)
    assert found.horizontal[0] == pytest.approx(np.sqrt(4 / 3))
    assert found.vertical[0] == pytest.approx(np.sqrt(4 / 3))
    assert found.position[0] == pytest.approx(np.sqrt(8 / 3))


def test_satellites_that_determine_no_position_have_no_dilution():
    around = np.radians(np.arange(6) * 60.0)[:, None]
    level = np.full((6, 1), np.radians(40.0))  # on a cone: up and the clock are the same
    everything = np.ones((6, 1), dtype=bool)
    assert np.isnan(dilution(around, level, everything, ("G",) * 6).position).all()
    three = everything.copy()
    three[3:] = False
    assert np.isnan(dilution(around, level * around, three, ("G",) * 6).position).all()


def test_one_satellite_of_another_system_adds_nothing():
    rng = np.random.default_rng(4)
    azimuth, elevation = rng.uniform(0, 6.28, (7, 1)), rng.uniform(0.2, 1.5, (7, 1))
    both = dilution(azimuth, elevation, np.ones((7, 1), dtype=bool), ("G",) * 6 + ("E",))
    alone = dilution(azimuth[:6], elevation[:6], np.ones((6, 1), dtype=bool), ("G",) * 6)
    assert both.position == pytest.approx(alone.position)


def test_a_satellite_more_never_dilutes():
    rng = np.random.default_rng(5)
    azimuth, elevation = rng.uniform(0, 6.28, (8, 200)), rng.uniform(0.1, 1.5, (8, 200))
    used = np.ones((8, 200), dtype=bool)
    less = used.copy()
    less[7] = False
    more, fewer = (dilution(azimuth, elevation, one, ("G",) * 8).position for one in (used, less))
    assert (more <= fewer * (1 + 1e-9)).all()


def test_a_typed_horizon_is_straight_between_its_rows_and_closes_around_north():
    rows = typed_horizon([(350, 20), (10, 10), (90, 30), (90, 0), (180, 0)])
    at = np.radians([10.0, 50.0, 89.999, 90.001, 135.0, 265.0, 0.0, 360.0, 355.0])
    found = np.degrees(Horizon(rows).elevation(at))
    assert found == pytest.approx([10, 20, 30, 0, 0, 10, 15, 15, 17.5], abs=1e-2)
    assert (OPEN.elevation(at) < 0).all()


def test_a_wall_hides_what_trigonometry_says():
    """10 m north of the antenna, from 20 m west to 20 m east, 10 m above it."""
    wall = Building("wall", np.array([[-20.0, 10], [20, 10], [20, 12], [-20, 12]]), 10.0)
    azimuths = np.radians([0.0, 45.0, -30.0, 70.0, 180.0])
    distance = 10 / np.cos(azimuths[:3])
    expected = [*np.arctan2(10, distance), -np.pi / 2, -np.pi / 2]
    assert roof_elevation(wall, azimuths) == pytest.approx(expected)
    low = Building("low", wall.corners, -1.0)
    assert (roof_elevation(low, azimuths) < 0).all()


def stands_behind(building, azimuth, elevation):
    """Whether a ray is blocked: by walking along it in steps of 10 cm, without geometry."""
    steps = np.arange(0.05, 120.0, 0.1)
    points = steps[:, None] * [np.sin(azimuth), np.cos(azimuth)]
    inside = Outline(building.corners).contains_points(points)
    return bool((inside & (steps * np.tan(elevation) < building.above)).any())


@pytest.mark.parametrize("seed", range(6))
def test_buildings_of_any_outline_hide_what_a_walk_along_the_ray_meets(seed):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 7))
    shape = rng.uniform(5, 25, 7)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    building = Building("any", shape + rng.uniform(28, 40, 2) * [1, -1], 15.0)
    off = 0
    for azimuth in rng.uniform(0, 2 * np.pi, 60):
        for elevation in rng.uniform(0.02, 0.7, 3):
            hidden = elevation < roof_elevation(building, np.array(azimuth))
            off += bool(hidden) != stands_behind(building, azimuth, elevation)
    assert off <= 2  # of 180: rays within 10 cm of an edge


@given(st.lists(st.floats(0, 2 * np.pi), min_size=1, max_size=5))
def test_the_higher_of_horizon_and_building_counts(azimuths):
    at = np.array(azimuths)
    house = Building("house", np.array([[5.0, -5], [5, 5], [9, 5], [9, -5]]), 6.0)
    rows = typed_horizon([(0, 20), (180, 40)])
    both = Horizon(rows, (house,)).elevation(at)
    assert (both == np.maximum(Horizon(rows).elevation(at), roof_elevation(house, at))).all()


def test_a_place_inside_of_a_building_is_named():
    house = Building("Rettorato", np.array([[-5.0, -5], [5, -5], [5, 5], [-5, 5]]), 6.0)
    with pytest.raises(GtvalError, match="inside of building 'Rettorato'"):
        Horizon(OPEN.rows, (house,)).elevation(np.array([0.0]))
    on_its_roof = Building("Rettorato", house.corners, -1.5)
    assert (Horizon(OPEN.rows, (on_its_roof,)).elevation(np.array([0.0])) < 0).all()


def test_a_horizon_hides_satellites_below_it_and_no_others(tmp_path):
    rows = typed_horizon([(90, 0), (90, 35), (270, 35), (270, 0)])
    hidden = Place("court", MILAN.frame, Horizon(rows))
    free, shut = milan_plan(tmp_path), milan_plan(tmp_path, rover=hidden)
    south = np.abs(free.rover.azimuth - np.pi) < np.pi / 2
    lost = free.rover.visible & ~shut.rover.visible
    assert (lost == (free.rover.visible & south & (free.rover.elevation < 35 * DEGREE))).all()


def test_a_horizon_file_is_read_and_its_bad_cells_are_named(tmp_path):
    path = tmp_path / "horizon.csv"
    path.write_text("azimuth,elevation\n180,25\n0,5\n")
    assert np.degrees(read_horizon(path)) == pytest.approx(np.array([[0, 5], [180, 25]]))
    path.write_text("azimuth,elevation\n400,25\n0,steep\n")
    with pytest.raises(InputError) as error:
        read_horizon(path)
    assert "line 2, field 'azimuth': '400'" in str(error.value)
    assert "line 3, field 'elevation': 'steep'" in str(error.value)


def test_the_day_is_the_one_of_the_tests(tmp_path):
    assert milan_plan(tmp_path).times[0] == times(day=DAY)[0]
