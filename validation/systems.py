"""Ground-truth systems and commands, found by their entry points.

A package adds a system by an entry point in the group ``gtval.systems`` that names an object
with the attributes of :class:`System`, and commands by one in ``gtval.commands`` that names a
sequence of click commands. The entry point of a system is called as the system, and so is its
table of campaign.toml. Neither may import anything heavy when it is loaded.
"""

import contextlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from validation.errors import GtvalError
from validation.plugins import entry_points
from validation.results import VALIDATION_SYSTEM

if TYPE_CHECKING:
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult

Progress = Callable[[str, float], None]
"""Called with what is being done and the share done, 0 to 1."""


def no_progress(_what: str, _share: float) -> None:
    """Report to nobody."""


class System(Protocol):
    """What a package offers to make poses from a campaign folder.

    A system may also have a method ``inputs(campaign)`` that gives the files and folders which
    `solve` reads, campaign.toml apart. Without it, its results are out of date when any file of
    the campaign has changed. A system that needs the surveyed stops says so by an attribute
    ``starts_from_survey``: they are then in ``campaign.solved``, also where it is solved alone.
    """

    name: str
    """Short name; its table of campaign.toml has the same."""

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether the campaign holds anything for this system. Reads no large file."""
        ...

    def solve(self, campaign: "Campaign", progress: Progress, **choices: Any) -> "SystemResult":
        """Poses, findings and report sections.

        ``choices`` are those of the command line that differ from the settings; a system
        without a command of its own takes none.

        Raises
        ------
        GtvalError
            If the data are bad or do not determine the poses.
        """
        ...


def inputs_of(system: System, campaign: "Campaign") -> list[Path]:
    """Files and folders that a system reads: its own word for it, or the whole campaign.

    The whole campaign also where a plug-in fails to say it: its results are then rather taken
    for out of date than for up to date.
    """
    own: Callable[[Campaign], Iterable[Path]] | None = getattr(system, "inputs", None)
    if own is not None:
        with contextlib.suppress(Exception):
            return [campaign.toml, *own(campaign)]
    return [campaign.folder]


def installed_systems() -> list[System]:
    """All systems whose packages are installed, the survey first, then by name.

    Raises
    ------
    GtvalError
        If a plug-in cannot be loaded.
    """
    systems: list[System] = []
    for entry in entry_points(group="gtval.systems"):
        try:
            system: System = entry.load()
            systems.append(system)
            name = system.name
        except Exception as error:
            raise GtvalError(
                f"the plug-in '{entry.name}' ({entry.value}) cannot be loaded: {error}"
            ) from error
        if name != entry.name:
            raise GtvalError(
                f"the plug-in '{entry.name}' ({entry.value}) calls its system '{name}'; in its "
                "pyproject.toml call the entry point so too, or change the system's name"
            )
    return sorted(systems, key=lambda system: (system.name != VALIDATION_SYSTEM, system.name))


def installed_system(name: str) -> System:
    """The installed system of that name.

    Raises
    ------
    GtvalError
        If there is none, or a plug-in cannot be loaded.
    """
    systems = installed_systems()
    for system in systems:
        if system.name == name:
            return system
    raise GtvalError(
        f"no system '{name}' is installed; there are: {', '.join(s.name for s in systems)}"
    )
