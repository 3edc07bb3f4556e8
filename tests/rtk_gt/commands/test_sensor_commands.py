"""Commands for the sensors on a vehicle, on files as people have them."""

import json
import tomllib

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats
from trials.drives import placement_error

from data_samples.drives.drive import (
    LEFT_CAMERA,
    LEFT_SCANNER,
    START,
    DriveSettings,
    scan_along,
    simulate_drive,
)
from data_samples.drives.files import SCANNERS, nmea_text, write_drive
from rtk_gt.path.orientation import pose_of, transform_of
from rtk_gt.sensors.scanner_calibration import calibrate_scanners
from rtk_gt.sensors.sensor_files import (
    read_images,
    read_imu,
    read_line_scans,
    read_seen_points,
    read_times,
)
from validation.cli import main
from validation.errors import InputError
from validation.poses.pose_table import SPATIAL, from_csv


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    made = simulate_drive(4, DriveSettings(loops=2, straight=50.0, shadow=0.0))
    write_drive(folder, made)
    return folder, made


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def scan_file(folder, made, every=0.4, beams=61):
    scans = scan_along(made, LEFT_SCANNER, np.random.default_rng(0), every=every, beams=beams)
    step = scans.angles[1] - scans.angles[0]
    rows = [
        f"{time},{scans.angles[0]},{step},{' '.join(f'{r:.3f}' for r in ranges)}"
        for time, ranges in zip(scans.times, scans.ranges, strict=True)
    ]
    path = folder / "scans.csv"
    path.write_text("time,first_angle,angle_step,ranges\n" + "\n".join(rows) + "\n")
    return path


def test_a_cloud_is_written_along_the_path(drive, tmp_path):
    folder, made = drive
    out = tmp_path / "cloud.ply"
    done = run("rtk", "cloud", folder, "left_scanner", scan_file(folder, made), out)
    assert done.exit_code == 0, done.output
    assert out.read_bytes().startswith(b"ply\n")


def test_a_cloud_takes_the_colours_of_images(drive, tmp_path):
    import cv2

    folder, made = drive
    cv2.imwrite(str(tmp_path / "red.png"), np.full((96, 128, 3), (0, 0, 255), np.uint8))
    images = tmp_path / "images.csv"
    images.write_text("time,file\n" + "".join(f"{START + t},red.png\n" for t in range(5, 60, 5)))
    out = tmp_path / "cloud.ply"
    scans = scan_file(folder, made)
    lens = ["--lens", 80, 80, 63.5, 47.5, 0, 0, 0, 0]
    colour = ["--images", images, "--camera", "left_camera", *lens]
    done = run("rtk", "cloud", folder, "left_scanner", scans, out, *colour)
    assert done.exit_code == 0, done.output
    body = out.read_bytes().split(b"end_header\n", 1)[1]
    colours = np.frombuffer(body, dtype=[("p", "<f4", 3), ("c", "u1", 3)])["c"]
    assert {tuple(colour) for colour in colours.tolist()} == {(255, 0, 0), (128, 128, 128)}
    assert run("rtk", "cloud", folder, "left_scanner", scans, out, *lens).exit_code == 2
    images.write_text("time,file\n1,nowhere.png\n")
    missing = run("rtk", "cloud", folder, "left_scanner", scans, out, *colour)
    assert "no such file" in missing.output


def test_a_cloud_takes_the_right_colours_of_a_drives_own_images(tmp_path):
    """Each point's true colour is known; a camera turned by ten degrees gives other ones."""
    made = simulate_drive(12, DriveSettings(loops=1, straight=50.0, shadow=0.0, route="eight"))
    folder = tmp_path / "drive"
    scans = scan_along(made, LEFT_SCANNER, np.random.default_rng(0), every=0.4, beams=61)
    write_drive(folder, made, {"left_scanner": scans}, images=True)
    toml = (folder / "campaign.toml").read_text()
    lens = (folder / "sensors" / "left_camera_lens.txt").read_text().split()
    share = {}
    for turn in (0.0, np.radians(10.0)):
        moved = toml.split('name = "left_camera"')[0] + 'name = "left_camera"\npose = '
        pose = (LEFT_CAMERA + np.array([0, 0, 0, turn, 0, 0])).tolist()
        # Both sensors where they are; where the hand puts the scanner is another question.
        where = f"{LEFT_SCANNER.tolist()}\n"
        moved += f'{pose}\n[[rtk.sensors]]\nname = "left_scanner"\npose = {where}'
        (folder / "campaign.toml").write_text(moved)
        out = tmp_path / "cloud.ply"
        images = folder / "sensors" / "left_camera_images.csv"
        done = run(
            *("rtk", "cloud", folder, "left_scanner", folder / "scans" / "left_scanner.csv", out),
            *("--images", images, "--camera", "left_camera", "--lens", *lens),
        )
        assert done.exit_code == 0, done.output
        body = out.read_bytes().split(b"end_header\n", 1)[1]
        cloud = np.frombuffer(body, dtype=[("p", "<f4", 3), ("c", "u1", 3)])
        seen = (cloud["c"] != 128).any(1)
        assert seen.mean() > 0.3
        true = np.round(255 * made.campus.colours(cloud["p"][seen].astype(float)))
        share[turn] = (np.abs(true - cloud["c"][seen]) <= 1).all(1).mean()
    # The path's noise of half a degree is 10 to 20 cm of a wall, whose bands are 2 m high; both
    # the point and its colour are off by that near the borders of a band.
    assert share[0.0] > 0.8
    assert share[np.radians(10.0)] < share[0.0] - 0.15


