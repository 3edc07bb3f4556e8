"""What is wrong with a campaign of images is named, with its size; and nothing is invented."""

from dataclasses import replace

import numpy as np
import pytest
import spoilt_images as spoilt
from scipy.spatial.transform import RigidTransform, Rotation

from validation.statistics.hypotheses import ranked
from vision_gt.campaign.findings import vision_findings
from vision_gt.campaign.solve import _diagnosis
from vision_gt.causes import diagnosis as causes
from vision_gt.causes.diagnosis import diagnose
from vision_gt.causes.evidence import BAR, CALIBRATION, REFERENCE_BOARD, evidence_of
from vision_gt.causes.reference import reference_turn
from vision_gt.causes.surveyed import Surveyed
from vision_gt.causes.telling import cause_finding, noise_finding, said_of
from vision_gt.causes.trial import Noise, with_own_noise
from vision_gt.least_squares.setups import camera_slots
from vision_gt.optics.lenses import fisheye_parameters
from vision_gt.optics.transforms import planar_pose, planar_transform
from vision_gt.patterns.boards import Board


@pytest.fixture(scope="session")
def good(outcome):
    """What was seen in a good campaign of two cameras."""
    return outcome.diagnosis.seen


def test_nothing_is_wrong_with_a_good_campaign(outcome):
    assert outcome.diagnosis.cause is None
    assert noise_finding(outcome.diagnosis) is None


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda s: spoilt.boards_printed(s, {BAR}, -0.03), "bar_scale"),
        (lambda s: spoilt.boards_printed(s, {REFERENCE_BOARD}, -0.03), "reference_scale"),
        (lambda s: spoilt.boards_printed(s, {BAR, REFERENCE_BOARD}, -0.03), "board_scale"),
        (lambda s: spoilt.markers_printed(s, -0.03), "marker_scale"),
        (lambda s: spoilt.markers_printed(s, 0.05, 14), "marker_side"),
        (lambda s: spoilt.lens_from_file(s, "1", 0.02), "focal_length"),
    ],
)
def test_a_length_that_was_stated_wrongly_is_named_with_its_size(good, spoil, kind):
    share = {"marker_side": 0.05, "focal_length": -0.02 / 1.02}.get(kind, -0.03)
    diagnosis = diagnose(spoil(good))
    cause = diagnosis.cause
    assert cause is not None
    assert cause.effect.kind == kind
    # One of 16,000 is beyond four. Lenses that are taken as exact are estimates of the campaign.
    lens = good.cameras[good.names.index("1")]
    own = lens.sigmas[0] / lens.parameters[0] if kind == "focal_length" else 0.0
    assert abs(cause.size[0] - share) < 4 * np.hypot(cause.sigma[0], own)
    found = cause_finding(diagnosis)
    assert f"{100 * abs(share):.0f}" in f"{100 * abs(cause.size[0]):.0f}"
    assert found.sizes[0].low < found.sizes[0].value < found.sizes[0].high


def test_prints_of_97_per_cent_end_in_an_error_that_says_3_per_cent(good):
    share = -0.03
    for spoil, words in (
        (lambda s: spoilt.boards_printed(s, {BAR}, share), "the bar's boards are 3.0"),
        (lambda s: spoilt.boards_printed(s, {REFERENCE_BOARD}, share), "reference pattern are 3.0"),
        (lambda s: spoilt.markers_printed(s, share), "all markers are 3.0"),
    ):
        found = cause_finding(diagnose(spoil(good)))
        assert (found.severity, found.code) == ("error", "print_size")
        assert words in found.text or words.replace("3.0", "2.9") in found.text


def test_one_mistake_is_one_error(outcome, good):
    diagnosis = diagnose(spoilt.markers_printed(good, -0.03))
    found = vision_findings(replace(outcome, diagnosis=diagnosis))
    errors = [one for one in found if one.severity == "error"]
    assert [one.code for one in errors] == ["print_size"]
    assert sum(one.code in {"poor_fit", "off_floor"} for one in found) == 0


