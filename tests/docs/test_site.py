"""The site is built without a warning, leads nowhere into nothing, and fetches nothing."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from blocks import REPOSITORY

LOADED = {"img": "src", "script": "src", "iframe": "src", "source": "src", "link": "href"}
"""Elements that a browser fetches by itself, and the attribute that says what."""
LINK_IS_NO_LOAD = {"canonical", "index", "search", "next", "prev", "author"}


class Links(HTMLParser):
    """Links, targets and loaded files of a page."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.targets: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.targets |= {found[name] for name in ("id", "name") if found.get(name)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if tag in LOADED and found.get(LOADED[tag]) and found.get("rel") not in LINK_IS_NO_LOAD:
            self.loaded.append(found[LOADED[tag]])


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """The built site; one for all tests, and for all processes that share a run of them."""
    fcntl = pytest.importorskip("fcntl")
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    place = shared / "site"
    with (shared / "site.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # whoever comes second waits here
        if not (place / "built").exists():
            build(place)
            (place / "built").touch()
    return place / "html"


def build(place):
    """The site in a folder."""
    command = [sys.executable, "-m", "sphinx", "-W", "-n", "--keep-going", "-q", "-b", "html"]
    environment = {
        **os.environ,
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    built = subprocess.run(
        [*command, "-d", str(place / "doctrees"), str(REPOSITORY / "docs"), str(place / "html")],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert built.returncode == 0, built.stderr[-5000:]


@pytest.fixture(scope="session")
def pages(site):
    return {page.resolve(): Links(page) for page in site.rglob("*.html")}


# With --dist loadgroup these tests stay together in one process.
pytestmark = pytest.mark.xdist_group("site")


def test_a_group_of_tests_stays_in_one_process(request):
    """Otherwise both processes build what the group shares, or one waits for the other."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("tests are not grouped in this run")
    assert request.node.nodeid.endswith("@site")


def test_every_link_leads_somewhere(pages):
    dead = []
    for page, found in pages.items():
        for link in found.links:
            parts = urlsplit(link)
            if parts.scheme or link in {"#", ""}:
                continue
            target = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
            if target.is_dir():
                target /= "index.html"
            anchors = pages[target].targets if target in pages else set()
            if not target.exists() or (
                parts.fragment and target in pages and unquote(parts.fragment) not in anchors
            ):
                dead.append(f"{page.name}: {link}")
    assert not dead


def test_every_file_that_a_page_needs_is_there(pages):
    missing = [
        f"{page.name}: {name}"
        for page, found in pages.items()
        for name in found.loaded
        if not name.startswith("data:")
        and not (page.parent / unquote(urlsplit(name).path)).exists()
    ]
    assert not missing


def test_reading_the_site_fetches_nothing_from_elsewhere(site, pages):
    foreign = [
        f"{page.name}: {name}"
        for page, found in pages.items()
        for name in found.loaded
        if urlsplit(name).netloc
    ]
    foreign += [
        f"{sheet.name}: {name}"
        for sheet in site.rglob("*.css")
        for name in re.findall(
            r"(?:url\(|@import )\s*['\"]?((?:https?:)?//[^'\")]+)",
            sheet.read_text(encoding="utf-8"),
        )
    ]
    assert not foreign


def test_every_page_is_reached_from_the_first(site, pages):
    first = (site / "index.html").resolve()
    seen, waiting = set(), [first]
    while waiting:
        page = waiting.pop()
        if page in seen or page not in pages:
            continue
        seen.add(page)
        waiting += [
            (page.parent / unquote(urlsplit(link).path)).resolve()
            for link in pages[page].links
            if not urlsplit(link).scheme and urlsplit(link).path
        ]
    own = {page for page in pages if "_modules" not in page.parts}
    assert own - seen <= {
        (site / name).resolve() for name in ("search.html", "genindex.html", "py-modindex.html")
    }


def test_no_picture_is_left_over():
    shown = " ".join(
        page.read_text(encoding="utf-8")
        for page in [*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")]
    )
    pictures = (REPOSITORY / "docs" / "images").iterdir()
    drawn = {f"rooms_{package}.svg" for package in re.findall(r"{rooms} (\w+)", shown)}
    names = {picture.name for picture in pictures} - drawn
    assert not [name for name in names if name not in shown]
