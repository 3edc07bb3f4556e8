"""Nobody without a code gets anything of any panel, and no foreign site acts for one who has."""

import re
from pathlib import Path

import httpx
import pytest
from page_rooms import HOSTILE

from validation.page.desk import Desk
from validation.page.panels import installed_panels
from validation.page.runner import Runner


@pytest.fixture(scope="module")
def routes(tmp_path_factory):
    """Method and path of every request that any installed panel answers."""
    folder = tmp_path_factory.mktemp("routes")
    (folder / "campaign.toml").write_text('name = "any"\n')
    desk = Desk(folder, Runner(folder))
    found = installed_panels()
    assert found.failed == {}
    named = [("GET", "/versions")]
    for panel in found.panels:
        opened = panel.open(desk)
        named += [(call.method, f"/{panel.name}/{call.path}") for call in opened.calls]
        opened.close()
    return [(method, re.sub(r"\{\w+(:path)?\}", "1", path)) for method, path in named]


def sent(client, method, path, **more):
    return client.request(method, path, json={} if method == "POST" else None, **more)


def test_every_package_adds_its_panels(routes):
    paths = {path for _, path in routes}
    panels = ("to_do", "readings", "matches", "images", "trajectories", "report")
    assert {f"/{name}/" for name in panels} <= paths


def test_without_a_code_no_panel_answers(served, routes):
    with httpx.Client(base_url=served.url) as stranger:
        stranger.cookies.set(f"gtval_page_{served.port}", "made-up")
        for method, path in routes:
            answer = sent(stranger, method, path)
            if path.endswith("/"):
                assert "Type the code" in answer.text, path
                assert len(answer.text) < 3_000, path
            else:
                assert answer.status_code == 401, path


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example"},
    ],
)
def test_requests_from_other_sites_are_refused_by_every_panel(ann, routes, headers):
    for method, path in routes:
        if method == "POST" or "Host" in headers:
            answer = sent(ann, method, path, headers=headers)
            assert answer.status_code in (403, 421), (method, path)


@pytest.mark.parametrize(
    ("content", "kind", "statuses"),
    [
        (b"x" * 1_000_000, "application/json", {413}),
        (b"a=b", "application/x-www-form-urlencoded", {415}),
        (b"{}", "text/plain", {415}),
        (b"not json", "application/json", {400}),
        (b"[" * 60_000, "application/json", {400}),
        (b"[]", "application/json", {400}),
        (b"\xff\xfe", "application/json", {400}),
        (b'{"a":"\\ud800","reference":"\\ud800"}', "application/json", {200, 400, 404, 409}),
    ],
)
def test_hostile_bodies_are_refused_by_every_panel(ann, routes, content, kind, statuses):
    for method, path in routes:
        if method == "POST" and not path.endswith(("/run", "/stop")):
            try:
                answer = ann.post(path, content=content, headers={"Content-Type": kind})
            except httpx.TransportError:
                continue  # hung up on, which is a refusal too
            # One that cannot be opened for this campaign says so before it looks at anything.
            assert answer.status_code in statuses | {409}, (path, answer.text)
    assert ann.get("/versions").status_code == 200


def test_a_run_is_started_by_json_of_this_site_alone(ann):
    for kind in ("text/plain", "application/x-www-form-urlencoded"):
        answer = ann.post("/to_do/run", content=b"{}", headers={"Content-Type": kind})
        assert answer.status_code == 415
    assert ann.get("/versions").json()["run"]["number"] == 0


@pytest.mark.parametrize(
    "path",
    [
        "static/../app.py",
        "static/%2e%2e/app.py",
        "static/..%2fapp.py",
        "static/%00",
        "static/page.html.j2",
        "../../etc/passwd",
        "%2e%2e/%2e%2e/campaign.toml",
        "campaign.toml",
        "document/../../campaign.toml",
    ],
)
def test_no_path_leads_to_another_file(ann, path):
    for panel in ("", "to_do/", "report/", "readings/", "matches/", "images/", "trajectories/"):
        answer = ann.get(f"/{panel}{path}")
        assert answer.status_code in (400, 404, 405), (panel, path)
        assert "published" not in answer.text


def test_markup_in_names_is_text_everywhere(ann):
    panels = ("/to_do/", "/report/", "/matches/", "/images/", "/trajectories/")
    for path in (*panels, "/to_do/lists", "/to_do/standing"):
        answer = ann.get(path)
        assert answer.status_code == 200
        assert HOSTILE not in answer.text
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy


def test_nothing_but_get_and_post_is_answered(ann, routes):
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
        for _, path in routes:
            assert ann.request(method, path).status_code in (400, 404, 405), (method, path)


def test_the_files_of_who_was_let_in_let_nobody_in(served, ann):
    kept = Path(served.folder) / ".page.devices"
    token = dict(ann.cookies)[f"gtval_page_{served.port}"]
    assert token not in kept.read_text()
    assert kept.stat().st_mode & 0o077 == 0


def test_a_report_that_is_a_link_out_of_the_folder_is_not_shown(served, ann, tmp_path):
    outside = tmp_path / "report.html"
    outside.write_text("of somebody else")
    (served.folder / "report").mkdir(exist_ok=True)
    link = served.folder / "report/report.html"
    before = link.read_bytes() if link.exists() else None
    link.unlink(missing_ok=True)
    link.symlink_to(outside)
    try:
        answer = ann.get("/report/document")
        assert answer.status_code == 409
        assert "somebody" not in answer.text
    finally:
        link.unlink()
        if before is not None:
            link.write_bytes(before)


def test_a_campaign_file_that_is_being_edited_is_told_on_every_page(served, ann):
    toml = served.folder / "campaign.toml"
    before = toml.read_text()
    toml.write_text(before + "\n[visi")
    try:
        for panel in ("to_do", "readings", "matches", "images", "trajectories", "report"):
            answer = ann.get(f"/{panel}/")
            assert answer.status_code == 200
            assert answer.headers["content-type"].startswith("text/html")
    finally:
        toml.write_text(before)
