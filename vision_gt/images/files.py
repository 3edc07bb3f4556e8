"""Images of a campaign: where they lie, what their names say, and reading them."""

import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from validation.errors import InputError, Problem
from validation.text_files.reading import file_bytes
from vision_gt.images.pictures import VIDEOS, OtherPixelsError, Picture, decoded

Image = npt.NDArray[np.uint8]
LeftOut = AbstractSet[Path]

ENDINGS = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm"}
OTHER_ENDINGS = {".gif", ".heic", ".jp2", ".ppm", ".webp"}
"""Of images that are not read."""
MAX_BYTES = 100_000_000
"""A judgement: an uncompressed image of 30 megapixels in three colours."""
BLANK = 1.5
"""Standard deviation of the grey levels (of a copy of an eighth of the size) below which an image
shows nothing. Noise of 5 grey levels leaves 0.6 in the copy; a dim room has 10 and more."""
_NOTHING_LARGER = 3 * BLANK
"""Grey levels from the middle that the copy of an empty image keeps within: noise of 8 reaches 4
levels, while a marker of 20 pixels on an even wall makes 7 with a contrast of 40."""
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_LEAST_FILLED = 8
"""Rows: JPEG files are cut in blocks of eight."""
_SNAPSHOT = re.compile(r"(?P<one>[^-]+)-(?P<other>[^-]+)-(?P<number>\d+)")
_OF_CAMERA = re.compile(r"(?P<camera>[^-]+)-(?P<number>\d+)")
_POSE = re.compile(r"pose(?P<pose>.+)")


@dataclass(frozen=True)
class Snapshot:
    """One moment of the double pattern.

    Parameters
    ----------
    name : str
        '1-2-4': the two cameras in the order of their names, and the number.
    images : mapping of str to Path
        Image by camera: one or two.
    """

    name: str
    images: Mapping[str, Path]


@dataclass(frozen=True)
class CampaignImages:
    """All images of a vision campaign.

    Parameters
    ----------
    calibration : mapping of str to sequence of Path
        By camera.
    network : sequence of Snapshot
        Double pattern seen by two cameras.
    bar : sequence of (str, Path)
        Images that show both boards, with their camera.
    reference : mapping of str to Path
        The reference pattern, by camera.
    movie : mapping of str to sequence of Path
        The walk around the robot, by camera.
    poses : mapping of str to mapping of str to Path
        Image by camera and stop.
    before, after : mapping of str to Path
        Of the steadiness check, by camera.
    """

    calibration: Mapping[str, Sequence[Path]]
    network: Sequence[Snapshot]
    bar: Sequence[tuple[str, Path]]
    reference: Mapping[str, Path]
    movie: Mapping[str, Sequence[Path]]
    poses: Mapping[str, Mapping[str, Path]]
    before: Mapping[str, Path]
    after: Mapping[str, Path]


def campaign_images(folder: Path, left_out: LeftOut = frozenset()) -> CampaignImages:
    """The images below a vision folder, by the naming of AD2.3.

    Parameters
    ----------
    folder : Path
        Holds calibration/CAMERA/*, network/2-1-4.*, bar/2-1.*, reference/CAMERA.*,
        layout/CAMERA/*, poses/CAMERA/poseX.* and steadiness/{before,after}/CAMERA.*.
    left_out : set of Path
        Images that a person decided not to use: as if they were not there.

    Raises
    ------
    InputError
        Naming every image whose name cannot be understood.

    Notes
    -----
    AD2.3, "Calibration of the camera network": '4th snapshot from camera n. 2 (when paired with
    camera n. 1): 2-1-4.bmp'; "Collection of the GT data for static poses": 'poseX.ext'.
    """
    problems: list[Problem] = []
    found = CampaignImages(
        calibration=_by_camera(folder / "calibration", left_out),
        network=_snapshots(list_images(folder / "network", left_out), problems),
        bar=_of_cameras(list_images(folder / "bar", left_out), problems),
        reference=_one_each(list_images(folder / "reference", left_out), problems),
        movie=_by_camera(folder / "layout", left_out),
        poses=_poses(_by_camera(folder / "poses", left_out), problems),
        before=_one_each(list_images(folder / "steadiness" / "before", left_out), problems),
        after=_one_each(list_images(folder / "steadiness" / "after", left_out), problems),
    )
    if problems:
        raise InputError(problems)
    return found


def list_images(folder: Path, left_out: LeftOut = frozenset()) -> list[Path]:
    """Image files of a folder but those left out, in the order that people count."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if path.suffix.lower() in ENDINGS]
    return sorted(set(found) - left_out, key=lambda path: counting(path.name))


def drive_cameras(folder: Path, left_out: LeftOut = frozenset()) -> list[str]:
    """Names of the cameras that have frames below a folder of a drive."""
    if not folder.is_dir():
        return []
    found = [one.name for one in folder.iterdir() if one.is_dir() and list_images(one, left_out)]
    found += [one.stem for one in folder.iterdir() if one.suffix.lower() in VIDEOS]
    return sorted(set(found))


def images_below(folder: Path) -> list[Path]:
    """All image files below a folder, also those that are not read, by their names."""
    known = ENDINGS | OTHER_ENDINGS | VIDEOS
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in known)


def counting(name: str) -> list[tuple[int, str]]:
    """Sort key by which 'pose10' comes after 'pose9'."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def images_of_poses(folder: Path, left_out: LeftOut = frozenset()) -> dict[str, dict[str, Path]]:
    """Images CAMERA/poseX.* by camera and pose, but those left out.

    Raises
    ------
    InputError
        Naming every image whose name cannot be understood.
    """
    problems: list[Problem] = []
    found = _poses(_by_camera(folder, left_out), problems)
    if problems:
        raise InputError(problems)
    return found


