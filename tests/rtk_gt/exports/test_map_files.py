"""Files for maps hold the points of the run, where they are, with their quality."""

import json
import re
import shutil
import xml.etree.ElementTree as ET
from datetime import datetime

import numpy as np
import pymap3d
import pytest
from click.testing import CliRunner
from skies import gga, zda

from rtk_gt.exports.points import stored_points
from rtk_gt.receivers.formats.fix_csv import read_fix_csv
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.text_files.csv_tables import Column, read_csv

GPX = "{http://www.topografix.com/GPX/1/1}"
KML = "{http://www.opengis.net/kml/2.2}"
START = 1_796_000_000.0


def run(*arguments, status=0):
    done = CliRunner().invoke(main, ["rtk", *map(str, arguments)])
    assert done.exit_code == status, done.output
    return done.output


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    """One receiver: 40 epochs, of which ten are float, with a pause of ten seconds."""
    folder = tmp_path_factory.mktemp("export") / "roof & yard"
    folder.mkdir()
    times = START + np.arange(40.0) + np.where(np.arange(40) >= 20, 10.0, 0.0)
    lines = [zda(times[0])]
    for k, time in enumerate(times):
        kind = 5 if 5 <= k < 15 else 4
        lines.append(gga(time, 45.5 + 1e-6 * k, 9.2 + 2e-6 * k, 7 + k % 2, 1.2, kind))
    (folder / "roof.nmea").write_text("\n".join(lines) + "\n")
    text = 'name = "Roof & yard"\n[[rtk.receivers]]\nname = "roof"\nfile = "roof.nmea"\n'
    (folder / "campaign.toml").write_text(text)
    run("solve", folder)
    return folder


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Three receivers: a simulated drive."""
    folder = tmp_path_factory.mktemp("export") / "drive"
    done = CliRunner().invoke(main, ["simulate-drive", str(folder), "--loops", "1"])
    assert done.exit_code == 0, done.output
    run("solve", folder)
    return folder


def places(text, form):
    """Times, latitudes and longitudes in a file."""
    if form == "geojson":
        found = json.loads(text)["features"]
        ends = [one["geometry"]["coordinates"] for one in found]
        return [one["properties"]["time"] for one in found], [(b, a) for a, b, _ in ends]
    if form == "gpx":
        found = ET.fromstring(text).iter(f"{GPX}trkpt")
        rows = [
            (p.find(f"{GPX}time").text, float(p.get("lat")), float(p.get("lon"))) for p in found
        ]
        return [row[0] for row in rows], [row[1:] for row in rows]
    found = list(ET.fromstring(text).iter(f"{KML}Placemark"))
    ends = [one.find(f".//{KML}coordinates").text.split(",") for one in found]
    times = [one.find(f".//{KML}when").text for one in found]
    order = np.argsort(times)
    return [times[k] for k in order], [(float(ends[k][1]), float(ends[k][0])) for k in order]


@pytest.mark.parametrize("form", ["geojson", "gpx", "kml"])
def test_every_file_holds_every_point_where_it_is(roof, drive, tmp_path, form):
    for folder in (roof, drive):
        path = tmp_path / f"path.{form}"
        run("export", folder, "--to", path)
        points, late = stored_points(load_campaign(folder))
        assert late == []
        times, found = places(path.read_text(), form)
        stamps = [datetime.fromisoformat(one).timestamp() for one in times]
        assert stamps == pytest.approx(points.times, abs=6e-4)
        assert np.abs(np.array(found) - points.geodetic[:, :2]).max() < 1e-9


def test_poses_in_the_local_frame_are_where_pymap3d_puts_them(drive):
    points, _ = stored_points(load_campaign(drive))
    columns = [Column(name, "number") for name in ("x", "y", "z")]
    numbers = read_csv(drive / "results" / "poses_rtk.csv", columns).numbers
    told = json.loads((drive / "results" / "run.json").read_text())["systems"]["rtk"]["frame"]
    origin = [float(one) for one in re.findall(r"-?\d+\.\d+", told)]
    expected = pymap3d.enu2geodetic(*(np.array(numbers[name]) for name in "xyz"), *origin)
    off = (points.geodetic - np.column_stack(expected)) * [111e3, 111e3, 1]
    assert np.abs(off).max() < 1e-3


def test_the_quality_of_each_point_is_told(roof, tmp_path):
    run("export", roof, "--to", tmp_path / "a.geojson")
    told = [
        one["properties"] for one in json.loads((tmp_path / "a.geojson").read_text())["features"]
    ]
    assert [one["fix"] for one in told].count("RTK float") == 10
    assert {one["satellites"] for one in told} == {7, 8}
    assert {one["hdop"] for one in told} == {1.2}
    run("export", roof, "--to", tmp_path / "a.kml")
    root = ET.fromstring((tmp_path / "a.kml").read_text())
    assert [one.find(f"{KML}name").text for one in root.iter(f"{KML}Folder")] == [
        *("RTK fixed", "RTK float")
    ]
    styles = {f"#{one.get('id')}" for one in root.iter(f"{KML}Style")}
    assert {one.text for one in root.iter(f"{KML}styleUrl")} == styles


def test_sigmas_of_poses_are_those_of_their_covariances(drive, tmp_path):
    run("export", drive, "--to", tmp_path / "a.geojson")
    told = [
        one["properties"] for one in json.loads((tmp_path / "a.geojson").read_text())["features"]
    ]
    columns = [Column(name, "number") for name in ("xx", "xy", "yy", "zz")]
    number = read_csv(drive / "results" / "poses_rtk.csv", columns).numbers
    level = np.moveaxis(
        np.array([[number["xx"], number["xy"]], [number["xy"], number["yy"]]]), -1, 0
    )
    largest = np.sqrt(np.linalg.eigvalsh(level)[:, -1])
    assert [one["sigma_level"] for one in told] == pytest.approx(largest, abs=6e-5)
    assert [one["sigma_up"] for one in told] == pytest.approx(np.sqrt(number["zz"]), abs=6e-5)


def test_a_track_has_no_line_over_a_pause_and_the_order_of_the_schema(roof, tmp_path):
    run("export", roof, "--to", tmp_path / "a.gpx")
    root = ET.fromstring((tmp_path / "a.gpx").read_text())
    assert [len(one) for one in root.iter(f"{GPX}trkseg")] == [20, 20]
    assert root.find(f"{GPX}metadata/{GPX}name").text == "Roof & yard"
    order = ["ele", "time", "cmt", "sat", "hdop"]
    assert [one.tag.removeprefix(GPX) for one in next(root.iter(f"{GPX}trkpt"))] == order


def test_points_may_be_fewer_and_of_one_kind(roof, tmp_path):
    path = tmp_path / "a.geojson"
    told = json.loads(run("export", roof, "--to", path, "--only", "RTK float", "--json"))
    assert told["kinds"] == {"RTK float": 10}
    told = json.loads(run("export", roof, "--to", path, "--every", 5, "--json"))
    assert told["points"] == 8


def test_the_table_is_read_as_a_log_of_fixes(roof, tmp_path):
    path = tmp_path / "a.csv"
    run("export", roof, "--to", path)
    points, _ = stored_points(load_campaign(roof))
    again = read_fix_csv(path, "roof")
    assert again.times == pytest.approx(points.times, abs=1e-3)
    assert np.degrees(again.geodetic[:, :2]) == pytest.approx(points.geodetic[:, :2], abs=1e-12)
    assert again.satellites.tolist() == points.satellites.tolist()


def test_sensors_have_their_own_path(drive, tmp_path):
    path = tmp_path / "a.csv"
    run("export", drive, "--to", path, "--sensor", "left_camera")
    vehicle, _ = stored_points(load_campaign(drive))
    camera, _ = stored_points(load_campaign(drive), "left_camera")
    apart = np.linalg.norm((camera.geodetic - vehicle.geodetic)[:, :2] * 111e3, axis=1)
    assert 0.5 < np.median(apart) < 4.0
    said = run("export", drive, "--to", path, "--sensor", "radar", status=2)
    assert "there are sensors: left_camera, left_scanner, right_scanner" in said


def test_poses_that_leap_say_so(drive, tmp_path):
    folder = tmp_path / "leaping"
    shutil.copytree(drive, folder)
    path = folder / "results" / "poses_rtk.csv"
    lines = path.read_text().splitlines()
    lines[7] = lines[7].replace("RTK fixed", '"RTK fixed, leaps"')
    path.write_text("\n".join(lines) + "\n")
    for form in ("geojson", "gpx", "kml", "csv"):
        run("export", folder, "--to", tmp_path / f"a.{form}")
        assert (tmp_path / f"a.{form}").read_text().count("leaps") == 1
    points, _ = stored_points(load_campaign(folder))
    assert [row for row, remark in enumerate(points.remarks) if remark] == [6]
    assert set(points.kinds) == {"RTK fixed"}


def test_results_that_are_out_of_date_are_told(roof, tmp_path):
    folder = tmp_path / "old"
    shutil.copytree(roof, folder)
    with (folder / "roof.nmea").open("a") as log:
        log.write("\n")
    assert "out of date: changed after the step 'rtk'" in run(
        "export", folder, "--to", tmp_path / "a.kml"
    )


def test_what_cannot_be_exported_is_said(roof, drive, tmp_path):
    assert ".geojson, .gpx, .kml, .csv only" in run("export", roof, "--to", "a.shp", status=2)
    said = run("export", roof, "--to", tmp_path / "a.kml", "--only", "DGPS", status=2)
    assert "no point of the kind DGPS; there are: RTK fixed, RTK float" in said
    assert not (tmp_path / "a.kml").exists()
    folder = tmp_path / "new"
    shutil.copytree(drive, folder)
    (folder / "results" / "run.json").write_text("{}")
    assert "does not tell the local frame" in run("export", folder, "--to", "a.kml", status=2)
    shutil.rmtree(folder / "results")
    assert "run `gtval rtk" in run("export", folder, "--to", "a.kml", status=2)
