"""A board or a marker at a known place, beside where a camera sees it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import special
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array, wrap
from vision_gt.images.markers import MarkerView
from vision_gt.least_squares.setups import camera_slots
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import project_with_jacobians
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.optics.transforms import (
    composition_jacobians,
    cross_matrix,
    planar_jacobian,
    planar_transform,
)
from vision_gt.patterns.board_views import BoardView
from vision_gt.robot.marker_poses import marker_corners

LEVEL = 1e-3
"""A thing that is where it should be is said to be elsewhere so often by chance: once in a
campaign of ten readings and a hundred campaigns."""
COMPONENTS = ("x", "y", "z", "heading")
Kind = Literal["board", "marker"]


@dataclass(frozen=True)
class KnownPlace:
    """Where a thing lies, face up.

    Parameters
    ----------
    name : str
        The stop that it was put over, or the place.
    state : (4,) array
        x, y, height (metres) of its first corner or of its middle, and heading of its x axis
        (radians), in the GTV frame.
    covariance : (4, 4) array
        How well that is known.
    """

    name: str
    state: Array
    covariance: Array


@dataclass(frozen=True)
class PlaceReading:
    """One thing at a known place, seen by one camera.

    Parameters
    ----------
    pose : str
        The stop that it was put over, or the place.
    camera : str
        That saw it.
    kind : {"board", "marker"}
        What it is.
    validation, seen : (4,) arrays
        x, y, height (metres) and heading (radians): where it should be, and where it is seen.
    difference : (4,) array
        Validation minus seen, the heading wrapped.
    covariance : (4, 4) array
        Of the difference: of the place, of the camera's pose and lens, and of the corners.
    """

    pose: str
    camera: str
    kind: Kind
    validation: Array
    seen: Array
    difference: Array
    covariance: Array

    @property
    def sigmas(self) -> Array:
        """(4,) standard deviations of the difference."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def p_value(self) -> float:
        """How likely so large a difference is by chance."""
        statistic = self.difference @ np.linalg.solve(self.covariance, self.difference)
        return float(special.chdtrc(len(COMPONENTS), statistic))

    @property
    def agrees(self) -> bool:
        """Whether chance explains the difference."""
        return self.p_value >= LEVEL


def placed_on(
    name: str,
    frame: Array,
    covariance: Array,
    place: Sequence[float],
    sigmas: Sequence[float],
) -> KnownPlace:
    """A place in the robot frame of a surveyed stop (or in the GTV frame: a frame of zeros).

    Parameters
    ----------
    name : str
        Of the place.
    frame : (3,) array
        x, y, theta of the frame; zeros are the GTV frame itself.
    covariance : (3, 3) array
        Of it; taken for zero where it is not known (NaN).
    place : (4,) sequence
        x, y, height and heading in it.
    sigmas : (4,) sequence
        How well the thing was laid there.
    """
    x, y, height, heading = place
    at = planar_transform(frame).apply(np.array([x, y, height]))
    c, s = np.cos(frame[2]), np.sin(frame[2])
    J = np.zeros((4, 3))
    J[0] = [1, 0, -s * x - c * y]
    J[1] = [0, 1, c * x - s * y]
    J[3, 2] = 1
    turned = np.eye(4)
    turned[:2, :2] = [[c, -s], [s, c]]
    laid = turned @ np.diag(np.square(sigmas)) @ turned.T
    whole = J @ np.nan_to_num(covariance) @ J.T + laid
    return KnownPlace(name, np.array([*at, wrap(frame[2] + heading)]), whole)


def read_board(view: BoardView, network: Network, known: KnownPlace) -> PlaceReading | None:
    """A board at a known place; None if the view gives no pose.

    For a board that looks the same turned the reading nearer to the known heading is taken: the
    check is not meant to find that out.

    Notes
    -----
    AD2.3, "Calibration of the camera network": 'a small chessboard placed on the corner of a
    table [...] positioned on some validated pose'; "Validation poses": a chessboard aligned with
    the x axis of the Vframe, seen by camera 2.
    """
    noise = view.stated_sigmas[:, None, None] ** 2 * np.eye(2)
    i = network.index(view.camera)
    found = []
    for reading in view.readings():
        poses = planar_solutions(reading.points, view.pixels, network.cameras[i].parameters)
        if poses is not None:
            found.append((reading.points, poses.best))
    return _read("board", found, view.pixels, noise, network, i, known)


