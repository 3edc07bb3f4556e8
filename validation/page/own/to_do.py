"""The panel of what to do: what waits for a person now, and the list of the last report."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from validation.errors import GtvalError
from validation.page.desk import Desk, english, static_files
from validation.page.own.standing import Standing
from validation.page.panels import Call, Waiting

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from validation.campaign.folder import Campaign
    from validation.page.access import Device

_NUMBERS = re.compile(r"[-+]?\d+(?:\.\d+)?")
MOST_DONE = 20
"""Ticked lines that are shown below the open ones."""

Item = dict[str, Any]


class ToDoPanel:
    """What to do: there for every campaign."""

    name, title = "to_do", english()["to_do"]["title"]

    def has_work(self, campaign: "Campaign") -> bool:  # noqa: ARG002
        """Always: a campaign can be run."""
        return True

    def open(self, desk: Desk) -> "OpenToDo":
        """The list of a campaign."""
        return OpenToDo(desk)


class OpenToDo:
    """The list of a campaign, and its run."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._standing = Standing(desk)
        self._listed: tuple[str, list[Item]] = ("", [])
        self._ticked: list[Item] = []
        self.others: Callable[[], Mapping[str, tuple[str, Sequence[Waiting], str]]] = dict
        """What waits in the other panels, by name: title, what, and their versions."""
        self.static: Mapping[str, bytes] = static_files("validation.page", ["to_do.js"])
        self.calls: Sequence[Call] = [
            Call("GET", "", self.page),
            Call("GET", "standing", self.standing),
            Call("GET", "lists", self.lists),
            Call("POST", "run", self.run),
            Call("POST", "stop", self.stop),
        ]

    def version(self) -> str:
        """Changes with the files of the campaign, and with what waits in the other panels."""
        parts = [version for _, _, version in self.others().values()]
        return f"{self._standing.version()}/{'/'.join(parts)}/{self._desk.runner.state.state}"

    def waiting(self) -> list[Waiting]:
        """Nothing of its own."""
        return []

    def close(self) -> None:
        """Nothing is held."""

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The whole panel."""
        return await self._html("to_do.html.j2", device)

    async def standing(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """What is out of date, to be put in place of what the page shows."""
        return await self._html("to_do_standing.html.j2", device)

    async def lists(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """Both lists, likewise."""
        return await self._html("to_do_lists.html.j2", device)

    async def run(self, request: "Request", device: "Device") -> "Response":
        """Start the run."""
        return await self._told(request, lambda: self._desk.runner.start(device.person.name))

    async def stop(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """Stop it."""
        return await self._told(request, self._desk.runner.stop)

    async def _told(self, request: "Request", do: Callable[[], Any]) -> "Response":
        """How the run is after something was done."""
        from starlette.responses import JSONResponse  # noqa: PLC0415  (an extra)

        from validation.page.requests import json_fields  # noqa: PLC0415  (the same)

        await json_fields(request)
        return JSONResponse({"run": do().as_json()})

    async def _html(self, template: str, device: "Device") -> "Response":
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

        state = await run_in_threadpool(self.state)
        values = {"state": state, "data": {"run": self._desk.runner.state.as_json()}}
        return self._desk.html("validation.page", template, "to_do", device, values)

    def state(self) -> dict[str, Any]:
        """All that is shown."""
        try:
            old = self._standing.old()
        except GtvalError:
            old = []
        path = self._desk.campaign_as_opened.report / "to_do.json"
        return {
            "ran": self._standing.ran,
            "old": old,
            "yours": [
                {"panel": name, "title": title, "text": one.text, "done": one.done}
                for name, (title, waiting, _) in self.others().items()
                for one in waiting
            ],
            "reported": path.is_file(),
            "lines": self._items(),
        }

    def _items(self) -> list[Item]:
        """The lines of the report, open ones first; those that are no longer there are ticked."""
        path = self._desk.campaign_as_opened.report / "to_do.json"
        try:
            text = path.read_text(encoding="utf-8")
            items = [one for one in json.loads(text)["to_do"] if isinstance(one, dict)]
        except (OSError, ValueError, KeyError, TypeError):
            text, items = "", []
        items = [{name: str(one.get(name, "")) for name in SHOWN} for one in items]
        if text and text != self._listed[0]:
            there = {_kind(one) for one in items}
            gone = [one for one in self._listed[1] if _kind(one) not in there]
            kept = [one for one in self._ticked if _kind(one) not in there]
            self._ticked = [*({**one, "done": True, "to": ""} for one in gone), *kept][:MOST_DONE]
            self._listed = (text, items)
        return [*({**one, "done": False} for one in items), *self._ticked]


SHOWN = ("subject", "text", "to", "name")


def _kind(item: Item) -> tuple[str, str]:
    """What a line is about, whatever its numbers are after another run."""
    return item["subject"], _NUMBERS.sub("#", item["text"])


PANEL = ToDoPanel()
