"""What was mixed up is named where hardly any scans come to lie on each other."""

import re
import shutil

import numpy as np
import pytest
from laser_rooms import solved, write_campaign

from validation.poses.pose_table import from_csv


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
    assert said in outcome.slip.text
    assert outcome.slip.share >= 0.3


def test_without_a_slip_the_stops_are_placed(folder):
    outcome = solved(folder)
    assert outcome.slip is None
    assert outcome.solutions["scanmatch"].lost == ()


def test_guesses_worse_than_assumed_are_matched_again_with_what_they_show(tmp_path):
    from laser_gt.campaign.findings import laser_findings

    write_campaign(tmp_path, seed=9, stops=9)
    rng = np.random.default_rng(1)
    table = tmp_path / "laser" / "odometry.csv"
    head, *rows = table.read_text().splitlines()
    drift = np.cumsum(rng.normal(size=(len(rows), 3)) * [0.35, 0.35, 0.2], axis=0)
    changed = []
    for row, off in zip(rows, drift, strict=True):
        name, *pose = row.split(",")
        wild = np.array(pose[:3], dtype=float) + off
        changed.append(",".join([name, *map(str, wild), *pose[3:]]))
    table.write_text("\n".join([head, *changed]) + "\n")
    toml = tmp_path / "campaign.toml"
    text = re.sub(r"^guess_sigmas.*\n", "", toml.read_text(), flags=re.MULTILINE)
    toml.write_text(text.replace("[laser]\n", "[laser]\ngenetic = false\n"))
    outcome = solved(tmp_path)
    assert outcome.assumed_guesses == (0.15, 0.1)
    assert outcome.settings.guess_sigmas[0] > 0.3
    truth = from_csv(tmp_path / "truth" / "poses.csv")
    solution = outcome.solutions["scanmatch"]
    off = solution.placement.poses - truth.select(solution.stops).poses
    assert np.abs(off[:, :2]).max() < 0.01
    (said,) = [one for one in laser_findings(outcome) if one.code == "guess_sigmas"]
    assert "matched again" in said.text
