"""The joint adjustment of the camera network: cameras, bar and boards from all images at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.least_squares.adjustment import Knowledge, adjust, robust_m0
from vision_gt.least_squares.setups import (
    CAMERA_UNKNOWNS,
    Setup,
    as_views,
    camera_slots,
    part_slots,
)
from vision_gt.optics.camera import PARAMETERS, Camera, stacked_parameters
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_LEAST_FACTOR = 0.05
"""Of the stated corner noise. A judgement: exact corners, as of a simulation, must not make weights
infinite."""
_POSE_NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")


@dataclass(frozen=True)
class Bar:
    """The double pattern: where the second pattern is, seen from the first.

    Parameters
    ----------
    T_first_second : RigidTransform
        As it was built.
    sigmas : (6,) array
        Standard deviations of the building: metres along the first pattern's axes, then
        radians about them; zeros if it is taken as exact.
    """

    T_first_second: RigidTransform
    sigmas: Array

    @property
    def patterns(self) -> RigidTransform:
        """Stack of the two patterns in the bar's frame, which is the first pattern's."""
        return RigidTransform.concatenate([RigidTransform.identity(), self.T_first_second])


@dataclass(frozen=True)
class KnownBody:
    """A board whose place in the GTV frame is known: the reference pattern.

    Parameters
    ----------
    T_gtv_body : RigidTransform
        Where it was put.
    covariance : (6, 6) array
        How well.
    """

    T_gtv_body: RigidTransform
    covariance: Array


@dataclass(frozen=True)
class Network:
    """The cameras in the GTV frame, with the covariance of everything about them.

    Parameters
    ----------
    cameras : tuple of Camera
        With adjusted intrinsic parameters and their covariances.
    T_gtv_camera : RigidTransform
        Stack in the same order.
    covariance : (15 c, 15 c) array
        Of all cameras together; each has six of its pose and nine intrinsic parameters.
    bar : RigidTransform
        The second pattern seen from the first.
    bar_covariance : (6, 6) array
        Of it.
    sigma : float
        Of a corner's coordinate as the residuals show it, pixels.
    views : tuple of BoardView
        What was used.
    residuals : tuple of (n, 2) array
        Of each view, pixels.
    """

    cameras: tuple[Camera, ...]
    T_gtv_camera: RigidTransform
    covariance: Array
    bar: RigidTransform
    bar_covariance: Array
    sigma: float
    views: tuple[BoardView, ...] = ()
    residuals: tuple[Array, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(camera.name for camera in self.cameras)

    @cached_property
    def placed(self) -> tuple[Array, Array]:
        """Rotations (c, 3, 3) and translations (c, 3) of T_gtv_camera."""
        return self.T_gtv_camera.rotation.as_matrix(), np.asarray(self.T_gtv_camera.translation)

    def index(self, name: str) -> int:
        """Place of a camera in the stacks."""
        return self.names.index(name)

    def pose_covariance(self, name: str) -> Array:
        """(6, 6) covariance of a camera's pose in the GTV frame."""
        first = CAMERA_UNKNOWNS * self.index(name)
        return self.covariance[first : first + 6, first : first + 6]


def adjust_network(
    cameras: Sequence[Camera],
    T_gtv_camera: Mapping[str, RigidTransform],
    views: Sequence[BoardView],
    known: Mapping[str, KnownBody],
    bar: Bar,
    *,
    free_intrinsics: bool = False,
    frame: str = "",
) -> Network:
    """Cameras, bar and boards that fit all views best.

    Parameters
    ----------
    cameras : sequence of Camera
        Start; a camera's covariance is what is known of its parameters.
    T_gtv_camera : mapping of str to RigidTransform
        Start of each.
    views : sequence of BoardView
        Of snapshots, of the reference, and of single boards for the intrinsic parameters.
    known : mapping of str to KnownBody
        Bodies with a known place; at least one, or the network floats.
    bar : Bar
        Start of the double pattern, and how well it is known.
    free_intrinsics : bool
        Whether the views also determine the intrinsic parameters, from nothing.
    frame : str
        The camera that stands where it starts, if no body has a known place.

    Raises
    ------
    NotDeterminedError
        If the views leave something undetermined.
    GtvalError
        If no board has a known place.
    """
    names = [camera.name for camera in cameras]
    starts = board_starts(views, cameras, T_gtv_camera, bar)
    starts.update({name: body.T_gtv_body for name, body in known.items() if name in starts})
    if not frame and not set(known) & set(starts):
        raise GtvalError("no camera sees the reference pattern")
    used = [view for view in views if view.body in starts]
    bodies = list(starts)
    setup = Setup.of(
        RigidTransform.concatenate([T_gtv_camera[name] for name in names]),
        stacked_parameters(cameras),
        RigidTransform.concatenate([starts[name] for name in bodies]),
        bar.patterns,
    )
    has_bar = any(view.part == 1 for view in used)
    knowledge = _knowledge(setup, cameras, bodies, known, bar, (has_bar, free_intrinsics))
    if frame:
        first = camera_slots(names.index(frame)).start
        knowledge.free[first : first + 6] = False
    return _two_rounds(cameras, used, bodies, setup, knowledge)


