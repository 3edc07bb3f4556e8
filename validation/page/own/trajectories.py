"""The panel on which the signals of trajectories are laid over each other."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from validation.errors import GtvalError
from validation.page.desk import Desk, english, static_files, version_of
from validation.page.own.moving import origins
from validation.page.panels import Call, Waiting, answered, said_in
from validation.pieces.processes import Beside

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from validation.campaign.folder import Campaign
    from validation.page.access import Device

WORDS = english()["trajectories"]
FILES = ("trajectories.css", "trajectories.js", "plot.js")
SECONDS = 120.0
"""For one answer; a judgement: the clock of an hour of drive takes a quarter of that."""
MOST_SECONDS = 1e7
"""Of a time within a drive: four months."""
MOST_MOVED = 3600.0
"""Seconds that a part may be moved by: an hour is a time zone."""


class TrajectoriesPanel:
    """The trajectories of a campaign that has two of them."""

    name, title = "trajectories", WORDS["title"]

    def has_work(self, campaign: "Campaign") -> bool:
        """Whether there are two to be laid over each other."""
        return len(origins(campaign)) > 1

    def open(self, desk: Desk) -> "OpenTrajectories":
        """The trajectories of a campaign; they are read when somebody looks."""
        return OpenTrajectories(desk)


class OpenTrajectories:
    """The trajectories of a campaign; nothing is decided here."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._beside = Beside()
        self.static: Mapping[str, bytes] = static_files("validation.page", FILES)
        self.calls: Sequence[Call] = [
            Call("GET", "", self.page),
            Call("GET", "list", self.rows),
            Call("GET", "signals", self.signals),
            Call("GET", "clock", self.clock),
            Call("POST", "part", self.part),
        ]

    def version(self) -> str:
        """Changes with campaign.toml and the files of the trajectories."""
        try:
            files = [one.path for one in origins(self._desk.campaign()).values()]
        except GtvalError as error:
            return str(error)
        return version_of([self._desk.campaign_as_opened.toml, *files])

    def waiting(self) -> list[Waiting]:
        """Nothing: here is only looked."""
        return []

    def close(self) -> None:
        """End what runs beside."""
        self._beside.close()

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The whole panel."""
        return self._html("trajectories.html.j2", device)

    async def rows(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The list, to be put in place of what the page shows."""
        return self._html("trajectories_list.html.j2", device)

    def _html(self, template: str, device: "Device") -> "Response":
        from validation.trajectories.settings import TimeSettings  # noqa: PLC0415  (slow to load)

        state: dict[str, Any] = {"problem": "", "names": [], "reference": ""}
        try:
            campaign = self._desk.campaign()
            names = list(origins(campaign))
            settings = campaign.section("time", TimeSettings)
            wanted = (settings.reference, settings.odometry, *names)
            state |= {"names": names, "reference": next((n for n in wanted if n in names), "")}
        except GtvalError as error:
            state["problem"] = str(error)
        values = {"state": state, "data": {"reference": state["reference"]}}
        return self._desk.html("validation.page", template, "trajectories", device, values)

    async def signals(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The signals of a reference and a source."""
        reference, source = _asked(request)
        given = [request.query_params.get(name) for name in ("from", "to")]
        span = None if given == [None, None] else _span(*(_as_number(text) for text in given))

        def made() -> dict[str, Any]:
            from validation.page.own.signals import signals_told  # noqa: PLC0415  (scipy)

            folder = str(self._desk.folder)
            return self._beside.call(SECONDS, signals_told, folder, reference, source, span)

        return await answered(made)

    async def clock(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The delay of a source as a whole."""
        reference, source = _asked(request)

        def made() -> dict[str, Any]:
            from validation.page.own.signals import clock_told  # noqa: PLC0415  (scipy)

            return self._beside.call(SECONDS, clock_told, str(self._desk.folder), reference, source)

        return await answered(made)

    async def part(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The delay of a part of a source, near where it was put."""
        from validation.page.requests import text_field  # noqa: PLC0415  (an extra)

        said = await said_in(request)
        reference, source = (
            text_field(said, name, needed=True) for name in ("reference", "source")
        )
        span = _span(said.get("from"), said.get("to"))
        moved = _number(said.get("moved", 0), MOST_MOVED, "moved")

        def made() -> dict[str, Any]:
            from validation.page.own.signals import part_told  # noqa: PLC0415  (scipy)

            folder = str(self._desk.folder)
            return self._beside.call(SECONDS, part_told, folder, reference, source, span, moved)

        return await answered(made)


def _asked(request: "Request") -> tuple[str, str]:
    """The reference and the source that a request names."""
    return request.query_params.get("reference", ""), request.query_params.get("source", "")


def _as_number(text: str | None) -> float | None:
    """The number of a query; None where it is none."""
    try:
        return float(text or "")
    except ValueError:
        return None


def _span(start: object, end: object) -> tuple[float, float]:
    """Two times, the later one second."""
    from validation.page.requests import RefusedError  # noqa: PLC0415  (an extra)

    first, last = (_number(v, MOST_SECONDS, "from' and 'to") for v in (start, end))
    if first >= last:
        raise RefusedError(400, "'from' must be before 'to'")
    return first, last


def _number(value: object, most: float, name: str) -> float:
    """A number of a request, no larger than ``most`` to both sides."""
    from validation.page.requests import RefusedError  # noqa: PLC0415  (an extra)

    good = isinstance(value, int | float) and not isinstance(value, bool)
    if not good or not abs(value) <= most:  # type: ignore[arg-type]
        raise RefusedError(400, f"'{name}' must be a number of seconds")
    return float(value)  # type: ignore[arg-type]


PANEL = TrajectoriesPanel()