def test_images_that_cannot_be_used(drive, tmp_path):
    import cv2

    folder, made = drive
    scans = scan_file(folder, made)
    images = tmp_path / "images.csv"
    lens = ["--lens", 80, 80, 63.5, 47.5, 0, 0, 0, 0]
    rest = [tmp_path / "cloud.ply", "--images", images, "--camera", "left_camera", *lens]
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((96, 128, 3), np.uint8))
    cv2.imwrite(str(tmp_path / "b.png"), np.zeros((48, 64, 3), np.uint8))
    (tmp_path / "c.png").write_text("no image")
    for second, file, words in (
        (7, "b.png", "64 x 48 pixels; expected 128 x 96"),
        (7, "c.png", "no image that can be read"),
        (7e6, "a.png", ""),
    ):
        images.write_text(f"time,file\n{START + 5},a.png\n{START + second},{file}\n")
        done = run("rtk", "cloud", folder, "left_scanner", scans, *rest)
        assert done.exit_code == (2 if words else 0)
        assert words in " ".join(done.output.split())
    images.write_text("time,file\n5,a.png\n")
    done = run("rtk", "cloud", folder, "left_scanner", scans, *rest)
    assert done.exit_code == 2
    assert "images.csv: none of its times, 5.000 to 5.000," in " ".join(done.output.split())


def test_a_sensors_path_with_added_angles_says_so(drive, tmp_path):
    folder, made = drive
    times = tmp_path / "times.csv"
    times.write_text("time\n" + "".join(f"{START + t}\n" for t in range(5, 40)))
    files = [tmp_path / "composed.csv", tmp_path / "added.csv"]
    for file, option in zip(files, ([], ["--additive-angles"]), strict=True):
        done = run("rtk", "sensor-path", folder, "left_camera", times, "-o", file, *option)
        assert done.exit_code == 0, done.output
    composed, added = (from_csv(file, "camera", SPATIAL) for file in files)
    assert "angles added" in files[1].read_text()
    assert "angles added" not in files[0].read_text()
    at = np.array([float(one) for one in composed.ids])
    true = pose_of(made.T_local_vehicle(at) * transform_of(np.tile(LEFT_CAMERA, (len(at), 1))))
    off = [
        (transform_of(table.poses).rotation * transform_of(true).rotation.inv()).magnitude()
        for table in (composed, added)
    ]
    # On slopes of ten degrees added angles are several degrees off; the path's noise is one.
    assert np.median(off[0]) < np.radians(2)
    assert off[1].max() > np.radians(5)
    np.testing.assert_allclose(added.poses[:, :3], composed.poses[:, :3], atol=1e-9)


def test_the_reference_covariance_is_the_same_by_both_ways(drive):
    folder, _ = drive
    options = ["--samples", 200_000, "--seed", 3]
    done = run("rtk", "reference-covariance", folder, *options, "--json")
    found = json.loads(done.output)
    first, simulated = (np.diagonal(found[way]) for way in ("first_order", "simulated"))
    # Five standard deviations of chance, and half a percent of second order.
    np.testing.assert_allclose(simulated, first, rtol=5 * np.sqrt(2 / 200_000) + 0.005)
    assert "200,000 samples" in run("rtk", "reference-covariance", folder, *options).output


