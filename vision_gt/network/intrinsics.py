"""The intrinsic parameters of one camera from images of a board, and how good the images are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array
from vision_gt.least_squares.adjustment import Adjustment, Knowledge, adjust, robust_m0
from vision_gt.least_squares.setups import CAMERA_UNKNOWNS, Setup, as_views
from vision_gt.optics.camera import PARAMETERS, Camera, undistort
from vision_gt.optics.lenses import LensName, fisheye_parameters, rational_parameters
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

GRID = (8, 6)
"""Cells of the coverage report, across and down the image."""
_LEAST_IMAGES, _LEAST_CORNERS = 4, 8
"""Three images determine a camera without distortion (Zhang, PAMI 22, 2000), so four leave one to
spare. Boards with fewer corners are not taken for found, see `vision_gt.images.boards`."""
_OUTLIER = 3.0
"""An image whose residuals are so many times the median image's is left out. A judgement: with 50
corners and equal noise images differ by a tenth."""
_NOISIER = 1.5
"""Times the stated noise from which on the corners are weighted by what their residuals show: the
robust loss is linear from four times the stated noise on, and bends little below this."""
_LEAST_FOR_LENSES, _FOLDS = 8, 4
"""Images from which on other lenses are tried, and parts of them that are held out in turn."""
_CURVE, _INSIDE = 60, 0.9
"""Places along half an image's width, and how much of it they cover, at which two lenses agree."""
_BETTER = 0.9
"""Of the error with Brown's lens on images held out, that another one must have at most."""
_LEAST_OUTLIER = 0.15
"""Pixels; below this no image is an outlier. A judgement: so good are corners of sharp images."""


@dataclass(frozen=True)
class Coverage:
    """Where the board was shown.

    Parameters
    ----------
    counts : (6, 8) array of int
        Corners in each cell of the image.
    distances : (n,) array
        Of the boards' middles from the camera, metres.
    tilts : (n,) array
        Between the boards' normals and the lines of sight, radians.
    """

    counts: npt.NDArray[np.intp]
    distances: Array
    tilts: Array

    @property
    def share(self) -> float:
        """Share of the image's cells that hold corners."""
        return float((self.counts > 0).mean())


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera with what speaks for and against it.

    Parameters
    ----------
    camera : Camera
        With the covariance of its parameters.
    sigma : float
        Of a corner's coordinate as the residuals show it, pixels.
    views : tuple of BoardView
        Images used.
    residuals : tuple of (n, 2) array
        Of each, pixels.
    outliers : tuple of str
        Images left out: their residuals are too large, or they show too few corners.
    coverage : Coverage
        Of the images used.
    held_out : mapping of str to float
        Root mean square residual, pixels, of images that took no part in the fit of a lens; empty
        where Brown's lens leaves no more than the stated noise, or is the only one that fits.
    """

    camera: Camera
    sigma: float
    views: tuple[BoardView, ...]
    residuals: tuple[Array, ...]
    outliers: tuple[str, ...]
    coverage: Coverage
    held_out: Mapping[LensName, float] = field(default_factory=dict)

    @property
    def image_rms(self) -> Array:
        """(n,) root mean square length of the residuals of each image, pixels."""
        return np.array([np.sqrt((r**2).sum(1).mean()) for r in self.residuals])

    @property
    def rms(self) -> float:
        """Root mean square length of all residuals, pixels, as OpenCV states it."""
        whole = np.concatenate(self.residuals)
        return float(np.sqrt((whole**2).sum(1).mean()))


def lens_words(found: Calibration) -> str:
    """Which lens was taken, and by how much it is better on images that took no part."""
    lens = {"brown": "Brown's", "rational": "rational", "fisheye": "Kannala-Brandt fisheye"}
    said = f"Lens: {lens[found.camera.lens]}."
    if found.held_out:
        errors = ", ".join(f"{lens[one]} {rms:.3f} px" for one, rms in found.held_out.items())
        said += f" On images held out: {errors}."
    return said


@kept_result()
def calibrate(name: str, size: tuple[int, int], views: Sequence[BoardView]) -> Calibration:
    """A camera's intrinsic parameters.

    Parameters
    ----------
    name : str
        Of the camera.
    size : (int, int)
        Width and height of its images.
    views : sequence of BoardView
        At least four, of a board in different places.

    Raises
    ------
    GtvalError
        If there are too few images, or they do not determine the parameters.

    Notes
    -----
    AD2.3, "Single camera calibration": Bouguet's toolbox. Here OpenCV's version of it starts
    the adjustment, which takes the noise from the residuals and leaves outlier images out.
    """
    usable = [view for view in views if len(view.ids) >= _LEAST_CORNERS]
    if len(usable) < _LEAST_IMAGES:
        raise GtvalError(
            f"camera {name}: only {len(usable)} images show the board; at least {_LEAST_IMAGES} "
            "are needed, and 12 or more in all parts of the image are better"
        )
    found = _with_best_lens(name, size, usable)
    limit = max(_OUTLIER * float(np.median(found.image_rms)), _LEAST_OUTLIER)
    kept = [view for view, rms in zip(usable, found.image_rms, strict=True) if rms <= limit]
    if _LEAST_IMAGES <= len(kept) < len(usable):
        again = _fitted(_start(name, size, kept, found.camera.lens), kept)
        found = replace(again, held_out=found.held_out)
    left = tuple(v.source or v.body for v in views if all(v is not one for one in found.views))
    return replace(found, outliers=left)


def _with_best_lens(name: str, size: tuple[int, int], views: Sequence[BoardView]) -> Calibration:
    """The calibration with the lens that foretells images best that took no part in its fit.

    Others than Brown's are tried where that one leaves more than the stated noise, or fits nothing,
    and taken where their error is smaller by a tenth: with 50 corners and equal noise images differ
    by as much.
    """
    brown: Calibration | GtvalError
    try:
        brown = _fitted(_start(name, size, views), views)
    except GtvalError as error:
        brown = error
    found = _tried(brown, name, size, views)
    if isinstance(found, GtvalError):
        raise found
    return found


def _tried(
    brown: Calibration | GtvalError, name: str, size: tuple[int, int], views: Sequence[BoardView]
) -> Calibration | GtvalError:
    """The calibration with Brown's lens, or with another one that is better."""
    stated = float(np.median(np.concatenate([view.stated_sigmas for view in views])))
    enough = not isinstance(brown, GtvalError) and brown.sigma < _NOISIER * stated
    if enough or len(views) < _LEAST_FOR_LENSES:
        return brown
    errors: dict[LensName, float] = {}
    lenses: tuple[LensName, ...] = ("brown", "rational", "fisheye")
    for lens in lenses:
        squares = []
        try:
            for fold in range(_FOLDS):
                held = views[fold::_FOLDS]
                rest = [v for i, v in enumerate(views) if i % _FOLDS != fold]
                camera = _fitted(_start(name, size, rest, lens), rest).camera
                squares += [_foretold(view, camera) ** 2 for view in held]
        except (GtvalError, cv2.error, np.linalg.LinAlgError):
            continue
        errors[lens] = float(np.sqrt(np.mean(squares)))
    if not set(errors) - {"brown"}:
        return brown
    best = min(errors, key=lambda lens: errors[lens])
    if errors[best] > _BETTER * errors.get("brown", np.inf):
        best = "brown"
    if best == "brown":
        return brown if isinstance(brown, GtvalError) else replace(brown, held_out=errors)
    try:
        return replace(_fitted(_start(name, size, views, best), views), held_out=errors)
    except (GtvalError, cv2.error, np.linalg.LinAlgError):
        return brown


