"""The document's check of the cameras: a board on a table, put over validated poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable
from vision_gt.network.adjustment import Network
from vision_gt.optics.transforms import planar_transform
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board


@dataclass(frozen=True)
class TableReading:
    """One board on the table.

    Parameters
    ----------
    pose : str
        The validated pose that it was put over.
    camera : str
        That saw it.
    validation : (4,) array
        x, y, height (metres) and heading (radians) where the board should be.
    board : (4,) array
        Where the camera sees it.
    difference : (4,) array
        Validation minus board, the heading wrapped.
    """

    pose: str
    camera: str
    validation: Array
    board: Array
    difference: Array


def check_table(
    views: Sequence[tuple[str, BoardView]],
    network: Network,
    validation: PoseTable,
    table: tuple[float, float, float, float],
) -> list[TableReading]:
    """Where boards on the table are, beside where they should be.

    Parameters
    ----------
    views : sequence of (str, BoardView)
        The pose that the table was put over, and the board as one camera saw it.
    network : Network
        The cameras.
    validation : PoseTable
        Planar validation poses.
    table : (float, float, float, float)
        Place of the board's first corner in the robot frame (x, y), its heading there, and the
        table's height.

    Notes
    -----
    AD2.3, "Calibration of the camera network": 'a small chessboard placed on the corner of a
    table [...] positioned on some validated pose'. For a board that looks the same turned the
    reading nearer to the validated heading is taken: the check is not meant to find that out.
    """
    known = dict(zip(validation.ids, validation.poses, strict=True))
    readings = []
    for pose, view in views:
        if pose not in known:
            raise GtvalError(f"{view.source}: there is no validation pose '{pose}'")
        i = network.index(view.camera)
        x, y, heading, height = table
        corner = planar_transform(known[pose]).apply(np.array([x, y, height]))
        wanted = np.array([*corner, known[pose][2] + heading])
        found = [_board_state(reading, network, i) for reading in view.readings()]
        seen = [state for state in found if state is not None]
        if not seen:
            raise GtvalError(f"{view.source}: the board gives no pose")
        best = min(seen, key=lambda state: abs(float(wrap(state[3] - wanted[3]))))
        wanted[3] = wrap(wanted[3])
        off = wanted - best
        off[3] = wrap(off[3])
        readings.append(TableReading(pose, view.camera, wanted, best, off))
    return readings


def _board_state(view: BoardView, network: Network, camera: int) -> Array | None:
    """x, y, z and heading of a board that lies face up."""
    T = camera_pose_of_board(view, network.cameras[camera])
    if T is None:
        return None
    T_gtv_board: RigidTransform = network.T_gtv_camera[camera] * T
    rows = T_gtv_board.rotation.as_matrix()[:, 0]
    return np.array([*T_gtv_board.translation, np.arctan2(rows[1], rows[0])])
