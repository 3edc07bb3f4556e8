"""Commands for the sensors on a vehicle, on files as people have them."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from data_samples.drive_files import nmea_text, write_drive
from data_samples.drives import (
    LEFT_CAMERA,
    LEFT_SCANNER,
    START,
    DriveSettings,
    scan_along,
    simulate_drive,
)
from rtk_gt.orientation import transform_of
from rtk_gt.sensor_files import read_imu, read_line_scans, read_seen_points
from validation.cli import main
from validation.errors import InputError


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
    done = run("rtk", "imu", folder, folder / "sensors" / "imu.csv", "--json")
    yaw = json.loads(done.output)[0]
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
    done = run("rtk", "imu", folder, imu)
    assert done.exit_code == 0, done.output
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
        (read_imu, "time,yaw,pitch,roll\nnoon,0,0,0\n", "not a time"),
        (read_seen_points, "time,x,y,z,u,v\n1,0,0,0,left,3\n", "not a number"),
    ],
)
def test_bad_sensor_files(tmp_path, reader, text, words):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        reader(path)
