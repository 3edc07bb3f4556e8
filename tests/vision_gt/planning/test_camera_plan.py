"""What a plan of cameras predicts is what simulated robots, and rays by other means, show."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import GtvalError, InputError
from vision_gt.example_settings import PLAN_EXAMPLE
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera, project
from vision_gt.optics.transforms import perturbed, planar_pose, planar_transform
from vision_gt.optics.written_cameras import write_camera
from vision_gt.planning.floor import area_of, floor_grid, floor_seen, holes, inside_outline
from vision_gt.planning.inputs import load_plan
from vision_gt.planning.mounting import (
    MountedCamera,
    mounted,
    pinhole,
    planned_layout,
    tilt_for_depth,
)
from vision_gt.planning.plan import PlanInput, place_sigma, predict, rule_of, work_out
from vision_gt.planning.telling import plan_findings
from vision_gt.robot.robot_pose import Floor, Sighting, robot_pose
from vision_gt.settings import VisionSettings

LENS = np.array([1000.0, 1000.0, 639.5, 479.5, -0.2, 0.08, 0.0005, -0.0003, 0.0])
OUTLINE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]])
FLOOR = Floor(0.003, 0.005)
HELD = np.diag([0, 0, FLOOR.height**-2, FLOOR.tilt**-2, FLOOR.tilt**-2, 0])
RIGS = {
    "one marker that faces up": planned_layout(1, 0.3, 0.5, 0.0, 0.0),
    "four markers that lean": planned_layout(4, 0.156, 0.5, np.pi / 4, 0.2),
}


def mount(name, position, pan, tilt, camera=None):
    camera = camera or Camera(name, (1280, 960), LENS)
    T = mounted(camera, position, 2.3, np.deg2rad(pan), np.deg2rad(tilt))
    return MountedCamera(camera, T, float(np.deg2rad(tilt)))


def two_cameras():
    return mount("1", (-1.0, 1.5), 0.0, 42.0), mount("2", (5.0, 4.0), 190.0, 40.0)


def planned(rig, *, held=False):
    return PlanInput(two_cameras(), rig, OUTLINE, {}, 0.1, 8, HELD if held else None)


def by_opencv(points, one):
    """Pixels (n, 2) of points (n, 3), by OpenCV: another projection, another pose convention."""
    T = one.T_gtv_camera.inv()
    rotvec, t = T.rotation.as_rotvec(), T.translation
    points = np.ascontiguousarray(points)
    pixels, _ = cv2.projectPoints(points, rotvec, t, one.camera.matrix, one.camera.distortion)
    ahead = T.apply(points)[:, 2] > 0
    return np.where(ahead[:, None], pixels[:, 0], -1e9)


def simulated_errors(given, views, rng):
    """Errors (p, 3) of poses that the robot's own estimator finds in noisy corners; NaN: none."""
    c = len(given.mounts)
    network = Network(
        tuple(one.camera for one in given.mounts),
        type(given.mounts[0].T_gtv_camera).concatenate([m.T_gtv_camera for m in given.mounts]),
        np.zeros((15 * c, 15 * c)),
        given.mounts[0].T_gtv_camera,
        np.zeros((6, 6)),
        given.corner_sigma,
    )
    noise = np.broadcast_to(given.corner_sigma**2 * np.eye(2), (4, 2, 2))
    found = predict(given, views)
    errors = np.full((len(views), 3), np.nan)
    uneven = np.array([0, 0, FLOOR.height, FLOOR.tilt, FLOOR.tilt, 0])
    for p, pose in enumerate(views):
        # A robot that is held to the floor stands as unevenly as it is said to.
        off = uneven * rng.standard_normal(6) if given.floor is not None else np.zeros(6)
        T = perturbed(planar_transform(pose), off)
        best, least = None, np.inf
        for i, one in enumerate(given.mounts):
            sigma = place_sigma(found.single[i, p])
            if sigma < least:
                best, least = (i, one), sigma
        if best is None:
            continue
        i, one = best
        seen = []
        for m in np.flatnonzero(found.views[i].readable[p]):
            corners = by_opencv(T.apply(given.layout.corners_on_robot[m]), one)
            noisy = corners + given.corner_sigma * rng.standard_normal((4, 2))
            seen.append(MarkerView(int(m), noisy, noise))
        sighting = Sighting(one.camera.name, tuple(seen))
        held = given.floor is not None
        pose_found = robot_pose([sighting], network, given.layout, FLOOR, on_floor=held)
        if pose_found is not None and not pose_found.ambiguous:
            errors[p] = planar_pose(pose_found.T_gtv_robot) - pose
    errors[:, 2] = (errors[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return errors, found.best


def compared(rig, count, seed, *, held=False):
    """RMS of simulated errors over the predicted one, by component."""
    rng = np.random.default_rng(seed)
    given = planned(RIGS[rig], held=held)
    poses = rng.uniform([0, 0, -np.pi], [4, 6, np.pi], (count, 3))
    errors, covariances = simulated_errors(given, poses, rng)
    both = np.isfinite(errors[:, 0]) & np.isfinite(covariances[:, 0, 0])
    # A pose predicted as sure is found, but for those at the limit of two poses that look alike.
    assert both.sum() >= 0.95 * np.isfinite(covariances[:, 0, 0]).sum()
    predicted = np.sqrt(np.diagonal(covariances[both], axis1=1, axis2=2).mean(0))
    return np.sqrt((errors[both] ** 2).mean(0)) / predicted


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("held", [False, True])
def test_200_simulated_poses_err_by_what_was_predicted(rig, held):
    """Within 25 %; the mean of 150 squares of normal errors that differ in size has 15 %."""
    ratio = compared(rig, 200, 5, held=held)
    assert np.abs(ratio - 1).max() < 0.25, ratio


@pytest.mark.full
@pytest.mark.parametrize("rig", RIGS)
def test_3000_simulated_poses_err_by_what_was_predicted(rig):
    """Linear prediction: 4 % of chance, and the rest for what is not linear about far markers."""
    ratio = compared(rig, 3000, 6)
    assert np.abs(ratio - 1).max() < 0.10, ratio


def test_shares_of_the_floor_are_those_of_points_thrown_at_it():
    """100,000 random points by OpenCV's projection: 0.2 % of chance; asked for are 2 %."""
    rng = np.random.default_rng(1)
    given = planned(RIGS["one marker that faces up"])
    plan = work_out(given)
    thrown = np.column_stack([rng.uniform([0, 0], [4, 6], (100_000, 2)), np.zeros(100_000)])
    seen = []
    for one in given.mounts:
        pixels = by_opencv(thrown, one)
        inside = (pixels > -0.5).all(1) & (pixels < np.array([1279.5, 959.5])).all(1)
        # No lens bends a ray to beyond 60 degrees back into the image.
        T = one.T_gtv_camera.inv().apply(thrown)
        seen.append(inside & (np.linalg.norm(T[:, :2], axis=1) < 1.73 * T[:, 2]))
    count = np.sum(seen, axis=0)
    assert plan.share(1) == pytest.approx((count >= 1).mean(), abs=0.01)
    assert plan.share(2) == pytest.approx((count >= 2).mean(), abs=0.01)
    assert plan.footprint(0) == pytest.approx(24 * seen[0].mean(), abs=0.01 * 24)


def test_a_camera_that_looks_straight_down_sees_a_rectangle():
    camera = pinhole("1", (1000, 600), np.deg2rad(60))
    one = MountedCamera(camera, mounted(camera, (0, 0), 3.0, 0.0, np.pi / 2), np.pi / 2)
    grid = floor_grid(np.array([[-5.0, -5], [5, -5], [5, 5], [-5, 5]]))
    share = floor_seen(grid.points, [one])[0].mean()
    across = 2 * 3.0 * np.tan(np.deg2rad(30))
    assert share * 100 == pytest.approx(across * across * 0.6, rel=0.01)


def test_the_image_is_upright_and_its_middle_looks_where_pan_and_tilt_say():
    """Also of a lens whose axis is not in the middle of the image."""
    lens = Camera("1", (1280, 960), np.array([900, 900, 639.5, 430.0, 0, 0, 0, 0, 0]))
    for camera in (lens, pinhole("2", (1280, 960), 1.0)):
        T = mounted(camera, (1.0, 2.0), 2.0, np.pi / 2, np.pi / 4)
        middle, higher, right = (
            project(T.inv().apply(np.array(p)), camera.parameters)
            for p in ([1.0, 4.0, 0.0], [1.0, 4.0, 0.1], [1.1, 4.0, 0.0])
        )
        assert middle == pytest.approx([639.5, 479.5], abs=1e-6)
        assert higher[1] < middle[1]
        assert right[0] > middle[0]


def test_a_depth_is_seen_from_its_near_to_its_far_end():
    tilt, field = tilt_for_depth(2.3, (2.0, 5.0))
    f = 0.5 * 960 / np.tan(field / 2)
    camera = Camera("1", (1280, 960), np.array([f, f, 639.5, 479.5, 0, 0, 0, 0, 0]))
    T = mounted(camera, (0, 0), 2.3, 0.0, tilt)
    far, near = (project(T.inv().apply(np.array([x, 0, 0])), camera.parameters) for x in (5, 2))
    assert far[1] == pytest.approx(-0.5, abs=1e-6)
    assert near[1] == pytest.approx(959.5, abs=1e-6)


def test_holes_are_named_by_place_and_area():
    grid = floor_grid(OUTLINE)
    covered = ~((grid.points[:, 0] < 1) & (grid.points[:, 1] < 2))
    covered &= ~((grid.points > [3, 5.5]).all(1))
    found = holes(grid, covered)
    assert [one.area for one in found] == pytest.approx([2.0, 0.5], abs=0.05)  # half a cell around
    assert found[0].middle == pytest.approx([0.5, 1.0], abs=0.05)


def test_an_outline_with_a_notch_is_no_rectangle():
    notched = np.array([[0, 0], [4, 0], [4, 4], [2, 4], [2, 2], [0, 2]], dtype=float)
    assert area_of(notched) == 12
    points = np.array([[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [5.0, 1.0]])
    assert inside_outline(points, notched).tolist() == [True, False, True, False]


def test_the_rule_says_sides_that_keep_what_they_promise():
    """A marker of the side for 10 mm is good to 10 mm, one a step smaller is not."""
    given = planned(RIGS["one marker that faces up"])
    camera = given.mounts[0].camera
    row = rule_of(camera, 2.3, given)[1]
    ends = []
    for side in (row.wanted_side, row.wanted_side * 0.9):
        layout = planned_layout(1, side, 0.5, 0.0, 0.0)
        ends.append(rule_of(camera, 2.3, replace(given, layout=layout))[1].sigma)
    assert ends[0] <= 0.01 < ends[1]
    assert row.side_pixels * row.readable_side / 0.3 == pytest.approx(8 * 1.6, rel=0.09)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "plan"\n\n' + PLAN_EXAMPLE)
    return tmp_path


def asked(folder, *options):
    done = CliRunner().invoke(main, ["vision", "plan", str(folder), *map(str, options)])
    return done.exit_code, done.output


def test_the_example_is_worked_out_with_a_picture(folder):
    status, said = asked(folder, "--figure", folder / "plan.png")
    assert status == 0, said
    assert "Side of a marker by its distance, camera 1" in said
    assert (folder / "plan.png").stat().st_size > 10_000
    status, said = asked(folder, "--json")
    told = json.loads(said)
    assert told["floor_seen"]["one"] > told["floor_seen"]["two"] == 0
    assert "plan_holes" in {one["code"] for one in told["findings"]}


def test_stops_are_told_one_by_one_and_make_the_floor_where_none_is_stated(folder):
    toml = (folder / "campaign.toml").read_text().replace("floor = ", "# floor = ")
    (folder / "campaign.toml").write_text(toml)
    assert asked(folder)[0] == 2
    (folder / "survey").mkdir()
    stops = "pose,x,y,theta\n1,1.5,1.5,0.2\nfar,9,1.5,1\n"
    (folder / "survey" / "initial_guesses.csv").write_text(stops)
    loaded = load_campaign(folder)
    plan = work_out(load_plan(loaded, loaded.section("vision", VisionSettings)))
    assert plan.grid.outline.max(0) == pytest.approx([9.5, 2.0])
    assert plan.stops_seen.tolist() == [[True, False]]
    (blind,) = [one for one in plan_findings(plan) if one.code == "plan_stops"]
    assert "stop far" in blind.text
    assert "far" in asked(folder)[1]


def test_a_lens_of_a_file_replaces_the_field_of_view(folder):
    camera = Camera("any", (640, 480), np.array([500.0, 500, 320, 240, 0, 0, 0, 0, 0]))
    (folder / "lens.yaml").write_bytes(write_camera(".yaml", "opencv", camera))
    toml = (folder / "campaign.toml").read_text()
    (folder / "campaign.toml").write_text(toml + 'file = "lens.yaml"\n')
    loaded = load_campaign(folder)
    given = load_plan(loaded, loaded.section("vision", VisionSettings))
    assert given.mounts[0].camera.size == (640, 480)
    assert given.mounts[0].camera.name == "1"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("marker_side = 0.156", "", "marker_side"),
        ("resolution = [1280, 960]", "", "resolution"),
        ("depth = [1.0, 4.5]", "", "tilt_deg or depth"),
        ("depth = [1.0, 4.5]", "depth = [4.5, 1.0]", "near to far"),
        ("height = 2.3", "height = -2.3", "height"),
        ("floor = [[0.0, 0.0], [4.0, 0.0], ", "floor = [[0.0, 0.0], ", ""),
        ("floor = ", "stops = 'none.csv'\nfloor = ", "none.csv"),
        ("depth = [1.0, 4.5]", "depth = [4.5, 1.0]", "depth': '[4.5, 1.0]'"),
        ("marker_side", "file = 'nope.yaml'\nmarker_side", "field 'vision.plan.file': 'nope.yaml'"),
        ("pan_deg", "file = 'nope.yaml'\npan_deg", "'vision.plan.cameras.0.file': 'nope.yaml'"),
        (
            "[4.0, 6.0], [0.0, 6.0]]",
            "[0.0, 6.0], [4.0, 6.0]]",
            "cross, that from corner 2 to 3",
        ),
        ("[4.0, 6.0], [0.0, 6.0]]", "[0.0, 6.0], [4.0, 6.0]]", ", field 'vision.plan.floor': '[["),
        ("[4.0, 6.0], [0.0, 6.0]]", "[2.0, 0.0]]", "do not lie on one line"),
        ("[[vision.plan.cameras]]", "[[vision.plan.camera]]", "cameras"),
    ],
)
def test_what_is_missing_or_wrong_is_named(folder, old, new, said):
    text = (folder / "campaign.toml").read_text()
    assert old in text
    (folder / "campaign.toml").write_text(text.replace(old, new))
    status, told = asked(folder)
    assert said in told
    assert status == (2 if said else 0)


def test_two_cameras_of_one_name_are_refused(folder):
    text = (folder / "campaign.toml").read_text()
    second = text[text.index("[[vision.plan.cameras]]") :]
    (folder / "campaign.toml").write_text(text + "\n" + second)
    loaded = load_campaign(folder)
    with pytest.raises(InputError, match=r"line 18, field .*cameras.1.name.: .1. — camera 1"):
        load_plan(loaded, loaded.section("vision", VisionSettings))


def test_a_campaign_without_a_plan_is_told_how_to_write_one(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "none"\n')
    loaded = load_campaign(tmp_path)
    with pytest.raises(GtvalError, match=r"\[\[vision.plan.cameras\]\]"):
        load_plan(loaded, loaded.section("vision", VisionSettings))


def test_a_plan_alone_is_a_chapter_of_the_report(folder):
    """Before there are images `gtval run` tells the plan, with its numbers in run.json."""
    done = CliRunner().invoke(main, ["run", str(folder), "--json"])
    assert done.exit_code == 0, done.output
    assert "Vision: plan of the cameras" in (folder / "report" / "report.html").read_text()
    record = json.loads((folder / "results" / "run.json").read_text())
    assert record["systems"]["vision"]["plan"]["floor_seen"]["one"] > 0.5