def _foretold(view: BoardView, camera: Camera) -> float:
    """Root mean square residual of a board by a lens, its pose fitted; infinite without one."""
    found = planar_solutions(view.points, view.pixels, camera.parameters)
    return np.inf if found is None else float(found.errors[0])


def _start(
    name: str, size: tuple[int, int], views: Sequence[BoardView], lens: LensName = "brown"
) -> Camera:
    """OpenCV's calibration, in one thread: several add up in an order that changes."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    points = [view.points.astype(np.float32) for view in views]
    pixels = [view.pixels.astype(np.float32)[:, None] for view in views]
    try:
        if lens == "fisheye":
            return Camera(name, size, _fisheye_start(size, points, pixels))
        flags, coefficients = 0, np.zeros(5)
        K: npt.NDArray[Any] = np.eye(3)
        if lens == "rational":
            # From nothing it ends in a lens that no camera has.
            near = _fisheye_start(size, points, pixels)
            K, coefficients = Camera(name, size, near).matrix, _as_rational(near, size)
            flags = cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_USE_INTRINSIC_GUESS
        _rms, K, found, _r, _t = cv2.calibrateCamera(
            points, pixels, size, K, coefficients, flags=flags
        )
    except cv2.error:
        raise GtvalError(
            f"camera {name}: the images of the board do not determine its parameters; show it "
            "tilted, near and far, and in all parts of the image"
        ) from None
    finally:
        cv2.setNumThreads(threads)
    focal = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], dtype=float)
    if lens == "rational":
        coefficients = np.asarray(np.ravel(found)[:8], dtype=float)
        return Camera(name, size, rational_parameters(focal, coefficients))
    return Camera(name, size, np.concatenate([focal, np.ravel(found)[:5]]))


def _as_rational(fisheye: Array, size: tuple[int, int]) -> Array:
    """(8,) coefficients of the rational lens that is most like a fisheye lens inside an image."""
    rim = np.stack([np.linspace(0, size[0] / 2, _CURVE), np.zeros(_CURVE)], 1) * _INSIDE
    r = undistort(rim + fisheye[2:4], fisheye)[:, 0]
    r, s = r[1:], rim[1:, 0] / fisheye[0] / r[1:]
    fine = np.isfinite(s)
    powers = np.stack([r**2, r**4, r**6], 1)[fine]
    # (1 + k1 r^2 + ...) - s (k4 r^2 + ...) = s is linear; far points, where s is small, count less.
    rows = np.concatenate([powers, -s[fine, None] * powers], 1) / (1 + powers[:, 2:])
    found = np.linalg.lstsq(rows, (s[fine] - 1) / (1 + powers[:, 2]), rcond=1e-9)[0]
    k1, k2, k3, k4, k5, k6 = found.tolist()
    return np.array([k1, k2, 0.0, 0.0, k3, k4, k5, k6])


def _fisheye_start(size: tuple[int, int], points: list[Any], pixels: list[Any]) -> Array:
    """(13,) parameters of a fisheye lens by OpenCV, from a focal length that fits the image."""
    width, height = size
    first = max(size) / np.pi
    K = np.array([[first, 0, (width - 1) / 2], [0, first, (height - 1) / 2], [0, 0, 1]])
    # OpenCV 4 has these in its fisheye module, 5 beside those of other lenses.
    holder = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2
    wanted = ("CALIB_USE_INTRINSIC_GUESS", "CALIB_RECOMPUTE_EXTRINSIC", "CALIB_FIX_SKEW")
    flags = sum(int(getattr(holder, one)) for one in wanted)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-9)
    _rms, K, found, _r, _t = cv2.fisheye.calibrate(
        [one.reshape(1, -1, 3).astype(np.float64) for one in points],
        [one.reshape(1, -1, 2).astype(np.float64) for one in pixels],
        size,
        K,
        np.zeros(4),
        flags=flags,
        criteria=stop,
    )
    focal = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], dtype=float)
    return fisheye_parameters(focal, np.asarray(np.ravel(found)[:4], dtype=float))


def _fitted(start: Camera, views: Sequence[BoardView]) -> Calibration:
    """The adjustment, with the noise that its residuals show."""
    bodies = [f"{number}" for number in range(len(views))]
    own = [replace(v, body=b, part=0) for b, v in zip(bodies, views, strict=True)]
    poses = [camera_pose_of_board(view, start) for view in own]
    if any(T is None for T in poses):
        raise GtvalError(f"camera {start.name}: the calibration failed; check the board's size")
    setup = Setup.of(
        RigidTransform.concatenate([RigidTransform.identity()]),
        start.parameters[None],
        RigidTransform.concatenate([T for T in poses if T is not None]),
        RigidTransform.concatenate([RigidTransform.identity()]),
    )
    knowledge = Knowledge.nothing(setup)
    knowledge.free[6:CAMERA_UNKNOWNS] = start.estimated
    corners = as_views(own, [start.name], bodies)
    done = adjust(corners, setup, knowledge, describe=lambda i: _named(i, start.name))
    larger = robust_m0(done)
    if larger > _NOISIER:  # by the stated noise the loss holds back most corners
        corners = as_views(own, [start.name], bodies, larger)
        done = adjust(corners, setup, knowledge, describe=lambda i: _named(i, start.name))
    else:
        larger = 1.0
    factor = larger * done.m0
    camera = Camera(
        start.name,
        start.size,
        done.setup.intrinsics[0],
        done.m0**2 * done.covariance[6:CAMERA_UNKNOWNS, 6:CAMERA_UNKNOWNS],
    )
    ends = np.cumsum([len(view.ids) for view in own])[:-1]
    sigmas = np.concatenate([view.stated_sigmas for view in own])
    residuals = tuple(np.split(larger * sigmas[:, None] * done.residuals, ends))
    return Calibration(
        camera,
        factor * float(np.median(sigmas)),
        tuple(views),
        residuals,
        (),
        _coverage(start.size, views, done),
    )


def _named(unknown: int, name: str) -> str:
    return f"{PARAMETERS[(unknown - 6) % 9]} of camera {name}"


def _coverage(size: tuple[int, int], views: Sequence[BoardView], done: Adjustment) -> Coverage:
    pixels = np.concatenate([view.pixels for view in views])
    across, down = GRID
    counts, _, _ = np.histogram2d(
        pixels[:, 1],
        pixels[:, 0],
        bins=(down, across),
        range=((-0.5, size[1] - 0.5), (-0.5, size[0] - 0.5)),
    )
    T = done.setup.T_world_body
    middles = np.array([T[i].apply(view.board.corners.mean(0)) for i, view in enumerate(views)])
    distances = np.linalg.norm(middles, axis=1)
    normals = T.rotation.as_matrix()[:, :, 2]
    cosine = (normals * middles).sum(1) / distances
    return Coverage(counts.astype(np.intp), distances, np.arccos(np.clip(cosine, -1, 1)))
