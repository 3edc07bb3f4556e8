"""The panel with the report of the last run."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from validation.campaign.provenance import REPORT_FILE
from validation.errors import GtvalError
from validation.page.desk import Desk, english, static_files
from validation.page.own.standing import Standing
from validation.page.panels import Call, Waiting

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from validation.campaign.folder import Campaign
    from validation.page.access import Device

POLICY = (
    "sandbox allow-popups; default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    "font-src data:; form-action 'none'; base-uri 'none'; frame-ancestors 'self'"
)
"""Of the report itself: a page with pictures and styles of its own, and nothing that runs."""


class ReportPanel:
    """The report: there for every campaign."""

    name, title = "report", english()["report"]["title"]

    def has_work(self, campaign: "Campaign") -> bool:  # noqa: ARG002
        """Always: without a report it says how to make one."""
        return True

    def open(self, desk: Desk) -> "OpenReport":
        """The report of a campaign."""
        return OpenReport(desk)


class OpenReport:
    """The report of a campaign, with what of it is out of date."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._standing = Standing(desk)
        self.static: Mapping[str, bytes] = static_files("validation.page", ["report.js"])
        self.calls: Sequence[Call] = [
            Call("GET", "", self.page),
            Call("GET", "standing", self.standing),
            Call("GET", "document", self.document),
        ]

    def version(self) -> str:
        """Changes with the report and with what it was made from."""
        return self._standing.version()

    def waiting(self) -> list[Waiting]:
        """Nothing: what to do is the list's."""
        return []

    def close(self) -> None:
        """Nothing is held."""

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The report in its frame."""
        return await self._html("report.html.j2", device)

    async def standing(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """Whether it is out of date."""
        return await self._html("report_standing.html.j2", device)

    async def _html(self, template: str, device: "Device") -> "Response":
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

        there = (self._desk.folder / REPORT_FILE).is_file()
        reason = await run_in_threadpool(self._standing.reason) if there else ""
        state = {"there": there, "reason": reason}
        return self._desk.html("validation.page", template, "report", device, {"state": state})

    async def document(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The page that the last run wrote, as it is."""
        from starlette.responses import FileResponse  # noqa: PLC0415  (an extra)

        path = self._desk.inside(REPORT_FILE)
        if not path.is_file():
            raise GtvalError("there is no report yet")
        headers = {"Content-Security-Policy": POLICY}
        return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)


PANEL = ReportPanel()
