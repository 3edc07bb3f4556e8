"""The AD2.3 campaign that comes with the program, copied to a folder of the user's."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from validation.errors import GtvalError
from validation.text_files.writing import write_files


def demo_files() -> dict[str, bytes]:
    """The files of the AD2.3 campaign, by their names relative to its folder."""
    return dict(sorted(_below(files("data_samples") / "ad23", "").items()))


def _below(folder: Traversable, prefix: str) -> dict[str, bytes]:
    """All files below a folder of the installed package."""
    found: dict[str, bytes] = {}
    for entry in folder.iterdir():
        name = prefix + entry.name
        found.update(_below(entry, name + "/") if entry.is_dir() else {name: entry.read_bytes()})
    return found


def copy_demo(folder: Path) -> None:
    """Copy the AD2.3 campaign to a folder that is new, empty, or such a copy already.

    Raises
    ------
    GtvalError
        If the folder holds something else, or a copy that was changed; nothing is written then.
    """
    contents = demo_files()
    if folder.exists() and not folder.is_dir():
        raise GtvalError(f"{folder} is a file; give the demo a folder of its own")
    held = any(folder.iterdir()) if folder.exists() else False
    if held and not (folder / "campaign.toml").is_file():
        raise GtvalError(
            f"{folder} is not empty and holds no copy of the demo; nothing was written. "
            "Give another folder: gtval demo DIR"
        )
    changed = [name for name, content in contents.items() if _differs(folder / name, content)]
    if changed:
        raise GtvalError(
            f"{folder} is not the demo, or was changed since it was copied "
            f"({', '.join(changed[:3])}{', …' if len(changed) > 3 else ''}); nothing was written. "
            f"Give another folder, or compute it as it is: gtval run {folder}"
        )
    write_files(folder, {n: c for n, c in contents.items() if not (folder / n).exists()})


def _differs(path: Path, content: bytes) -> bool:
    """Whether a file is there with another content."""
    return path.exists() and (not path.is_file() or path.read_bytes() != content)
