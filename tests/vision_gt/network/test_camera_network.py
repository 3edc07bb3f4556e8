"""The camera network: exact where it must be, honest along the chain, never partial."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform
from scipy.stats import chi2
from vision_scenes import CameraRow

from data_samples.rooms.cameras import CHESSBOARD
from validation.errors import GtvalError
from vision_gt.network.adjustment import Bar, KnownBody
from vision_gt.network.chain import NotLinkedError, bar_poses, chain_cameras, pair_links
from vision_gt.network.solution import NetworkInput, solve_network
from vision_gt.optics.camera import project
from vision_gt.optics.transforms import angle_between, change_between
from vision_gt.patterns.dictionaries import Family

KNOWN_REFERENCE = np.diag([1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]) ** 2
UNSURE = np.array([0.003] * 3 + [np.deg2rad(0.3)] * 3)


def given(row: CameraRow, sigmas=None, snapshots=None) -> NetworkInput:
    bar = Bar(row.nominal_bar, np.zeros(6) if sigmas is None else sigmas)
    return NetworkInput(
        cameras=tuple(row.cameras),
        snapshots=tuple(row.snapshots if snapshots is None else snapshots),
        both=tuple(row.both),
        reference=(row.reference,),
        calibration=(),
        bar=bar,
        known_reference=KnownBody(row.T_gtv_reference, KNOWN_REFERENCE),
        origin_near=row.reference.pixels[0] + 4.0,
    )


def pair_error(network, row: CameraRow) -> tuple[float, float]:
    """Error of camera 2 relative to camera 1: millimetres and degrees."""
    true = row.T_gtv_camera[0].inv() * row.T_gtv_camera[1]
    found = network.T_gtv_camera[0].inv() * network.T_gtv_camera[1]
    length = np.linalg.norm(found.translation - true.translation)
    return 1e3 * float(length), float(np.rad2deg(angle_between(found, true)))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_known_bar_gives_cameras_4_m_apart_to_a_millimetre(seed):
    row = CameraRow(seed)
    length, angle = pair_error(solve_network(given(row)).network, row)
    assert length < 1.0
    assert angle < 0.015


@pytest.mark.parametrize("seed", [2, 3])
def test_a_bar_that_starts_wrong_calibrates_itself(seed):
    row = CameraRow(seed, bar_error=(0.002, np.deg2rad(0.2)), both=15)
    solution = solve_network(given(row, UNSURE))
    length, _ = pair_error(solution.network, row)
    assert length < 1.5
    # The document's way cannot see it: millimetres, times the lever of the distance.
    assert pair_error(solution.averaged, row)[0] > 3.0
    # How well the bar is known is stated: six numbers within what chi-squared allows.
    off = change_between(solution.network.bar, row.bar)
    statistic = off @ np.linalg.solve(solution.network.bar_covariance, off)
    assert chi2.ppf(1e-4, 6) < statistic < chi2.ppf(1 - 1e-4, 6)


def test_images_of_one_board_are_not_blamed_on_the_bar():
    row = CameraRow(4, bar_error=(0.002, np.deg2rad(0.2)), both=4)
    row.both.remove(next(v for v in row.both if v.body == "both-1" and v.part == 1))
    wrong = [v for v in row.both if v.body == "both-2"]
    row.both.remove(wrong[1])
    row.both.append(replace(wrong[1], pixels=wrong[1].pixels + 60.0))
    solution = solve_network(given(row, UNSURE))
    assert solution.bar_single == ("both-1",)
    assert solution.bar_outliers == ("both-2",)


@pytest.mark.full
def test_known_and_unknown_bars_over_many_seeds():
    for seed in range(10, 22):
        row = CameraRow(seed)
        length, angle = pair_error(solve_network(given(row)).network, row)
        assert length < 1.0
        assert angle < 0.015
        row = CameraRow(seed, bar_error=(0.002, np.deg2rad(0.2)), both=15)
        assert pair_error(solve_network(given(row, UNSURE)).network, row)[0] < 1.5


def chain_statistics(cameras: int, seeds: range, snapshots: int) -> list[float]:
    """NEES / 6 of the last camera of a chain."""
    statistics = []
    for seed in seeds:
        row = CameraRow(seed, cameras=cameras, snapshots=snapshots)
        network = solve_network(given(row)).network
        off = change_between(network.T_gtv_camera[cameras - 1], row.T_gtv_camera[cameras - 1])
        P = network.pose_covariance(str(cameras))
        statistics.append(float(off @ np.linalg.solve(P, off)) / 6)
    return statistics


def test_errors_at_the_end_of_a_chain_of_four_are_as_large_as_stated():
    statistics = chain_statistics(4, range(5), 8)
    total = 6 * sum(statistics)
    # The reference is laid exactly here, though 0.1 mm is stated: the lower bound is loose.
    assert chi2.ppf(1e-4, 30) * 0.5 < total < chi2.ppf(1 - 1e-4, 30)


@pytest.mark.full
@pytest.mark.parametrize("cameras", [4, 10])
def test_errors_along_long_chains_are_as_large_as_stated(cameras):
    statistics = chain_statistics(cameras, range(100, 120), 20)
    total, freedom = 6 * sum(statistics), 120
    assert chi2.ppf(1e-4, freedom) * 0.5 < total < chi2.ppf(1 - 1e-4, freedom)


def test_uncertainty_grows_along_the_chain():
    network = solve_network(given(CameraRow(0, cameras=4, snapshots=8))).network
    sizes = [np.trace(network.pose_covariance(str(k))[:3, :3]) for k in (1, 2, 3, 4)]
    assert sizes == sorted(sizes)


def test_cameras_that_nothing_links_are_named():
    row = CameraRow(0, cameras=4, snapshots=6)
    some = [view for view in row.snapshots if not view.body.startswith("2-3")]
    with pytest.raises(NotLinkedError, match="links cameras 3, 4 to camera 1"):
        solve_network(given(row, snapshots=some))


def test_a_swapped_pair_is_left_out_and_named():
    row = CameraRow(1, snapshots=10, board=replace(CHESSBOARD, family=Family("4X4_100")))
    victim = "1-2-4"
    swapped = [
        replace(view, camera={"1": "2", "2": "1"}[view.camera]) if view.body == victim else view
        for view in row.snapshots
    ]
    solution = solve_network(given(row, snapshots=swapped))
    assert solution.links[0].outliers == (victim,)
    assert pair_error(solution.network, row)[0] < 2.5


def test_images_that_take_no_part_are_named():
    row = CameraRow(0, snapshots=3)
    lonely = replace(row.snapshots[0], body="1-2-9", source="1-2-9.png")
    solution = solve_network(given(row, snapshots=[*row.snapshots, lonely]))
    assert solution.unused == ("1-2-9.png",)


def test_boards_that_look_the_same_turned_are_read_by_consensus():
    row = CameraRow(4, snapshots=12)
    rng = np.random.default_rng(0)
    turned = [view.turned() if rng.uniform() < 0.5 else view for view in row.snapshots]
    length, _ = pair_error(solve_network(given(row, snapshots=turned)).network, row)
    assert length < 2.0


def test_one_snapshot_of_such_boards_does_not_decide():
    row = CameraRow(5, snapshots=1)
    with pytest.raises(NotLinkedError, match="do not decide between two positions"):
        solve_network(given(row))


def test_a_reference_that_looks_the_same_turned_needs_a_hint():
    row = CameraRow(0, snapshots=3)
    with pytest.raises(GtvalError, match="origin_near"):
        solve_network(replace(given(row), origin_near=None))


def test_without_a_reference_there_is_no_frame():
    row = CameraRow(0, snapshots=3)
    with pytest.raises(GtvalError, match="reference pattern"):
        solve_network(replace(given(row), reference=()))


def test_one_board_seen_by_two_cameras_links_them():
    row = CameraRow(0, snapshots=3)
    both = [replace(view, part=0) for view in row.snapshots if view.part == 0]
    T = row.T_gtv_camera[0]
    poses = bar_poses(both, row.cameras, Bar(row.nominal_bar, np.zeros(6)).patterns)
    twins = [
        replace(
            p, camera="2", T_camera_bar=[row.T_gtv_camera[1].inv() * T * q for q in p.T_camera_bar]
        )
        for p in poses
    ]
    chain = chain_cameras(["1", "2"], pair_links([*poses, *twins]), "1")
    true = T.inv() * row.T_gtv_camera[1]
    np.testing.assert_allclose(
        chain.T_reference_camera["2"].as_matrix(), true.as_matrix(), atol=1e-9
    )
    assert chain.path("2") == ("2", "1")


def test_the_averaged_network_is_the_fallback():
    row = CameraRow(6, snapshots=10)
    solution = solve_network(given(row), joint=False)
    assert solution.network is solution.averaged
    assert pair_error(solution.network, row)[0] < 10
    assert isinstance(solution.network.T_gtv_camera, RigidTransform)


def test_the_corner_clicked_in_any_image_tells_how_the_reference_lies():
    row = CameraRow(0, snapshots=3)
    first, along = row.reference.pixels[0], row.reference.pixels[row.reference.board.inner[0] - 1]
    camera = row.reference.camera
    expected = solve_network(given(row)).network.T_gtv_camera[0]
    turned = replace(given(row), reference=(row.reference.turned(),), origin_near=None)
    for places in ([first + 5], [first + 5, along - 20]):
        found = solve_network(replace(turned, corners={camera: np.array(places)}))
        assert angle_between(found.network.T_gtv_camera[0], expected) < 1e-6
    # It counts before the pixel of campaign.toml.
    wrong = row.reference.pixels[-1]
    both = replace(turned, corners={camera: np.array([first])}, origin_near=wrong)
    assert angle_between(solve_network(both).network.T_gtv_camera[0], expected) < 1e-6
    column = row.reference.pixels[-row.reference.board.inner[0]]
    with pytest.raises(GtvalError, match="first corner and row"):
        solve_network(replace(turned, corners={camera: np.array([first, column])}))


def test_corners_that_contradict_each_other_are_refused():
    row = CameraRow(0, snapshots=3)
    # The second camera sees the pattern, too, and where it stands.
    T = row.T_gtv_camera[1].inv() * row.T_gtv_reference
    board = row.reference.board
    seen = project(T.apply(board.corners), row.cameras[1].parameters)
    other = replace(row.reference, camera=row.cameras[1].name, pixels=seen)
    corners = {row.reference.camera: row.reference.pixels[:1], other.camera: seen[:1]}
    both = replace(given(row), reference=(row.reference, other), corners=corners)
    assert len(solve_network(both).network.views) > len(solve_network(given(row)).network.views)
    with pytest.raises(GtvalError, match="another one than in that of camera"):
        solve_network(replace(both, corners={**corners, other.camera: seen[-1:]}))
