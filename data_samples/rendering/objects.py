"""Boards, markers, the robot and what stands in the way, as sheets for the renderer."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.rendering.image import Sheet
from data_samples.rooms.cameras import (
    BAR_BOARDS,
    DIMA_MARKER,
    HAT,
    MARKER_FAMILY,
    VisionTruth,
)
from validation.poses.angles import Array
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.robot.marker_poses import Layout

PAPER = 0.95
INK = 0.05
_BODY = 0.30
_BODY_HALF, _BODY_HEIGHT = 0.14, 0.40
_POLE_HALF, _POLE_HEIGHT = 0.05, 0.59
_CHESS_CELLS = 4
_BAR_WIDTH = 0.04
_FACE = RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
"""From y up, z to the viewer, to the sheets' y down, z away."""


def board_sheet(board: Board, T_world_board: RigidTransform) -> Sheet:
    """A printed board with a white margin."""
    bits, cell = board.cells()
    finer, margin = (_CHESS_CELLS, 1) if board.family is None else (1, 2)
    cell /= finer
    squares = np.kron(np.where(bits > 0, PAPER, INK), np.ones((finer, finer)))
    grey: Array = np.asarray(np.pad(squares, margin, constant_values=PAPER), dtype=float)
    corner = -(board.square + margin * cell)
    T_board_sheet = RigidTransform.from_translation([corner, corner, 0.0])
    return Sheet(grey, (cell, cell), T_world_board * T_board_sheet)


def marker_sheet(family: Family, number: int, side: float, T_world_marker: RigidTransform) -> Sheet:
    """A printed marker with a white margin of one cell."""
    cell = side / family.cells
    grey = np.pad(np.where(family.bits(number) > 0, PAPER, INK), 1, constant_values=PAPER)
    outer = side / 2 + cell
    T = T_world_marker * RigidTransform.from_translation([-outer, outer, 0.0]) * _FACE
    return Sheet(grey, (cell, cell), T)


def double_pattern(T_world_first: RigidTransform, T_first_second: RigidTransform) -> list[Sheet]:
    """The two boards and the two aluminium bars between them."""
    second = T_world_first * T_first_second
    first_board = BAR_BOARDS[0]
    start = first_board.columns * first_board.square - first_board.square
    length = float(T_first_second.translation[0]) - start - BAR_BOARDS[1].square
    bars = [
        Sheet(
            np.full((1, 1), 0.7),
            (length, _BAR_WIDTH),
            T_world_first * RigidTransform.from_translation([start, y, 0.002]),
            two_sided=True,
        )
        for y in (0.05, 0.30)
    ]
    return [
        *bars,
        board_sheet(first_board, T_world_first),
        board_sheet(BAR_BOARDS[1], second),
    ]


def robot_sheets(
    layout: Layout, T_world_robot: RigidTransform, eye: Array, family: Family = MARKER_FAMILY
) -> list[Sheet]:
    """The robot with its dima and its six markers, as seen from ``eye`` (3,): far things first."""
    T_world_marker = T_world_robot * layout.T_robot_marker
    markers = {
        number: marker_sheet(family, number, float(side), T_world_marker[i])
        for i, (number, side) in enumerate(zip(layout.numbers, layout.sides, strict=True))
    }
    on_dima = [markers.pop(DIMA_MARKER)] if DIMA_MARKER in markers else []
    near_last = sorted(
        markers.values(), key=lambda sheet: -float(np.linalg.norm(sheet.corners.mean(0) - eye))
    )
    body = _box(_BODY_HALF, _BODY_HEIGHT, T_world_robot)
    pole = _box(_POLE_HALF, _POLE_HEIGHT, T_world_robot)
    # The top marker hides parts of the others and is hidden by none.
    top = [markers[89]] if 89 in markers else []
    others = [sheet for sheet in near_last if not any(sheet is one for one in top)]
    return [*_dima(T_world_robot), *on_dima, *body, *pole, *others, *top]


def _dima(T_world_robot: RigidTransform) -> list[Sheet]:
    """The L with arms of 0.6 m and 0.4 m, its outer edges being the axes."""
    arms = (([0.0, 0.0, 0.010], (0.6, 0.04)), ([-0.04, -0.2, 0.010], (0.04, 0.6)))
    plate = ([-0.25, -0.01, 0.012], (0.25, 0.21))
    return [
        Sheet(
            np.full((1, 1), 0.6),
            size,
            T_world_robot * RigidTransform.from_translation(np.add(place, [0, size[1], 0])) * _FACE,
        )
        for place, size in (*arms, plate)
    ]


def _box(half: float, height: float, T_world_robot: RigidTransform) -> list[Sheet]:
    """Four sides and the top of a box around the middle of the robot's body."""
    sheets = []
    for quarter in range(4):
        around = Rotation.from_rotvec([0, 0, quarter * np.pi / 2])
        # Sheet axes: x along the side, y down, z into the box.
        axes = np.column_stack([around.apply([0, 1, 0]), [0, 0, -1], around.apply([-1, 0, 0])])
        corner = HAT + around.apply([half, -half, 0]) + np.array([0, 0, height])
        T = RigidTransform.from_components(corner, Rotation.from_matrix(axes))
        grey = _BODY * (0.7 + 0.15 * quarter)
        sheets.append(Sheet(np.full((1, 1), grey), (2 * half, height), T_world_robot * T))
    top = RigidTransform.from_translation(HAT + np.array([-half, half, height])) * _FACE
    sheets.append(Sheet(np.full((1, 1), 1.2 * _BODY), (2 * half, 2 * half), T_world_robot * top))
    return sheets


def bystander(place: Array, eye: Array, width: float = 0.12, height: float = 1.2) -> Sheet:
    """Someone's leg: an upright dark strip at a place (2,) on the floor, facing ``eye``."""
    towards = np.append(np.asarray(eye, dtype=float)[:2] - place, 0.0)
    towards = towards / np.linalg.norm(towards)
    x = np.cross([0.0, 0.0, 1.0], towards)
    axes = np.column_stack([x, [0, 0, -1], -towards])
    corner = np.append(place, height) - x * width / 2
    T = RigidTransform.from_components(corner, Rotation.from_matrix(axes))
    return Sheet(np.full((1, 1), 0.2), (width, height), T)


def bar_sheets(truth: VisionTruth, T_world_first: RigidTransform) -> list[Sheet]:
    """The double pattern as it was really built."""
    return double_pattern(T_world_first, truth.T_bar)
