"""The files that a result was made from, by their hashes."""

import hashlib
from pathlib import Path

from validation.errors import GtvalError

COMPUTED = frozenset({"results", "report"})
"""Folders of a campaign that hold nothing a person typed or a sensor recorded."""


def input_hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a campaign folder, by its path relative to the folder.

    Left out are computed folders, hidden files (version control, editors) and temporary ones.

    Raises
    ------
    GtvalError
        If a file cannot be read.
    """
    hashes = {}
    for path in sorted(folder.rglob("*")):
        relative = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in relative.parts)
        if hidden or relative.parts[0] in COMPUTED or path.suffix == ".tmp" or not path.is_file():
            continue
        try:
            with path.open("rb") as stream:
                hashes[relative.as_posix()] = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error
    return hashes
