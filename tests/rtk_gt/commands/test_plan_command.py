"""`gtval rtk plan` from campaigns and options: files, JSON, and errors in plain words."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner
from skies import DAY, log_of, milan_plan, times

from data_samples.sky.constellation import gps_rows
from data_samples.sky.texts import two_line_text, yuma_text
from validation.cli import main

AT = ["--at", "45.5", "9.2", "150"]
CAMPAIGN = """\
name = "Campus"

[rtk]
origin = { latitude = 45.478, longitude = 9.232, height = 160.0 }

[rtk.plan]
almanac = "sky/almanac.alm"
mask = 10.0
satellites = 6
pdop = 4.0

[[rtk.plan.places]]
name = "base"
base = true
latitude = 45.478
longitude = 9.232
height = 185.0

[[rtk.plan.places]]
name = "Rettorato"
latitude = 45.478
longitude = 9.232
height = 161.5
horizon = [[0, 5], [180, 5]]

[[rtk.plan.places]]
name = "Piazzetta"
latitude = 45.4784
longitude = 9.232
height = 161.5
horizon_file = "sky/piazzetta.csv"

[[rtk.plan.buildings]]
name = "aula_magna"
height = 25.0
corners = [[-30, 10], [30, 10], [30, 20], [-30, 20]]
"""


def run(*arguments, status=0):
    done = CliRunner().invoke(main, ["rtk", "plan", *map(str, arguments)])
    assert done.exit_code == status, done.output
    return done.output


@pytest.fixture
def sky(tmp_path):
    path = tmp_path / "sky.alm"
    path.write_text(yuma_text(gps_rows(DAY, 27)))
    return ["--almanac", path, "--day", DAY.isoformat()]


@pytest.fixture
def campaign(tmp_path):
    folder = tmp_path / "campus"
    (folder / "sky").mkdir(parents=True)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "sky" / "almanac.alm").write_text(yuma_text(gps_rows(DAY, 27)))
    (folder / "sky" / "piazzetta.csv").write_text("azimuth,elevation\n90,5\n180,40\n270,5\n")
    return folder


def test_csv_files_hold_what_the_plan_says(sky, tmp_path):
    run(*sky, *AT, "--step", 60, "-o", tmp_path / "plan.csv")
    plan = milan_plan(tmp_path, at=times(3600.0))
    rows = list(csv.DictReader((tmp_path / "plan.csv").read_text().splitlines()))
    assert [int(row["satellites"]) for row in rows] == plan.count.tolist()
    assert [float(row["pdop"]) for row in rows] == pytest.approx(plan.dop.position, abs=6e-4)
    seen = list(csv.DictReader((tmp_path / "plan_satellites.csv").read_text().splitlines()))
    assert sum(int(row["visible"]) for row in seen) == plan.used.sum()
    assert len(seen) == (plan.rover.elevation > 0).sum()


def test_places_of_a_campaign_have_their_horizons_and_buildings(campaign):
    told = json.loads(run(campaign, "--day", DAY, "--json"))
    assert [one["place"] for one in told["places"]] == ["Rettorato", "Piazzetta"]
    assert {one["base"] for one in told["places"]} == {"base"}
    assert told["places"][0]["baseline"] == pytest.approx(23.5, abs=0.1)
    rettorato, piazzetta = (one["satellite_seconds"] for one in told["places"])
    # The building stands north of the first place and south of the second, which has a horizon
    # in the south besides; in the south there is more to lose.
    assert rettorato["S"] > 1.3 * piazzetta["S"]
    assert rettorato["NE"] < piazzetta["NE"]
    one = json.loads(run(campaign, "--day", DAY, "--place", "Piazzetta", "--json"))
    assert one["places"] == told["places"][1:]


def test_options_count_more_than_the_campaign(campaign, sky):
    told = json.loads(run(campaign, *sky, *AT, "--mask", 30, "--satellites", 4, "--json"))
    assert told["mask"] == pytest.approx(0.5236, abs=1e-4)
    assert [one["place"] for one in told["places"]] == ["rover"]


def test_a_plan_of_some_hours(sky):
    told = json.loads(run(*sky, *AT, "--from", "08:00", "--to", "17:30", "--json"))
    assert len(told["places"][0]["hours"]) == 10
    assert told["end"] - told["start"] == 9.5 * 3600


def test_the_log_gives_day_and_place_and_is_held_against_the_plan(sky, tmp_path):
    at = times()[0] + 3600.0 * 9 + 30.0 + 60.0 * np.arange(30)
    path = tmp_path / "drive.nmea"
    path.write_text(log_of(milan_plan(tmp_path, at=at)))
    arguments = [*sky[:2], "--log", path, "--log-figure", tmp_path / "log.png"]
    told = json.loads(run(*arguments, "-o", tmp_path / "plan.csv", "--json"))
    assert told["log"]["minutes"] == 30
    assert told["log"]["mean_predicted"] == pytest.approx(told["log"]["mean_seen"])
    assert [path.rpartition("/")[2] for path in told["files"]] == [
        *("log.png", "plan.csv", "plan_satellites.csv", "plan_log.csv")
    ]
    assert "seen_as_planned" in {one["code"] for one in told["findings"]}
    said = run(*sky, "--at", 40, 9.2, 150, "--log", path, status=2)
    assert "was written 611 km from the place 'rover'" in said


def test_figures_are_written(sky, tmp_path):
    run(*sky, *AT, "--sky", tmp_path / "sky.png", "--figure", tmp_path / "time.svg")
    assert (tmp_path / "sky.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "time.svg").read_text().startswith("<?xml")


BAD = {
    "no almanac is stated": ["--day", "2026-11-30", *AT],
    "no day is stated": ["--almanac", "{almanac}", *AT],
    "no place is stated": ["--almanac", "{almanac}", "--day", "2026-11-30"],
    "there is no such file": ["--almanac", "nothing.alm", "--day", "2026-11-30", *AT],
    "is no place on Earth": ["--almanac", "{almanac}", "--day", "2026-11-30", "--at", 145, 9, 0],
    "no place 'yard' for the rover in [rtk.plan]; there are: none": [
        *("--almanac", "{almanac}", "--day", "2026-11-30", "--place", "yard")
    ],
    "--from 18:00 is not before --to 08:00": [
        *("--almanac", "{almanac}", "--day", "2026-11-30", *AT, "--from", "18:00", "--to", "08:00")
    ],
    "'8 am' is not a time of day; expected HH:MM": [
        *("--almanac", "{almanac}", "--day", "2026-11-30", *AT, "--from", "8 am")
    ],
    "--horizon needs --at": ["--almanac", "{almanac}", "--horizon", "x.csv"],
    "--log-figure needs --log": ["--almanac", "{almanac}", "--log-figure", "x.png"],
    "can be written as .png or .svg only": [
        *("--almanac", "{almanac}", "--day", "2026-11-30", *AT, "--sky", "x.pdf")
    ],
}


@pytest.mark.parametrize("said", BAD)
def test_what_is_wrong_is_said_in_a_sentence(sky, said):
    arguments = [str(one).format(almanac=sky[1]) for one in BAD[said]]
    assert said in run(*arguments, status=2).replace("\n", " ")


def test_buildings_need_an_origin(campaign):
    path = campaign / "campaign.toml"
    path.write_text(CAMPAIGN.replace("[rtk]\norigin", "[rtk]\n# origin"))
    assert "field 'rtk.origin': needed, as the corners" in run(campaign, "--day", DAY, status=2)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"Piazzetta"', '"base"', "two places have the same name"),
        ("height = 161.5\nhorizon = [", "base = true\nheight = 161.5\nhorizon = [", "are the base"),
        ("[[0, 5], [180, 5]]", "[[0, 95]]", "horizon.0.1': '95' — write a number of at most 90"),
        ("mask = 10.0", "mask = 95", "rtk.plan.mask'"),
        ("[rtk.plan]", "[rtk.plan]\nelevation = 5", "elevation"),
        ("[[-30, 10], ", "[", "at least 3"),
    ],
)
def test_bad_settings_are_named(campaign, old, new, said):
    text = CAMPAIGN.replace(old, new, 1)
    if "at least 3" in said:
        text = text.replace("[30, 10], [30, 20], ", "[30, 10], ")
    (campaign / "campaign.toml").write_text(text)
    assert said in run(campaign, "--day", DAY, status=2)


def test_a_bad_horizon_file_is_named(campaign):
    (campaign / "sky" / "piazzetta.csv").write_text("azimuth,elevation\n90,95\n")
    said = run(campaign, "--day", DAY, status=2)
    assert "piazzetta.csv, line 2, field 'elevation': '95' — " in said


def test_an_almanac_for_the_samples_says_how_to_ask_for_galileo(tmp_path):
    arguments = ["simulate-almanac", str(tmp_path / "x.alm"), "--day", "2026-11-30"]
    done = CliRunner().invoke(main, [*arguments, "--galileo"])
    assert done.exit_code == 2
    assert "--galileo: a file of kind yuma has GPS only" in done.output
    done = CliRunner().invoke(main, [*arguments, "--galileo", "--format", "tle"])
    assert done.output.startswith("51 satellites")


def test_two_line_elements_say_that_health_is_unknown(tmp_path):
    path = tmp_path / "gps.tle"
    path.write_text(two_line_text(gps_rows(DAY)))
    told = json.loads(run("--almanac", path, "--day", DAY, *AT, "--json"))
    assert "almanac" in {one["code"] for one in told["findings"]}
    assert told["almanac"]["kind"] == "TLE"
