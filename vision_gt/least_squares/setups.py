"""Where cameras, bodies and parts are, what is seen of them, and how it depends on the former.

Cameras stand in a world, bodies lie in the world, parts lie on bodies, points lie on parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.optics.camera import project_with_jacobians
from vision_gt.optics.transforms import rotation_matrices, rotation_vectors, stacked
from vision_gt.patterns.board_views import BoardView

Ints = npt.NDArray[np.intp]

_ESTIMATED = 9
CAMERA_UNKNOWNS = 6 + _ESTIMATED
"""Of each camera: six of its pose, then nine intrinsic parameters."""


@dataclass(frozen=True)
class Views:
    """Points seen in images: n of them.

    Parameters
    ----------
    camera, body, part : (n,) array of int
        Who saw it, and what it belongs to.
    point : (n, 3) array
        Its coordinates on its part, metres.
    pixel : (n, 2) array
        Where it was seen.
    covariance : (n, 2, 2) array
        Of the pixel.
    """

    camera: Ints
    body: Ints
    part: Ints
    point: Array
    pixel: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.camera)

    def select(self, rows: npt.NDArray[np.generic]) -> "Views":
        """Some of the points."""
        return Views(
            self.camera[rows],
            self.body[rows],
            self.part[rows],
            self.point[rows],
            self.pixel[rows],
            self.covariance[rows],
        )


def as_views(
    views: Sequence[BoardView],
    cameras: Sequence[str],
    bodies: Sequence[str],
    factor: float = 1.0,
) -> Views:
    """All corners of all views, for the adjustment.

    Parameters
    ----------
    views : sequence of BoardView
        At least one.
    cameras, bodies : sequence of str
        Names in the order of the adjustment's stacks.
    factor : float
        On the stated standard deviations.
    """
    counts = [len(view.ids) for view in views]
    camera = [cameras.index(view.camera) for view in views]
    number = {name: i for i, name in enumerate(bodies)}
    sigmas = factor * np.concatenate([view.stated_sigmas for view in views])
    return Views(
        camera=np.repeat(camera, counts),
        body=np.repeat([number[view.body] for view in views], counts),
        part=np.repeat([view.part for view in views], counts),
        point=np.concatenate([view.points for view in views]),
        pixel=np.concatenate([view.pixels for view in views]),
        covariance=np.square(sigmas)[:, None, None] * np.eye(2),
    )


@dataclass(frozen=True)
class Setup:
    """Where everything is, as plain rotations and translations: quick to change.

    Parameters
    ----------
    R_camera, t_camera : (c, 3, 3) and (c, 3) arrays
        T_world_camera.
    intrinsics : (c, 9) or (c, 13) array
        Parameters of the cameras; the first nine are unknowns.
    R_body, t_body : (b, 3, 3) and (b, 3) arrays
        T_world_body.
    R_part, t_part : (p, 3, 3) and (p, 3) arrays
        T_body_part, the same on every body.
    """

    R_camera: Array
    t_camera: Array
    intrinsics: Array
    R_body: Array
    t_body: Array
    R_part: Array
    t_part: Array

    @classmethod
    def of(
        cls,
        T_world_camera: RigidTransform,
        intrinsics: Array,
        T_world_body: RigidTransform,
        T_body_part: RigidTransform,
    ) -> "Setup":
        """Of stacks of transforms."""
        (Rc, tc), (Rb, tb), (Rp, tp) = (
            (T.rotation.as_matrix(), np.asarray(T.translation))
            for T in (T_world_camera, T_world_body, T_body_part)
        )
        return cls(Rc, tc, np.asarray(intrinsics, dtype=float), Rb, tb, Rp, tp)

    @property
    def T_world_camera(self) -> RigidTransform:
        """Stack of the cameras."""
        return stacked(self.R_camera, self.t_camera)

    @property
    def T_world_body(self) -> RigidTransform:
        """Stack of the bodies."""
        return stacked(self.R_body, self.t_body)

    @property
    def T_body_part(self) -> RigidTransform:
        """Stack of the parts."""
        return stacked(self.R_part, self.t_part)

    @property
    def shared(self) -> int:
        """Number of unknowns that are not a body's: 15 of each camera, then 6 of each part."""
        return CAMERA_UNKNOWNS * len(self.R_camera) + 6 * len(self.R_part)

    def moved(self, shared: Array, bodies: Array) -> "Setup":
        """After changes (g,) of the shared unknowns and (b, 6) of the bodies."""
        c = len(self.R_camera)
        cameras = shared[: CAMERA_UNKNOWNS * c].reshape(c, CAMERA_UNKNOWNS)
        parts = shared[CAMERA_UNKNOWNS * c :].reshape(-1, 6)
        intrinsics = self.intrinsics.copy()
        intrinsics[:, :_ESTIMATED] += cameras[:, 6:]
        return Setup(
            rotation_matrices(cameras[:, 3:6]) @ self.R_camera,
            self.t_camera + cameras[:, :3],
            intrinsics,
            rotation_matrices(bodies[:, 3:]) @ self.R_body,
            self.t_body + bodies[:, :3],
            rotation_matrices(parts[:, 3:]) @ self.R_part,
            self.t_part + parts[:, :3],
        )

    def change_from(self, other: "Setup") -> tuple[Array, Array]:
        """Changes of the shared unknowns (g,) and the bodies (b, 6) that make it of another."""
        cameras = np.concatenate(
            [
                self.t_camera - other.t_camera,
                _turn(self.R_camera, other.R_camera),
                (self.intrinsics - other.intrinsics)[:, :_ESTIMATED],
            ],
            axis=1,
        )
        parts = np.concatenate(
            [self.t_part - other.t_part, _turn(self.R_part, other.R_part)], axis=1
        )
        bodies = np.concatenate(
            [self.t_body - other.t_body, _turn(self.R_body, other.R_body)], axis=1
        )
        return np.concatenate([cameras.ravel(), parts.ravel()]), bodies


