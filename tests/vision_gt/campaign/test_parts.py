"""What the images of a campaign allow is solved and kept, and what is missing is named."""

import csv
import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2
from vision_scenes import LENS, board_view, camera, random_marker

from data_samples.rooms.cameras import MARKER_FAMILY, looking
from validation.cli import main
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Bar
from vision_gt.network.single_board import board_in_camera
from vision_gt.network.solution import NetworkInput, solve_network
from vision_gt.optics.camera import inside_image, project
from vision_gt.optics.camera_files import read_cameras
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.robot.alone import marker_in_camera
from vision_gt.robot.marker_poses import marker_corners

SIDE = 0.16


def solved(campaign, status=0):
    done = CliRunner().invoke(main, ["vision", "solve", str(campaign), "--workers", "1", "--json"])
    assert done.exit_code == status, done.output
    return json.loads(done.stdout)


def without(campaign, *folders):
    for folder in folders:
        shutil.rmtree(campaign / "vision" / folder, ignore_errors=True)


def rows(campaign, name):
    return list(csv.DictReader((campaign / "results" / name).read_text().splitlines()))


def placed(row):
    translation = [float(row[name]) for name in ("x", "y", "z")]
    turn = Rotation.from_rotvec([float(row[name]) for name in ("rx", "ry", "rz")])
    return RigidTransform.from_components(translation, turn)


def test_calibration_images_alone_give_lenses_and_no_error(campaign):
    without(campaign, "poses", "network", "bar", "reference", "layout", "table", "survey_check",
            "displacement", "steadiness")  # fmt: skip
    facts = solved(campaign)
    assert set(facts["calibration_verdict"]) >= {"1", "2"}
    assert not [one for one in facts["findings"] if one["severity"] == "error"]
    (parts,) = [one["text"] for one in facts["findings"] if one["code"] == "parts"]
    assert "add images network/1-2-1" in parts
    for name in ("1", "2"):
        truth = read_cameras(campaign / "truth" / f"camera_{name}.yaml")[0].parameters
        found = read_cameras(campaign / "results" / f"vision_camera_{name}.yaml")[0]
        assert found.parameters[0] == pytest.approx(truth[0], abs=5 * found.sigmas[0])


def test_a_network_alone_is_in_the_frame_of_a_camera(campaign):
    without(campaign, "poses", "reference", "layout", "table", "survey_check", "displacement",
            "steadiness")  # fmt: skip
    facts = solved(campaign)
    assert facts["frame"].startswith("camera ")
    found = {row["camera"]: row for row in rows(campaign, "vision_cameras_relative.csv")}
    assert set(found) == {"1", "2"}
    truth = {
        row["camera"]: placed(row)
        for row in csv.DictReader(
            (campaign / "truth" / "vision_cameras.csv").read_text().splitlines()
        )
    }
    root = facts["frame"].removeprefix("camera ")
    (other,) = {"1", "2"} - {root}
    off = placed(found[other]).translation - (truth[root].inv() * truth[other]).translation
    sigmas = [float(found[other][f"sigma_{name}"]) for name in ("x", "y", "z")]
    assert np.abs(off / sigmas).max() < 6
    assert max(sigmas) < 0.005


def test_without_a_reference_the_robot_is_known_in_the_frame_of_a_camera(campaign):
    without(campaign, "reference", "table", "survey_check", "displacement", "steadiness")
    done = CliRunner().invoke(main, ["vision", "solve", str(campaign), "--workers", "1"])
    assert done.exit_code == 2
    assert "no image of the reference pattern" in done.output + done.stderr
    robot = [row for row in rows(campaign, "vision_image_poses.csv") if row["of"] == "robot"]
    by_stop = {}
    for row in robot:
        if row["ambiguous"] == "no":
            by_stop.setdefault(row["stop"], []).append(placed(row).translation)
    # Two cameras that see a stop agree in the frame of the network.
    spread = [np.ptp(some, axis=0).max() for some in by_stop.values() if len(some) > 1]
    assert spread
    assert max(spread) < 0.02


@pytest.mark.full
def test_without_a_walk_the_stops_tell_where_the_markers_are(campaign):
    without(campaign, "layout")
    facts = solved(campaign)
    assert len(facts["stops_with_pose"]) >= 5
    (told,) = [one for one in facts["findings"] if one["subject"] == "layout"]
    assert (told["severity"], told["code"]) == ("note", "part_missing")


def test_cameras_that_nothing_links_cost_their_own_stops_only(campaign):
    without(campaign, "network", "bar")
    facts = solved(campaign)
    (told,) = [one for one in facts["findings"] if one["code"] == "part_missing"]
    assert "No chain of views links camera" in told["text"]
    assert told["severity"] == "warning"
    assert len(facts["cameras"]) == 1
    assert facts["stops_with_pose"]