def read_marker(
    view: MarkerView, side: float, camera: str, network: Network, known: KnownPlace
) -> PlaceReading | None:
    """A marker that lies at a known place; None if the view gives no pose.

    Of the two poses that fit a marker's corners the one that lies flatter is taken, as the table
    is level.

    Notes
    -----
    AD2.3, "ARToolkit": a table 'with a single marker and a chessboard (calibration pattern) on
    it', put over validated poses.
    """
    i = network.index(camera)
    points = marker_corners(side)
    poses = planar_solutions(points, view.corners, network.cameras[i].parameters)
    if poses is None:
        return None
    stack = poses.T_camera_plane
    up = (network.T_gtv_camera[i].rotation * stack.rotation).as_matrix()[:, 2, 2]
    flattest = stack[int(np.argmax(up))]
    return _read("marker", [(points, flattest)], view.corners, view.covariances, network, i, known)


def _read(
    kind: Kind,
    candidates: Iterable[tuple[Array, RigidTransform]],
    pixels: Array,
    noise: Array,
    network: Network,
    camera: int,
    known: KnownPlace,
) -> PlaceReading | None:
    """The candidate (points and T_camera_thing) nearest to the known heading."""
    best: tuple[Array, Array] | None = None
    least = np.inf
    for points, T in candidates:
        state, covariance = _state(points, pixels, noise, T, network, camera)
        off = abs(float(wrap(state[3] - known.state[3])))
        if off < least:
            best, least = (state, covariance), off
    if best is None:
        return None
    state, covariance = best
    difference = known.state - state
    difference[3] = wrap(difference[3])
    name = network.names[camera]
    whole = covariance + known.covariance
    return PlaceReading(known.name, name, kind, known.state, state, difference, whole)


def _state(
    points: Array,
    pixels: Array,
    noise: Array,
    T_camera_thing: RigidTransform,
    network: Network,
    camera: int,
) -> tuple[Array, Array]:
    """x, y, z, heading in the GTV frame, and their covariance (4, 4)."""
    lens = network.cameras[camera].parameters
    own, by_lens = thing_covariance(points, pixels, noise, T_camera_thing, lens)
    T_gtv_camera = network.T_gtv_camera[camera]
    by_camera, by_thing = composition_jacobians(T_gtv_camera, T_camera_thing)
    slots = camera_slots(camera)
    sensitivity = np.hstack([by_camera, by_thing @ by_lens])
    change = by_thing @ own @ by_thing.T
    change = change + sensitivity @ network.covariance[slots, slots] @ sensitivity.T
    T = T_gtv_camera * T_camera_thing
    R = T.rotation.as_matrix()
    J = np.eye(4, 6)
    J[3] = planar_jacobian(R)[2]
    state = np.array([*T.translation, np.arctan2(R[1, 0], R[0, 0])])
    return state, J @ change @ J.T


def thing_covariance(
    points: Array,
    pixels: Array,
    noise: Array,
    T_camera_thing: RigidTransform,
    parameters: Array,
) -> tuple[Array, Array]:
    """Covariance (6, 6) of T_camera_thing from the corners, and its derivative (6, 9) by the lens.

    Parameters
    ----------
    points : (n, 3) array
        Corners in the thing's own frame.
    pixels : (n, 2) array
        Where they are seen.
    noise : (n, 2, 2) array
        Their covariances, square pixels. Enlarged where the corners fit worse than that.
    T_camera_thing : RigidTransform
        The pose that fits them best.
    parameters : (9,) array
        Intrinsic parameters.
    """
    R, t = T_camera_thing.rotation.as_matrix(), T_camera_thing.translation
    turned = points @ R.T
    seen, by_point, lens = project_with_jacobians(turned + t, parameters)
    by_change = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(points), 3, 3)), -cross_matrix(turned)], -1
    )
    J = by_point @ by_change
    weight = np.linalg.inv(noise)
    information = np.einsum("nai,nab,nbj->ij", J, weight, J)
    covariance = np.linalg.inv(information)
    by_lens = -covariance @ np.einsum("nai,nab,nbj->ij", J, weight, lens)
    miss = pixels - seen
    freedom = max(2 * len(points) - 6, 1)
    misfit = float(np.einsum("na,nab,nb->", miss, weight, miss)) / freedom
    return covariance * max(misfit, 1.0), by_lens
