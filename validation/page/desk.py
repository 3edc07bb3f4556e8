"""What the page offers to its panels: the campaign, its texts, and how a page is set."""

import hashlib
import json
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from validation.campaign.folder import Campaign, load_campaign
from validation.errors import FinalError

if TYPE_CHECKING:
    from starlette.responses import Response

    from validation.page.access import Device
    from validation.page.runner import Runner

MEDIA = {".css": "text/css", ".js": "text/javascript"}
"""What a panel may serve as a file of its own."""


@cache
def english() -> dict[str, dict[str, str]]:
    """All texts of our own panels, by panel and name: one file, to be translated."""
    return tomllib.loads((files("validation.page") / "words.toml").read_text(encoding="utf-8"))


def static_files(package: str, names: Iterable[str]) -> dict[str, bytes]:
    """Files of a package's folder 'static', by their names."""
    folder = files(package) / "static"
    return {name: (folder / name).read_bytes() for name in names}


def version_of(paths: Iterable[Path]) -> str:
    """A text that changes when any of some files does: size, time and place on the disk of each.

    A file that is not there counts as such. Folders count by the names in them.
    """
    said = []
    for path in paths:
        try:
            at = os.stat(path)  # noqa: PTH116  (asked each second for each device)
            said.append((at.st_mtime_ns, at.st_size, at.st_ino))
        except OSError:
            said.append((0, 0, 0))
    return "-".join(f"{time:x}.{size:x}.{place:x}" for time, size, place in said)


def campaign_key(folder: Path) -> str:
    """What tells a campaign from others that a browser keeps something of."""
    name = str(folder.resolve())
    return hashlib.sha256(name.encode(errors="surrogateescape")).hexdigest()[:16]


class Desk:
    """What all panels of a page share.

    Parameters
    ----------
    folder : Path
        The campaign folder, or its campaign.toml.
    runner : Runner
        Runs the campaign in another process.
    """

    def __init__(self, folder: Path, runner: "Runner") -> None:
        self.campaign_as_opened = load_campaign(folder)
        self.folder = self.campaign_as_opened.folder
        self.runner = runner
        self.keep_devices: Callable[[], None] = lambda: None
        """Called when the person at a device has changed, so that it is known after a restart."""
        self.navigation: list[dict[str, Any]] = []
        """Name, title and mark of every panel, as the head of each page shows them."""
        self._loaded = (version_of([self.campaign_as_opened.toml]), self.campaign_as_opened)
        self._environments: dict[str, Environment] = {}

    def campaign(self) -> Campaign:
        """The campaign as campaign.toml says now.

        Raises
        ------
        GtvalError
            If that file is bad.
        """
        version = version_of([self.campaign_as_opened.toml])
        if version != self._loaded[0]:
            self._loaded = (version, load_campaign(self.folder))
        return self._loaded[1]

    @property
    def key(self) -> str:
        """Tells the campaign from others that are served at the same address."""
        return campaign_key(self.folder)

    @property
    def title(self) -> str:
        """Name of the campaign."""
        return self._loaded[1].settings.name

    def inside(self, name: str) -> Path:
        """Where a file of the campaign folder is.

        Raises
        ------
        FinalError
            If a link leads out of the folder.
        """
        folder = self.folder.resolve()
        path = (folder / name).resolve()
        if not path.is_relative_to(folder):
            raise FinalError(f"{name} is not in the campaign folder: a link leads out of it")
        return path

    def html(
        self, package: str, template: str, panel: str, device: "Device", values: Mapping[str, Any]
    ) -> "Response":
        """A page from a template of a package; it may extend 'frame.html.j2'.

        Parameters
        ----------
        package : str
            Dotted name; its folder 'templates' is looked in first.
        template : str
            Name of the file.
        panel : str
            Name of the panel.
        device : Device
            Who asks.
        values : mapping
            Of the template. ``data`` goes to scripts as JSON.
        """
        from starlette.responses import HTMLResponse  # noqa: PLC0415  (an extra)

        if package not in self._environments:
            self._environments[package] = environment_of(package)
        page = self._environments[package].get_template(template)
        told = {"data": {}, **values, "words": english(), "campaign": self.title}
        told |= {"panel": panel, "who": device.person.name, "navigation": self.navigation}
        told["key"] = self.key
        return HTMLResponse(page.render(told))

    def head(self, panel: str, device: "Device") -> Markup:
        """The head alone, for a page that has a form of its own."""
        page = environment_of("validation.page").get_template("head_alone.html.j2")
        told = {"words": english(), "panel": panel, "who": device.person.name}
        # The template escapes all text.
        return Markup(  # noqa: S704
            page.render({**told, "navigation": self.navigation, "campaign": self.title})
        )


def environment_of(package: str) -> Environment:
    """Where the templates of a package and those of the page are; all text is escaped."""
    own = [] if package == "validation.page" else [PackageLoader(package)]
    environment = Environment(
        loader=ChoiceLoader([*own, PackageLoader("validation.page")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_function"] = _as_json
    return environment


def _as_json(value: Any, **_options: Any) -> str:
    """JSON as short as it can be; the filter escapes what HTML would take for a tag."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