def test_a_single_board_that_two_cameras_see_at_once_links_them():
    """No bar: the same board in both images, also one that looks the same after half a turn."""
    rng = np.random.default_rng(8)
    ahead = looking(np.array([0.0, -2.2, 2.2]), np.zeros(3))
    beside = looking(np.array([0.8, -2.2, 2.2]), np.array([0.4, 0, 0]))
    for board in (Board(9, 6, 0.08), Board(10, 6, 0.08)):
        views = []
        while len(views) < 16:
            lean = Rotation.from_euler("ZYX", [*rng.uniform(-0.5, 0.5, 2), np.pi])
            place = [*rng.uniform(-0.3, 0.5, 2), rng.uniform(0, 0.6)]
            T = RigidTransform.from_components(place, lean)
            body = f"1-2-{len(views)}"
            pair = [
                board_view(where, name, board, T, body, 0, 0.1, rng)
                for name, where in (("1", ahead), ("2", beside))
            ]
            views += pair if None not in pair else []
        given = NetworkInput(
            (camera("1"), camera("2")), tuple(views), (), (), (),
            Bar(RigidTransform.identity(), np.zeros(6)), None,
        )  # fmt: skip
        network = solve_network(given).network
        step = network.T_gtv_camera[0].inv() * network.T_gtv_camera[1]
        true = ahead.inv() * beside
        other = int(np.argmax(np.abs(network.T_gtv_camera.translation).sum(1)))
        covariance = network.pose_covariance(network.names[other])[:3, :3]
        off = step.translation - true.translation
        if other == 0:
            off = step.inv().translation - true.inv().translation
        # One draw of three numbers: one in ten thousand.
        assert off @ np.linalg.solve(covariance, off) < chi2.ppf(1 - 1e-4, 3)
        assert np.linalg.norm(off) < 0.005


def test_a_photo_gives_the_poses_of_its_markers(rendered, outcome, tmp_path):
    """As the run has them, of the same image: the robot by its markers is one body."""
    key = next(key for key, one in outcome.detections.items() if len(one.views) > 2)
    photo = rendered / "vision" / "poses" / key[0] / f"pose{key[1]}.png"
    lens = rendered / "truth" / f"camera_{key[0]}.yaml"
    picture = tmp_path / "photo.jpg"
    arguments = ["pose", photo, "--intrinsics", lens, "--markers", MARKER_FAMILY.name]
    done = CliRunner().invoke(
        main, ["vision", *map(str, arguments), "--side", "0.156", "--json",
               "--picture", str(picture)],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    poses = json.loads(done.stdout)["poses"]
    assert picture.exists()
    layout = outcome.layout.layout
    seen = {}
    for one in poses:
        number = int(one["of"].split()[1])
        if number in layout.numbers and layout.sides[layout.index(number)] == 0.156:
            T = RigidTransform.from_components(
                one["translation"], Rotation.from_rotvec(one["rotation_vector"])
            )
            here = T * layout.T_robot_marker[layout.index(number)].inv()
            seen[number] = (here.translation, np.array(one["covariance"]), one["ambiguous"])
    sure = [t for t, _, ambiguous in seen.values() if not ambiguous]
    assert len(sure) >= 2
    # Single markers tilt by a degree, and the robot's origin is half a metre from them.
    assert np.ptp(sure, axis=0).max() < 0.05


def test_a_photo_without_what_is_sought_says_what_it_shows(rendered):
    photo = rendered / "vision" / "calibration" / "1" / "01.png"
    lens = rendered / "truth" / "camera_1.yaml"
    done = CliRunner().invoke(
        main, ["vision", "pose", str(photo), "--intrinsics", str(lens),
               "--markers", "APRILTAG_36H11", "--side", "0.1"],
    )  # fmt: skip
    assert done.exit_code == 2
    assert "no marker of APRILTAG_36H11 gives a pose" in done.output + done.stderr


def test_poses_of_single_markers_and_boards_are_as_good_as_stated():
    """NEES of 60 each: six degrees of freedom, bounds of chi-squared at one in ten thousand."""
    rng = np.random.default_rng(5)
    board = Board(9, 6, 0.08)
    squares = {"marker": [], "board": []}
    while min(map(len, squares.values())) < 60:
        T = random_marker(rng, 1.2)
        pixels = project(T.apply(marker_corners(SIDE)), LENS)
        # x right, y up, z towards the viewer: a marker that faces the camera is turned about x.
        facing = T * RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
        pixels = project(facing.apply(marker_corners(SIDE)), LENS)
        noisy = pixels + 0.1 * rng.standard_normal(pixels.shape)
        view = MarkerView(7, noisy, np.broadcast_to(0.01 * np.eye(2), (4, 2, 2)))
        pose = marker_in_camera(camera(), view, SIDE)
        if pose is not None and not pose.ambiguous:
            squares["marker"].append(nees(pose.T_gtv_robot, facing, pose.covariance))
        corners = project(T.apply(board.corners), LENS)
        if inside_image(corners, camera().size, 5).all():
            noisy = corners + 0.1 * rng.standard_normal(corners.shape)
            found = board_in_camera(
                BoardView("1", "b", 0, board, np.arange(len(noisy)), noisy, "b",
                          np.full(len(noisy), 0.1)),
                camera(),
            )  # fmt: skip
            squares["board"].append(nees(found.T_camera_board, T, found.covariance))
    for some in squares.values():
        count = 6 * len(some)
        assert chi2.ppf(1e-4, count) < sum(some) < chi2.ppf(1 - 1e-4, count)


def nees(found, true, covariance):
    off = np.concatenate(
        [
            found.translation - true.translation,
            (found.rotation * true.rotation.inv()).as_rotvec(),
        ]
    )
    return float(off @ np.linalg.solve(covariance, off))
