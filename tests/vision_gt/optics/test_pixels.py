"""Camera files whose numbers are not in pixels: told for every lens, and no lens is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.errors import InputError
from vision_gt.optics.formats.pixels import check_pixels

WHERE = Path("camera.yaml")
SIZES = [(640, 480), (1280, 1024), (1920, 1080), (480, 640), (512, 512), (512, 500), (4000, 3000)]
VIEWS = st.floats(3, 165)
"""Degrees across the longer side of a pinhole's image."""
OFF = st.floats(-0.1, 0.1)


def a_camera(size, view, off):
    """fx, fy, cx, cy of a pinhole whose axis is off the middle by these shares of the image."""
    focal = max(size) / 2 / np.tan(np.deg2rad(view / 2))
    middle = (np.array(size) - 1) / 2 + np.array(off) * size
    return np.array([focal, focal, *middle])


@given(st.sampled_from(SIZES), VIEWS, OFF, OFF)
def test_no_usual_camera_is_refused(size, view, right, down):
    check_pixels(WHERE, size, a_camera(size, view, (right, down)))


@given(st.sampled_from(SIZES), VIEWS, OFF, OFF, st.floats(0.001, 0.02))
def test_millimetres_are_told_whatever_the_lens(size, view, right, down, pixel):
    """Of pixels of 1 to 20 micrometres, which sensors of cameras have."""
    with pytest.raises(InputError, match=r"'(focal length|centre)': .*millimetres"):
        check_pixels(WHERE, size, a_camera(size, view, (right, down)) * pixel)


@given(st.sampled_from(SIZES), VIEWS, OFF, OFF)
def test_shares_of_the_image_are_told_whatever_the_lens(size, view, right, down):
    four = a_camera(size, view, (right, down)) / [*size, *size]
    with pytest.raises(InputError, match="normalised"):
        check_pixels(WHERE, size, four)


def test_what_it_looks_like_is_told_in_pixels():
    with pytest.raises(InputError, match=r"'3\.6, 3\.61'.*millimetres.* 480, 481, 320, 240"):
        check_pixels(WHERE, (640, 480), np.array([3.6, 3.61, 2.4, 1.8]))
    with pytest.raises(InputError, match=r"'0\.95, 1\.27'.*normalised.* 608, 610, 320, 240"):
        check_pixels(WHERE, (640, 480), np.array([0.95, 1.27, 0.5, 0.5]))
    # As many shares are of the larger side for both: the focal lengths are then alike.
    with pytest.raises(InputError, match=r"normalised.* 608, 608, 320, 240"):
        check_pixels(WHERE, (640, 480), np.array([0.95, 0.95, 0.5, 0.5]))
    with pytest.raises(InputError, match="measured from the middle"):
        check_pixels(WHERE, (640, 480), np.array([0.95, 0.95, 0.01, -0.02]))


@pytest.mark.parametrize(
    ("centre", "said"),
    [
        ((1.2, -0.9), "measured from the middle"),
        ((641.0, 482.0), "images of about 1283 x 965 pixels"),
        ((159.5, 119.5), "images of about 320 x 240 pixels"),
        ((3000.0, 240.0), "far outside"),
        ((320.0, -600.0), "far outside"),
    ],
)
def test_a_centre_where_no_lens_has_its_axis_is_told(centre, said):
    with pytest.raises(InputError, match=said):
        check_pixels(WHERE, (640, 480), np.array([612.5, 613.7, *centre]))


@pytest.mark.parametrize("size", [(480, 640), (1024, 1280), (1080, 1920), (3000, 4000)])
def test_a_size_whose_sides_are_exchanged_is_told(size):
    four = np.array([900.0, 900.0, size[1] / 2, size[0] / 2])
    with pytest.raises(InputError, match=f"exchanged.* {size[1]} x {size[0]} pixels"):
        check_pixels(WHERE, size, four)


def test_the_limit_is_a_field_of_view_of_170_degrees():
    limit = 320 / np.tan(np.deg2rad(85))
    check_pixels(WHERE, (640, 480), np.array([limit + 0.01, limit + 0.01, 320, 240]))
    with pytest.raises(InputError, match="focal length has to be in pixels"):
        check_pixels(WHERE, (640, 480), np.array([limit - 0.01, limit, 320, 240]))
