"""What earlier runs left in a folder for later ones, found and removed."""

from pathlib import Path

from validation.errors import GtvalError
from validation.pieces.store import FOLDER


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
    if strange := [one for one in found if one.suffix != ".jsonl" or not one.is_file()]:
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
