"""The page and its requests, over an entry session."""

import asyncio
from collections.abc import Callable, Collection
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import put_edited_file_aside, take_edited_file
from survey.entry.dialogue.words import jumped_text, undone_text
from survey.entry.record.journal import NotRecordedError
from survey.entry.room.rough_places import load_rough_places
from survey.entry.room.targets import Target
from survey.entry.screens.page_state import answer_state, page_state
from validation.page.access import Access, Device
from validation.page.desk import static_files
from validation.page.guard import Door, Handler, guarded, routes_of, static_route
from validation.page.panels import Call
from validation.page.people import MAX_NAME, Person, clean_text
from validation.page.requests import (
    RefusedError,
    flag_field,
    json_fields,
    number_field,
    text_field,
)

COOKIE = "gtval_entry"
PACKAGE = "survey.entry.screens"
FILES = ("page.css", "awake.js", "meter.js", "page.js", "queue.js", "room_map.js", "sound.js")
LATE = 5.0
"""A reading that waited longer than so many seconds for the link has the time of its typing."""
MAX_WAIT = 366 * 86400.0
"""A reading that waited longer on a device is refused: its clock is wrong."""
PAUSE = 0.03
"""Seconds between two stops that are looked through, for the requests that wait."""


class EntryApp:
    """The requests of the page, but for who may send them.

    Parameters
    ----------
    entry_session : EntrySession
        One for all devices.
    keep : callable
        Called when a person at a device has changed.
    """

    def __init__(self, entry_session: EntrySession, keep: Callable[[], None]) -> None:
        self._session = entry_session
        self._keep = keep
        self._rough = load_rough_places(entry_session.campaign)
        self._templates = Environment(
            loader=PackageLoader(PACKAGE),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        self._serving = 0
        self._examining: asyncio.Task[None] | None = None
        self.handlers = {
            "state": self._counted(self.state),
            "readings": self._counted(self.reading),
            "actions": self._counted(self.action),
            "person": self._counted(self.person),
        }
        """What a device that was let in may ask for, the page itself apart."""

    def page(self, device: Device, head: str = "") -> Response:
        """The page, below a head that it shares with others."""
        return self._html("page.html.j2", {"state": self._state_of(device), "head": head})

    def join_page(self) -> Response:
        """The page that asks for a code."""
        return self._html("join.html.j2", {"campaign": self._session.campaign.settings.name})

    def greet(self, person: Person) -> None:
        """Note that somebody has joined."""
        try:
            self._session.begin(person)
        except NotRecordedError as error:
            raise RefusedError(503, str(error)) from None

    async def state(self, request: Request, device: Device) -> Response:
        """What the page shows; nothing where it is up to date."""
        if request.query_params.get("version") == str(self._session.version):
            return Response(status_code=204)
        return JSONResponse(self._state_of(device))

    def _state_of(self, device: Device) -> dict[str, Any]:
        """What a device shows; what takes long is looked through between the requests."""
        state = page_state(self._session, device.person, self._rough)
        if state["unexamined"] and (self._examining is None or self._examining.done()):
            self._examining = asyncio.create_task(self._examine())
        return state

    async def _examine(self) -> None:
        """Look for doubtful readings everywhere, as after a start, while nobody waits."""
        left = 1
        while left:
            await asyncio.sleep(PAUSE)
            if not self._serving:
                left = self._session.examine()
        self._session.version += 1

    async def reading(self, request: Request, device: Device) -> Response:
        """Record a reading."""
        said = await json_fields(request)
        target = Target(text_field(said, "from", needed=True), text_field(said, "to", needed=True))
        age = number_field(said, "age", MAX_WAIT)
        second = flag_field(said, "second")
        by = clean_text(text_field(said, "by"), MAX_NAME) or device.person.name
        answer = self._session.record(
            target,
            text_field(said, "text", needed=True),
            Person(by, device.name, second),
            entry_id=text_field(said, "id", needed=True),
            again=flag_field(said, "again"),
            sure=flag_field(said, "sure"),
            measured=_ago(age) if age > LATE else "",
        )
        return JSONResponse(answer_state(self._session, answer))

    async def action(self, request: Request, device: Device) -> Response:
        """Undo, skip, keep, jump, note, begin a stop."""
        said = await json_fields(request)
        name = text_field(said, "action", needed=True)
        actions = self._actions(said, device.person)
        if name not in actions:
            raise RefusedError(400, f"there is no action '{name[:40]}'")
        return JSONResponse({"text": actions[name]()})

    async def person(self, request: Request, device: Device) -> Response:
        """Say who is at the device."""
        said = await json_fields(request)
        name = clean_text(text_field(said, "name"), MAX_NAME)
        device.person = replace(device.person, name=name, second=flag_field(said, "second"))
        self._keep()
        return JSONResponse({})

    def _actions(self, said: dict[str, Any], person: Person) -> dict[str, Callable[[], str]]:
        """What each action does, with the sentence that says it was done."""
        entry_session = self._session
        number = int(number_field(said, "number", 1e9))
        text = text_field(said, "text")

        def undo() -> str:
            return undone_text(entry_session.undo(person))

        def keep() -> str:
            entry_session.keep(number, person)
            return "kept"

        def note() -> str:
            entry_session.note(number, text, person)
            return "noted"

        def skip() -> str:
            target = Target(text_field(said, "from"), text_field(said, "to"))
            entry_session.skip(target, text, person)
            return f"skipped: {target.start}–{target.end}"

        def jump() -> str:
            target = entry_session.guide.target(text)
            entry_session.jump(target, person)
            return jumped_text(entry_session, target, person)

        def stop() -> str:
            target = entry_session.begin_stop(text, person)
            return f"going on with {target.start}–{target.end}"

        def mark() -> str:
            target = entry_session.add_world_point(text, person)
            return f"{target.end} is in campaign.toml now; laser on {target.start}"

        return {
            "mark": mark,
            "take": partial(take_edited_file, entry_session),
            "aside": partial(put_edited_file_aside, entry_session),
            "undo": undo,
            "keep": keep,
            "note": note,
            "skip": skip,
            "jump": jump,
            "stop": stop,
        }

    def _counted(self, handler: Handler) -> Handler:
        """The handler; while it is at work, nothing is looked through in between."""

        async def recorded(request: Request, device: Device) -> Response:
            self._serving += 1
            try:
                return await handler(request, device)
            except NotRecordedError as error:
                raise RefusedError(503, str(error)) from None
            finally:
                self._serving -= 1

        return recorded

    def _html(self, template: str, values: dict[str, Any]) -> Response:
        return HTMLResponse(self._templates.get_template(template).render(values))


def calls(handler_of: Callable[[str], Handler]) -> list[Call]:
    """The requests of the page, each with what answers it by its path."""
    changes = [Call("POST", path, handler_of(path)) for path in ("readings", "actions", "person")]
    return [Call("GET", "state", handler_of("state")), *changes]


def make_app(entry_session: EntrySession, access: Access, hosts: Collection[str]) -> Starlette:
    """The web application.

    Parameters
    ----------
    entry_session : EntrySession
        One for all devices.
    access : Access
        Who is let in.
    hosts : collection of str
        Names under which it is served; '*' stands for every address that is a number.
    """
    entry = EntryApp(entry_session, access.keep)
    door = Door(access, COOKIE, entry.greet)

    async def page(request: Request) -> Response:
        """The page, or the one that asks for a code."""
        device = door.device(request)
        return entry.join_page() if device is None else entry.page(device)

    routes = [
        Route("/", page, methods=["GET"]),
        Route("/join", door.join, methods=["POST"]),
        Route("/static/{name}", static_route(static_files(PACKAGE, FILES)), methods=["GET"]),
        *routes_of("", calls(entry.handlers.__getitem__), door),
    ]
    return guarded(routes, hosts)


def _ago(seconds: float) -> str:
    """The local time so long ago."""
    then = datetime.now().astimezone() - timedelta(seconds=seconds)
    return then.isoformat(timespec="milliseconds")
