"""Grey levels of 8 bits from image and video files: 8 to 16 bits, colours, alpha, turns."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from validation.errors import InputError, Problem

Image = npt.NDArray[np.uint8]

VIDEOS = {".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm"}
_JPEG, _PNG = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"
_TIFF = {b"II*\x00", b"MM\x00*"}
_EXIF = b"Exif\x00\x00"
_TURNS = {
    2: "mirrored",
    3: "turned by half a turn",
    4: "mirrored and turned by half a turn",
    5: "mirrored and turned by a quarter turn",
    6: "turned by a quarter turn",
    7: "mirrored and turned by a quarter turn",
    8: "turned by a quarter turn the other way",
}
_ORIENTATION, _AS_STORED = 0x0112, 1
_LEAST_BITS = 8


@dataclass(frozen=True)
class Picture:
    """A decoded image.

    Parameters
    ----------
    grey : (h, w) array of uint8
        Grey levels, the pixels where the file has them: a camera's pixels stay in their places
        whatever a viewer is told to turn.
    remarks : tuple of str
        What was done to get there.
    """

    grey: Image
    remarks: tuple[str, ...] = ()


class OtherPixelsError(ValueError):
    """Pixels of a kind that no camera gives: its text says which."""


def decoded(data: bytes) -> Picture | None:
    """The picture that the bytes of a file hold; None if they hold none that can be read.

    Raises
    ------
    OtherPixelsError
        If its pixels are neither of 8 nor of 16 bits.
    """
    remarks = []
    turned = exif_orientation(data)
    if turned != _AS_STORED:
        said = _TURNS.get(turned, f"in the unknown way {turned}")
        remarks.append(f"its EXIF tag says: to be shown {said}; its pixels are used as stored")
    if turned != _AS_STORED and data[:4] in _TIFF:
        data = _untagged(data)  # OpenCV turns TIFF images whatever it is told
    if data[:4] in _TIFF and (pages := _pages(data)) > 1:
        remarks.append(f"it has {pages} pages; the first one is used")
    whole = np.frombuffer(data, np.uint8)
    if data.startswith(_JPEG):
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        found = cv2.imdecode(whole, flags)
    else:
        found = cv2.imdecode(whole, cv2.IMREAD_UNCHANGED)
    if found is None:
        return None
    values: npt.NDArray[Any] = np.asarray(found)
    if values.dtype == np.uint16:
        opaque = values[..., :3] if values.ndim == 3 and values.shape[2] == 4 else values
        bits = used_bits(opaque)
        remarks.append(f"16 bits a pixel, of which {bits} are used")
        shifted = values >> (bits - _LEAST_BITS)
        if opaque is not values:
            shifted[..., 3] = values[..., 3] >> _LEAST_BITS
        values = shifted.astype(np.uint8)
    elif values.dtype != np.uint8:
        raise OtherPixelsError(
            f"its pixels are {values.dtype}; expected whole numbers, 8 or 16 bits"
        )
    if values.ndim == 3:
        values, more = _grey(values)
        remarks += more
    return Picture(np.ascontiguousarray(values), tuple(remarks))


def used_bits(values: npt.NDArray[np.uint16]) -> int:
    """How many bits the largest value needs: 8 to 16."""
    return max(int(values.max(initial=0)).bit_length(), _LEAST_BITS)


def _grey(values: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.uint8], list[str]]:
    """Grey levels of an image with colours, over white where it is transparent."""
    channels = values.shape[2]
    if channels == 2:
        return values[..., 0], ["an alpha channel, which is left out"]
    if channels == 3:
        return np.asarray(cv2.cvtColor(values, cv2.COLOR_BGR2GRAY), dtype=np.uint8), []
    grey = np.asarray(cv2.cvtColor(values[..., :3], cv2.COLOR_BGR2GRAY), dtype=float)
    cover = values[..., 3] / 255.0
    over = np.rint(grey * cover + 255.0 * (1 - cover)).astype(np.uint8)
    if (values[..., 3] == 255).all():
        return over, []
    return over, ["an alpha channel: what is transparent is taken as white"]


def exif_orientation(data: bytes) -> int:
    """How an image is to be turned to be shown, as its EXIF tag 274 says; 1 for not at all."""
    if data[:4] in _TIFF:
        return _orientation(data)
    if data.startswith(_PNG):
        place = data.find(b"eXIf")
        return _AS_STORED if place < 0 else _orientation(data[place + 4 :])
    if not data.startswith(_JPEG):
        return _AS_STORED
    place = 2
    while place + 4 <= len(data) and data[place] == 0xFF:
        size = int.from_bytes(data[place + 2 : place + 4], "big")
        if data[place + 1] == 0xE1 and data[place + 4 : place + 10] == _EXIF:
            return _orientation(data[place + 10 : place + 2 + size])
        if data[place + 1] == 0xDA:
            break
        place += 2 + size
    return _AS_STORED


def _directory(tiff: bytes, start: int, order: str) -> list[int]:
    """Where the entries of a TIFF directory are."""
    if start + 2 > len(tiff):
        return []
    (count,) = struct.unpack_from(order + "H", tiff, start)
    return [p for p in range(start + 2, start + 2 + 12 * count, 12) if p + 12 <= len(tiff)]


def _first(tiff: bytes) -> tuple[str, int] | None:
    """Byte order of a TIFF block, and where its first directory is."""
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])
    if order is None or len(tiff) < 8:
        return None
    return order, int(struct.unpack_from(order + "I", tiff, 4)[0])


def _pages(tiff: bytes) -> int:
    """How many images a TIFF file holds."""
    begin = _first(tiff)
    pages, seen = 0, set[int]()
    while begin is not None and begin[1] and begin[1] not in seen and begin[1] + 2 <= len(tiff):
        order, start = begin
        seen.add(start)
        pages += 1
        (count,) = struct.unpack_from(order + "H", tiff, start)
        after = start + 2 + 12 * count
        following = struct.unpack_from(order + "I", tiff, after)[0] if after + 4 <= len(tiff) else 0
        begin = order, int(following)
    return pages


def _untagged(tiff: bytes) -> bytes:
    """The TIFF file with its orientation set to none."""
    begin = _first(tiff)
    if begin is None:
        return tiff
    order, start = begin
    changed = bytearray(tiff)
    for entry in _directory(tiff, start, order):
        if struct.unpack_from(order + "H", tiff, entry)[0] == _ORIENTATION:
            struct.pack_into(order + "H", changed, entry + 8, _AS_STORED)
    return bytes(changed)


def _orientation(tiff: bytes) -> int:
    """The orientation in the first directory of an EXIF or TIFF block."""
    begin = _first(tiff)
    if begin is None:
        return _AS_STORED
    order, start = begin
    for entry in _directory(tiff, start, order):
        tag, _kind, _number, value = struct.unpack_from(order + "HHIH", tiff, entry)
        if tag == _ORIENTATION:
            return int(value)
    return _AS_STORED


def video_frames(path: Path, most: int) -> Iterator[tuple[str, Image]]:
    """Frames of a video, evenly spread over it, by names such as 'frame120'.

    Parameters
    ----------
    path : Path
        The video.
    most : int
        Frames at most.

    Raises
    ------
    InputError
        If it cannot be read as a video, or has no frame.
    """
    source = cv2.VideoCapture(str(path))
    try:
        count = int(source.get(cv2.CAP_PROP_FRAME_COUNT)) if source.isOpened() else 0
        step = max(-(-count // most), 1)
        number, given = 0, 0
        while source.isOpened() and source.grab():
            if number % step == 0:
                seen, frame = source.retrieve()
                if seen:
                    grey = frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
                    given += 1
                    yield f"frame{number}", np.asarray(grey, dtype=np.uint8)
            number += 1
    finally:
        source.release()
    if not given:
        raise InputError([Problem(path, "not a video that OpenCV can read")])
