"""Intrinsic parameters: as good as stated, outliers left out, displacement measured."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2
from vision_scenes import LENS, SIZE, board_view, camera

from data_samples.rendering.campaign import _board_in_view
from data_samples.rooms.cameras import CHESSBOARD
from validation.errors import GtvalError
from vision_gt.network.intrinsics import calibrate
from vision_gt.network.repeats import repeated
from vision_gt.network.verdict import calibration_verdict
from vision_gt.patterns.boards import Board

WORLD = RigidTransform.identity()


def board_views(seed: int, count: int = 12, noise: float = 0.05):
    rng = np.random.default_rng(seed)
    views = []
    for number in range(count):
        T = _board_in_view(camera(), number, rng)
        view = board_view(WORLD, "1", CHESSBOARD, T, f"{number}", 0, noise, rng)
        assert view is not None
        views.append(view)
    return views


def test_parameters_are_as_good_as_stated():
    total = 0.0
    for seed in range(5):
        found = calibrate("1", SIZE, board_views(seed))
        off = found.camera.parameters - LENS
        total += float(off @ np.linalg.solve(found.camera.covariance, off))
        assert found.sigma == pytest.approx(0.05, rel=0.1)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 45)
    assert low < total < high


def test_an_image_that_does_not_fit_is_left_out_and_named():
    views = board_views(1)
    bent = views[3].pixels + 2 * np.random.default_rng(0).standard_normal(views[3].pixels.shape)
    views[3] = replace(views[3], pixels=bent, source="third.png")
    found = calibrate("1", SIZE, views)
    assert found.outliers == ("third.png",)
    assert len(found.views) == len(views) - 1
    assert found.sigma < 0.07


def test_an_image_with_too_few_corners_is_left_out_and_named():
    views = board_views(1)
    few = replace(views[0], ids=views[0].ids[:7], pixels=views[0].pixels[:7], source="few.png")
    assert calibrate("1", SIZE, [*views, few]).outliers == ("few.png",)


def test_the_same_images_give_the_same_bytes_whatever_the_threads():
    views = board_views(6)
    threads = cv2.getNumThreads()
    found = {calibrate("1", SIZE, views).camera.parameters.tobytes() for _ in range(6)}
    assert len(found) == 1
    assert cv2.getNumThreads() == threads


def test_the_coverage_tells_where_the_board_was():
    found = calibrate("1", SIZE, board_views(2))
    coverage = found.coverage
    assert coverage.counts.sum() == 12 * 45
    assert 1.0 < coverage.distances.min() < coverage.distances.max() < 3.2
    assert 0.3 < coverage.tilts.max() < 1.2
    assert found.image_rms.shape == (12,)


def test_too_few_images_and_images_all_alike_are_errors():
    with pytest.raises(GtvalError, match="only 3 images"):
        calibrate("1", SIZE, board_views(3)[:3])


def test_a_verdict_says_what_images_lack():
    """Boards that face the camera in its middle: no tilt, no coverage, no focal length."""
    board = Board(columns=10, rows=6, square=0.03)
    rng = np.random.default_rng(8)

    def seen(count, tilt, spread, noise=0.05):
        views = []
        while len(views) < count:
            turn = Rotation.from_rotvec([*rng.uniform(-tilt, tilt, 2), rng.uniform(-3, 3)])
            depth = rng.uniform(0.5, 0.9)
            middle = np.array([*(rng.uniform(-spread, spread, 2) * [0.5, 0.4] * depth), depth])
            T = RigidTransform.from_components(middle, turn)
            T = T * RigidTransform.from_translation(-board.corners.mean(0))
            name = f"{len(views)}"
            view = board_view(RigidTransform.identity(), "1", board, T, name, 0, noise, rng)
            if view is not None:
                views.append(view)
        return calibration_verdict(calibrate("1", SIZE, views))

    good = seen(16, 0.7, 1.0)
    assert good.word == "good"
    assert good.text.startswith("Verdict: good.")
    assert 0 < good.pixels < 0.5  # ten times the noise of a corner
    flat = seen(16, 0.03, 0.2)
    assert flat.word == "not determined"
    assert {"undetermined", "tilt", "coverage"} <= {one.kind for one in flat.shortcomings}
    few = seen(5, 0.7, 1.0)
    assert "few" in {one.kind for one in few.shortcomings}
    blurred = seen(16, 0.7, 1.0, noise=0.8)
    assert "blur" in {one.kind for one in blurred.shortcomings}


def test_a_frame_given_twice_counts_once_and_a_board_at_rest_twice():
    taken = board_views(1)
    rng = np.random.default_rng(1)
    first, *_ = taken
    n = first.pixels.shape
    again = replace(first, source="copy", pixels=first.pixels + 0.01 * rng.standard_normal(n))
    rest = replace(first, source="rest", pixels=first.pixels + 0.1 * rng.standard_normal(n))
    assert repeated([*taken, again, rest]) == {"copy": first.source}


def test_corners_of_which_the_image_leaves_much_open_are_said_to_be_blurred():
    taken = board_views(1)

    def kinds(sigma):
        views = [replace(v, sigmas=np.full(len(v.ids), sigma)) for v in taken]
        found = calibrate("1", SIZE, views)
        return {one.kind for one in calibration_verdict(found).shortcomings}

    assert "blur" not in kinds(0.05)
    assert "blur" in kinds(0.52)
