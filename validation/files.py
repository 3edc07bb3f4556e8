"""Files written whole or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from validation.errors import GtvalError


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """The paths of a set of files, all written before the first is put in place.

    Each file goes to a temporary neighbour, is flushed to the disk, and only when all of them
    are there do they take their names. An error or a power cut leaves the old files as they
    were.

    Parameters
    ----------
    folder : Path
        Root of the relative names; made if missing.
    contents : mapping of str to str or bytes
        Relative name to content; text is written as UTF-8.

    Raises
    ------
    GtvalError
        If the folder cannot be written; the old files are untouched.
    """
    staged: list[tuple[Path, Path]] = []
    try:
        for name, content in contents.items():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            staged.append((_stage(target, content), target))
        for temporary, target in staged:
            temporary.replace(target)
    except OSError as error:
        for temporary, _ in staged:
            temporary.unlink(missing_ok=True)
        raise GtvalError(f"cannot write to {folder}: {error.strerror or error}") from error
    return [target for _, target in staged]


def _stage(target: Path, content: str | bytes) -> Path:
    """A flushed temporary file beside the target; removed again if it cannot be filled."""
    data = content.encode() if isinstance(content, str) else content
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".tmp", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
    umask = os.umask(0)
    os.umask(umask)
    Path(name).chmod(0o666 & ~umask)
    return Path(name)
