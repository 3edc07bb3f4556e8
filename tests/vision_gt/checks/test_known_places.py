"""Differences from known places scatter as stated, drawn many times without images."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2
from vision_scenes import LENS, SIZE, board_view

from data_samples.rooms.cameras import looking
from validation.poses.angles import wrap
from vision_gt.checks.displacement import known_displacement
from vision_gt.checks.known_places import KnownPlace, placed_on, read_board, read_marker
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera, project
from vision_gt.optics.transforms import perturbed
from vision_gt.patterns.boards import Board
from vision_gt.robot.marker_poses import marker_corners

BOARD = Board(columns=8, rows=5, square=0.06)
ALIKE = Board(columns=8, rows=6, square=0.06)
T_CAMERA = looking(np.array([0.0, -2.0, 2.3]), np.array([0.0, 0.0, 0.4]))
SIGMAS = np.array([0.003] * 3 + [0.002] * 3 + [0.5, 0.5, 0.4, 0.4] + [0.0] * 5)
"""Of the camera's pose and lens."""
NOISE, SIDE = 0.1, 0.16
FRAME, FRAME_SIGMAS = np.array([0.2, 0.1, 0.7]), np.array([0.002, 0.002, 0.003])
PLACE, LAID = (0.05, 0.05, 0.72, 0.3), (0.002, 0.001, 0.001, 0.004)


def drawn_network(rng):
    """The network as it is known: off from the true camera by what it states."""
    off = SIGMAS * rng.standard_normal(15)
    camera = Camera("1", SIZE, LENS + off[6:])
    placed = RigidTransform.concatenate([perturbed(T_CAMERA, off[:6])])
    here = RigidTransform.identity()
    return Network((camera,), placed, np.diag(SIGMAS**2), here, np.zeros((6, 6)), NOISE)


def drawn_place(rng):
    """Where a thing truly lies, (4,), and the place as it is known."""
    frame = FRAME + FRAME_SIGMAS * rng.standard_normal(3)
    known = placed_on("7", frame, np.diag(FRAME_SIGMAS**2), PLACE, LAID)
    laid = np.array(PLACE) + np.array(LAID) * rng.standard_normal(4)
    true = placed_on("7", FRAME, np.zeros((3, 3)), laid, (0, 0, 0, 0)).state
    return true, known


def lying(state, *, up):
    turn = Rotation.from_rotvec([0, 0, state[3]])
    if not up:
        turn = turn * Rotation.from_rotvec([np.pi, 0, 0])
    return RigidTransform.from_components(state[:3], turn)


def readings(kind, count, seed, board=BOARD):
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        network = drawn_network(rng)
        true, known = drawn_place(rng)
        if kind == "board":
            T = lying(true, up=False)
            view = board_view(T_CAMERA, "1", board, T, "b", 0, NOISE, rng)
            found.append(read_board(view, network, known))
        else:
            T = T_CAMERA.inv() * lying(true, up=True)
            corners = project(T.apply(marker_corners(SIDE)), LENS)
            corners = corners + NOISE * rng.standard_normal((4, 2))
            noise = np.broadcast_to(NOISE**2 * np.eye(2), (4, 2, 2))
            found.append(read_marker(MarkerView(15, corners, noise), SIDE, "1", network, known))
    return found


@pytest.mark.parametrize("kind", ["board", "marker"])
def test_differences_scatter_as_stated(kind):
    """The sum of 100 chi-squared of four numbers, both bounds at one in ten thousand."""
    found = readings(kind, 100, 2)
    total = sum(float(r.difference @ np.linalg.solve(r.covariance, r.difference)) for r in found)
    # A fit worse than stated widens the covariance, which takes a little off the sum.
    assert 0.9 * chi2.ppf(1e-4, 400) < total < chi2.ppf(1 - 1e-4, 400)
    assert sum(one.agrees for one in found) >= 98


def test_a_board_that_looks_the_same_turned_is_read_by_its_heading():
    for one in readings("board", 10, 3, ALIKE):
        assert abs(one.difference[3]) < 0.05


def test_a_place_in_a_robot_frame_is_turned_with_it():
    known = placed_on("7", np.array([1.0, 2.0, np.pi / 2]), np.full((3, 3), np.nan),
                      (0.3, 0.1, 0.7, 0.2), (0.001, 0.002, 0.003, 0.004))  # fmt: skip
    assert known.state == pytest.approx([0.9, 2.3, 0.7, np.pi / 2 + 0.2])
    # Along the robot's x, which is the room's y, it was laid better.
    assert np.sqrt(np.diagonal(known.covariance)) == pytest.approx([0.002, 0.001, 0.003, 0.004])


def test_a_turn_of_the_frame_moves_what_is_far_from_its_origin():
    """By finite differences: the covariance is J C J^T."""
    covariance = np.diag([0.002, 0.003, 0.01]) ** 2
    known = placed_on("7", FRAME, covariance, PLACE, (0, 0, 0, 0))
    J = np.zeros((4, 3))
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6
        ends = [
            placed_on("", FRAME + s * step, covariance, PLACE, (0, 0, 0, 0)).state for s in (1, -1)
        ]
        J[:, k] = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(known.covariance, J @ covariance @ J.T, atol=1e-12)
    assert wrap(known.state[3]) == known.state[3]
    assert isinstance(known, KnownPlace)


def test_a_displacement_errs_as_it_says():
    """200 boards moved by 0.3 m: the root mean square of the normalised error is 1 to 0.2."""
    rng = np.random.default_rng(4)
    lens_sigmas = np.array([1.0, 1.0, 0.5, 0.5, 0, 0, 0, 0, 0])
    off, covered = [], []
    for number in range(200):
        lean = Rotation.from_rotvec(0.4 * rng.standard_normal(3))
        start = RigidTransform.from_components([-0.3, -0.2, 2.2], lean)
        moved = start * RigidTransform.from_translation([0.3, 0.0, 0.0])
        world = RigidTransform.identity()
        views = [board_view(world, "1", ALIKE, T, "b", 0, NOISE, rng) for T in (start, moved)]
        lens = LENS + lens_sigmas * rng.standard_normal(9)
        known = Camera("1", SIZE, lens, np.diag(lens_sigmas**2))
        second = views[1] if number % 2 else views[1].turned()
        found = known_displacement(views[0], second, known, 0.3, 1e-6)
        assert found.angle < 0.05
        off.append(found.off / found.off_sigma)
        covered.append(found.agrees)
    low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], 200) / 200)
    assert low < np.sqrt(np.mean(np.square(off))) < high
    assert sum(covered) >= 197
