"""The whole page: its panels behind one door, and word of what has changed."""

import asyncio
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from validation.errors import GtvalError
from validation.page.access import Access, Device
from validation.page.desk import Desk, english, environment_of, static_files
from validation.page.guard import Door, Handler, guarded, routes_of, static_route
from validation.page.own.to_do import OpenToDo
from validation.page.panels import Call, Found, OpenPanel, Panel, Waiting
from validation.page.requests import RefusedError

STATIC = ("head.css", "frame.css", "bench.css", "frame.js", "canvas.js", "outbox.js", "join.js")


class BrokenPanel:
    """Stands in for a panel that cannot be opened: its page says why."""

    def __init__(self, desk: Desk, name: str, reason: str) -> None:
        self._desk, self._name, self._reason = desk, name, reason
        self.calls: Sequence[Call] = [Call("GET", "", self.page)]
        self.static: Mapping[str, bytes] = {}

    async def page(self, request: Request, device: Device) -> Response:  # noqa: ARG002
        """The reason."""
        values = {"reason": self._reason}
        return self._desk.html("validation.page", "broken.html.j2", self._name, device, values)

    def version(self) -> str:
        """Always the same."""
        return ""

    def waiting(self) -> list[Waiting]:
        """Nothing."""
        return []

    def close(self) -> None:
        """Nothing is held."""


class PageApp:
    """The page of a campaign.

    Parameters
    ----------
    desk : Desk
        What panels share.
    found : Found
        The panels that are installed.
    access : Access
        Who is let in.
    cookie : str
        Name of the cookie by which a device is known again.
    """

    def __init__(self, desk: Desk, found: Found, access: Access, cookie: str) -> None:
        self._desk = desk
        self._door = Door(access, cookie, campaign=desk.key)
        self._panels = {panel.name: panel for panel in found.panels}
        self.opened: dict[str, OpenPanel] = {}
        for panel in found.panels:
            self.opened[panel.name] = _opened(panel, desk)
        for name, reason in found.failed.items():
            self.opened.setdefault(name, BrokenPanel(desk, name, reason))
        self._waiting: dict[str, tuple[str, list[Waiting]]] = {}
        for one in self.opened.values():
            if isinstance(one, OpenToDo):
                one.others = self._others

    def app(self, hosts: Collection[str]) -> Starlette:
        """The web application, served under some names."""
        routes = [
            Route("/", self._first, methods=["GET"]),
            Route("/join", self._door.join, methods=["POST"]),
            Route("/versions", self._door.for_device(self.versions), methods=["GET"]),
            Route(
                "/static/{name}",
                static_route(static_files("validation.page", STATIC)),
                methods=["GET"],
            ),
        ]
        for name, panel in self.opened.items():
            pages = [call for call in panel.calls if not call.path]
            others = [call for call in panel.calls if call.path]
            routes += [Route(f"/{name}/", self._page(name, call.handler)) for call in pages]
            route = Route(f"/{name}/static/{{name}}", static_route(panel.static), methods=["GET"])
            routes += [route, *routes_of(f"/{name}", others, self._door)]
        return guarded(routes, hosts)

    def close(self) -> None:
        """End all panels."""
        for panel in self.opened.values():
            panel.close()

    async def _first(self, request: Request) -> Response:
        """The way to the first panel; a stranger types the code on the way."""
        if self._door.device(request) is None:
            return self._join_page()
        return RedirectResponse(f"/{next(iter(self.opened))}/", 303)

    def _join_page(self) -> Response:
        page = environment_of("validation.page").get_template("join.html.j2")
        return HTMLResponse(page.render({"words": english(), "campaign": self._desk.title}))

    def _page(self, name: str, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The page of a panel; for a stranger, the one that asks for the code."""
        checked = self._door.for_device(handler)

        async def page(request: Request) -> Response:
            if self._door.device(request) is None:
                return self._join_page()
            await run_in_threadpool(self.look)
            try:
                return await checked(request)
            except RefusedError as error:  # such as a campaign.toml that is being edited
                device = self._door.device(request)
                assert device is not None
                shown = BrokenPanel(self._desk, name, error.reason)
                return await shown.page(request, device)

        return page

    async def versions(self, request: Request, device: Device) -> Response:  # noqa: ARG002
        """What has changed, how much waits where, and how the run is."""
        async with asyncio.timeout(60):
            panels = await run_in_threadpool(self.look)
        return JSONResponse({"panels": panels, "run": self._desk.runner.state.as_json()})

    def look(self) -> list[dict[str, Any]]:
        """Name, version and count of every panel that has work, for the head of all pages."""
        shown = []
        for name, panel in self.opened.items():
            title = self._panels[name].title if name in self._panels else name
            if self._has_work(name):
                count = sum(one.count for one in self._waiting_of(name, panel))
                version = panel.version()
                shown.append({"name": name, "title": title, "count": count, "version": version})
        self._desk.navigation = [
            {name: one[name] for name in ("name", "title", "count")} for one in shown
        ]
        return shown

    def _has_work(self, name: str) -> bool:
        """Whether the campaign has something for a panel; one that failed to load is shown."""
        try:
            panel = self._panels.get(name)
            return panel is None or panel.has_work(self._desk.campaign())
        except GtvalError:  # campaign.toml is being edited: told by the panels
            return True

    def _waiting_of(self, name: str, panel: OpenPanel) -> list[Waiting]:
        """What waits in a panel, asked for anew only when it has changed."""
        version = "" if isinstance(panel, OpenToDo) else panel.version()
        known = self._waiting.get(name)
        if known is None or known[0] != version:
            try:
                found = panel.waiting()
            except GtvalError as error:
                found = [Waiting(str(error))]
            known = self._waiting[name] = (version, found)
        return known[1]

    def _others(self) -> dict[str, tuple[str, Sequence[Waiting], str]]:
        """What waits in all panels but the list itself."""
        return {
            name: (
                self._panels[name].title if name in self._panels else name,
                self._waiting_of(name, panel),
                panel.version(),
            )
            for name, panel in self.opened.items()
            if not isinstance(panel, OpenToDo) and self._has_work(name)
        }


def _opened(panel: Panel, desk: Desk) -> OpenPanel:
    """The panel of a campaign, or what stands in for it."""
    try:
        return panel.open(desk)
    except Exception as error:  # noqa: BLE001  (one panel must not take the others)
        return BrokenPanel(desk, panel.name, f"{type(error).__name__}: {error}")
