"""Marker corners: as good as promised, better than the stock ones, and never lost quietly."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from vision_scenes import (
    APRIL,
    LENS,
    SIDE,
    camera,
    close_up,
    exact_network,
    laid_out,
    marker_image,
    opencv_markers,
    over_pixels,
    random_marker,
)

from data_samples.rendering.image import Optics
from validation.errors import GtvalError
from vision_gt.images.corners import refine_corners
from vision_gt.images.markers import detect_markers
from vision_gt.optics.camera import Camera
from vision_gt.optics.transforms import angle_between
from vision_gt.patterns.dictionaries import ARTOOLKITPLUS, Family, artoolkitplus_bits
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor, Sighting, robot_pose


def corner_errors(distance: float, count: int, seed: int = 5):
    """Errors (n, 4, 2) of refined corners, with true corners and covariances."""
    rng = np.random.default_rng(seed)
    errors, truths, covariances, flips = [], [], [], 0
    for _ in range(count):
        number = int(rng.integers(0, 200))
        T = random_marker(rng, distance)
        part, image, true = close_up(rng, T, number)
        views = detect_markers(image, APRIL, part, [number]).views
        assert len(views) == 1
        errors.append(views[0].corners - true)
        truths.append(true)
        covariances.append(views[0].covariances)
        flips += is_silent_flip(views[0], T, part)
    return np.array(errors), np.array(truths), np.array(covariances), flips


def is_silent_flip(view, T_camera_marker, part) -> bool:
    """Whether the pose of a single marker is wrong by more than 10 degrees and not declared so.

    Detection has y down and z away from the viewer, the marker's own frame y up and z towards
    him: half a turn about x.
    """
    layout = Layout(
        (view.number,),
        np.array([SIDE]),
        RigidTransform.concatenate([RigidTransform.identity()]),
        np.zeros((6, 6)),
    )
    network = replace(exact_network(RigidTransform.identity()), cameras=(part,))
    pose = robot_pose([Sighting("1", (view,))], network, layout, Floor(0.003, 0.005))
    own = RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
    off = np.rad2deg(angle_between(pose.T_gtv_robot, T_camera_marker * own))
    return bool(off > 10 and not pose.ambiguous)


def side_bias(errors, truths):
    """Mean error of the lengths of the sides, pixels."""
    found = truths + errors
    lengths = [np.linalg.norm(np.roll(c, -1, axis=1) - c, axis=-1) for c in (found, truths)]
    return float((lengths[0] - lengths[1]).mean())


@pytest.mark.parametrize("distance", [2.0, 5.0])
def test_corners_are_within_a_tenth_of_a_pixel_and_sides_unbiased(distance):
    errors, truths, covariances, flips = corner_errors(distance, 8)
    assert np.sqrt((errors**2).sum(-1).mean()) <= 0.10
    assert abs(side_bias(errors, truths)) < 0.05
    assert flips == 0
    # Stated sigmas are neither too good nor too bad: the mean square of the normalised errors.
    normalised = np.einsum("mki,mkij,mkj->mk", errors, np.linalg.inv(covariances), errors) / 2
    assert 0.2 < normalised.mean() < 2.5


@pytest.mark.full
@pytest.mark.parametrize("distance", [2.0, 3.0, 4.0, 5.0])
def test_corners_of_150_renders(distance):
    errors, truths, _, flips = corner_errors(distance, 150, seed=int(distance))
    assert np.sqrt((errors**2).sum(-1).mean()) <= 0.10
    assert abs(side_bias(errors, truths)) < 0.05
    assert flips == 0


def test_uneven_light_and_vignetting_lose_no_marker():
    rng = np.random.default_rng(3)
    dim = Optics(falloff=0.7, gradient=(1.0, 0.6), rays=32)
    for place in ((-0.55, -0.4), (0.55, 0.4), (0.5, -0.38), (-0.5, 0.38)):
        T = random_marker(rng, 1.0)
        t = 3.0 * np.array([*place, 1.0])
        T = type(T).from_components(t, T.rotation)
        image, true = marker_image(rng, T, 7, dim)
        views = detect_markers(image, APRIL, camera(), [7]).views
        assert len(views) == 1
        assert np.abs(views[0].corners - true).max() < 0.35


def test_saturated_paper_does_not_move_the_edges():
    rng = np.random.default_rng(4)
    T = random_marker(rng, 2.5)
    image, true = marker_image(rng, T, 11, Optics(white=265.0, falloff=0.0, rays=64))
    assert (image == 255).sum() > 100
    views = detect_markers(image, APRIL, camera(), [11]).views
    assert np.sqrt(((views[0].corners - true) ** 2).mean()) < 0.15


def test_a_blade_of_sun_along_an_edge_does_not_tilt_it():
    """What is left of the print places the corners, the covered one too."""
    rng = np.random.default_rng(12)
    T = RigidTransform.from_components([0.1, 0.05, 2.4], Rotation.from_rotvec([0.3, -0.2, 0.1]))
    image, true = marker_image(rng, T, 11)
    worst = []
    for inside in (0.5, 1.5, 2.5, 3.5):
        spoiled = image.copy()
        # From a cell outside of the top edge, on its left, to some pixels inside, on its right.
        along, down = true[1] - true[0], (true[3] - true[0]) / np.linalg.norm(true[3] - true[0])
        ends = true[0] - 0.6 * along - 9 * down, true[1] + 0.6 * along + (2 * inside - 2) * down
        blade = [ends[0], ends[1], ends[1] - 14 * down, ends[0] - 14 * down]
        cv2.fillPoly(spoiled, [np.rint(16 * np.array(blade)).astype(np.int32)], 255, shift=4)
        views = detect_markers(spoiled, APRIL, camera(), [11]).views
        if views:
            worst.append(np.linalg.norm(views[0].corners - true, axis=1).max())
    assert len(worst) >= 3
    assert max(worst) < 0.15


def test_the_distortion_matters():
    rng = np.random.default_rng(6)
    T = random_marker(rng, 0.6)
    T = type(T).from_components([0.25, 0.18, 0.6], T.rotation)
    image, true = marker_image(rng, T, 3)
    start = detect_markers(image, APRIL, None, [3], fitted=False).views[0].corners[None]
    bits = APRIL.bits(3)[None]
    with_lens = refine_corners(image, start, bits, LENS).corners[0] - true
    without = refine_corners(image, start, bits).corners[0] - true
    assert np.abs(with_lens).max() < 0.06
    assert np.abs(without).max() > 2 * np.abs(with_lens).max()


def test_a_marker_seen_twice_is_named_and_not_used():
    rng = np.random.default_rng(7)
    T = random_marker(rng, 2.0)
    image, _ = marker_image(rng, T, 5)
    half = np.concatenate([image[:, 320:960], image[:, 320:960]], axis=1)
    detection = detect_markers(np.ascontiguousarray(half), APRIL, None, [5])
    assert detection.duplicates == (5,)
    assert detection.views == ()


def test_unknown_ids_are_strangers():
    rng = np.random.default_rng(8)
    image, _ = marker_image(rng, random_marker(rng, 2.0), 9)
    detection = detect_markers(image, APRIL, None, [1, 2, 3])
    assert detection.strangers == (9,)
    assert detection.views == ()


def test_an_image_of_another_size_is_refused():
    small = Camera("7", (640, 480), LENS)
    with pytest.raises(GtvalError, match="calibrated with 640 x 480"):
        detect_markers(np.zeros((960, 1280), dtype=np.uint8), APRIL, small)


def test_no_marker_is_no_error():
    assert detect_markers(np.full((960, 1280), 90, dtype=np.uint8), APRIL, camera()).views == ()


def test_artoolkitplus_ids_are_four_masked_copies_that_no_turn_confuses():
    seen = set()
    for number in range(512):
        bits = artoolkitplus_bits(number)
        for turn in range(4):
            seen.add(np.rot90(bits, turn).tobytes())
        word = int("".join(str(b) for b in bits.ravel()), 2)
        copies = [(word >> shift) & 0x1FF for shift in (27, 18, 9, 0)]
        masks = [0x0DB, 0x109, 0x14E, 0x027]
        assert all(c ^ m == number for c, m in zip(copies, masks, strict=True))
    assert len(seen) == 4 * 512


def test_artoolkitplus_markers_are_drawn_and_detected():
    family = Family(ARTOOLKITPLUS)
    np.testing.assert_array_equal(family.bits(200)[1:-1, 1:-1], artoolkitplus_bits(200))
    rng = np.random.default_rng(9)
    for number in (3, 6, 14, 30, 89, 200):
        image, true = marker_image(rng, random_marker(rng, 2.5), number, family=family)
        views = detect_markers(image, family, camera()).views
        assert [view.number for view in views] == [number]
        assert np.abs(views[0].corners - true).max() < 0.15


def test_the_stock_corners_are_worse():
    rng = np.random.default_rng(5)
    ours, stock = [], []
    for number in range(6):
        part, image, true = close_up(rng, random_marker(rng, 4.0), number)
        ours.append(detect_markers(image, APRIL, part).views[0].corners - true)
        stock.append(opencv_markers(image, APRIL, "subpix")[number] - true)
    assert np.sqrt(np.square(stock).mean()) > 4 * np.sqrt(np.square(ours).mean())


def test_an_unknown_family_is_named():
    with pytest.raises(GtvalError, match="no marker family '9X9_10'"):
        Family("9X9_10").bits(0)
    with pytest.raises(GtvalError, match="ids 0 to 49"):
        Family("4X4_50").bits(50)


def test_dark_images_lose_no_marker():
    rng = np.random.default_rng(29)
    for _ in range(4):
        number = int(rng.integers(200))
        # Sides of 25 to 45 pixels, exposed to less than a fifth.
        image, true = marker_image(rng, random_marker(rng, rng.uniform(3.5, 6.0)), number)
        dark = 0.17 * image + rng.normal(0, 1.5, image.shape)
        dark = np.clip(np.rint(dark), 0, 255).astype(np.uint8)
        (view,) = detect_markers(dark, APRIL, camera()).views
        assert view.number == number
        off = view.corners - true
        inverse = np.linalg.inv(view.covariances)
        # Of eight errors of a marker the largest is within four standard deviations or so.
        assert np.einsum("ki,kij,kj->k", off, inverse, off).max() < 20


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.3, 2.4])
@pytest.mark.parametrize("length", [4, 8])
def test_corners_under_motion_are_where_they_are_and_as_good_as_stated(length, angle):
    """Motion of so many pixels: 12 markers each, 48 corners of two coordinates."""
    rng = np.random.default_rng(round(10 * angle) + length)
    squares, offs = [], []
    for number in range(12):
        bits = np.pad(APRIL.bits(number), 2, constant_values=1)
        texture = np.kron(bits, np.ones((40, 40)))
        low, high = 79.5, len(texture) - 80.5
        own = [[low, low], [high, low], [high, high], [low, high]]
        seen = np.array([[60, 52], [158, 66], [150, 140], [52, 148]]) + rng.uniform(-9, 9, (4, 2))
        large, _ = laid_out(texture, own, seen, (220, 200), outside=0.7)
        line = np.zeros((65, 65), dtype=np.float32)
        steps = np.linspace(-4 * length, 4 * length, 400)
        at = np.rint(32 + np.outer(steps, [np.cos(angle), np.sin(angle)])).astype(int)
        np.add.at(line, (at[:, 1], at[:, 0]), 1 / len(at))
        large = cv2.GaussianBlur(cv2.filter2D(large, -1, line), (0, 0), 5.6)
        image = 40 + 165 * over_pixels(large)
        image += 2 * rng.standard_normal(image.shape)
        (view,) = detect_markers(np.clip(np.rint(image), 0, 255).astype(np.uint8), APRIL).views
        assert view.number == number
        off = view.corners - seen
        squares.append(np.einsum("ki,kij,kj->k", off, np.linalg.inv(view.covariances), off))
        offs.append(off)
    # Blur of motion is a box, the model has a bell curve: deviations may be a third too small.
    assert 0.4 < np.mean(squares) / 2 < 2.0
    assert np.sqrt(np.mean(np.square(offs))) < 0.012 * length
