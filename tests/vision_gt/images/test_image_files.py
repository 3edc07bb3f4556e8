"""Image files that were cut short are errors, also where an end mark was put back."""

import struct

import cv2
import numpy as np
import pytest

from validation.errors import InputError
from vision_gt.images.files import read_image, read_picture

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


@pytest.mark.parametrize(("bits", "shift"), [(10, 0), (12, 0), (14, 0), (16, 0), (12, 4)])
def test_deep_images_are_read_by_the_bits_that_they_use(tmp_path, bits, shift):
    plain = photograph()
    deep = (plain.astype(np.uint16) << (bits - 8)) << shift
    path = tmp_path / "deep.png"
    cv2.imwrite(str(path), deep)
    picture = read_picture(path)
    scale = 8 - int(plain.max()).bit_length()
    np.testing.assert_array_equal(picture.grey, plain << scale)
    assert f"of which {bits + shift - scale} are used" in picture.remarks[0]


def test_what_is_transparent_is_white_and_said(tmp_path):
    plain = photograph()
    cover = np.full_like(plain, 255)
    cover[:, :100] = 0
    path = tmp_path / "alpha.png"
    cv2.imwrite(str(path), np.dstack([plain, plain, plain, cover]))
    picture = read_picture(path)
    assert (picture.grey[:, :100] == 255).all()
    np.testing.assert_array_equal(picture.grey[:, 100:], plain[:, 100:])
    assert "alpha" in picture.remarks[0]


@pytest.mark.parametrize("order", ["II", "MM"])
def test_a_turn_by_a_tag_is_said_and_pixels_stay_as_stored(tmp_path, order):
    plain = tmp_path / "plain.jpg"
    cv2.imwrite(str(plain), photograph())
    data, sign = plain.read_bytes(), {"II": "<", "MM": ">"}[order]
    tiff = order.encode() + struct.pack(sign + "HIHHHIHHI", 42, 8, 1, 0x0112, 3, 1, 6, 0, 0)
    block = b"Exif\x00\x00" + tiff
    turned = tmp_path / "turned.jpg"
    turned.write_bytes(
        data[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + data[2:]
    )
    picture = read_picture(turned)
    np.testing.assert_array_equal(picture.grey, read_picture(plain).grey)
    assert "a quarter turn" in picture.remarks[0]
    assert read_picture(plain).remarks == ()


def test_sixteen_bits_with_an_opaque_cover_keep_their_range(tmp_path):
    """A cover is always 65535, and says nothing of the bits that the camera uses."""
    path = tmp_path / "a.png"
    grey = np.tile(np.arange(16, 4096, 16, dtype=np.uint16), (40, 1))
    cover = np.full_like(grey, 65535)
    cv2.imwrite(str(path), np.dstack([grey, grey, grey, cover]))
    picture = read_picture(path)
    assert picture.remarks == ("16 bits a pixel, of which 12 are used",)
    assert np.abs(picture.grey.astype(int) - (grey >> 4)).max() <= 1


@pytest.mark.parametrize("ending", ["jpg", "png", "tiff"])
def test_a_turn_is_said_in_every_kind_of_file_and_never_done(tmp_path, ending):
    from PIL import Image

    path = tmp_path / f"a.{ending}"
    tags = Image.Exif()
    tags[274] = 6
    shown = np.tile(np.arange(0, 240, 4, dtype=np.uint8), (40, 1))
    Image.fromarray(shown).save(path, exif=tags)
    picture = read_picture(path)
    assert picture.grey.shape == shown.shape
    assert "quarter turn" in picture.remarks[0]


def test_pages_are_counted_and_other_pixels_named(tmp_path):
    from PIL import Image

    grey = Image.fromarray(np.full((20, 30), 90, dtype=np.uint8))
    several = tmp_path / "several.tiff"
    grey.save(several, save_all=True, append_images=[grey, grey])
    assert read_picture(several).remarks == ("it has 3 pages; the first one is used",)
    cv2.imwrite(str(tmp_path / "float.tiff"), np.zeros((20, 30), dtype=np.float32))
    with pytest.raises(InputError, match="its pixels are float32"):
        read_picture(tmp_path / "float.tiff")
