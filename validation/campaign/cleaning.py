"""What earlier runs left in a folder for later ones, found and removed."""

import re
from pathlib import Path

from validation.errors import GtvalError
from validation.pieces.store import FOLDER

OWN = re.compile(r"\.?\w+\.jsonl(\.\d+)?")
"""Names of kept files, and of what a run leaves beside one that it was killed while it replaced."""


def folders_of(folder: Path) -> list[Path]:
    """The folder, or the campaigns in it where it is neither a campaign nor has anything kept."""
    if (folder / FOLDER).exists() or (folder / "campaign.toml").exists() or not folder.is_dir():
        return [folder]
    below = sorted(one for one in folder.iterdir() if (one / "campaign.toml").is_file())
    return below or [folder]


def kept_files(folder: Path) -> dict[Path, int]:
    """Files of kept pieces below a campaign or study folder, and their bytes.

    Raises
    ------
    GtvalError
        If there is no such folder, or what is called 'kept' in it is not of gtval's making.
    """
    if not folder.is_dir():
        raise GtvalError(f"{folder}: there is no such folder")
    kept = folder / FOLDER
    if kept.is_symlink() or (kept.exists() and not kept.is_dir()):
        raise GtvalError(f"{kept} is no folder of kept pieces; nothing was removed")
    found = sorted(kept.iterdir()) if kept.is_dir() else []
    if strange := [one for one in found if not (OWN.fullmatch(one.name) and one.is_file())]:
        raise GtvalError(
            f"{strange[0]} is not of gtval's making; nothing was removed. Move it elsewhere first"
        )
    return {one: one.stat().st_size for one in found}


def remove_kept(folder: Path) -> None:
    """Remove these files and their folder.

    Raises
    ------
    GtvalError
        As `kept_files`, or if they cannot be removed.
    """
    try:
        for one in kept_files(folder):
            one.unlink()
        if (folder / FOLDER).is_dir():
            (folder / FOLDER).rmdir()
    except OSError as error:
        raise GtvalError(f"{folder / FOLDER} cannot be removed: {error.strerror}") from None
