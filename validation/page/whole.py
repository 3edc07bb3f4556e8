"""The page of a campaign, opened and served until Ctrl-C."""

import secrets
import threading
import webbrowser
from pathlib import Path

from validation.errors import GtvalError
from validation.page.access import Access
from validation.page.desk import Desk
from validation.page.panels import Found, Waiting, installed_panels
from validation.page.runner import Runner
from validation.page.serving import WITHOUT_WEB, Address, serve_app
from validation.report.terminal import console

DEVICES = ".page.devices"
"""File of the campaign folder with who was let in; hidden, so that it is no input of a run."""


def serve_page(folder: Path, host: str, port: int, *, tls: bool, browser: bool) -> None:
    """Serve the page of a campaign until Ctrl-C.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    host, port : str, int
        Where.
    tls : bool
        Whether encrypted.
    browser : bool
        Whether to open it in the browser of this machine.

    Raises
    ------
    GtvalError
        If the campaign is bad, the extra ``web`` is not installed, or the address cannot be
        served.
    """
    try:
        import uvicorn  # noqa: F401, PLC0415  (an extra)

        from validation.page.app import PageApp  # noqa: PLC0415
        from validation.page.certificate import certificate  # noqa: PLC0415
    except ImportError as error:
        raise GtvalError(WITHOUT_WEB.format(error.name)) from None
    found = installed_panels()
    runner = Runner(folder)
    desk = Desk(folder, runner)
    address = Address(host, port, tls=tls)
    store = desk.folder / DEVICES
    # Undo takes back what the same device did: no name comes twice, whatever became of the store.
    prefix = f"screen {secrets.token_hex(2)}-"
    access = Access(lambda text: address.announce(access, text), store=store, prefix=prefix)
    desk.keep_devices = access.keep
    names = {*address.hosts, address.shown} - {"*"}
    files = certificate(desk.folder / ".page.tls.pem", names) if tls else None
    # One browser may have several campaigns open, at ports of one machine, which share cookies.
    page = PageApp(desk, found, access, f"gtval_page_{address.port}")
    if files is not None:
        console().print(files.warning, markup=False)
    for name, reason in found.failed.items():
        console().print(f"Warning: the panel '{name}' cannot be loaded: {reason}", markup=False)
    address.announce(access, f"{desk.title}: the page is at {address.url}")
    if browser:
        link = f"{address.url}/#{access.code}"
        threading.Thread(target=webbrowser.open, args=(link,), daemon=True).start()
    # What panels load is loaded while the first person types the code.
    threading.Thread(target=page.look, daemon=True).start()
    try:
        serve_app(page.app(address.hosts), address, None if files is None else files.path)
    finally:
        page.close()
        runner.close()


def page_status(folder: Path) -> tuple[Found, dict[str, list[Waiting]]]:
    """The panels of a campaign that have work, and what waits in each.

    Raises
    ------
    GtvalError
        If the campaign is bad.
    """
    found = installed_panels()
    desk = Desk(folder, Runner(folder))
    told = {}
    for panel in found.panels:
        if panel.has_work(desk.campaign()):
            opened = panel.open(desk)
            try:
                told[panel.name] = opened.waiting()
            except GtvalError as error:
                told[panel.name] = [Waiting(str(error))]
            opened.close()
    return found, told
