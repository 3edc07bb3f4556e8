"""The page, served on the laptop while the readings are taken."""

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.words import taken_over_text
from validation.errors import GtvalError
from validation.page.access import Access, last_device
from validation.page.people import Person
from validation.page.serving import WITHOUT_WEB, Address, serve_app
from validation.report.terminal import console

SERVER = Person("", "page server")


def serve(entry_session: EntrySession, host: str, port: int, *, tls: bool = False) -> int:
    """Exit status after serving the page until Ctrl-C.

    With ``tls`` it is served encrypted, under a certificate made on the spot.

    Raises
    ------
    GtvalError
        If the extra ``web`` is not installed, or the address cannot be served.
    """
    try:
        import uvicorn  # noqa: F401, PLC0415  (an extra)

        from survey.entry.screens.app import make_app  # noqa: PLC0415
        from validation.page.certificate import certificate  # noqa: PLC0415
    except ImportError as error:
        raise GtvalError(WITHOUT_WEB.format(error.name)) from None
    address = Address(host, port, tls=tls)
    journal = entry_session.journal.path
    access = Access(
        lambda text: address.announce(access, text),
        used=last_device(entry.device for entry in entry_session.journal.entries),
        store=journal.with_suffix(".devices"),
    )
    names = {*address.hosts, address.shown} - {"*"}
    files = certificate(journal.with_suffix(".tls.pem"), names) if tls else None
    app = make_app(entry_session, access, address.hosts)
    # numpy takes a while to load; devices can join meanwhile.
    entry_session.prepare()
    taken_over = taken_over_text(entry_session)
    if taken_over:
        console().print(taken_over, markup=False)
    if files is not None:
        console().print(files.warning, markup=False)
    name = entry_session.campaign.settings.name
    address.announce(access, f"{name}: the page is at {address.url}")
    serve_app(app, address, None if files is None else files.path)
    entry_session.end(SERVER)
    return 0
