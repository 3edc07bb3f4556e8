"""Coordinates against independent libraries, and the frames' rules."""

import numpy as np
import pymap3d
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtk_samples import MALAGA

from data_samples.drives.drive import OFFSETS
from validation.errors import GtvalError
from validation.poses.earth_frames import (
    FrameVectors,
    LocalFrame,
    ecef_from_geodetic,
    geodetic_from_ecef,
    rotation_angle,
)

LATITUDES = st.floats(-90, 90)
LONGITUDES = st.floats(-180, 180)
HEIGHTS = st.floats(-500, 9000)


def places(count=2000, seed=0):
    generator = np.random.default_rng(seed)
    return np.column_stack(
        [
            generator.uniform(-90, 90, count),
            generator.uniform(-180, 180, count),
            generator.uniform(-500, 9000, count),
        ]
    )


def radians(places):
    return np.column_stack([np.radians(places[:, :2]), places[:, 2]])


def test_ecef_agrees_with_proj():
    transformer = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    sample = places()
    x, y, z = transformer.transform(sample[:, 1], sample[:, 0], sample[:, 2])
    # Doubles at 6.4e6 m resolve 1 nm; a handful of operations lose a few of them.
    np.testing.assert_allclose(
        ecef_from_geodetic(radians(sample)), np.column_stack([x, y, z]), rtol=0, atol=1e-8
    )


def test_the_whole_earth_there_and_back():
    """From 10 km below to 10,000 km above it, both poles and the date line included.

    PROJ is an oracle for one way only: its way back is off by centimetres at such heights.
    """
    generator = np.random.default_rng(7)
    n = 100_000
    latitude = np.degrees(np.arcsin(generator.uniform(-1, 1, n)))
    latitude[:100], latitude[100:200], latitude[200:300] = 90, -90, 0
    latitude[300:400] = 90 - 10.0 ** generator.uniform(-10, 0, 100)
    longitude = generator.uniform(-180, 180, n)
    longitude[400:500], longitude[500:600] = 180, -180
    height = np.where(
        np.arange(n) % 2, generator.uniform(-1e4, 1e4, n), generator.uniform(-1e4, 1e7, n)
    )
    ecef = ecef_from_geodetic(radians(np.column_stack([latitude, longitude, height])))
    transformer = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    # At 1.6e7 m one unit in the last place is 2 nm.
    proj = np.column_stack(transformer.transform(longitude, latitude, height))
    np.testing.assert_allclose(ecef, proj, rtol=0, atol=1.5e-8)
    back = geodetic_from_ecef(ecef)
    np.testing.assert_allclose(ecef_from_geodetic(back), ecef, rtol=0, atol=1.5e-8)
    np.testing.assert_allclose(np.degrees(back[:, 0]), latitude, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back[:, 2], height, rtol=0, atol=1.5e-8)


def test_geodetic_agrees_with_proj():
    transformer = pyproj.Transformer.from_crs(4978, 4979, always_xy=True)
    sample = places(seed=1)
    ecef = ecef_from_geodetic(radians(sample))
    longitude, latitude, height = transformer.transform(*ecef.T)
    found = geodetic_from_ecef(ecef)
    np.testing.assert_allclose(found[:, 2], height, atol=2e-8)
    np.testing.assert_allclose(np.degrees(found[:, 0]), latitude, atol=1e-12)
    np.testing.assert_allclose(np.degrees(found[:, 1]), longitude, atol=1e-12)


def test_local_coordinates_agree_with_pymap3d():
    sample = places(500, 2)
    sample[:, 0] = 36.7 + sample[:, 0] / 1000
    sample[:, 1] = -4.4 + sample[:, 1] / 1000
    frame = LocalFrame.from_degrees(36.714459075, -4.47895882833333, 38.8887)
    expected = pymap3d.geodetic2enu(*sample.T, 36.714459075, -4.47895882833333, 38.8887)
    found = frame.from_geodetic(radians(sample))
    np.testing.assert_allclose(found, np.column_stack(expected), rtol=0, atol=1e-8)


@given(LATITUDES, LONGITUDES, HEIGHTS)
def test_there_and_back(latitude, longitude, height):
    place = np.array([np.radians(latitude), np.radians(longitude), height])
    ecef = ecef_from_geodetic(place)
    np.testing.assert_allclose(ecef_from_geodetic(geodetic_from_ecef(ecef)), ecef, atol=1e-8)


@given(LATITUDES, LONGITUDES, HEIGHTS, st.sampled_from(["ellipsoid", "geocentric"]))
def test_local_frames_are_rigid_and_right_handed(latitude, longitude, height, up):
    frame = LocalFrame.from_degrees(latitude, longitude, height, up)
    np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame.axes) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(frame.from_ecef(frame.origin), 0, atol=1e-12)


def test_geocentric_and_normal_up_differ_by_0184_degrees_at_malaga():
    normal = LocalFrame(MALAGA.latitude, MALAGA.longitude, MALAGA.height)
    turn = MALAGA.rotation_from(normal)
    assert np.degrees(rotation_angle(turn)) == pytest.approx(0.184, abs=0.0005)
    height = FrameVectors(MALAGA, OFFSETS).turned_to(normal).values[:, 2] - OFFSETS[:, 2]
    np.testing.assert_allclose(np.abs(height[1:]), 0.092, atol=0.0005)


def test_mixing_frames_is_an_error_that_says_how_much_it_is():
    normal = LocalFrame(MALAGA.latitude, MALAGA.longitude, MALAGA.height)
    offsets = FrameVectors(MALAGA, OFFSETS)
    with pytest.raises(GtvalError, match=r"0\.184\d degrees, which is 0\.093 m"):
        offsets.within(normal)
    back = offsets.turned_to(normal).turned_to(MALAGA)
    np.testing.assert_allclose(back.within(MALAGA), OFFSETS, atol=1e-12)


def test_the_rearrangement_of_equation_4_is_not_needed_in_double_precision():
    frame = MALAGA
    sample = np.column_stack(
        [
            frame.latitude + np.linspace(-1e-4, 1e-4, 500),
            frame.longitude + np.linspace(1e-4, -1e-4, 500),
            np.linspace(30, 60, 500),
        ]
    )
    ecef = ecef_from_geodetic(sample)

    def equation_4(kind):
        axes, origin = frame.axes.astype(kind), frame.origin.astype(kind)
        return ecef.astype(kind) @ axes.T - axes @ origin

    right = frame.from_ecef(ecef)
    in_64, in_32 = (np.abs(equation_4(kind) - right).max() for kind in (np.float64, np.float32))
    # Of 6.4e6 m one unit in the last place is 0.9 nm in double precision, 0.5 m in single.
    assert in_64 < 2e-9
    assert 0.5 < in_32 < 1.0


@pytest.mark.parametrize("place", [(91, 0, 0), (0, 400, 0), (0, 0, 1e6)])
def test_no_place_on_earth(place):
    with pytest.raises(GtvalError, match="Earth"):
        LocalFrame.from_degrees(*place)


def test_the_centre_of_the_earth_has_no_latitude():
    with pytest.raises(GtvalError, match="centre"):
        geodetic_from_ecef([0.0, 0.0, 10.0])