def board_starts(
    views: Sequence[BoardView],
    cameras: Sequence[Camera],
    T_gtv_camera: Mapping[str, RigidTransform],
    bar: Bar,
) -> dict[str, RigidTransform]:
    """Where each body is by the first view that gives a pose: T_gtv_body by name.

    Parameters
    ----------
    views : sequence of BoardView
        Of boards by themselves, and of the bar's.
    cameras : sequence of Camera
        That took them.
    T_gtv_camera : mapping of str to RigidTransform
        Where each is.
    bar : Bar
        The double pattern.
    """
    by_name = {camera.name: camera for camera in cameras}
    starts: dict[str, RigidTransform] = {}
    for view in views:
        if view.body in starts:
            continue
        T = camera_pose_of_board(view, by_name[view.camera])
        if T is not None:
            T_pattern_bar = bar.patterns[view.part].inv()
            starts[view.body] = T_gtv_camera[view.camera] * T * T_pattern_bar
    return starts


def _two_rounds(
    cameras: Sequence[Camera],
    views: Sequence[BoardView],
    bodies: Sequence[str],
    setup: Setup,
    knowledge: Knowledge,
) -> Network:
    """The adjustment with the corner noise that its own residuals show."""
    names = [camera.name for camera in cameras]
    describe = partial(_described, names)
    first = adjust(as_views(views, names, bodies), setup, knowledge, describe=describe)
    factor = max(robust_m0(first), _LEAST_FACTOR)
    done = adjust(as_views(views, names, bodies, factor), setup, knowledge, describe=describe)
    # What the median does not see, heavier tails than normal, the covariance should.
    scale = max(done.m0, 1.0) ** 2
    g = CAMERA_UNKNOWNS * len(names)
    covariance = scale * done.covariance[:g, :g]
    adjusted = tuple(
        Camera(
            camera.name,
            camera.size,
            done.setup.intrinsics[i],
            covariance[camera_slots(i), camera_slots(i)][6:, 6:],
        )
        for i, camera in enumerate(cameras)
    )
    ends = np.cumsum([len(view.ids) for view in views])[:-1]
    slots = part_slots(setup, 1)
    sigmas = factor * np.concatenate([view.stated_sigmas for view in views])
    return Network(
        adjusted,
        done.setup.T_world_camera,
        covariance,
        done.setup.T_body_part[1],
        scale * done.covariance[slots, slots],
        float(np.median(sigmas)),
        tuple(views),
        tuple(np.split(sigmas[:, None] * done.residuals, ends)),
    )


def _knowledge(
    setup: Setup,
    cameras: Sequence[Camera],
    bodies: Sequence[str],
    known: Mapping[str, KnownBody],
    bar: Bar,
    choices: tuple[bool, bool],
) -> Knowledge:
    """Priors of the reference, the bar and the intrinsic parameters, and what is held fixed."""
    has_bar, free_intrinsics = choices
    knowledge = Knowledge.nothing(setup)
    for i, camera in enumerate(cameras):
        slots = camera_slots(i)
        knowledge.free[slots.start : slots.start + 6] = True
        if free_intrinsics:
            knowledge.free[slots.start + 6 : slots.stop] = camera.estimated
        else:
            knowledge.add_camera(i, camera.covariance)
    second = part_slots(setup, 1)
    if has_bar and (bar.sigmas > 0).any():
        knowledge.free[second] = bar.sigmas > 0
        sigmas = np.where(bar.sigmas > 0, bar.sigmas, 1.0)
        knowledge.shared[second, second] = np.diag(1 / sigmas**2)
    for name, body in known.items():
        if name in bodies:
            knowledge.bodies[bodies.index(name)] = np.linalg.inv(body.covariance)
    return knowledge


def _described(names: Sequence[str], unknown: int) -> str:
    """The name of a shared unknown."""
    camera, place = divmod(unknown, CAMERA_UNKNOWNS)
    if camera < len(names):
        return f"{(*_POSE_NAMES, *PARAMETERS)[place]} of camera {names[camera]}"
    return f"{_POSE_NAMES[(unknown - CAMERA_UNKNOWNS * len(names)) % 6]} of the bar"
