"""Ground-truth systems and commands, found by their entry points.

A package adds a system by an entry point in the group ``gtval.systems`` that names an object
with the attributes of :class:`System`, and commands by one in ``gtval.commands`` that names a
sequence of click commands. Neither may import anything heavy when it is loaded.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from validation.errors import GtvalError
from validation.plugins import entry_points

if TYPE_CHECKING:
    from validation.campaign import Campaign
    from validation.results import SystemResult

VALIDATION_SYSTEM = "survey"
"""The system whose poses the others are compared with."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the share done, 0 to 1."""


def no_progress(_what: str, _share: float) -> None:
    """Report to nobody."""


class System(Protocol):
    """What a package offers to make poses from a campaign folder."""

    name: str
    """Short name; its table of campaign.toml has the same."""

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether the campaign holds anything for this system. Reads no large file."""
        ...

    def solve(self, campaign: "Campaign", progress: Progress) -> "SystemResult":
        """Poses, findings and report sections.

        Raises
        ------
        GtvalError
            If the data are bad or do not determine the poses.
        """
        ...


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
            systems.append(entry.load())
        except Exception as error:
            raise GtvalError(
                f"the plug-in '{entry.name}' ({entry.value}) cannot be loaded: {error}"
            ) from error
    return sorted(systems, key=lambda system: (system.name != VALIDATION_SYSTEM, system.name))
