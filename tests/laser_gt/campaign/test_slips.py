"""What was mixed up is named where hardly any scans come to lie on each other."""

import re
import shutil

import numpy as np
import pytest
from laser_rooms import solved, write_campaign


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A room seen by one scanner alone: the other's scans and mount are taken out."""
    path = tmp_path_factory.mktemp("slips")
    write_campaign(path, seed=9, stops=9)
    toml = path / "campaign.toml"
    text = toml.read_text()
    first, *others = re.findall(r"\[laser\.scanners\.(\w+)\]", text)
    for other in others:
        text = re.sub(
            rf"\[laser\.scanners\.{other}\][^\[]*(?:\[[^\]\n]*\]\n[^\[]*)*?(?=\n\[|\Z)", "", text
        )
    toml.write_text(text.replace("[laser]\n", "[laser]\ngenetic = false\n"))
    scans = path / "laser" / "scans.csv"
    kept = [
        line for line in scans.read_text().splitlines() if f",{first}," in line or "ranges" in line
    ]
    scans.write_text("\n".join(kept) + "\n")
    return path


def _half_turn(folder):
    toml = folder / "campaign.toml"

    def turned(found):
        x, y, theta = (float(one) for one in found[1].split(","))
        return f"mount = [{x}, {y}, {(theta + 2 * np.pi) % (2 * np.pi) - np.pi}]"

    toml.write_text(re.sub(r"^mount = \[(.*)\]", turned, toml.read_text(), flags=re.MULTILINE))


def _reversed(folder):
    scans = folder / "laser" / "scans.csv"
    head, *rows = scans.read_text().splitlines()
    place = head.split(",").index("ranges")
    changed = []
    for row in rows:
        values = row.split(",")
        values[place] = " ".join(values[place].split()[::-1])
        changed.append(",".join(values))
    scans.write_text("\n".join([head, *changed]) + "\n")


@pytest.mark.parametrize(
    ("slip", "said"), [(_half_turn, "half a turn"), (_reversed, "reverse order")]
)
def test_the_slip_is_named(folder, tmp_path, slip, said):
    shutil.copytree(folder, tmp_path / "c")
    slip(tmp_path / "c")
    outcome = solved(tmp_path / "c")
    assert said in outcome.slip


def test_without_a_slip_the_stops_are_placed(folder):
    outcome = solved(folder)
    assert outcome.slip == ""
    assert outcome.solutions["scanmatch"].lost == ()
