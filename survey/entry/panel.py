"""The entry page as a panel of the page of a campaign."""

import threading
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from validation.page.desk import Desk, english, static_files, version_of
from validation.page.panels import Call, Waiting

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from survey.entry.dialogue.entry_session import EntrySession
    from survey.entry.screens.app import EntryApp
    from validation.campaign.folder import Campaign
    from validation.page.access import Device
    from validation.page.panels import Handler


class ReadingsPanel:
    """Readings typed in, for a campaign that surveys stops of its own."""

    name, title = "readings", english()["readings"]["title"]

    def has_work(self, campaign: "Campaign") -> bool:
        """Whether there are readings, or stops planned to be read."""
        from survey.readings.readings import readings_path  # noqa: PLC0415  (slow to load)
        from survey.settings import SurveySettings  # noqa: PLC0415

        settings = campaign.section("survey", SurveySettings)
        there = [readings_path(campaign, settings), campaign.folder / settings.entry.journal]
        return bool(settings.entry.poses) or any(path.exists() for path in there)

    def open(self, desk: Desk) -> "OpenReadings":
        """The entry page of a campaign; its journal is opened when somebody looks."""
        return OpenReadings(desk)


class OpenReadings:
    """The entry page of a campaign, and the journal behind it once somebody has looked."""

    def __init__(self, desk: Desk) -> None:
        from survey.entry.screens.app import FILES, PACKAGE, calls  # noqa: PLC0415  (an extra)

        self._desk = desk
        self._opening = threading.Lock()
        self._entry: tuple[EntrySession, EntryApp] | None = None
        self._greeted: set[str] = set()
        own = [Call("GET", "", self.page), Call("POST", "begin", self.begin)]
        self.calls: Sequence[Call] = [*own, *calls(self._forward)]
        self.static: Mapping[str, bytes] = static_files(PACKAGE, (*FILES, "begin.js"))

    def version(self) -> str:
        """Changes with every entry, also of others, and with the readings file."""
        from survey.readings.readings import readings_path  # noqa: PLC0415  (slow to load)
        from survey.settings import SurveySettings  # noqa: PLC0415

        campaign = self._desk.campaign_as_opened
        settings = campaign.section("survey", SurveySettings)
        journal = campaign.folder / settings.entry.journal
        own = "" if self._entry is None else str(self._entry[0].version)
        return f"{version_of([journal, readings_path(campaign, settings)])}/{own}"

    def waiting(self) -> list[Waiting]:
        """How many readings are left, and how many are doubtful so far."""
        from survey.entry.dialogue.entry_session import EntrySession  # noqa: PLC0415  (slow to load)
        from survey.entry.dialogue.words import progress_text  # noqa: PLC0415

        entered = self._entry[0] if self._entry else EntrySession.look(self._desk.campaign())
        if not entered.journal.entries and entered.readings_file.path.exists():
            return []  # read and written down elsewhere
        progress = entered.guide.progress()
        told = [Waiting(progress_text(progress), done=progress.left == 0)]
        doubtful = len(entered.doubtful_so_far()) if self._entry else 0
        if doubtful:
            told.append(
                Waiting(f"{doubtful} doubtful: measure them again, or keep them", count=doubtful)
            )
        return told

    def close(self) -> None:
        """Close the journal, if it is open; the readings file is brought up to date."""
        if self._entry is not None:
            from survey.entry.screens.serving import SERVER  # noqa: PLC0415

            entered, self._entry = self._entry[0], None
            entered.end(SERVER)
            entered.close()

    def _ready(self) -> "EntryApp":
        """What answers, its journal open.

        Raises
        ------
        GtvalError
            If the journal is open elsewhere, or cannot be written.
        """
        with self._opening:
            if self._entry is None:
                from survey.entry.dialogue.entry_session import EntrySession  # noqa: PLC0415
                from survey.entry.screens.app import EntryApp  # noqa: PLC0415  (an extra)

                entered = EntrySession.open(self._desk.campaign(), "gtval open")
                entered.prepare()
                self._entry = entered, EntryApp(entered, self._desk.keep_devices)
            return self._entry[1]

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The entry page below the head of all panels; why not, where that is so."""
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

        from validation.errors import GtvalError  # noqa: PLC0415

        name = await run_in_threadpool(self._written_elsewhere)
        if name:
            values = {"name": name}
            package = "survey.entry.screens"
            return self._desk.html(package, "begin.html.j2", "readings", device, values)
        try:
            app = await run_in_threadpool(self._ready)
        except GtvalError as error:
            values = {"reason": str(error)}
            return self._desk.html("validation.page", "broken.html.j2", "readings", device, values)
        if device.name not in self._greeted:
            app.greet(device.person)
            self._greeted.add(device.name)
        return app.page(device, self._desk.head("readings", device))

    def _written_elsewhere(self) -> str:
        """Name of a file of readings that no journal has taken over; '' where there is none."""
        from survey.readings.readings import readings_path  # noqa: PLC0415  (slow to load)
        from survey.settings import SurveySettings  # noqa: PLC0415

        campaign = self._desk.campaign()
        settings = campaign.section("survey", SurveySettings)
        path = readings_path(campaign, settings)
        there = (campaign.folder / settings.entry.journal).exists() or not path.exists()
        return "" if there or self._entry is not None else path.name

    async def begin(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """Take the readings of a file into a journal, to go on from there."""
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)
        from starlette.responses import JSONResponse  # noqa: PLC0415

        from validation.page.requests import json_fields  # noqa: PLC0415

        await json_fields(request)
        await run_in_threadpool(self._ready)
        return JSONResponse({})

    def _forward(self, path: str) -> "Handler":
        """What hands a request on to the entry page."""

        async def handler(request: "Request", device: "Device") -> "Response":
            from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

            app = await run_in_threadpool(self._ready)
            return await app.handlers[path](request, device)

        return handler


PANEL = ReadingsPanel()
