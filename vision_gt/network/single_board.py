"""The pose of one board in one image, with its covariance."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform
from scipy.special import chdtrc

from validation.poses.angles import Array
from vision_gt.least_squares.adjustment import Knowledge, NotDeterminedError, adjust
from vision_gt.least_squares.setups import Setup, as_views
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_BODY = "board"


@dataclass(frozen=True)
class SingleBoard:
    """A board in the frame of its camera.

    Parameters
    ----------
    T_camera_board : RigidTransform
        Its pose: the first inner corner, x along the columns, y along the rows, z into the board.
    covariance : (6, 6) array
        From corners and lens: metres, then radians, in the axes of the camera.
    rms : float
        Root mean square length of the residuals, pixels.
    p_value : float
        How likely so bad a fit is by chance, with the corners as good as they are said to be.
    """

    T_camera_board: RigidTransform
    covariance: Array
    rms: float
    p_value: float


def board_in_camera(view: BoardView, camera: Camera) -> SingleBoard | None:
    """The pose of a board by one image; None if it has too few corners.

    Parameters
    ----------
    view : BoardView
        The board.
    camera : Camera
        That took the image; its covariance counts. Where corners fit worse than they should, the
        pose is stated less certain by as much.
    """
    T = camera_pose_of_board(view, camera)
    if T is None:
        return None
    still = RigidTransform.concatenate([RigidTransform.identity()])
    setup = Setup.of(still, camera.parameters[None], RigidTransform.concatenate([T]), still)
    knowledge = Knowledge.nothing(setup)
    if camera.covariance.any():
        knowledge.add_camera(0, camera.covariance)
    own = replace(view, body=_BODY, part=0)
    try:
        done = adjust(as_views([own], [camera.name], [_BODY]), setup, knowledge)
    except NotDeterminedError:
        return None
    pixels = view.stated_sigmas[:, None] * done.residuals
    square, freedom = float((done.residuals**2).sum()), max(done.residuals.size - 6, 1)
    worse = max(square / freedom, 1.0)
    return SingleBoard(
        done.setup.T_world_body[0],
        worse * done.body_covariances[0],
        float(np.sqrt((pixels**2).sum(1).mean())),
        float(chdtrc(freedom, square)),
    )
