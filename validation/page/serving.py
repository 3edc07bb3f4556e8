"""A page served from this machine until Ctrl-C: address, code, QR code."""

import ipaddress
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

from validation.errors import GtvalError
from validation.page.access import Access, shown_code
from validation.report.terminal import console

if TYPE_CHECKING:
    from pathlib import Path

    from starlette.applications import Starlette

MAX_OPEN_FILES = 8192
"""A judgement: more connections than any room makes, and few enough for every system."""
WITHOUT_WEB = "the page needs the extra 'web' ({} is missing): pip install gtval[web]"


class Address:
    """Where the page is: a bound socket, and what people call it.

    Parameters
    ----------
    host : str
        To bind to.
    port : int
        0 for any that is free.
    tls : bool
        Whether it is served encrypted.

    Raises
    ------
    GtvalError
        If the address cannot be served.
    """

    def __init__(self, host: str, port: int, *, tls: bool = False) -> None:
        _allow_many_connections()
        self.socket = listen(host, port)
        self.port: int = self.socket.getsockname()[1]
        self.hosts = served_names(host)
        self.shown = _shown_host(host)
        self.url = f"{'https' if tls else 'http'}://{self.shown}:{self.port}"

    def announce(self, access: Access, text: str) -> None:
        """Say on the terminal what happened, and the code for the next device."""
        shown = console()
        shown.print(text, markup=False)
        link = f"{self.url}/#{access.code}"
        code = shown_code(access.code)
        shown.print(f"Code for the next device: {code}   (or {link})", markup=False)
        drawn = _qr_lines(link)
        if drawn is not None and shown.is_terminal:
            shown.print(drawn(), markup=False, highlight=False)
        shown.file.flush()


def serve_app(app: "Starlette", address: Address, certificate: "Path | None" = None) -> None:
    """Serve an application until Ctrl-C.

    Parameters
    ----------
    app : Starlette
        What answers.
    address : Address
        Where; its socket is closed in the end.
    certificate : Path, optional
        Key and certificate, to serve it encrypted.
    """
    import uvicorn  # noqa: PLC0415  (an extra)

    from validation.page.connection import PromptConnection  # noqa: PLC0415  (needs uvicorn)

    config = uvicorn.Config(
        app,
        http=PromptConnection,
        log_level="error",  # what strangers send is no reason to scroll the code away
        access_log=False,
        lifespan="off",
        ws="none",
        server_header=False,
        timeout_graceful_shutdown=3,
        ssl_certfile=certificate,
    )
    try:
        uvicorn.Server(config).run(sockets=[address.socket])
    except KeyboardInterrupt:
        pass
    finally:
        address.socket.close()


def served_names(host: str) -> set[str]:
    """Names under which the page may be called when bound to a host."""
    names = {host.lower(), "localhost", "127.0.0.1", "::1"}
    if not is_loopback(host):
        names |= {"*", socket.gethostname().lower(), f"{socket.gethostname().lower()}.local"}
    return names


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a host."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def listen(host: str, port: int) -> socket.socket:
    """A socket bound to the address."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        # The protocol named: asyncio then sends small answers at once (TCP_NODELAY), where
        # Nagle's algorithm would hold back the second half of each for 40 ms.
        listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(2048)
    except OSError as error:
        raise GtvalError(
            f"the page cannot be served at {host}, port {port}: {error.strerror or error}; "
            "choose others with --host and --port"
        ) from error
    return listening


def _allow_many_connections() -> None:
    """Raise this process's limit of open files, so that a burst of connections meets none."""
    try:
        import resource  # noqa: PLC0415  (not on Windows)
    except ImportError:
        return
    now, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_OPEN_FILES if most == resource.RLIM_INFINITY else min(most, MAX_OPEN_FILES)
    if now != resource.RLIM_INFINITY and now < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def _shown_host(host: str) -> str:
    """The address to type on a phone."""
    if host not in ("0.0.0.0", "::"):  # noqa: S104  (compared, not bound)
        return f"[{host}]" if ":" in host else host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing: it only picks the outgoing address
            return str(probe.getsockname()[0])
        except OSError:
            return socket.gethostname()


def _qr_lines(link: str) -> Callable[[], str] | None:
    """What draws a QR code of a link; None where segno is not installed."""
    try:
        import segno  # noqa: PLC0415  (an extra)
    except ImportError:
        return None

    def draw() -> str:
        import io  # noqa: PLC0415

        stream = io.StringIO()
        segno.make(link, micro=False).terminal(stream, compact=True)
        return stream.getvalue()

    return draw
