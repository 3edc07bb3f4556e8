"""Image files that were cut short are errors, also where an end mark was put back."""

import cv2
import numpy as np
import pytest

from validation.errors import InputError
from vision_gt.images.files import read_image

ENDS = {".png": b"\0\0\0\0IEND\xaeB`\x82", ".jpg": b"\xff\xd9", ".bmp": b""}


def photograph() -> np.ndarray:
    """Noise on uneven light: no row of it is even."""
    rng = np.random.default_rng(2)
    light = np.linspace(60, 180, 480)[:, None] + np.linspace(-30, 30, 640)
    return np.clip(light + rng.normal(0, 3, light.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("ending", list(ENDS))
def test_a_whole_image_is_read(tmp_path, ending):
    path = tmp_path / f"whole{ending}"
    cv2.imwrite(str(path), photograph())
    assert np.abs(read_image(path).astype(int) - photograph()).mean() < 3


@pytest.mark.parametrize("share", [0.2, 0.6, 0.95])
@pytest.mark.parametrize("mark", [False, True], ids=["no_end", "end_put_back"])
@pytest.mark.parametrize("ending", list(ENDS))
def test_a_cut_image_is_an_error_that_names_it(tmp_path, ending, mark, share):
    whole = cv2.imencode(ending, photograph())[1].tobytes()
    path = tmp_path / f"cut{ending}"
    path.write_bytes(whole[: int(share * len(whole))] + (ENDS[ending] if mark else b""))
    with pytest.raises(InputError, match=rf"cut{ending}.*truncated"):
        read_image(path)


def test_a_changed_byte_of_a_png_is_noticed(tmp_path):
    data = bytearray(cv2.imencode(".png", photograph())[1].tobytes())
    data[len(data) // 2] ^= 0x10
    path = tmp_path / "changed.png"
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match="truncated"):
        read_image(path)


def test_black_and_saturated_rows_are_no_sign_of_a_cut(tmp_path):
    for level in (0, 255):
        image = photograph()
        image[-40:] = level
        path = tmp_path / "rim.jpg"
        cv2.imwrite(str(path), image)
        assert read_image(path).shape == image.shape
