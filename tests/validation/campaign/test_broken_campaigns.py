"""Campaigns as people break them: each ends with status 2 and says file, place and next step."""

import re
import shutil

import pytest
from click.testing import CliRunner

from validation.cli import main


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A small campaign without a fault."""
    folder = tmp_path_factory.mktemp("sound") / "room"
    made = CliRunner().invoke(main, ["simulate", str(folder), "--seed", "5", "--stops", "4"])
    assert made.exit_code == 0, made.output
    return folder


def edited(name, old, new, count=1):
    """A change of a text file; the old text must be there, so that the fault is really made."""

    def change(folder):
        path = folder / name
        text = path.read_text()
        assert re.search(old, text, re.MULTILINE), old
        path.write_text(re.sub(old, new, text, count=count, flags=re.MULTILINE))

    return change


def added(text):
    """Lines at the end of campaign.toml."""

    def change(folder):
        with (folder / "campaign.toml").open("a") as file:
            file.write(text)

    return change


def encoded(name, encoding):
    def change(folder):
        path = folder / name
        path.write_bytes(("# Größe\n" + path.read_text()).encode(encoding))

    return change


def removed(name):
    def change(folder):
        (folder / name).unlink()

    return change


def written(name, content):
    def change(folder):
        (folder / name).write_bytes(content)

    return change


READINGS = "survey/readings.csv"
FRAME = r"^(points = \{ \"?O\"? = )\[0.0, 0.0\], \"?X\"? = \[2.5.*"
PUBLISHED = '[[published]]\nsystem = "{}"\nfile = "{}"\n'
CASES = {
    "no campaign.toml": (removed("campaign.toml"), ["campaign.toml", "gtval simulate"]),
    "misspelt table": (added("[comparision]\nconfidence = 0.9\n"), ["comparision", "comparison"]),
    "misspelt key": (
        edited("campaign.toml", r"^world_points =", "world_point ="),
        ["campaign.toml, line", "survey.world_point", "world_points"],
    ),
    "key of another table": (
        added("[comparison]\ntolerance = 0.001\n"),
        ["campaign.toml, line", "comparison.tolerance", "acceptable_bias_length"],
    ),
    "not TOML": (added("[room\n"), ["campaign.toml", "not valid TOML", "line"]),
    "campaign.toml in UTF-16": (encoded("campaign.toml", "utf-16"), ["campaign.toml", "UTF-8"]),
    "campaign.toml in Latin-1": (
        encoded("campaign.toml", "latin-1"),
        ["campaign.toml, line 1", "UTF-8"],
    ),
    "confidence in per cent": (
        added("[comparison]\nconfidence = 95\n"),
        ["campaign.toml, line", "comparison.confidence", "95", "less than 1"],
    ),
    "a negative sigma": (
        added("[comparison]\nacceptable_bias_length = -0.05\n"),
        ["comparison.acceptable_bias_length", "-0.05", "greater than 0"],
    ),
    "no data": (
        lambda folder: (
            removed(READINGS)(folder),
            edited("campaign.toml", r"^\[\[published\]\](.*\n)+?(?=\[|$)", "")(folder),
        ),
        ["there is a table [survey], but the files", "readings.csv"],
    ),
    "readings without a column": (
        edited(READINGS, r"^time,from,to,distance", "time,from,to,length"),
        [READINGS, "line 1", "distance"],
    ),
    "readings in millimetres": (
        edited(READINGS, r",(\d+)\.(\d{3})", r",\1\2.000", count=0),
        [READINGS, "line 2", "distance", 'units = "mm"', "[survey]"],
    ),
    "a sign before a distance": (
        edited(READINGS, r",(\d+\.\d{3})", r",-\1"),
        [READINGS, "line 2", "distance", "0.05 to 50 m"],
    ),
    "a word for a number": (
        edited(READINGS, r",\d+\.\d{3}", ",far"),
        [READINGS, "line 2", "distance", "'far'"],
    ),
    "a point nobody stated": (
        edited(READINGS, r"^(\S+?),O,\w+", r"\1,O,99"),
        [READINGS, "line", "99", "world_points"],
    ),
    "an empty file of readings": (written(READINGS, b""), [READINGS, "empty"]),
    "a spreadsheet named CSV": (written(READINGS, b"PK\x03\x04" + bytes(60)), [READINGS, "CSV"]),
    "published poses missing": (
        added(PUBLISHED.format("rig", "gt/rig.csv")),
        ["gt/rig.csv", "no such file"],
    ),
    "a system's name twice": (
        added(2 * PUBLISHED.format("rig", "survey/initial_guesses.csv")),
        ["campaign.toml", "published", "rig", "twice"],
    ),
    "a system's name with a space": (
        added(PUBLISHED.format("my rig", "survey/initial_guesses.csv")),
        ["campaign.toml, line", "published", "my rig"],
    ),
    "published headings in degrees": (
        lambda folder: (
            (folder / "gt.csv").write_text(
                "pose,x,y,theta\n1,0,0,90\n2,1,0,180\n3,2,0,270\n4,2,1,-90\n"
            ),
            added(PUBLISHED.format("rig", "gt.csv"))(folder),
        ),
        ["gt.csv, line 2", "theta", "90", "rad"],
    ),
    "a folder named as the readings": (
        lambda folder: (removed(READINGS)(folder), (folder / READINGS).mkdir()),
        [READINGS, "a folder", "put the file there"],
    ),
    "a frame on one line": (
        edited("campaign.toml", FRAME, r"\1[0, 0], X = [2.5, 0], Y = [5, 0], XY = [7.5, 0] }"),
        ["campaign.toml, line", "vframe", "on one line", "state one that lies off the line"],
    ),
    "two frame points in one place": (
        edited("campaign.toml", FRAME, r"\1[0, 0], X = [0, 0], Y = [0, 2.5], XY = [2.5, 2.5] }"),
        ["campaign.toml, line", "vframe", "O and X are the same place"],
    ),
    "two rig points in one place": (
        edited("campaign.toml", r"^(points = .*\[)0.0, 0.4\]", r"\g<1>0.6, 0.0]"),
        ["campaign.toml, line", "robot_frame", "X and Y are the same place"],
    ),
    **{
        f"a pole_length of {value}": (
            edited("campaign.toml", r"^pole_length = .*", f"pole_length = {value}"),
            ["campaign.toml, line", word],
        )
        for value, word in {
            "1e300": "vframe.pole_length': '1e+300' — longer than 300 m",
            "2500": "write metres",
            "true": "vframe.pole_length': 'True' — write a number, without quotes",
            '"2.5"': "vframe.pole_length': '2.5' — write a number, without quotes",
            "20.0": "no two points are pole_length = 20 m apart; take out one of both",
        }.items()
    },
    "no length of the frame's side": (
        edited("campaign.toml", r"^(pole_length|points) =.*$", "", count=0),
        ["campaign.toml", "pole_length ="],
    ),
}


@pytest.mark.parametrize("fault", CASES)
def test_a_broken_campaign_says_file_place_and_next_step(sound, tmp_path, fault):
    change, words = CASES[fault]
    folder = tmp_path / "room"
    shutil.copytree(sound, folder)
    change(folder)
    done = CliRunner().invoke(main, ["run", str(folder)])
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.output
    said = " ".join(done.stderr.split())
    missing = [word for word in words if word not in said]
    assert not missing, f"{missing} not in: {said}"
    assert not (folder / "results").exists()
    assert not (folder / "report").exists()


def test_the_campaign_is_sound_before_it_is_broken(sound, tmp_path):
    shutil.copytree(sound, tmp_path / "room")
    done = CliRunner().invoke(main, ["run", str(tmp_path / "room"), "--no-report"])
    assert done.exit_code == 0, done.output
    assert len(CASES) >= 20
