"""Files written whole or not at all."""

import contextlib
import csv
import hashlib
import os
import platform
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count, islice
from pathlib import Path

from validation.errors import GtvalError
from validation.text_files.csv_text import csv_text

_PIECE = 1 << 20
"""Characters that are turned into bytes at a time."""
_LINES = 4096
"""Lines, likewise."""


@dataclass(frozen=True)
class LargeText:
    """A file too large to be kept as text: its lines are made whenever they are needed.

    Parameters
    ----------
    lines : callable
        Makes all lines, without their ends, each time the same.
    """

    lines: Callable[[], Iterable[str]]

    @cached_property
    def digest(self) -> str:
        """SHA-256 of its bytes, made once."""
        digest = hashlib.sha256()
        for piece in pieces_of(self):
            digest.update(piece)
        return digest.hexdigest()


Content = str | bytes | LargeText
"""What a file will hold."""
LARGEST_KEPT = 10_000
"""Numbers beyond which the text of a table is not kept, but made when it is written: a megabyte of
poses with their covariances."""


def text_of(lines: Callable[[], Iterable[str]], numbers: int) -> str | LargeText:
    """The text of lines without their ends, kept where they hold few numbers."""
    return LargeText(lines) if numbers > LARGEST_KEPT else "\n".join(lines()) + "\n"


def write_files(
    folder: Path,
    contents: Mapping[str, Content],
    *,
    before: Callable[[], None] = lambda: None,
    then: Callable[[], Mapping[str, Content]] = dict,
) -> list[Path]:
    """The paths of a set of files, all written before the first is put in place.

    Each file goes to a temporary neighbour, is flushed to the disk, and only when all of them
    are there do they take their names. After an error the old files are as they were. Each
    single file is old or new at every moment, also in a power cut; only a power cut between
    two renames leaves some files old and some new.

    Parameters
    ----------
    folder : Path
        Root of the relative names; made if missing.
    contents : mapping of str to str, bytes or LargeText
        Relative name to content; text is written as UTF-8.
    before : callable
        Called when all are on the disk, just before the first takes its name; what it raises
        leaves everything as it was.
    then : callable
        Gives further files once these are on the disk, when the digests of large texts are known:
        such a text is made only once then.

    Raises
    ------
    GtvalError
        If the folder cannot be written; the old files are untouched.
    """
    target, made = folder, list[Path]()
    staged: dict[Path, Path] = {}
    kept: dict[Path, Path | None] = {}
    try:
        for name, content in _in_turn(contents, then):
            target = folder / name
            made += [path for path in target.parents if not path.exists()]
            target.parent.mkdir(parents=True, exist_ok=True)
            staged[target] = _stage(target, content)
        before()
        for target, temporary in staged.items():
            kept[target] = _keep(target)
            temporary.replace(target)
    except BaseException as error:
        _undo(kept, staged)
        for path in sorted(made, reverse=True):  # the inner before the outer
            with contextlib.suppress(OSError):
                path.rmdir()
        if isinstance(error, OSError):
            where = error.filename if isinstance(error, FileExistsError) else target
            reason = error.strerror or error
            if isinstance(error, FileExistsError | IsADirectoryError | NotADirectoryError):
                reason = f"{reason}; move away what stands there"
            raise GtvalError(f"cannot write to {where}: {reason}") from error
        raise
    for copy in kept.values():
        if copy:
            copy.unlink()
    _remove_left({target.parent for target in staged})
    return list(staged)


def _in_turn(
    contents: Mapping[str, Content], then: Callable[[], Mapping[str, Content]]
) -> Iterator[tuple[str, Content]]:
    """Files, and those that depend on them."""
    yield from contents.items()
    yield from then().items()


def pieces_of(content: Content) -> Iterator[bytes]:
    """The bytes of a file in pieces, as a large text is not to be there twice.

    A file name that is no UTF-8 may have got into a text: it is written with escapes.
    """
    if isinstance(content, bytes):
        yield content
        return
    if isinstance(content, LargeText):
        lines = iter(content.lines())
        while piece := list(islice(lines, _LINES)):
            yield ("\n".join(piece) + "\n").encode(errors="backslashreplace")
        return
    for start in range(0, len(content), _PIECE):
        yield content[start : start + _PIECE].encode(errors="backslashreplace")


