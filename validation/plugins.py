"""Entry points of installed packages, read straight from their metadata files.

The same answer as `importlib.metadata.entry_points`, for packages that are installed as folders
(as pip does). Importing importlib.metadata takes longer than the rest of ``gtval --help``
together, because it brings mail and zip archives along.
"""

import os
import sys
from importlib import import_module
from typing import Any, NamedTuple


class EntryPoint(NamedTuple):
    """A name and the object that it stands for, 'module:attribute'."""

    name: str
    value: str

    def load(self) -> Any:
        """The object.

        Raises
        ------
        ImportError, AttributeError
            If there is no such module or attribute; and whatever importing it raises.
        """
        module, _, attribute = self.value.partition(":")
        loaded = import_module(module.strip())
        for part in filter(None, attribute.split(".")):
            loaded = getattr(loaded, part.strip())
        return loaded


def entry_points(*, group: str) -> list[EntryPoint]:
    """All entry points of a group, in the order of sys.path.

    A package that is found twice counts once, where it is found first.

    Notes
    -----
    Format: PyPA specification "Entry points", file entry_points.txt in a .dist-info folder.
    """
    found: list[EntryPoint] = []
    seen: set[str] = set()
    for folder in sys.path:
        for path in _metadata_folders(folder or "."):
            package = os.path.basename(path).partition("-")[0].lower()  # noqa: PTH119
            if package not in seen:
                seen.add(package)
                found += _entries(path, group)
    return found


def _metadata_folders(folder: str) -> list[str]:
    """Folders of installed packages' metadata in a folder of sys.path."""
    try:
        with os.scandir(folder) as items:
            return sorted(i.path for i in items if i.name.endswith((".dist-info", ".egg-info")))
    except OSError:
        return []


def _entries(path: str, group: str) -> list[EntryPoint]:
    """Entries of a group in one package's entry_points.txt."""
    try:
        with open(os.path.join(path, "entry_points.txt"), encoding="utf-8") as file:  # noqa: PTH118, PTH123
            lines = file.read().splitlines()
    except OSError:
        return []
    entries, inside = [], False
    for line in lines:
        text = line.partition("#")[0].strip()
        if text.startswith("["):
            inside = text == f"[{group}]"
        elif inside and "=" in text:
            name, _, value = text.partition("=")
            entries.append(EntryPoint(name.strip(), value.partition("[")[0].strip()))
    return entries
