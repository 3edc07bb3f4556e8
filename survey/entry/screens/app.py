"""The page and its requests, over an entry session."""

import asyncio
from collections.abc import Awaitable, Callable, Collection
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import put_edited_file_aside, take_edited_file
from survey.entry.dialogue.words import jumped_text, undone_text
from survey.entry.record.entries import MAX_NAME, Person, clean_text
from survey.entry.record.journal import NotRecordedError
from survey.entry.room.rough_places import load_rough_places
from survey.entry.room.targets import Target
from survey.entry.screens.access import MAX_AGE, Access, AccessError, Device, address_of
from survey.entry.screens.page_state import answer_state, page_state
from survey.entry.screens.requests import (
    RefusedError,
    check_host,
    check_origin,
    flag_field,
    json_fields,
    number_field,
    text_field,
)
from validation.errors import GtvalError

COOKIE = "gtval_entry"
STATIC = {
    "page.css": "text/css",
    "awake.js": "text/javascript",
    "meter.js": "text/javascript",
    "page.js": "text/javascript",
    "queue.js": "text/javascript",
    "room_map.js": "text/javascript",
    "sound.js": "text/javascript",
}
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
LATE = 5.0
"""A reading that waited longer than so many seconds for the link has the time of its typing."""
MAX_WAIT = 366 * 86400.0
"""A reading that waited longer on a device is refused: its clock is wrong."""
PAUSE = 0.03
"""Seconds between two stops that are looked through, for the requests that wait."""

Handler = Callable[[Request, Device], Awaitable[Response]]


class EntryApp:
    """The requests of the page.

    Parameters
    ----------
    entry_session : EntrySession
        One for all devices.
    access : Access
        Who is let in.
    """

    def __init__(self, entry_session: EntrySession, access: Access) -> None:
        self._session = entry_session
        self._access = access
        self._rough = load_rough_places(entry_session.campaign)
        self._templates = Environment(
            loader=PackageLoader("survey.entry.screens"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        folder = files("survey.entry.screens") / "static"
        self._serving = 0
        self._examining: asyncio.Task[None] | None = None
        self._static = {name: (folder / name).read_bytes() for name in STATIC}

    def routes(self) -> list[Route]:
        """All paths that there are."""
        return [
            Route("/", self.page, methods=["GET"]),
            Route("/join", self.join, methods=["POST"]),
            Route("/static/{name}", self.static, methods=["GET"]),
            Route("/state", self._for_device(self.state), methods=["GET"]),
            Route("/readings", self._for_device(self.reading), methods=["POST"]),
            Route("/actions", self._for_device(self.action), methods=["POST"]),
            Route("/person", self._for_device(self.person), methods=["POST"]),
        ]

    async def page(self, request: Request) -> Response:
        """The page, or the one that asks for a code."""
        device = self._access.device(request.cookies.get(COOKIE))
        if device is None:
            name = self._session.campaign.settings.name
            return self._html("join.html.j2", {"campaign": name})
        return self._html("page.html.j2", {"state": self._state_of(device)})

    async def static(self, request: Request) -> Response:
        """A file of the page; only those that are listed exist."""
        name = request.path_params["name"]
        if name not in self._static:
            raise RefusedError(404, "there is no such file")
        return Response(self._static[name], media_type=STATIC[name])

    async def join(self, request: Request) -> Response:
        """Let a device in that knows the code."""
        said = await json_fields(request)
        code, name = text_field(said, "code", needed=True), text_field(said, "name")
        address = address_of(request.client.host if request.client else "")
        try:
            token, device = self._access.join(code, name, address)
        except AccessError as error:
            raise RefusedError(403, str(error)) from None
        try:
            self._session.begin(device.person)
        except NotRecordedError as error:
            raise RefusedError(503, str(error)) from None
        response = JSONResponse({"device": device.name})
        response.set_cookie(
            COOKIE,
            token,
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
            max_age=int(MAX_AGE),
        )
        return response

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
        self._access.keep()
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

    def _for_device(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The handler, for devices that were let in; their mistakes in plain words."""

        async def checked(request: Request) -> Response:
            device = self._access.device(request.cookies.get(COOKIE))
            if device is None:
                raise RefusedError(401, "this device was not let in; type the terminal's code")
            self._serving += 1
            try:
                return await handler(request, device)
            except NotRecordedError as error:
                raise RefusedError(503, str(error)) from None
            except GtvalError as error:
                raise RefusedError(409, str(error)) from None
            finally:
                self._serving -= 1

        return checked

    def _html(self, template: str, values: dict[str, Any]) -> Response:
        return HTMLResponse(self._templates.get_template(template).render(values))


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
    guard = Middleware(BaseHTTPMiddleware, dispatch=partial(_guard, hosts=hosts))
    return Starlette(
        routes=EntryApp(entry_session, access).routes(),
        middleware=[guard],
        exception_handlers={RefusedError: _refusal},
    )


async def _guard(
    request: Request,
    call_next: Callable[[Request], Awaitable[Response]],
    hosts: Collection[str],
) -> Response:
    """Refuse foreign hosts and origins, and add the headers that protect the page."""
    try:
        check_host(request, hosts)
        if request.method != "GET":
            check_origin(request)
        response = await call_next(request)
    except RefusedError as error:
        response = await _refusal(request, error)
    for name, value in HEADERS.items():
        response.headers[name] = value
    return response


async def _refusal(_request: Request, error: Exception) -> Response:
    """A refused request as JSON."""
    assert isinstance(error, RefusedError)
    return JSONResponse({"error": error.reason}, error.status)


def _ago(seconds: float) -> str:
    """The local time so long ago."""
    then = datetime.now().astimezone() - timedelta(seconds=seconds)
    return then.isoformat(timespec="milliseconds")
