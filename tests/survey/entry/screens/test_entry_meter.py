"""Meters read by Bluetooth, the page over TLS, screens that stay awake."""

import json
import re
import shutil
import ssl
import struct
import subprocess
from importlib.resources import files

import httpx
import pytest
from entry_rooms import entry_room
from entry_server import EntryServer

from validation.page.certificate import certificate

NODE = shutil.which("node")
STATIC = files("survey.entry.screens") / "static"


def in_node(tmp_path, module, code):
    """What a piece of JavaScript prints that uses a module of the page."""
    (tmp_path / "module.mjs").write_text((STATIC / module).read_text())
    (tmp_path / "run.mjs").write_text(code)
    done = subprocess.run(
        [NODE, "run.mjs"], cwd=tmp_path, check=True, capture_output=True, text=True, timeout=60
    )
    return json.loads(done.stdout)


def glm(metres, head=(0xC0, 0x55, 0x10), mode=0x06):
    """A message of the Bosch protocol: head, mode, three bytes, the length, the rest."""
    return [*head, mode, 0, 0, 0, *struct.pack("<f", metres), *[0] * 9]


@pytest.mark.skipif(not NODE, reason="node is not installed")
def test_the_messages_of_two_makers_are_metres_and_all_else_is_no_reading(tmp_path):
    messages = {
        "leica": [list(struct.pack("<f", 2.504)), [0, 0]],
        "bosch": [
            glm(2.504),
            glm(2.504, mode=0x05),
            glm(31.2, mode=0x39),
            glm(2.5, head=(0xC0, 0x55, 0x02)),
            [0xC0, 0x55, 0x10, 0x06],
        ],
    }
    code = f"""
        import {{ METERS }} from "./module.mjs";
        const of = (meter, bytes) => meter.metres(new DataView(Uint8Array.from(bytes).buffer));
        const said = {json.dumps(messages)};
        console.log(JSON.stringify([
          said.leica.map((one) => of(METERS[0], one)), said.bosch.map((one) => of(METERS[1], one)),
        ]));
    """
    leica, bosch = in_node(tmp_path, "meter.js", code)
    assert leica == [pytest.approx(2.504, abs=1e-6), None]
    assert bosch == [pytest.approx(2.504, abs=1e-6)] * 2 + [None] * 3


@pytest.mark.skipif(not NODE, reason="node is not installed")
def test_a_meter_that_is_chosen_is_told_to_send_and_heard(tmp_path):
    code = f"""
        import {{ connectMeter, METERS, whyNoMeter }} from "./module.mjs";
        const be = (value) => Object.defineProperty(
          globalThis, "navigator", {{ value, configurable: true }},
        );
        be({{}});
        globalThis.window = {{ isSecureContext: false }};
        const why = whyNoMeter();
        let heard = null; const written = [], got = [], told = [];
        const value = {{
          startNotifications: async () => {{}},
          addEventListener: (_, listener) => {{ heard = listener; }},
          writeValue: async (bytes) => written.push([...bytes]),
        }};
        const server = {{ getPrimaryService: async (uuid) => {{
          if (uuid !== METERS[1].service) throw new Error("none");
          return {{ getCharacteristic: async () => value }};
        }} }};
        const device = {{
          name: "Bosch GLM50C", addEventListener() {{}}, gatt: {{ connect: async () => server }},
        }};
        be({{ bluetooth: {{ requestDevice: async () => device }} }});
        await connectMeter((metres) => got.push(metres), (text) => told.push(text));
        heard({{ target: {{ value: new DataView(Uint8Array.from({glm(7.25)}).buffer) }} }});
        heard({{ target: {{ value: new DataView(Uint8Array.from({glm(0.0)}).buffer) }} }});
        console.log(JSON.stringify({{ why, written, got, told }}));
    """
    said = in_node(tmp_path, "meter.js", code)
    assert "--tls" in said["why"]
    assert said["written"] == [[0xC0, 0x55, 0x02, 0x01, 0x00, 0x1A]]
    assert said["got"] == [7.25]
    assert said["told"] == [
        "Bosch GLM50C is connected: each measurement is entered as it is taken."
    ]


@pytest.mark.skipif(not NODE, reason="node is not installed")
@pytest.mark.parametrize("secure", ["true", "false"])
def test_where_the_screen_cannot_be_kept_awake_the_page_says_how(tmp_path, secure):
    code = f"""
        import {{ stayAwake }} from "./module.mjs";
        globalThis.window = {{ isSecureContext: {secure} }};
        Object.defineProperty(globalThis, "navigator", {{ value: {{}} }});
        stayAwake((text) => console.log(JSON.stringify(text)));
    """
    said = in_node(tmp_path, "awake.js", code)
    assert "longest time" in said
    assert ("--tls" in said) == (secure == "false")


@pytest.mark.skipif(not NODE, reason="node is not installed")
def test_the_screen_is_asked_to_stay_awake_whenever_the_page_is_looked_at_again(tmp_path):
    code = """
        import { stayAwake } from "./module.mjs";
        const asked = [], told = []; let looked = null;
        globalThis.document = {
          visibilityState: "visible", addEventListener: (_, one) => { looked = one; },
        };
        const wakeLock = { request: async (kind) => asked.push(kind) };
        Object.defineProperty(globalThis, "navigator", { value: { wakeLock } });
        stayAwake((text) => told.push(text));
        looked();
        await Promise.resolve();
        console.log(JSON.stringify([asked, told]));
    """
    asked, told = in_node(tmp_path, "awake.js", code)
    assert asked == ["screen", "screen"]
    assert set(told) <= {""}


def test_a_certificate_is_made_once_for_its_names(tmp_path):
    path = tmp_path / "journal.tls.pem"
    first = certificate(path, ["localhost", "192.168.7.1", "fe80::1%eth0"])
    assert path.stat().st_mode & 0o077 == 0
    assert re.fullmatch(r"([0-9A-F]{2}:){31}[0-9A-F]{2}", first.fingerprint)
    assert certificate(path, ["192.168.7.1", "localhost", "fe80::1%eth0"]) == first
    assert certificate(path, ["localhost"]) != first
    path.write_text("nothing")
    assert certificate(path, ["localhost"]).path == path


def test_the_page_is_served_encrypted_and_its_cookie_only_so(tmp_path):
    room = entry_room(5, 1, tmp_path / "room")
    with EntryServer(room, tmp_path / "log", "--tls") as server:
        assert server.url.startswith("https://")
        assert "fingerprint (SHA-256)" in server.log.read_text()
        trusted = ssl.create_default_context(cafile=str(room.journal.with_suffix(".tls.pem")))
        with httpx.Client(base_url=server.url, verify=trusted, timeout=20) as client:
            joined = client.post("/join", json={"code": server.code, "name": "ann"})
            assert joined.status_code == 200, joined.text
            assert "Secure" in joined.headers["set-cookie"]
            said = {"id": "a", "from": "O", "to": "X", "text": "2.5"}
            assert client.post("/readings", json=said).json()["outcome"] == "recorded"
            assert "meter" in client.get("/").text
