"""A camera file before anybody knows its format: its bytes, its text and its fields."""

import io
import json
import re
import zipfile
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from validation.errors import GtvalError, InputError, Problem
from vision_gt.optics.formats.fields import bad

MAX_BYTES = 20_000_000
"""A judgement: camera files have some kilobytes, images and videos megabytes."""
_SMALL = 10_000
"""Bytes of an array in a file of numpy; a covariance of nine parameters has 776."""


@dataclass(frozen=True)
class Source:
    """A camera file.

    Parameters
    ----------
    path : Path
        Where it is.
    data : bytes
        What it has.
    """

    path: Path
    data: bytes

    @cached_property
    def suffix(self) -> str:
        """The ending of its name, in small letters."""
        return self.path.suffix.lower()

    @cached_property
    def text(self) -> str:
        """Its text, with marks instead of bytes that are none."""
        return self.data.decode("utf-8-sig", errors="replace")

    @cached_property
    def root(self) -> dict[str, Any]:
        """What is named in it: dicts, lists, strings and floats, whatever its syntax.

        Raises
        ------
        InputError
            If it has no syntax that is read, or names nothing.
        """
        if self.suffix == ".npy":
            said = "one array without a name; write them with their names: numpy.savez"
            raise bad(self.path, f"{said}(file, camera_matrix=..., dist_coeffs=...)")
        if self.suffix == ".npz":
            return _arrays(self.path, self.data)
        if self.suffix == ".mat":
            return _matlab(self.path, self.data)
        start = self.text.lstrip()
        if start.startswith("<") or "opencv-matrix" in self.text:
            return _opencv(self.path, self.text)
        if start.startswith("{"):
            try:
                return _named(self.path, json.loads(self.text))
            except ValueError:
                pass  # YAML may begin with a bracket as well
        return _named(self.path, _yaml(self.path, self.text))


def source_of(path: Path) -> Source:
    """A file as it is on the disk.

    Raises
    ------
    GtvalError
        If it is missing, cannot be read, or is too large to be a camera file.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise bad(path, "larger than 20 MB; this cannot be a camera file")
        return Source(path, path.read_bytes())
    except FileNotFoundError:
        raise bad(path, "there is no such camera file") from None
    except OSError as error:
        raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error


def _named(path: Path, found: Any) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise bad(path, "not a camera file: nothing is named in it")
    return {str(key): _as_read(value) for key, value in found.items()}


def _as_read(value: Any) -> Any:
    """Values as OpenCV's parser gives them: dicts, lists, strings and floats."""
    if isinstance(value, dict):
        return {str(key): _as_read(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_as_read(one) for one in value]
    if isinstance(value, str):
        try:
            return float(value)  # '1e-3' is a string in YAML 1.1
        except ValueError:
            return value
    return float(value) if isinstance(value, int | float) else None


def _yaml(path: Path, text: str) -> Any:
    """The document of a text; of several alike, as ROS prints messages, the first."""
    import yaml  # noqa: PLC0415  (other formats do without)

    # OpenCV writes '%YAML:1.0', which is no YAML.
    text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
    try:
        documents = [one for one in yaml.safe_load_all(text) if one is not None]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        said = getattr(error, "problem", None) or "it is no YAML"
        line = None if mark is None else mark.line + 1
        raise InputError([Problem(path, f"not a camera file: {said}", line)]) from None
    if any(_without_header(one) != _without_header(documents[0]) for one in documents[1:]):
        said = f"it has {len(documents)} documents, which differ; leave the one that you mean"
        raise bad(path, f"not a camera file: {said}")
    return documents[0] if documents else None


def _without_header(document: Any) -> Any:
    """A document without that of a message of ROS, which has its time."""
    if not isinstance(document, dict):
        return document
    return {key: value for key, value in document.items() if key != "header"}


def _opencv(path: Path, text: str) -> dict[str, Any]:
    """What OpenCV's own files say, read by its parser."""
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        found = _plain(storage.root())
    except (cv2.error, SystemError) as error:
        # A storage that was not opened has no message of its own.
        said = str(error).splitlines()[0] if isinstance(error, cv2.error) else ""
        said = said if said and "<class" not in said else "not what OpenCV writes"
        raise bad(path, f"not a camera file: {said}") from None
    if not isinstance(found, dict):
        raise bad(path, "not a camera file: nothing is named in it")
    return found


def _plain(node: Any) -> Any:
    """A node as dict, list, str or float; None for any other."""
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118  (no dict)
    if node.isSeq():
        return [_plain(node.at(i)) for i in range(node.size())]
    if node.isString():
        return node.string()
    return node.real() if node.isInt() or node.isReal() else None


def _arrays(path: Path, data: bytes) -> dict[str, Any]:
    """Arrays of numpy.savez that are small enough to be fields of a camera; others are left out."""
    said = "not a camera file of numpy"
    if not zipfile.is_zipfile(io.BytesIO(data)):
        raise bad(path, f"{said}: no archive as numpy.savez writes it, or a part of one")
    faults = (ValueError, OSError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            small = [
                name
                for name in archive.files
                # Points of boards are not wanted, nor what unpacks to more than memory holds.
                if archive.zip.getinfo(f"{name}.npy").file_size < _SMALL
            ]
            return {name: _as_read(np.asarray(archive[name]).tolist()) for name in small}
    except faults as error:
        # numpy's advice would be to unpack objects, which can run anything.
        why = "it has objects, which are not read" if "pickle" in str(error) else str(error)
        raise bad(path, f"{said}: {why}") from None


def _matlab(path: Path, data: bytes) -> dict[str, Any]:
    """The variables of a MATLAB file, arrays as they are."""
    from scipy.io import loadmat  # noqa: PLC0415  (only this format needs it)

    try:
        stream: Any = io.BytesIO(data)
        return dict(loadmat(stream))
    except Exception as error:  # noqa: BLE001  (scipy raises many kinds for broken files)
        raise bad(path, f"not a MATLAB file: {error}") from None
