"""Did a camera move between two moments? Two tests, each with a threshold from its own noise."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from scipy import special
from scipy.spatial.transform import RigidTransform

from validation.pieces.results import kept_result
from validation.poses.angles import Array
from vision_gt.least_squares.adjustment import Knowledge, adjust
from vision_gt.least_squares.setups import Setup, as_views
from vision_gt.optics.camera import Camera
from vision_gt.optics.transforms import change_between
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

Image = npt.NDArray[np.uint8]

_LEVEL = 1e-3
"""A camera that stands still is accused so often by chance: in one campaign of a hundred, of ten
cameras."""
_TILES = (4, 3)
_BORDER, _LEAST_TILES = 24, 4
"""Tiles across and down the image, pixels between them and the rim, and how many must show
something. Judgements: a shift and a turn need two tiles, and what moved in one must be outvoted by
the others."""
_LEAST_CONTRAST, _LEAST_SCORE = 1.0, 0.3
"""Grey levels that a tile must vary by, and ECC's correlation. Judgements: below these it shows
noise."""
_LEAST_FACTOR = 0.2
"""Of the stated corner noise: what few corners leave may be small by chance. A judgement."""
_REPLACED = (0.001, 0.001)
"""Metres and radians by which a person puts a board back on its marks. A judgement: the width of a
line of felt-tip pen."""
_MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
"""Median length of a normal vector in the plane, in standard deviations of a coordinate."""
_FLOOR_PIXELS = 0.02
"""Pixels; what interpolation and changing light add to a shift of the whole image. A judgement."""


@dataclass(frozen=True)
class BoardMove:
    """A re-placed board before and after.

    Parameters
    ----------
    change : (6,) array
        Of the board's pose in the camera: metres, radians.
    p_value : float
        How likely so large a change is then.
    """

    change: Array
    p_value: float

    @property
    def moved(self) -> bool:
        """Whether chance does not explain the change."""
        return self.p_value < _LEVEL


@dataclass(frozen=True)
class ImageMove:
    """The whole image before and after.

    Parameters
    ----------
    shift : (2,) array
        Mean shift of the static background, pixels.
    rotation : float
        Its rotation about the image's middle, radians.
    p_value : float
        How likely so large a move is by chance.
    """

    shift: Array
    rotation: float
    p_value: float

    @property
    def moved(self) -> bool:
        """Whether chance does not explain the move."""
        return self.p_value < _LEVEL


@dataclass(frozen=True)
class Steadiness:
    """The verdict on one camera.

    Parameters
    ----------
    camera : str
        Which.
    board : BoardMove or None
        None where the board was not seen in both images.
    image : ImageMove or None
        None where the images show too little.
    before, after : (h, w) arrays
        The images, for the overlay.
    """

    camera: str
    board: BoardMove | None
    image: ImageMove | None
    before: Image
    after: Image

    @property
    def verdict(self) -> str:
        """'steady', 'moved' or 'not known'."""
        tests = [test for test in (self.board, self.image) if test is not None]
        if not tests:
            return "not known"
        return "moved" if any(test.moved for test in tests) else "steady"


def board_move(
    before: BoardView,
    after: BoardView,
    camera: Camera,
    replaced: tuple[float, float] = _REPLACED,
) -> BoardMove | None:
    """The change of a board that was put back on its marks.

    Parameters
    ----------
    before, after : BoardView
        The same board.
    camera : Camera
        With the same parameters both times.
    replaced : (float, float)
        Standard deviations of putting it back: metres and radians.

    Notes
    -----
    AD2.3, "Verification of the steadiness of the camera network": the usual calibration
    pattern re-positioned in the same pose, which was first marked with felt-tip pen.
    """
    found = [_board_pose(view, camera) for view in (before, after)]
    if found[0] is None or found[1] is None:
        return None
    (T_before, first), (T_after, second) = found[0], found[1]
    if before.board.looks_the_same_turned:
        turned = T_after * after.board.half_turn
        closer = (turned.rotation * T_before.rotation.inv()).magnitude()
        if closer < (T_after.rotation * T_before.rotation.inv()).magnitude():
            T_after = turned
    change = change_between(T_after, T_before)
    covariance = first + second + np.diag(np.repeat(np.square(replaced), 3))
    statistic = float(change @ np.linalg.solve(covariance, change))
    return BoardMove(change, float(special.chdtrc(6, statistic)))


def _board_pose(view: BoardView, camera: Camera) -> tuple[RigidTransform, Array] | None:
    """T_camera_board with its covariance from the corner noise."""
    start = camera_pose_of_board(view, camera)
    if start is None:
        return None
    one = RigidTransform.concatenate([RigidTransform.identity()])
    setup = Setup.of(one, camera.parameters[None], RigidTransform.concatenate([start]), one)
    alone = replace(view, body="it", part=0)
    done = adjust(as_views([alone], [view.camera], ["it"]), setup, Knowledge.nothing(setup))
    factor = max(done.m0, _LEAST_FACTOR) ** 2
    return done.setup.T_world_body[0], done.body_covariances[0] * factor


@kept_result()
def image_move(before: Image, after: Image) -> ImageMove | None:
    """Shift and rotation of an image against an earlier one; None if there is too little to see.

    Parameters
    ----------
    before, after : (h, w) arrays of uint8
        Of the same size, the same static scene; things that changed in a part of the image are
        outvoted by the other parts.

    Notes
    -----
    AD2.3, "Verification of the steadiness of the camera network": direct image comparison. The
    shift of each of twelve tiles is found by ECC (Evangelidis and Psarakis, PAMI 30, 2008);
    their medians give the whole image's shift, their scatter its noise.
    """
    if before.shape != after.shape:
        return None
    places, shifts = _tile_shifts(before, after)
    if len(places) < _LEAST_TILES:
        return None
    middle = np.array(before.shape[::-1]) / 2
    from_middle = places - middle
    unknown, covariance = _rigid_shift(from_middle, shifts)
    statistic = float(unknown @ np.linalg.solve(covariance, unknown))
    return ImageMove(unknown[:2], float(unknown[2]), float(special.chdtrc(3, statistic)))


def _tile_shifts(before: Image, after: Image) -> tuple[Array, Array]:
    """Middles (t, 2) of tiles that show something, and their shifts (t, 2), pixels."""
    height, width = before.shape
    across, down = _TILES
    places, shifts = [], []
    for row in range(down):
        for column in range(across):
            y0, y1 = row * height // down + _BORDER, (row + 1) * height // down - _BORDER
            x0, x1 = column * width // across + _BORDER, (column + 1) * width // across - _BORDER
            shift = _shift(before[y0:y1, x0:x1], after[y0:y1, x0:x1])
            if shift is not None:
                places.append([(x0 + x1) / 2, (y0 + y1) / 2])
                shifts.append(shift)
    return np.array(places).reshape(-1, 2), np.array(shifts).reshape(-1, 2)


def _shift(before: Image, after: Image) -> Array | None:
    """(2,) shift of one tile; None where it shows too little."""
    soft = [cv2.GaussianBlur(part.astype(np.float32), (0, 0), 1.5) for part in (before, after)]
    if min(float(part.std()) for part in soft) < _LEAST_CONTRAST:
        return None
    guess, _response = cv2.phaseCorrelate(soft[0], soft[1])
    dx, dy = float(guess[0]), float(guess[1])
    if np.hypot(dx, dy) > min(before.shape) / 4:
        dx, dy = 0.0, 0.0
    warp = np.array([[1, 0, dx], [0, 1, dy]], dtype=np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-6)
    try:
        score, found = cv2.findTransformECC(soft[0], soft[1], warp, cv2.MOTION_TRANSLATION, stop)
    except cv2.error:
        return None
    if score < _LEAST_SCORE:
        return None
    return np.asarray(found, dtype=float)[:, 2]


def _rigid_shift(places: Array, shifts: Array) -> tuple[Array, Array]:
    """Shift and rotation (3,) that fit the tiles' shifts, outliers held back; their covariance."""
    t = len(places)
    ones, zeros = np.ones(t), np.zeros(t)
    A = np.stack(
        [
            np.column_stack([ones, zeros, -places[:, 1]]),
            np.column_stack([zeros, ones, places[:, 0]]),
        ],
        axis=1,
    )
    weights = np.ones(t)
    unknown, scale = np.array([*np.median(shifts, axis=0), 0.0]), 1.0
    for _ in range(10):
        normal = np.einsum("t,tij,tik->jk", weights, A, A)
        unknown = np.linalg.solve(normal, np.einsum("t,tij,ti->j", weights, A, shifts))
        off = np.linalg.norm(shifts - A @ unknown, axis=1)
        scale = max(float(np.median(off)) / _MEDIAN_LENGTH, _FLOOR_PIXELS)
        ratio = np.minimum(off / (6 * scale), 1.0)
        weights = np.maximum((1 - ratio**2) ** 2, 1e-6)
    normal = np.einsum("t,tij,tik->jk", weights, A, A)
    # With few tiles the scatter itself is not well known: Student's factor for 2 t - 3, of which
    # a median makes use of 40 %.
    freedom = max(0.4 * (2 * t - 3), 3.0)
    covariance = np.linalg.inv(normal) * scale**2 * freedom / (freedom - 2)
    return unknown, covariance + np.diag([_FLOOR_PIXELS**2, _FLOOR_PIXELS**2, 1e-10])