def _stage(target: Path, content: Content) -> Path:
    """A flushed temporary file beside the target; removed again if it cannot be filled."""
    name = _beside(target)
    handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, "wb") as stream:
            digest = hashlib.sha256()
            for piece in pieces_of(content):
                digest.update(piece)
                stream.write(piece)
            stream.flush()
            os.fsync(stream.fileno())
    except BaseException:
        with contextlib.suppress(OSError):
            name.unlink()
        raise
    if isinstance(content, LargeText):
        vars(content)["digest"] = digest.hexdigest()
    return name


_number = count()
_HOST = hashlib.sha256(platform.node().encode()).hexdigest()[:4]
_TEMPORARY = re.compile(rf"\..+\.{_HOST}-(\d+)-\d+(\.old)?\.tmp")


def _beside(target: Path, what: str = "") -> Path:
    """A name beside a file that no other writer uses, and that says who does."""
    return target.with_name(f".{target.name}.{_HOST}-{os.getpid()}-{next(_number)}{what}.tmp")


def _remove_left(folders: Iterable[Path]) -> None:
    """Remove what writers of this machine have left that were killed."""
    for folder in folders:
        with contextlib.suppress(OSError):
            for one in os.scandir(folder):
                found = _TEMPORARY.fullmatch(one.name)
                if found and not _lives(int(found[1])):
                    Path(one.path).unlink()


def _lives(process: int) -> bool:
    """Whether there is a process of that number; said of all where that cannot be told."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _keep(target: Path) -> Path | None:
    """A second name for the file that is about to be replaced; None if there is none."""
    if not target.exists():
        return None
    copy = _beside(target, ".old")
    try:
        copy.hardlink_to(target)
    except OSError:  # a file system without hard links
        shutil.copy2(target, copy)
    return copy


def _undo(kept: Mapping[Path, Path | None], staged: Mapping[Path, Path]) -> None:
    """The files as they were before, and no temporary one left."""
    for target, temporary in staged.items():
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        if target not in kept:
            continue
        with contextlib.suppress(OSError):
            copy = kept[target]
            if copy is None:
                target.unlink(missing_ok=True)
            else:
                copy.replace(target)
                copy.unlink(missing_ok=True)  # two names of one file are not renamed


def append_rows(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Add rows to the end of a CSV file, which is made if missing, all at once.

    They are on the disk when this returns. A file whose columns stand in another order gets them
    in its own.

    Parameters
    ----------
    path : Path
        The file.
    header : sequence of str
        Names of the columns.
    rows : sequence of sequence
        As `csv_text` takes them.

    Raises
    ------
    GtvalError
        If the file lacks one of the columns, or cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        before = path.read_bytes() if path.exists() else b""
        text = csv_text(header, rows)
        if before:
            first = before.partition(b"\n")[0].decode("utf-8-sig", "replace")
            own = [name.strip() for name in next(csv.reader([first]), [])]
            if missing := [name for name in header if name not in own]:
                raise GtvalError(
                    f"{path}: its first line has no column '{missing[0]}'; add it there, and a "
                    "comma to each row"
                )
            order = [header.index(name) if name in header else None for name in own]
            rows = [["" if at is None else row[at] for at in order] for row in rows]
            text = csv_text(own, rows).partition("\n")[2]
            text = text if before.endswith(b"\n") else f"\n{text}"
        _append(path, text.encode())
    except OSError as error:
        raise GtvalError(f"cannot write {path}: {error.strerror or error}") from error


def _append(path: Path, text: bytes) -> None:
    """Add bytes to a file, on the disk when this returns: all of them, or none."""
    with path.open("ab", buffering=0) as stream:
        length = stream.tell()
        try:
            rest = memoryview(text)
            while rest:  # of a full disk the next write says so
                rest = rest[stream.write(rest) :]
            os.fsync(stream.fileno())
        except OSError:
            stream.truncate(length)
            raise