def _by_camera(folder: Path, left_out: LeftOut) -> dict[str, list[Path]]:
    if not folder.is_dir():
        return {}
    cameras = sorted(path for path in folder.iterdir() if path.is_dir())
    return {one.name: images for one in cameras if (images := list_images(one, left_out))}


def _one_each(images: Sequence[Path], problems: list[Problem]) -> dict[str, Path]:
    """One image of each camera, named as it is."""
    found: dict[str, Path] = {}
    for path in images:
        if path.stem in found:
            twin = found[path.stem].name
            problems.append(Problem(path, f"the same camera as {twin}; keep one of them"))
        found[path.stem] = path
    return found


def _snapshots(images: Sequence[Path], problems: list[Problem]) -> list[Snapshot]:
    pairs: dict[str, dict[str, Path]] = {}
    expected = "expected a name such as 2-1-4: camera, the one it is paired with, number"
    for path, match in _matching(images, _SNAPSHOT, expected, problems):
        low, high = sorted((match["one"], match["other"]))
        if low == high:
            problems.append(Problem(path, expected))
            continue
        views = pairs.setdefault(f"{low}-{high}-{int(match['number'])}", {})
        if match["one"] in views:
            problems.append(Problem(path, f"the same snapshot as {views[match['one']].name}"))
        views[match["one"]] = path
    return [Snapshot(name, images) for name, images in pairs.items()]


def _of_cameras(images: Sequence[Path], problems: list[Problem]) -> list[tuple[str, Path]]:
    expected = "expected a name such as 2-1: camera, number"
    found = _matching(images, _OF_CAMERA, expected, problems)
    return [(match["camera"], path) for path, match in found]


def _poses(
    by_camera: Mapping[str, Sequence[Path]], problems: list[Problem]
) -> dict[str, dict[str, Path]]:
    found: dict[str, dict[str, Path]] = {}
    for camera, images in by_camera.items():
        poses = found.setdefault(camera, {})
        expected = "expected a name such as pose7"
        for path, match in _matching(images, _POSE, expected, problems):
            if match["pose"] in poses:
                twin = poses[match["pose"]].name
                problems.append(Problem(path, f"the same pose as {twin}; keep one of them"))
            poses[match["pose"]] = path
    return found


def _matching(
    paths: Iterable[Path], pattern: re.Pattern[str], expected: str, problems: list[Problem]
) -> list[tuple[Path, re.Match[str]]]:
    """Images whose names a pattern understands; the others become problems."""
    matches = [(path, pattern.fullmatch(path.stem)) for path in paths]
    problems += [Problem(path, expected) for path, match in matches if match is None]
    return [(path, match) for path, match in matches if match is not None]


def read_image(path: Path) -> Image:
    """The grey levels (h, w) of an image file.

    Raises
    ------
    InputError
        As `read_picture`.
    """
    return read_picture(path).grey


def read_picture(path: Path) -> Picture:
    """The grey levels of an image file, and what was done to get them.

    Raises
    ------
    InputError
        If the file is missing, empty, truncated or no image.
    """
    data = file_bytes(path, MAX_BYTES, "an image")
    if not data or _is_cut(data):
        raise InputError([Problem(path, "the image is truncated or damaged; copy it again")])
    try:
        picture = decoded(data)
    except OtherPixelsError as error:
        raise InputError([Problem(path, str(error))]) from None
    if picture is None:
        raise InputError([Problem(path, "not an image that OpenCV can read")])
    if data.startswith(_JPEG) and (rows := _filled_rows(picture.grey)):
        expected = f"its last {rows} rows are one even grey: it is truncated; copy it again"
        raise InputError([Problem(path, expected)])
    return picture


def _is_cut(data: bytes) -> bool:
    """Whether a PNG, JPEG or BMP file ends too early: decoders fill such images with grey."""
    if data.startswith(_PNG):
        return not _is_whole_png(data)
    if data.startswith(_JPEG):
        return b"\xff\xd9" not in data[-4096:]
    if data.startswith(b"BM"):
        return len(data) < int.from_bytes(data[2:6], "little")
    return False


def _is_whole_png(data: bytes) -> bool:
    """Whether the chunks of a PNG file follow each other to its end, each with its check sum."""
    place = len(_PNG)
    while place + 12 <= len(data):
        end = place + 8 + int.from_bytes(data[place : place + 4], "big")
        kind = data[place + 4 : place + 8]
        if zlib.crc32(data[place + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return False
        if kind == b"IEND":
            return True
        place = end + 4
    return False


def _filled_rows(image: Image) -> int:
    """How many rows at the end are one even grey, while the others are not; 0 if few are.

    That is how a decoder fills a JPEG file that was cut and has an end mark none the less. No
    camera takes such rows: its pixels have noise, unless all of them are black or saturated.
    """
    fill = int(image[-1, 0])
    others = np.flatnonzero((image != fill).any(axis=1))
    rows = len(image) - 1 - int(others[-1]) if len(others) else 0
    return rows if rows >= _LEAST_FILLED and 0 < fill < 255 else 0


def is_blank(image: Image) -> bool:
    """Whether an image shows nothing but noise: a covered lens, a camera without light."""
    small = cv2.resize(image, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    far = np.abs(small - float(np.median(small))).max()
    return bool(small.std() < BLANK and far < _NOTHING_LARGER)
