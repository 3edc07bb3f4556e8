"""Panels of the page, found by their entry points.

A package adds a panel by an entry point in the group ``gtval.panels`` that names an object with
the attributes of :class:`Panel`. It may import nothing heavy when it is loaded. The entry point
of a panel is called as the panel.
"""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

from validation.errors import FinalError, GtvalError
from validation.plugins import EntryPoint, entry_points

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from validation.campaign.folder import Campaign
    from validation.page.access import Device
    from validation.page.desk import Desk

    Handler = Callable[[Request, Device], Awaitable[Response]]

FIRST = ("to_do", "readings", "matches", "images", "trajectories", "report")
"""The order of our own panels: as the work goes. Others stand behind them, by name."""


@dataclass(frozen=True)
class Call:
    """A request that a panel answers. Only devices that were let in get through to it.

    Parameters
    ----------
    method : {"GET", "POST"}
        What reads is a GET, what changes anything a POST.
    path : str
        Below the panel's own: '' for its page, 'pair/{number}'.
    handler : callable
        Called with the request and the device that sent it. What it raises as a `GtvalError` is
        told to the person as it is, as a `RefusedError` with its status.
    """

    method: Literal["GET", "POST"]
    path: str
    handler: "Handler"


@dataclass(frozen=True)
class Waiting:
    """Something that waits for a person, or has been done.

    Parameters
    ----------
    text : str
        What, with how much of it.
    done : bool
        Whether nothing of it is left.
    count : int
        How much is left, for the mark on the panel's name; 0 for what is not counted.
    """

    text: str
    done: bool = False
    count: int = 0


class OpenPanel(Protocol):
    """A panel of one campaign, as long as the page is served."""

    calls: Sequence[Call]
    """All its requests. One is a GET of '', its page."""
    static: Mapping[str, bytes]
    """Its style sheets and scripts by their names, served under 'static/'."""

    def version(self) -> str:
        """Another text whenever what it shows has changed, by whatever hand; quick to ask for."""
        ...

    def waiting(self) -> list[Waiting]:
        """What waits for a person here.

        Raises
        ------
        GtvalError
            If the files do not tell.
        """
        ...

    def close(self) -> None:
        """The page ends."""
        ...


class Panel(Protocol):
    """What a package offers to the page of a campaign."""

    name: str
    """Short name; its place in addresses."""
    title: str
    """Its name for people."""

    def has_work(self, campaign: "Campaign") -> bool:
        """Whether the campaign holds anything for it. Reads no large file."""
        ...

    def open(self, desk: "Desk") -> OpenPanel:
        """The panel of a campaign. Quick: what takes long is done when it is first asked for."""
        ...


@dataclass
class Found:
    """The panels of all packages, and those that cannot be loaded, with the reason."""

    panels: list[Panel] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)


def installed_panels() -> Found:
    """All panels whose packages are installed, in their order.

    One that cannot be loaded is told and takes none of the others along.
    """
    found = Found()
    for entry in entry_points(group="gtval.panels"):
        try:
            found.panels.append(_loaded(entry, found.panels))
        except (Exception, SystemExit) as error:  # noqa: BLE001  (it must not take the rest)
            found.failed[entry.name] = f"{entry.value}: {error}"
    rank = {name: place for place, name in enumerate(FIRST)}
    found.panels.sort(key=lambda panel: (rank.get(panel.name, len(FIRST)), panel.name))
    return found


async def said_in(request: "Request") -> dict[str, Any]:
    """The members of the JSON object that a request carries."""
    from validation.page.requests import json_fields  # noqa: PLC0415  (an extra)

    return await json_fields(request)


async def answered(made: Callable[[], dict[str, Any]]) -> "Response":
    """What is made in a thread of its own, as JSON."""
    from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)
    from starlette.responses import JSONResponse  # noqa: PLC0415  (the same)

    from validation.text_files.json_text import as_json  # noqa: PLC0415  (numpy)

    return JSONResponse(as_json(await run_in_threadpool(made)))


async def recorded(made: Callable[[], dict[str, Any]]) -> "Response":
    """The same of what records something: where files forbid it now, it may be sent again later.

    A file that is being edited, or a full disk, is no reason for a browser to forget what a person
    decided; only a `FinalError` is.
    """
    from validation.page.requests import RefusedError  # noqa: PLC0415  (an extra)

    try:
        return await answered(made)
    except FinalError:
        raise
    except GtvalError as error:
        raise RefusedError(503, str(error)) from None


def _loaded(entry: EntryPoint, others: Sequence[Panel]) -> Panel:
    """The panel of an entry point.

    Raises
    ------
    ImportError
        If it is none, or is called otherwise, or as another one.
    """
    panel: Panel = entry.load()
    if not (callable(panel.has_work) and callable(panel.open) and panel.title):
        raise ImportError(f"{panel!r} has no title, has_work or open")
    if panel.name != entry.name or not panel.name.replace("_", "").isalnum():
        raise ImportError(f"it calls its panel '{panel.name}'; call the entry point so too")
    if panel.name in {"static", "join", "versions", *(other.name for other in others)}:
        raise ImportError("that name is taken")
    return panel
