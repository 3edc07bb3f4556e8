"""What may come in: same origin, JSON, small, of the right shape; all else is refused."""

import asyncio
import ipaddress
import json
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from starlette.requests import ClientDisconnect, Request

MAX_BODY = 65_536
MAX_FIELD = 2_000
"""Bytes of a request, characters of a field. A judgement: a field is twice the longest remark, and
a request holds thirty of them."""
MAX_SECONDS = 10.0
"""For a request to come in whole."""


@dataclass
class RefusedError(Exception):
    """A request that is not served, with the HTTP status and the reason."""

    status: int
    reason: str


def check_host(request: Request, hosts: Collection[str]) -> None:
    """Raise where the page was called by a name that is not this machine's.

    A foreign page that has a name of its own point here is told apart by that name.
    """
    host = request.headers.get("host", "")
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
    name = name.strip("[]").lower()
    if name not in hosts and not ("*" in hosts and _is_address(name)):
        raise RefusedError(421, "this page is not served under that name")


def check_campaign(request: Request, key: str) -> None:
    """Raise where a page of another campaign sent the request: one address may serve several."""
    if request.headers.get("gtval-campaign", key) != key:
        raise RefusedError(421, "another campaign is served here now; load the page anew")


def check_origin(request: Request) -> None:
    """Raise where another site sent the request."""
    origin = request.headers.get("origin")
    if origin is not None and origin != f"{request.url.scheme}://{request.headers.get('host')}":
        raise RefusedError(403, "requests from other sites are refused")
    if request.headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        raise RefusedError(403, "requests from other sites are refused")


async def json_fields(request: Request) -> dict[str, Any]:
    """The members of the JSON object that a request carries."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json":
        raise RefusedError(415, "expected application/json")
    length = request.headers.get("content-length", "0")
    if not (length.isascii() and length.isdigit()) or int(length) > MAX_BODY:
        raise RefusedError(413, "too large")
    try:
        async with asyncio.timeout(MAX_SECONDS):
            body = await _body(request)
    except TimeoutError:
        raise RefusedError(408, "the body did not come") from None
    except ClientDisconnect:
        raise RefusedError(400, "the body was cut off") from None
    try:
        said = json.loads(body)
    except (ValueError, RecursionError):
        raise RefusedError(400, "not JSON") from None
    if not isinstance(said, dict):
        raise RefusedError(400, "expected a JSON object")
    return said


async def _body(request: Request) -> bytes:
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY:
            raise RefusedError(413, "too large")
    return body


def text_field(said: dict[str, Any], name: str, *, needed: bool = False) -> str:
    """A member that is text, '' where it is not there."""
    value = said.get(name, "")
    if not isinstance(value, str) or len(value) > MAX_FIELD:
        raise RefusedError(400, f"'{name}' must be text of at most {MAX_FIELD} characters")
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise RefusedError(400, f"'{name}' is no Unicode text")
    if needed and not value:
        raise RefusedError(400, f"'{name}' is missing")
    return value


def number_field(said: dict[str, Any], name: str, most: float) -> float:
    """A member that is a number from 0 to ``most``, 0 where it is not there."""
    value = said.get(name, 0)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= most:
        raise RefusedError(400, f"'{name}' must be a number from 0 to {most:g}")
    return float(value)


def flag_field(said: dict[str, Any], name: str) -> bool:
    """A member that is true or false, false where it is not there."""
    value = said.get(name, False)
    if not isinstance(value, bool):
        raise RefusedError(400, f"'{name}' must be true or false")
    return value


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return False
    return True
