"""The door of the page: foreign hosts and sites stay outside, and devices that no code let in."""

from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from pathlib import PurePosixPath

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from validation.errors import GtvalError
from validation.page.access import MAX_AGE, Access, AccessError, Device, address_of
from validation.page.desk import MEDIA
from validation.page.panels import Call
from validation.page.people import Person
from validation.page.requests import (
    RefusedError,
    check_campaign,
    check_host,
    check_origin,
    json_fields,
    text_field,
)

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src 'self' data:; frame-src 'self'; form-action 'none'; base-uri 'none'; "
        "frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Of every answer that does not state its own."""

Handler = Callable[[Request, Device], Awaitable[Response]]


class Door:
    """Lets devices in by a code, and knows them again.

    Parameters
    ----------
    access : Access
        Codes and devices.
    cookie : str
        Name of the cookie that holds a device's token.
    greet : callable
        Told who was let in; what it raises is told to the device, with the status.
    campaign : str
        Key of the campaign: requests of another's page are refused. '' if it is not looked at.
    """

    def __init__(
        self,
        access: Access,
        cookie: str,
        greet: Callable[[Person], None] = lambda _person: None,
        campaign: str = "",
    ) -> None:
        self.access = access
        self._campaign = campaign
        self._cookie = cookie
        self._greet = greet

    def device(self, request: Request) -> Device | None:
        """The device that sent a request; None for a stranger."""
        return self.access.device(request.cookies.get(self._cookie))

    async def join(self, request: Request) -> Response:
        """Let a device in that knows the code."""
        said = await json_fields(request)
        code, name = text_field(said, "code", needed=True), text_field(said, "name")
        address = address_of(request.client.host if request.client else "")
        try:
            token, device = self.access.join(code, name, address)
        except AccessError as error:
            raise RefusedError(403, str(error)) from None
        self._greet(device.person)
        response = JSONResponse({"device": device.name})
        response.set_cookie(
            self._cookie,
            token,
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
            max_age=int(MAX_AGE),
        )
        return response

    def for_device(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The handler, for devices that were let in; their mistakes in plain words."""

        async def checked(request: Request) -> Response:
            device = self.device(request)
            if device is None:
                raise RefusedError(401, "this device was not let in; type the terminal's code")
            if self._campaign:
                check_campaign(request, self._campaign)
            try:
                return await handler(request, device)
            except GtvalError as error:
                raise RefusedError(409, str(error)) from None

        return checked


def routes_of(below: str, calls: Iterable[Call], door: Door) -> list[Route]:
    """Routes of calls below a path, all behind the door."""
    return [
        Route(f"{below}/{call.path}", door.for_device(call.handler), methods=[call.method])
        for call in calls
    ]


def static_route(contents: Mapping[str, bytes]) -> Callable[[Request], Awaitable[Response]]:
    """What answers with style sheets and scripts; only those that are listed exist."""

    async def static(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in contents:
            raise RefusedError(404, "there is no such file")
        return Response(contents[name], media_type=MEDIA[PurePosixPath(name).suffix])

    return static


def guarded(routes: Sequence[BaseRoute], hosts: Collection[str]) -> Starlette:
    """A web application of routes that answers neither foreign names nor foreign sites.

    Parameters
    ----------
    routes : sequence of BaseRoute
        All that there are.
    hosts : collection of str
        Names under which it is served; '*' stands for every address that is a number.
    """
    return Starlette(
        routes=routes,
        middleware=[Middleware(BaseHTTPMiddleware, dispatch=partial(_guard, hosts=hosts))],
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
        response.headers.setdefault(name, value)
    return response


async def _refusal(_request: Request, error: Exception) -> Response:
    """A refused request as JSON."""
    assert isinstance(error, RefusedError)
    return JSONResponse({"error": error.reason}, error.status)
