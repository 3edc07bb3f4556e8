"""Ground-truth systems and commands, found by their entry points.

A package adds a system by an entry point in the group ``gtval.systems`` that names an object
with the attributes of :class:`System`, and commands by one in ``gtval.commands`` that names a
sequence of click commands. The entry point of a system is called as the system, and so is its
table of campaign.toml. Neither may import anything heavy when it is loaded.
"""

import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from validation.errors import GtvalError
from validation.plugins import EntryPoint, entry_points
from validation.results import VALIDATION_SYSTEM, Finding

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
    the campaign has changed. Of these files, those that ``optional_inputs(campaign)`` gives may be
    missing; of the others that is told. A system that needs the surveyed stops says so by an
    attribute ``starts_from_survey``: they are then in ``campaign.solved``, also where it is solved
    alone.
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


def needed_inputs(system: System, campaign: "Campaign") -> list[Path]:
    """Files that a system cannot do without; all that it reads where each has a stand-in."""
    paths = inputs_of(system, campaign)
    with contextlib.suppress(Exception):
        optional = set(getattr(system, "optional_inputs", lambda _: ())(campaign))
        return [path for path in paths if path not in optional | {campaign.toml}] or paths
    return paths


def untold_inputs(system: System, campaign: "Campaign") -> list[Finding]:
    """A warning where a system fails to say what it reads, or a file that it reads is missing."""
    try:
        paths = set(getattr(system, "inputs", lambda _: ())(campaign))
        paths -= set(getattr(system, "optional_inputs", lambda _: ())(campaign))
        missing = sorted(str(path) for path in paths if not path.exists())
    except Exception as error:  # noqa: BLE001  (its poses stand without that)
        text = (
            f"It does not say which files it reads ({type(error).__name__}: {error}), so that its "
            "results count as out of date when any file of the campaign changes. Please report it."
        )
        return [Finding("warning", text, system.name, "inputs_unknown")]
    text = f"Not there, though it is read: {', '.join(missing)}; put it back if there is one."
    return [Finding("warning", text, system.name, "input_missing")] if missing else []


@dataclass
class Unloadable:
    """Stands in for a system whose plug-in cannot be loaded: whatever is asked of it fails."""

    name: str
    entry: EntryPoint
    error: BaseException

    def has_data(self, campaign: "Campaign") -> bool:  # noqa: ARG002
        """Raise what its import raised."""
        said = f"the plug-in '{self.entry.name}' ({self.entry.value}) cannot be loaded"
        raise ImportError(f"{said}: {self.error}") from self.error

    def solve(self, campaign: "Campaign", progress: Progress, **choices: Any) -> "SystemResult":  # noqa: ARG002
        """Raise what its import raised."""
        raise AssertionError(self.has_data(campaign))


def _loaded(entry: EntryPoint, others: Iterable[System]) -> System:
    """The system of an entry point, or what stands in for it."""
    if any(other.name == entry.name for other in others):
        said = ImportError("another installed package has a system of that name")
        return Unloadable(f"{entry.name} ({entry.value})", entry, said)
    try:
        system: System = entry.load()
        name, sound = system.name, callable(system.has_data) and callable(system.solve)
    except (Exception, SystemExit) as error:  # noqa: BLE001  (one plug-in must not take the others)
        return Unloadable(entry.name, entry, error)
    if sound and name == entry.name:
        return system
    said = ImportError(
        f"it calls its system '{name}'; in its pyproject.toml call the entry point so too, or "
        "change the system's name"
        if sound
        else f"{system!r} has no method has_data or solve"
    )
    return Unloadable(entry.name, entry, said)


def installed_systems() -> list[System]:
    """All systems whose packages are installed, the survey first, then by name.

    A plug-in that cannot be loaded is there as a system that fails: leaving it out would leave
    its poses out of the comparison without a word.
    """
    systems: list[System] = []
    for entry in entry_points(group="gtval.systems"):
        systems.append(_loaded(entry, systems))
    return sorted(systems, key=lambda system: (system.name != VALIDATION_SYSTEM, system.name))


def installed_system(name: str) -> System:
    """The installed system of that name.

    Raises
    ------
    GtvalError
        If there is none.
    """
    systems = installed_systems()
    for system in systems:
        if system.name == name:
            return system
    raise GtvalError(
        f"no system '{name}' is installed; there are: {', '.join(s.name for s in systems)}"
    )
