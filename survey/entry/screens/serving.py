"""The page, served on the laptop while the readings are taken."""

import ipaddress
import socket
from collections.abc import Callable

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.words import taken_over_text
from survey.entry.record.entries import Person
from survey.entry.screens.access import Access, last_device, shown_code
from validation.errors import GtvalError
from validation.report.terminal import console

SERVER = Person("", "page server")
MAX_OPEN_FILES = 8192
"""A judgement: more connections than any room makes, and few enough for every system."""


def serve(entry_session: EntrySession, host: str, port: int, *, tls: bool = False) -> int:
    """Exit status after serving the page until Ctrl-C.

    With ``tls`` it is served encrypted, under a certificate made on the spot.

    Raises
    ------
    GtvalError
        If the extra ``web`` is not installed, or the address cannot be served.
    """
    try:
        import uvicorn  # noqa: PLC0415  (an extra)

        from survey.entry.screens.app import make_app  # noqa: PLC0415
        from survey.entry.screens.certificate import certificate  # noqa: PLC0415
        from survey.entry.screens.connection import PromptConnection  # noqa: PLC0415
    except ImportError as error:
        raise GtvalError(
            f"the page needs the extra 'web' ({error.name} is missing): pip install gtval[web]"
        ) from None
    _allow_many_connections()
    listening = _listen(host, port)
    port = listening.getsockname()[1]
    hosts = served_names(host)
    shown = _shown_host(host)
    url = f"{'https' if tls else 'http'}://{shown}:{port}"
    used = last_device(entry_session.journal.entries)
    journal = entry_session.journal.path
    store = journal.with_suffix(".devices")
    access = Access(lambda text: _announce(url, access, text), used=used, store=store)
    files = certificate(journal.with_suffix(".tls.pem"), {*hosts, shown} - {"*"}) if tls else None
    app = make_app(entry_session, access, hosts)
    # numpy takes a while to load; devices can join meanwhile.
    entry_session.prepare()
    taken_over = taken_over_text(entry_session)
    if taken_over:
        console().print(taken_over, markup=False)
    if files is not None:
        console().print(
            "The browser warns once, as nobody vouches for the certificate made here: let it go on "
            f"where it shows this fingerprint (SHA-256): {files.fingerprint}",
            markup=False,
        )
    _announce(url, access, f"{entry_session.campaign.settings.name}: the page is at {url}")
    config = uvicorn.Config(
        app,
        http=PromptConnection,
        log_level="error",  # what strangers send is no reason to scroll the code away
        access_log=False,
        lifespan="off",
        ws="none",
        server_header=False,
        ssl_certfile=None if files is None else files.path,
    )
    server = uvicorn.Server(config)
    try:
        server.run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        listening.close()
    entry_session.end(SERVER)
    return 0


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


def _listen(host: str, port: int) -> socket.socket:
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


def _announce(url: str, access: Access, text: str) -> None:
    """Say on the terminal what happened, and the code for the next device."""
    shown = console()
    shown.print(text, markup=False)
    link = f"{url}/#{access.code}"
    shown.print(f"Code for the next device: {shown_code(access.code)}   (or {link})", markup=False)
    drawn = _qr_lines(link)
    if drawn is not None and shown.is_terminal:
        shown.print(drawn(), markup=False, highlight=False)
    shown.file.flush()


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