@pytest.mark.parametrize(
    ("command", "text", "options", "words"),
    [
        ("camera", "time,x,y,z,u,v\n{0},1,2,3,4,5\n", ["--lens", *"00000000"], "above 0"),
        ("camera", "time,x,y,z,u,v\n{0},1,2,3,4,5\n", ["--lens", "nan", *"1234567"], "nan"),
        ("dgps", "time,latitude,longitude,height\n", ["--antenna", "0", "0", "nan"], "nan"),
        ("scanner", "time,first_angle,angle_step,ranges\n", ["--hand-sigma", "0"], "range"),
        ("imu", "time,yaw,pitch,roll\n1,0,0,0\n2,0,0,0\n", [], "same drive and clock"),
        ("sensor-path", "time\n5\n", [], "same drive and clock"),
        ("cloud", "time,first_angle,angle_step,ranges\n{0},0,1,nan 40\n", [], "no cloud to write"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_sentence(
    drive, tmp_path, command, text, options, words
):
    file = tmp_path / "input.csv"
    file.write_text(text.format(START + 20))
    names = {"camera": ["left_camera"], "scanner": ["left_scanner"], "cloud": ["left_scanner"]}
    sensor = names.get(command, ["left_camera"] if command == "sensor-path" else [])
    out = [tmp_path / "cloud.ply"] if command == "cloud" else []
    done = run("rtk", command, drive[0], *sensor, file, *out, *options)
    assert done.exit_code == 2, done.output
    assert words in " ".join(done.output.split())
    assert list(tmp_path.iterdir()) == [file]


def test_a_scanner_is_calibrated(drive, tmp_path):
    folder, made = drive
    path = scan_file(folder, made)
    picture = tmp_path / "heights.png"
    known = ["--ground", "-2.2", "--histogram"]
    assert run("rtk", "scanner", folder, "left_scanner", path, *known, "a.doc").exit_code == 2
    done = run("rtk", "scanner", folder, "left_scanner", path, *known, picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert done.exit_code == 0, done.output
    assert "measured by hand" in done.output
    # Two round trips on a road are no calibration drive, and it says so.
    assert "Not determined to 1 cm and 0.1 degrees" in " ".join(done.output.split())
    assert run("rtk", "scanner", folder, "nothing", path).exit_code == 2


def test_two_scanners_are_calibrated_together(tmp_path, monkeypatch):
    # Numbers and words are of one adjustment, which takes seconds.
    kept = []

    def once(*arguments, **options):
        if not kept:
            kept.append(calibrate_scanners(*arguments, **options))
        return kept[0]

    monkeypatch.setattr("rtk_gt.sensors.scanner_calibration.calibrate_scanners", once)
    made = simulate_drive(2, DriveSettings(route="eight", straight=60.0, loops=2, shadow=0.0))
    scans = {
        name: scan_along(made, pose, np.random.default_rng(row), every=0.3, beams=61)
        for row, (name, pose) in enumerate(SCANNERS.items())
    }
    write_drive(tmp_path, made, scans)
    files = {name: tmp_path / "scans" / f"{name}.csv" for name in scans}
    left, right = files.items()
    done = run("rtk", "scanner", tmp_path, *left, "--also", *right, "--ground", "-2.2", "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    for name, truth in SCANNERS.items():
        error = placement_error(np.array(found[name]["pose"]), truth)
        assert error @ np.linalg.solve(found[name]["covariance"], error) < stats.chi2(6).ppf(0.9999)
    done = run("rtk", "scanner", tmp_path, *left, "--also", *right, "--ground", "-2.2")
    for words in (*(f"Scanner {name}" for name in scans), "under the [[rtk.sensors]] named right"):
        assert words in " ".join(done.output.split())
    done = run("rtk", "scanner", tmp_path, *left, "--also", *left)
    assert done.exit_code == 2
    assert "named twice" in done.output


def test_a_camera_is_calibrated(drive, tmp_path):
    folder, made = drive
    generator = np.random.default_rng(0)
    rows = []
    for second in range(5, 60, 5):
        own = generator.uniform([-3, -2, 6], [3, 2, 20], (6, 3))
        time = START + second
        T = made.T_local_vehicle(np.array([time])) * transform_of(LEFT_CAMERA[None])
        pixels = own[:, :2] / own[:, 2:] * 900 + [500, 380]
        for place, pixel in zip(T.apply(own), pixels, strict=True):
            rows.append(",".join(repr(float(value)) for value in (time, *place, *pixel)))
    points = tmp_path / "points.csv"
    points.write_text("time,x,y,z,u,v\n" + "\n".join(rows) + "\n")
    lens = ["--lens", 900, 900, 500, 380, 0, 0, 0, 0]
    done = run("rtk", "camera", folder, "left_camera", points, *lens, "--json")
    found = json.loads(done.output)
    error = np.array(found["pose"]) - LEFT_CAMERA
    assert error @ np.linalg.solve(np.array(found["covariance"]), error) < stats.chi2(6).ppf(0.9999)
    said = run("rtk", "camera", folder, "left_camera", points, *lens).output
    assert "which hold the noise of the path" in " ".join(said.split())
    # What it says can stand in campaign.toml as it is.
    lines = tomllib.loads(said.split("(metres, radians):\n")[1])
    np.testing.assert_allclose(lines["pose"], found["pose"], atol=1e-6)
    sigmas = np.sqrt(np.diagonal(found["covariance"]))
    np.testing.assert_allclose(lines["sigmas"], sigmas, atol=1e-6)


def test_all_that_a_drive_writes_can_be_used(tmp_path):
    """The camera that a drive's own files give is right within what is said of it."""
    folder = tmp_path / "drive"
    assert run("simulate-drive", folder, "--seed", 11, "--sensors").exit_code == 0
    lens = (folder / "sensors" / "left_camera_lens.txt").read_text().split()
    points = folder / "sensors" / "left_camera_points.csv"
    done = run("rtk", "camera", folder, "left_camera", points, "--lens", *lens, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    error = np.array(found["pose"]) - LEFT_CAMERA
    assert error @ np.linalg.solve(np.array(found["covariance"]), error) < stats.chi2(6).ppf(0.9999)
    log = folder / "sensors" / "consumer.nmea"
    done = run("rtk", "dgps", folder, log, "--antenna", "-0.25", "0", "0.1", "--json")
    assert 0.7 < json.loads(done.output)["rmse_horizontal"] < 5
    # Its slow error takes a minute to change: two and a half of them tell no mean of it.
    said = run("rtk", "dgps", folder, log, "--antenna", "-0.25", "0", "0.1").output
    assert "the true standard errors may be larger" in " ".join(said.split())
    done = run("rtk", "imu", folder, folder / "sensors" / "imu.csv", "--json")
    yaw = json.loads(done.output)["angles"][0]
    assert abs(yaw["drift"] - np.radians(0.02)) < 4 * yaw["drift_sigma"]


def test_another_receiver_and_an_imu_are_compared(drive, tmp_path):
    folder, made = drive
    log = tmp_path / "dgps.nmea"
    log.write_text(nmea_text(made.records[0]))
    done = run("rtk", "dgps", folder, log, "--antenna", "0", "0", "0.132", "--json")
    assert json.loads(done.output)["rmse_horizontal"] < 0.02
    times = START + np.arange(0.0, made.duration - 1, 0.1)
    angles = made.poses(times)[:, 3:]
    rows = [
        ",".join(map(str, [t, *a])) for t, a in zip(times.tolist(), angles.tolist(), strict=True)
    ]
    imu = tmp_path / "imu.csv"
    imu.write_text("time,yaw,pitch,roll\n" + "\n".join(rows) + "\n")
    picture = tmp_path / "rates.svg"
    done = run("rtk", "imu", folder, imu, "--figure", picture)
    assert done.exit_code == 0, done.output
    assert "<svg" in picture.read_text()
    assert run("rtk", "imu", folder, imu, "--figure", "rates.doc").exit_code == 2
    assert "yaw" in done.output


@pytest.mark.parametrize(
    ("reader", "text", "words"),
    [
        (
            read_line_scans,
            "time,first_angle,angle_step,ranges\n1,0,0.1,1 2\n2,0,0.1,1\n",
            "1 ranges",
        ),
        (read_line_scans, "time,first_angle,angle_step,ranges\n1,0,0.1,one\n", "not numbers"),
        (
            read_line_scans,
            "time,first_angle,angle_step,ranges\n1,0,0.1,1\n1,0,0.1,1\n",
            "not later",
        ),
        (read_line_scans, "time,first_angle,angle_step,ranges\n1,0,0.1,1\n2,1,0.1,1\n", "one scan"),
        (read_line_scans, "time,first_angle,angle_step,ranges\n", "no rows"),
        (read_line_scans, "time,first_angle,angle_step,ranges\n1,0,0,1,1,2\n", "6 cells"),
        (read_line_scans, "time,first_angle,angle_step,ranges\n1,0,0.1,-1 2\n", "negative"),
        (read_times, "time\n", "no times"),
        (read_times, "time\n1712739600000\n", "not milliseconds"),
        (read_images, "time,file\n", "no rows"),
        (read_imu, "time,yaw,pitch,roll\nnoon,0,0,0\n", "not a time"),
        (read_imu, "time,yaw,pitch,roll\n1,0,0,0\n2,270,0,0\n", "not degrees"),
        (read_seen_points, "time,x,y,z,u,v\n1,0,0,0,left,3\n", "not a number"),
    ],
)
def test_bad_sensor_files(tmp_path, reader, text, words):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        reader(path)