def test_a_bar_that_is_off_by_45_mm_is_named(good):
    off = np.array([0.030, 0.030, -0.015])
    cause = diagnose(spoilt.bar_built(good, off)).cause
    assert cause is not None
    assert cause.effect.kind == "bar"
    # The bar of the synthetic room is built 2 mm off, too.
    assert (np.abs(cause.size[:3] + off) < 0.002 + 4 * cause.sigma[:3]).all()


def test_a_camera_that_was_knocked_is_named_with_the_stop(good):
    stops = [s for s, seen in good.stops.items() if any(o.camera == "1" for o in seen)]
    since = stops[len(stops) // 2]
    turn = np.array([0.004, -0.004, 0.002])
    diagnosis = diagnose(spoilt.camera_turned(good, "1", since, turn))
    cause = diagnosis.cause
    assert cause is not None
    assert (cause.effect.kind, cause.effect.subject, cause.effect.since) == (
        "camera_moved",
        "1",
        since,
    )
    assert f"and stop {since}" in cause_finding(diagnosis).text
    # Turns of the rays are turns of the camera the other way, whatever its axes.
    assert abs(np.linalg.norm(cause.size[3:]) - 0.006) < 4 * np.linalg.norm(cause.sigma[3:])


def test_stops_between_which_nothing_tells_when_a_camera_was_knocked_are_all_named(good):
    """Turned about the vertical, at stops that no other camera sees: the robot may stand so."""
    only = [s for s, seen in good.stops.items() if {o.camera for o in seen} == {"1"}]
    order = [s for s, seen in good.stops.items() if any(o.camera == "1" for o in seen)]
    upright = good.T_gtv_camera[good.names.index("1")].rotation.inv().apply([0.0, 0.0, 0.006])
    seen = spoilt.camera_turned(good, "1", only[1], upright)
    diagnosis = diagnose(replace(seen, surveyed=Surveyed()))
    assert {one.kind for one in diagnosis.alike} == {"camera_moved"}
    assert {one.since for one in diagnosis.alike} >= set(only)
    before = order[order.index(only[0]) - 1]
    assert f"between stop {before} and stop {only[-1]}." in cause_finding(diagnosis).text
    # A survey of the stops tells.
    assert {one.since for one in diagnose(seen).alike} == {only[1]}


def test_a_marker_that_slipped_is_named_with_the_stop(good):
    counts = {}
    for seen in good.stops.values():
        for number in {v.number for s in seen for v in s.views}:
            counts[number] = counts.get(number, 0) + 1
    number = max(counts, key=counts.get)
    stops = [
        stop
        for stop, seen in good.stops.items()
        if any(v.number == number for s in seen for v in s.views)
    ]
    change = np.array([0.015, -0.01, 0.0, 0.0, 0.03, 0.02])
    cause = diagnose(spoilt.marker_shifted(good, number, stops[1], change)).cause
    assert cause is not None
    assert (cause.effect.kind, cause.effect.subject) == ("marker_moved", str(number))
    assert cause.effect.since == stops[1]
    assert (np.abs(cause.size - change) < 4 * cause.sigma).all()


def test_exchanged_files_are_sought_where_all_but_a_lens_fits(good, monkeypatch):
    """As where most cameras are others: chi-squared alone does not ask for it then."""
    monkeypatch.setattr(causes, "_BAD", np.inf)
    lenses = {camera.name: camera for camera in good.cameras}
    swapped = tuple(replace(lenses[{"1": "2", "2": "1"}[n]], name=n) for n in good.names)
    boards = tuple(v for v in good.boards if spoilt.of_kind(v) != CALIBRATION)
    seen = replace(good, cameras=swapped, boards=boards, from_files=("1", "2"))
    cause = diagnose(seen).cause
    assert cause is not None
    assert cause.effect.kind == "camera_files_exchanged"


@pytest.fixture(scope="module")
def mixed(good):
    """Two stops whose images are exchanged, those of camera 1; and where the robot stood."""
    both = [s for s, seen in good.stops.items() if {o.camera for o in seen} >= {"1", "2"}]
    a, b = both[0], both[-1]
    stood = {stop: planar_pose(good.T_gtv_robot["1", stop]) for stop in (a, b)}
    alone = replace(good, surveyed=Surveyed())
    return spoilt.stops_exchanged(alone, "1", a, b), (a, b), stood


def test_that_images_do_not_tell_whose_are_exchanged_is_said(mixed):
    # Camera 1 with the images exchanged is camera 2 with its own exchanged, the robot elsewhere.
    seen, pair, _ = mixed
    diagnosis = diagnose(seen)
    assert {one.subject for one in diagnosis.alike} == {"1", "2"}
    assert {one.pair for one in diagnosis.alike} == {pair}
    found = cause_finding(diagnosis)
    assert (found.severity, found.code) == ("error", "exchanged")
    assert "of camera 1" in found.text
    assert "of camera 2" in found.text
    # Whichever it is, the stop that a wrong image gives is off by the way between both.
    assert (diagnosis.harm > 3).sum() == len(pair)


@pytest.mark.parametrize("whose", ["1", "2"])
def test_the_survey_tells_whose_images_are_exchanged(mixed, whose):
    seen, (a, b), stood = mixed
    # Were they camera 2's, the robot stood at the other stop.
    at = stood if whose == "1" else {a: stood[b], b: stood[a]}
    noise = np.random.default_rng(3).normal(0, 0.005, (2, 3))
    poses = np.array(list(at.values())) + noise
    diagnosis = diagnose(replace(seen, surveyed=surveyed_at(tuple(at), poses)))
    effect = diagnosis.cause.effect
    assert (effect.subject, effect.pair) == (whose, (a, b))
    assert {one.subject for one in diagnosis.excluded} == {"1", "2"} - {whose}
    text = cause_finding(diagnosis).text
    assert f"of camera {whose} are exchanged" in text
    assert "which the surveyed stops exclude" in text


def test_a_survey_in_another_frame_tells_by_how_its_stops_lie_to_each_other(mixed):
    seen, _, stood = mixed
    poses = np.array(list(stood.values())) + np.array([0.5, 0.5, 0.0])
    surveyed = surveyed_at(tuple(stood), poses)
    assert [one.subject for one in diagnose(replace(seen, surveyed=surveyed)).alike] == ["1"]
    elsewhere = next(stop for stop in seen.results if stop not in stood)
    other = surveyed_at((elsewhere,), [seen.results[elsewhere][0]])
    assert len(diagnose(replace(seen, surveyed=other)).alike) == 2


def surveyed_at(stops, poses, sigma=0.005):
    """Stops surveyed without correlations, to so many metres and radians."""
    return Surveyed(stops, np.asarray(poses), sigma**2 * np.eye(3 * len(stops)))


@pytest.fixture(scope="module")
def of_images(good):
    """Where the robot stood, to millimetres: what a survey of all stops says."""
    poses = {stop: pose for stop, (pose, _) in good.results.items()}
    return surveyed_at(tuple(poses), np.array(list(poses.values())), 0.002)


@pytest.mark.parametrize(
    ("spoil", "above"),
    [(spoilt.reference_raised, -0.03), (spoilt.dima_raised, -0.03)],
)
def test_a_height_that_was_stated_wrongly_is_told_though_not_which(good, of_images, spoil, above):
    """Reference and dima-marker lift the robot alike; prints of another size would move it."""
    diagnosis = diagnose(replace(spoil(good, -above), surveyed=of_images))
    assert diagnosis.cause is not None
    kinds = {diagnosis.cause.effect.kind, *(one.effect.kind for one in diagnosis.others)}
    assert kinds == {"reference_height", "dima_height"}
    by = {one.effect.kind: one for one in (diagnosis.cause, *diagnosis.others)}
    which = "reference_height" if spoil is spoilt.reference_raised else "dima_height"
    assert abs(by[which].size[2] - above) < 4 * by[which].sigma[2]
    found = cause_finding(diagnosis)
    assert found.text.startswith("Either: ")
    assert "Neither the images nor the surveyed stops tell which (odds 1 : " in found.text
    assert found.severity == "warning"  # no pose moves
    assert (diagnosis.harm < 3).all()


def test_without_a_survey_a_size_and_two_heights_are_told_alike(good):
    seen = replace(spoilt.reference_raised(good, 0.03), surveyed=Surveyed())
    diagnosis = diagnose(seen)
    kinds = {diagnosis.cause.effect.kind, *(one.effect.kind for one in diagnosis.others)}
    assert kinds >= {"reference_height", "dima_height", "reference_scale"}
    found = cause_finding(diagnosis)
    assert "a survey of the stops may" in found.text
    assert found.severity == "error"  # it may be the one that spoils all poses
    assert (diagnosis.harm > 3).any()


def test_a_bar_whose_boards_were_taken_for_each_other_is_told(good):
    boards = tuple(
        replace(v, part=1 - v.part) if spoilt.of_kind(v) == BAR else v for v in good.boards
    )
    cause = diagnose(replace(good, boards=boards)).cause
    assert cause is not None
    assert cause.effect.kind == "bar_exchanged"
    assert "two boards of the bar are exchanged" in said_of(cause)


def test_images_of_two_cameras_calibrations_that_are_exchanged_are_told(good):
    other = {"1": "2", "2": "1"}
    lenses = {camera.name: camera for camera in good.cameras}
    cameras = tuple(replace(lenses[other[n]], name=n) for n in good.names)
    boards = tuple(
        replace(v, camera=other[v.camera]) if spoilt.of_kind(v) == CALIBRATION else v
        for v in good.boards
    )
    cause = diagnose(replace(good, cameras=cameras, boards=boards)).cause
    assert cause is not None
    assert (cause.effect.kind, cause.effect.pair) == ("calibrations_exchanged", ("2", "1"))


def test_bar_and_markers_too_large_at_once_are_told_by_the_survey(good, of_images):
    share = -0.03
    seen = spoilt.markers_printed(spoilt.boards_printed(good, {BAR}, share), share)
    diagnosis = diagnose(replace(seen, surveyed=of_images))
    cause = diagnosis.cause
    assert cause is not None
    assert cause.effect.kind == "bar_and_marker_scale"
    assert abs(cause.size[0] - share) < 4 * cause.sigma[0]


def test_poses_as_they_are_that_the_survey_confirms_are_not_called_spoilt(good, of_images):
    """A wrong size is the best of what is left, were the heights not among what is tried."""
    diagnosis = diagnose(replace(spoilt.reference_raised(good, 0.03), surveyed=of_images))
    left = [o for o in diagnosis.ranking.tried if o.what.effect.kind == "reference_scale"]
    alone = replace(diagnosis, ranking=ranked([*left, diagnosis.nothing]))
    found = cause_finding(alone)
    assert alone.against
    assert found.severity == "warning"
    assert "the surveyed stops agree with the poses as they are" in found.text


def test_a_camera_with_rough_corners_is_told_though_the_detector_states_them(good):
    # Six times the scatter of rendered corners of 0.027 px.
    rough = spoilt.rougher(good, "1", 0.15, np.random.default_rng(8))
    diagnosis = diagnose(rough)
    assert diagnosis.cause is None
    assert all(one.factor < 1.5 for one in diagnosis.noise)
    found = noise_finding(diagnosis)
    assert (found.severity, found.subject, found.code) == ("note", "camera 1", "corner_noise")
    assert "of the other cameras" in found.text


@pytest.mark.parametrize("alike", [True, False])
def test_a_camera_without_calibration_images_is_not_measured_by_the_others(outcome, alike):
    """Its boards are those of the bar alone, which are farther away, and have markers."""
    noise = (
        Noise("boards", "1", 1.0, 600, 1100.0, 0.06, calibrated=alike),
        Noise("boards", "2", 1.0, 900, 1700.0, 0.03, calibrated=True),
    )
    found = noise_finding(replace(outcome.diagnosis, noise=noise))
    assert (found is not None) == alike


def test_which_cameras_boards_are_of_their_calibration_is_known(good):
    boards = tuple(v for v in good.boards if (spoilt.of_kind(v), v.camera) != (CALIBRATION, "1"))
    _, noise = with_own_noise(evidence_of(replace(good, boards=boards, from_files=("1",))))
    said = {one.camera: one.calibrated for one in noise if one.kind == "boards"}
    assert said == {"1": False, "2": True}


def test_what_a_fisheye_lens_has_not_is_not_sought(good):
    wide = fisheye_parameters(good.cameras[0].parameters[:4], np.zeros(4))
    cameras = (replace(good.cameras[0], parameters=wide), *good.cameras[1:])
    free = evidence_of(replace(good, cameras=cameras)).knowledge.free
    assert free[camera_slots(0)].tolist() == [True] * 14 + [False]
    assert free[camera_slots(1)].all()


def test_a_wrong_focal_length_is_told_though_it_moves_no_pose_that_is_used(good):
    """The camera is placed nearer, and another one's poses are used."""
    sizes = (0.02, 0.003)
    told = []
    for size in sizes:
        diagnosis = diagnose(spoilt.lens_from_file(good, "1", size))
        best = diagnosis.ranking.best.what
        after = best.solution.setup
        # As if all stops were where they were without it.
        null = replace(diagnosis.nothing.what.solution.adjustment, setup=after)
        still = replace(diagnosis.nothing.what.solution, adjustment=null)
        nothing = replace(diagnosis.nothing, what=replace(diagnosis.nothing.what, solution=still))
        told.append(replace(diagnosis, nothing=nothing).cause)
    assert told[0] is not None
    assert told[0].effect.what == "focal"
    assert told[1] is None


def test_that_no_cause_was_looked_for_is_said(good):
    # Without the bar nothing ties one of the cameras to the rest.
    lacks = []
    alone = replace(good, boards=tuple(v for v in good.boards if spoilt.of_kind(v) != BAR))
    stops = {s: [o for o in found if o.camera == "1"] for s, found in alone.stops.items()}
    assert _diagnosis(replace(alone, stops=stops), lacks) is None
    assert [one.part for one in lacks] == ["causes"]


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("corner", [(0, 0), (8, 4)])
def test_a_reference_read_from_another_corner_is_told_by_the_survey(quarters, corner):
    rng = np.random.default_rng(4)
    board = Board(columns=10, rows=6, square=0.1)
    T = RigidTransform.from_components([0.2, 0.0, 0.0], Rotation.from_rotvec([np.pi, 0, 0]))
    turned = Rotation.from_rotvec([0, 0, quarters * np.pi / 2])
    at = RigidTransform.from_components([0.1 * corner[0], 0.1 * corner[1], 0], turned)
    frame = T * at.inv() * T.inv()
    poses = np.column_stack([rng.uniform(-3, 3, (12, 2)), rng.uniform(-3, 3, 12)])
    true = np.array([planar_pose(frame * planar_transform(pose)) for pose in poses])
    true += 0.003 * rng.standard_normal(true.shape)
    found = reference_turn(poses, true, T, board)
    if quarters == 0 and corner == (0, 0):
        assert found is None
    else:
        assert found is not None
        assert found.quarters == quarters
        assert np.allclose(found.corner, 0.1 * np.array(corner))


def test_a_frame_that_no_corner_explains_is_not_the_patterns_fault():
    rng = np.random.default_rng(5)
    board = Board(columns=10, rows=6, square=0.1)
    T = RigidTransform.from_components([0.2, 0.0, 0.0], Rotation.from_rotvec([np.pi, 0, 0]))
    poses = np.column_stack([rng.uniform(-3, 3, (12, 2)), rng.uniform(-3, 3, 12)])
    assert reference_turn(poses, poses + np.array([0.25, 0.1, 0.0]), T, board) is None
