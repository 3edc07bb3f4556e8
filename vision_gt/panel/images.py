"""The panel on which images are looked at and decided on."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from validation.errors import GtvalError
from validation.page.desk import Desk, english, static_files
from validation.page.heard import Heard
from validation.page.panels import Call, Waiting, answered, recorded, said_in
from vision_gt.settings import VisionSettings

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from validation.campaign.folder import Campaign
    from validation.page.access import Device
    from validation.pieces.processes import Beside
    from vision_gt.panel.shelf import Shelves

WORDS = english()["images"]
FILES = ("images.css", "images.js", "picture.js", "times.js", "corner.js")
LEAST_WIDTH, MOST_WIDTH = 32, 4096
"""Pixels of a picture that may be asked for."""
SECONDS = 60.0
"""For one image; a judgement: the slowest takes two."""
_PLACES = ("x", "y", "axis_x", "axis_y")


class ImagesPanel:
    """The images of a campaign with cameras."""

    name, title = "images", WORDS["title"]

    def has_work(self, campaign: "Campaign") -> bool:
        """Whether there is a folder of images."""
        folder = campaign.folder / campaign.section("vision", VisionSettings).images
        return folder.is_dir() and any(one.is_dir() for one in folder.iterdir())

    def open(self, desk: Desk) -> "OpenImages":
        """The images of a campaign; they are looked through when somebody asks."""
        return OpenImages(desk)


class OpenImages:
    """The images of a campaign, and what people decide about them."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._shelves: Shelves | None = None
        self._beside: Beside | None = None
        self._heard = Heard()
        self.static: Mapping[str, bytes] = static_files("vision_gt.panel", FILES)
        self.calls: Sequence[Call] = [
            Call("GET", "", self.page),
            Call("GET", "list", self.rows),
            Call("GET", "look", self.look),
            Call("GET", "picture", self.picture),
            Call("GET", "times", self.times),
            Call("POST", "decide", self.decide),
            Call("POST", "undo", self.undo),
        ]

    @property
    def shelves(self) -> "Shelves":
        """Where the images are, made when it is first asked for."""
        if self._shelves is None:
            from vision_gt.panel.shelf import Shelves  # noqa: PLC0415  (OpenCV)

            self._shelves = Shelves(self._desk)
        return self._shelves

    @property
    def beside(self) -> "Beside":
        """The processes in which images are decoded and looked at."""
        if self._beside is None:
            from validation.pieces.processes import Beside  # noqa: PLC0415  (only when one is looked at)

            self._beside = Beside()
        return self._beside

    def version(self) -> str:
        """Changes with the images, what was decided about them, and the results of runs."""
        return "" if self._shelves is None else self._shelves.version()

    def waiting(self) -> list[Waiting]:
        """Whether the corner of the reference pattern is to be clicked."""
        if not PANEL.has_work(self._desk.campaign()):
            return []
        from vision_gt.panel.told import waiting_told  # noqa: PLC0415  (OpenCV)

        return waiting_told(self.shelves.shelf(), WORDS)

    def close(self) -> None:
        """End what runs beside."""
        if self._beside is not None:
            self._beside.close()

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The whole panel."""
        return await self._html("images.html.j2", device)

    async def rows(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The list, to be put in place of what the page shows."""
        return await self._html("list.html.j2", device)

    async def _html(self, template: str, device: "Device") -> "Response":
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

        def made() -> dict[str, Any]:
            from vision_gt.panel.told import list_told  # noqa: PLC0415  (OpenCV)

            try:
                return {"problem": "", **list_told(self.shelves.shelf(), WORDS)}
            except GtvalError as error:
                return {"problem": str(error), "rows": [], "frames": 0, "more": 0, "unnameable": 0}

        values = {"state": await run_in_threadpool(made), "data": {}}
        return self._desk.html("vision_gt.panel", template, "images", device, values)

    async def look(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """What was found in an image, what was expected, and what was decided about it."""
        image = request.query_params.get("image", "")

        def made() -> dict[str, Any]:
            from vision_gt.panel.aside import look_told  # noqa: PLC0415  (OpenCV)
            from vision_gt.panel.told import decision_told  # noqa: PLC0415  (the same)

            self.shelves.file_of(image)
            shelf = self.shelves.shelf()
            told = self.beside.call(SECONDS, look_told, str(self._desk.folder), image)
            return {**told, **decision_told(shelf, image, WORDS)}

        return await answered(made)

    async def picture(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The image itself, no larger than asked for."""
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)
        from starlette.responses import Response  # noqa: PLC0415  (the same)

        from validation.page.requests import RefusedError  # noqa: PLC0415  (the same)

        image, width = (request.query_params.get(name, "") for name in ("image", "width"))
        if not (width.isascii() and width.isdigit() and len(width) < 6):
            raise RefusedError(400, "'width' must be a whole number of pixels")
        pixels = min(max(int(width), LEAST_WIDTH), MOST_WIDTH)

        def made() -> bytes:
            from vision_gt.panel.aside import picture  # noqa: PLC0415  (OpenCV)

            return self.beside.call(SECONDS, picture, str(self.shelves.file_of(image)), pixels)

        return Response(await run_in_threadpool(made), media_type="image/jpeg")

    async def times(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The frames of a drive, camera by camera."""

        def made() -> dict[str, Any]:
            from vision_gt.panel.told import times_told  # noqa: PLC0415  (OpenCV)

            return times_told(self.shelves.shelf(), self._desk.campaign())

        return await answered(made)

    async def decide(self, request: "Request", device: "Device") -> "Response":
        """Record a decision about one image."""
        from validation.page.requests import RefusedError, text_field  # noqa: PLC0415  (an extra)
        from vision_gt.images.decisions import KINDS  # noqa: PLC0415  (numpy)

        said = await said_in(request)
        image, kind = (text_field(said, name, needed=True) for name in ("image", "decision"))
        note, name = text_field(said, "note"), text_field(said, "id")
        if kind not in KINDS:
            raise RefusedError(400, f"there is no decision '{kind[:40]}'")
        numbers = _numbers(said)

        def made() -> dict[str, Any]:
            import numpy as np  # noqa: PLC0415  (slow to load)

            from vision_gt.images.decisions import ImageDecision  # noqa: PLC0415  (numpy)

            if name in self._heard:
                return {"recorded": 0}
            places = np.array(numbers, dtype=float).reshape(-1, 2)
            one = ImageDecision(image, kind, places, device.by, note)
            count = self.shelves.decide([one])
            self._heard.add(name)
            return {"recorded": count}

        return await recorded(made)

    async def undo(self, request: "Request", device: "Device") -> "Response":
        """Take back what this person decided last."""
        await said_in(request)

        def made() -> dict[str, Any]:
            return {"images": [one.image for one in self.shelves.undo(device.by)]}

        return await answered(made)


def _numbers(said: dict[str, Any]) -> list[float]:
    """The pixels that a request states: none, x and y, or also those of the axis."""
    from validation.page.requests import RefusedError  # noqa: PLC0415  (an extra)

    given = [said[name] for name in _PLACES if said.get(name) is not None]
    numbers = [v for v in given if isinstance(v, int | float) and not isinstance(v, bool)]
    named = [name for name in _PLACES if said.get(name) is not None]
    whole = named in ([], list(_PLACES[:2]), list(_PLACES))
    if not whole or len(numbers) != len(given) or not all(-1 <= v <= 1e5 for v in numbers):
        raise RefusedError(400, "'x' and 'y', and with them 'axis_x' and 'axis_y', must be pixels")
    return [float(v) for v in numbers]


PANEL = ImagesPanel()
