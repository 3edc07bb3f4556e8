"""Snapshots under wrong names are named; cameras that nothing links get a probable reason."""

from dataclasses import replace

import numpy as np
import pytest
from vision_scenes import LENS, CameraRow

from vision_gt.network.adjustment import Bar, KnownBody
from vision_gt.network.chain import NotLinkedError, bar_poses, pair_links
from vision_gt.network.exchanged import why_not_linked
from vision_gt.network.solution import NetworkInput, solve_network
from vision_gt.optics.camera import project, undistort
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family

CHARUCO = Board(10, 6, 0.1, Family("4X4_100"))
OTHER_LENS = np.array([1300.0, 1300.0, 639.5, 479.5, -0.05, 0.02, 0, 0, 0])


def row_of(seed, board, snapshots=8):
    return CameraRow(seed, cameras=3, snapshots=snapshots, board=board)


def solved(row, views, cameras=None):
    """The network, of views whose files have the names of their cameras and moments."""
    named = []
    for view in views:
        one, other, number = view.body.split("-")
        partner = other if view.camera == one else one
        part = int(view.camera == other) if view.board.family is None else view.part
        named.append(replace(view, source=f"{view.camera}-{partner}-{number}", part=part))
    given = NetworkInput(
        tuple(cameras or row.cameras),
        tuple(named),
        (),
        (row.reference,),
        (),
        Bar(row.nominal_bar, np.full(6, 0.003)),
        KnownBody(row.T_gtv_reference, 1e-6 * np.eye(6)),
        row.reference.pixels[0],
    )
    return solve_network(given)


def exchanged(views, one, other):
    """Views with two (camera, moment) exchanged."""
    under = {one: other, other: one}
    names = [under.get((v.camera, v.body), (v.camera, v.body)) for v in views]
    return [replace(v, camera=c, body=b) for v, (c, b) in zip(views, names, strict=True)]


@pytest.mark.parametrize("board", [CHARUCO, None], ids=["charuco", "chessboard"])
@pytest.mark.parametrize(
    ("one", "other", "partners"),
    [
        (("1", "1-2-3"), ("2", "1-2-3"), [("1-2-3", "2-1-3")]),
        (("1", "1-2-3"), ("1", "1-2-7"), [("1-2-3", "2-1-7"), ("1-2-7", "2-1-3")]),
        (("2", "1-2-3"), ("2", "2-3-5"), [("1-2-3", "2-3-5"), ("2-1-3", "3-2-5")]),
    ],
    ids=["cameras", "moments", "pairs"],
)
def test_exchanged_snapshots_are_named(board, one, other, partners):
    for seed in (21, 22):
        row = row_of(seed, board)
        found = solved(row, exchanged(row.snapshots, one, other)).exchanged
        assert [pair for some in found for pair in some.partners] == partners
        assert all(some.of_cameras == (one[0] != other[0]) for some in found)


def test_a_snapshot_with_few_good_corners_is_taken_back():
    """Eight corners in a corner of the print: a poor pose, which the network does not need."""
    apart, lost = 0, 0
    for seed in range(41, 47):
        row = row_of(seed, CHARUCO, 12)
        poor = {("1", f"1-2-{k}") for k in (2, 5)}
        patch = [0, 1, 2, 3, 9, 10, 11, 12]
        views = [
            replace(v, ids=v.ids[patch], pixels=v.pixels[patch])
            if (v.camera, v.body) in poor
            else v
            for v in row.snapshots
        ]
        patterns = Bar(row.nominal_bar, np.zeros(6)).patterns
        apart += sum(len(k.outliers) for k in pair_links(bar_poses(views, row.cameras, patterns)))
        lost += sum(len(link.outliers) for link in solved(row, views).links)
    assert apart >= 1
    assert lost == 0


@pytest.mark.parametrize("board", [CHARUCO, None], ids=["charuco", "chessboard"])
def test_nothing_is_exchanged_where_the_bar_moved(board):
    """Left out, and no other name makes it agree; nothing at all where nothing is wrong."""
    row = row_of(23, board)
    assert solved(row, row.snapshots).exchanged == ()
    moved = [
        replace(v, pixels=v.pixels + np.array([40.0, 0]))
        if (v.camera, v.body) == ("1", "1-2-3")
        else v
        for v in row.snapshots
    ]
    found = solved(row, moved)
    assert [link.outliers for link in found.links] == [("1-2-3",), ()]
    assert found.exchanged == ()


def seen_through(view, parameters):
    """The view as another lens takes it."""
    rays = undistort(view.pixels, LENS)
    ahead = np.column_stack([rays, np.ones(len(rays))])
    return replace(view, pixels=project(ahead, parameters))


@pytest.mark.parametrize(
    ("lenses", "said"),
    [
        ((OTHER_LENS, LENS, LENS), "lenses of cameras 1 and 2 are exchanged"),
        ((LENS, LENS, OTHER_LENS), "lenses of cameras 2 and 3 are exchanged"),
        ((LENS, LENS, LENS), "the lens of camera 2 is not the one"),
    ],
)
def test_a_network_that_is_not_linked_says_whose_lens_is_wrong(lenses, said):
    """Camera 2 has another lens than the others; whose files are stated is varied."""
    for seed in (31, 32):
        row = row_of(seed, CHARUCO, 12)
        views = [seen_through(v, OTHER_LENS) if v.camera == "2" else v for v in row.snapshots]
        pairs = zip(row.cameras, lenses, strict=True)
        cameras = [replace(camera, parameters=lens) for camera, lens in pairs]
        patterns = Bar(row.nominal_bar, np.zeros(6)).patterns
        assert said in why_not_linked(views, cameras, patterns)
        if any(lens is OTHER_LENS for lens in lenses):
            with pytest.raises(NotLinkedError, match=said):
                solved(row, views, cameras)


@pytest.mark.parametrize(("share", "said"), [(0.8, "20 % smaller"), (1.25, "25 % larger")])
def test_a_bar_with_boards_of_another_size_is_said(share, said):
    row = row_of(34, CHARUCO, 12)
    stated = replace(CHARUCO, square=CHARUCO.square / share)
    views = [replace(view, board=stated) for view in row.snapshots]
    patterns = Bar(row.nominal_bar, np.zeros(6)).patterns
    found = why_not_linked(views, row.cameras, patterns)
    assert found.startswith(f"the squares of the bar's boards are some {said} than stated")


def test_boards_of_the_bar_that_were_taken_for_each_other_are_said():
    row = row_of(35, CHARUCO, 12)
    views = [replace(view, part=1 - view.part) for view in row.snapshots]
    patterns = Bar(row.nominal_bar, np.zeros(6)).patterns
    said = why_not_linked(views, row.cameras, patterns)
    assert said.startswith("the two boards of the bar are exchanged")


def test_numbers_that_run_apart_are_said():
    """Camera 1 took a frame too many: its files have the numbers of the moment after."""
    row = row_of(33, CHARUCO, 12)
    apart = [
        replace(v, body=f"1-2-{int(v.body.split('-')[2]) + 1}")
        if v.camera == "1" and v.body.startswith("1-2")
        else v
        for v in row.snapshots
    ]
    patterns = Bar(row.nominal_bar, np.zeros(6)).patterns
    said = why_not_linked(apart, row.cameras, patterns)
    assert said.startswith(
        "the snapshots of cameras 1 and 2 are numbered apart: those of camera 1 are 1 too high"
    )
    right = why_not_linked(row.snapshots, row.cameras, patterns)
    assert right == ""
