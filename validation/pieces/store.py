"""Results of pieces of work, kept in the campaign folder from one run to the next."""

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

FOLDER = "kept"
"""Below the campaign; may be deleted at any time."""
_BEGIN, _SUM, _TOLD = b'{"key":"', b'","sum":"', b'","told":'
_END = b"}\n"
_DIGITS = 64
"""Of a key, and of the sum of a line, in base 16."""
LIBRARIES = ("numpy", "scipy", "opencv-contrib-python-headless", "filterpy", "kiss-icp")
"""Others than gtval that results depend on to the last digit."""
_SHARED = ("validation.poses.angles", "validation.statistics.robust")
"""Formulas that all packages use."""


@dataclass
class Tally:
    """How many pieces were taken over from earlier runs, were done, and could not be kept."""

    taken: int = 0
    done: int = 0
    lost: int = 0


@dataclass
class Counts:
    """Pieces of each kind since `counted` began."""

    kinds: dict[str, Tally] = field(default_factory=dict)

    def of(self, kind: str) -> Tally:
        """Of one kind."""
        return self.kinds.setdefault(kind, Tally())

    def text(self) -> str:
        """'Taken over from earlier runs: 130 of 130 images', a line; '' where nothing was."""
        parts = [
            f"{one.taken:,} of {one.taken + one.done:,} {kind}"
            for kind, one in self.kinds.items()
            if one.taken
        ]
        told = f"Taken over from earlier runs: {', '.join(parts)}\n" if parts else ""
        lost = ", ".join(f"{one.lost:,} {kind}" for kind, one in self.kinds.items() if one.lost)
        if lost:
            told += f"Not kept for later runs, as the folder {FOLDER} cannot be written: {lost}\n"
        return told


_counts: ContextVar[Counts | None] = ContextVar("counts", default=None)


@contextmanager
def counted() -> Iterator[Counts]:
    """Count all pieces that are done or taken over until the end of the block."""
    counts = Counts()
    token = _counts.set(counts)
    try:
        yield counts
    finally:
        _counts.reset(token)


class KeptPieces:
    """What earlier runs made of pieces of work, and what this one adds.

    Each piece is one line of JSON, written as soon as it is done: a run that is killed goes on
    where it was, and two runs at once add to the same file. A line that is not as it was written
    does not count. Only where the lines are is in memory.
    Where nothing can be written all is done again by the next run.

    Parameters
    ----------
    path : Path
        The file, of a folder that need not be there.
    kind : str
        What the pieces are, in the plural: 'images'.
    """

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.kind = path, kind
        self._place: dict[str, int] = {}
        self._unwritten: dict[str, bytes] = {}
        self._cut = False
        with suppress(OSError), path.open("rb") as stream:
            start = 0
            for line in stream:
                if line.startswith(_BEGIN) and line.endswith(_END):
                    key = line[len(_BEGIN) : len(_BEGIN) + _DIGITS].decode("ascii", "replace")
                    self._place[key] = start
                start += len(line)
                self._cut = not line.endswith(b"\n")

    def __len__(self) -> int:
        return len(self._place) + len(self._unwritten)

    def __contains__(self, key: str) -> bool:
        return key in self._place or key in self._unwritten

    def get(self, key: str) -> dict[str, Any] | None:
        """What was made of a piece; None where that is not known, or not as it was written."""
        try:
            line = self._line(key)
            told = line[len(_head(key, "")) + _DIGITS : -len(_END)]
            if line != _line_of(key, told):
                return None
            found: dict[str, Any] = json.loads(told)
        except (OSError, ValueError, KeyError):
            return None
        return found

    def _line(self, key: str) -> bytes:
        if key in self._unwritten:
            return self._unwritten[key]
        with self.path.open("rb") as stream:
            stream.seek(self._place[key])
            return stream.readline()

    def add(self, key: str, told: Mapping[str, Any]) -> None:
        """Keep what was made of a piece, of values that JSON has."""
        line = _line_of(key, json.dumps(dict(told), separators=(",", ":")).encode())
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab", buffering=0) as stream:  # one write, so that no two mix
                if self._cut:
                    stream.write(b"\n")
                    self._cut = False
                written = stream.write(line)
                place = stream.tell() - written
                self._cut = written < len(line)
        except OSError:
            self._unwritten[key] = line
            self.count(lost=1)
            return
        self._place[key] = place

    def forget_others(self, keys: Collection[str]) -> None:
        """Leave only the pieces of some keys in the file; it stays as it is where that fails."""
        if not set(self._place) - set(keys):
            return
        beside = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        place: dict[str, int] = {}
        try:
            with beside.open("wb") as stream:
                for key in keys:
                    if key in self._place:
                        place[key] = stream.tell()
                        stream.write(self._line(key))
            beside.replace(self.path)
        except OSError:
            with suppress(OSError):
                beside.unlink()
            return
        self._place, self._cut = place, False

    def count(self, *, taken: int = 0, done: int = 0, lost: int = 0) -> None:
        """Tell those who count (`counted`) of pieces taken over, done, and not kept."""
        counts = _counts.get()
        if counts is not None:
            one = counts.of(self.kind)
            one.taken, one.done = one.taken + taken, one.done + done
            one.lost += lost


def _head(key: str, checked: str) -> bytes:
    return _BEGIN + key.encode() + _SUM + checked.encode() + _TOLD


def _line_of(key: str, told: bytes) -> bytes:
    """The line of a piece, with a sum that tells whether it is as it was written."""
    return _head(key, key_of(key.encode(), told)) + told + _END


_folder: ContextVar[Path | None] = ContextVar("folder", default=None)


@contextmanager
def kept_in(campaign: Path) -> Iterator[None]:
    """Keep the pieces of estimators that know no files below a campaign folder."""
    token = _folder.set(campaign / FOLDER)
    try:
        yield
    finally:
        _folder.reset(token)


def kept_here(file: str, kind: str) -> KeptPieces | None:
    """The pieces of a file where `kept_in` says; None where nothing is kept."""
    folder = _folder.get()
    return None if folder is None else KeptPieces(folder / file, kind)


def key_of(*parts: bytes) -> str:
    """SHA-256 of all that a piece depends on, each part by its length and its content."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big"))
        digest.update(part)
    return digest.hexdigest()


@cache
def code_of(*packages: str) -> bytes:
    """Digest of the code of packages or modules, and of the versions of the libraries below it.

    So a result is done again when the code that makes it has changed, and by no other change.

    Parameters
    ----------
    *packages : str
        Importable names: 'laser_gt.matching'.
    """
    digest = hashlib.sha256(libraries())
    for package in (*_SHARED, *packages):
        digest.update(_code_in(package))
    return digest.digest()


@cache
def libraries() -> bytes:
    """The versions of what results depend on."""
    return "".join(f"{name} {version(name)}\n" for name in (*LIBRARIES, "gtval")).encode()


@cache
def _code_in(package: str) -> bytes:
    """Digest of the code of a package or module."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(package)
    origin, digest = Path(spec.origin), hashlib.sha256()
    files = sorted(origin.parent.rglob("*.py")) if spec.submodule_search_locations else [origin]
    for file in files:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.digest()