def _turn(R: Array, reference: Array) -> Array:
    """(n, 3) rotation vectors from one stack of rotations to another."""
    return rotation_vectors(R @ np.swapaxes(reference, 1, 2))


def camera_slots(camera: int) -> slice:
    """Where a camera's 15 unknowns are among the shared ones."""
    return slice(CAMERA_UNKNOWNS * camera, CAMERA_UNKNOWNS * (camera + 1))


def part_slots(setup: Setup, part: int) -> slice:
    """Where a part's six unknowns are among the shared ones."""
    first = CAMERA_UNKNOWNS * len(setup.R_camera) + 6 * part
    return slice(first, first + 6)


def shared_slots(views: Views, cameras: int) -> Ints:
    """(n, 21) places among the shared unknowns of each view's camera and part."""
    return np.concatenate(
        [
            CAMERA_UNKNOWNS * views.camera[:, None] + np.arange(CAMERA_UNKNOWNS),
            CAMERA_UNKNOWNS * cameras + 6 * views.part[:, None] + np.arange(6),
        ],
        axis=1,
    )


@dataclass(frozen=True)
class Linearised:
    """Residuals of views and their derivatives, all made unit-variance.

    Parameters
    ----------
    residual : (n, 2) array
        Seen minus predicted; NaN where a point would be behind its camera.
    by_camera : (n, 2, 15) array
        Of the prediction, by the pose and parameters of the view's camera.
    by_part, by_body : (n, 2, 6) array
        By its part and its body.
    """

    residual: Array
    by_camera: Array
    by_part: Array
    by_body: Array


def linearised_at(views: Views, at: Setup, whitening: Array) -> Linearised:
    """Residuals of all views, and the derivatives of the predictions.

    Parameters
    ----------
    views : Views
        What was seen.
    at : Setup
        Where things are taken to be.
    whitening : (n, 2, 2) array
        From `whiten`.
    """
    R_body = at.R_body[views.body]
    turned_part = (at.R_part[views.part] @ views.point[..., None])[..., 0]
    on_body = turned_part + at.t_part[views.part]
    turned_body = (R_body @ on_body[..., None])[..., 0]
    in_world = turned_body + at.t_body[views.body]
    from_camera = in_world - at.t_camera[views.camera]
    to_camera = np.swapaxes(at.R_camera[views.camera], 1, 2)
    seen = (to_camera @ from_camera[..., None])[..., 0]
    pixel, by_point, by_intrinsics = project_with_jacobians(seen, at.intrinsics[views.camera])
    n = len(views.camera)
    by_world = whitening @ by_point @ to_camera
    by_camera, by_body, by_part = np.empty((n, 2, 15)), np.empty((n, 2, 6)), np.empty((n, 2, 6))
    # A turn by phi moves a point at r by phi x r, and a . (phi x r) = (r x a) . phi.
    np.negative(by_world, out=by_camera[..., :3])
    by_camera[..., 3:6] = -_turned_by(from_camera, by_world)
    by_camera[..., 6:] = whitening @ by_intrinsics
    by_body[..., :3] = by_world
    by_body[..., 3:] = _turned_by(turned_body, by_world)
    on_part = by_world @ R_body
    by_part[..., :3] = on_part
    by_part[..., 3:] = _turned_by(turned_part, on_part)
    residual = (whitening @ (views.pixel - pixel)[..., None])[..., 0]
    return Linearised(residual, by_camera, by_part, by_body)


def _turned_by(r: Array, rows: Array) -> Array:
    """(n, 2, 3) cross products of points r (n, 3) and rows a (n, 2, 3)."""
    x, y, z = r[:, None, 0], r[:, None, 1], r[:, None, 2]
    a, b, c = rows[..., 0], rows[..., 1], rows[..., 2]
    out = np.empty_like(rows)
    out[..., 0], out[..., 1], out[..., 2] = y * c - z * b, z * a - x * c, x * b - y * a
    return out


def whiten(covariance: Array) -> Array:
    """(n, 2, 2) matrices W with W cov W^T = 1."""
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    if not (a > 0).all() or not (a * c > b * b).all():
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    # The inverse of the Cholesky factor, written out.
    first = 1 / np.sqrt(a)
    second = 1 / np.sqrt(c - b * b / a)
    matrices = np.zeros_like(covariance)
    matrices[:, 0, 0], matrices[:, 1, 1] = first, second
    matrices[:, 1, 0] = -b / a * second
    return matrices
