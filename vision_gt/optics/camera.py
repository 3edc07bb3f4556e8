"""The camera model: from points in front of the lens to pixels, and back.

A pinhole with the lens distortion of Brown and Conrady, as OpenCV, ROS, Kalibr and Bouguet's
toolbox have it; with thirteen parameters instead of nine, one of the lenses of
`vision_gt.optics.lenses`. The centre of the top-left pixel is at (0, 0).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.optics.lenses import (
    COUNT,
    LensName,
    denominator,
    fisheye,
    is_fisheye,
    lens_of,
    thirteen,
    without_fisheye,
)

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
"""Names of the nine intrinsic parameters, in the order used everywhere."""

_BROWN = 5
"""Coefficients of Brown's lens."""
_NEWTON_STEPS = 20
_CONVERGED, _FOUND = 1e-12, 1e-9
"""Of undistorted coordinates: a thousandth of a millionth of a pixel ends the steps, as they double
the digits each; a millionth of a pixel off is still an answer, more is none."""


@dataclass(frozen=True)
class Camera:
    """A camera's name, image size and intrinsic parameters.

    Parameters
    ----------
    name : str
        As in campaign.toml and in the names of images.
    size : (int, int)
        Width and height of its images, pixels.
    parameters : (9,) or (13,) array
        fx, fy, cx, cy in pixels; k1, k2, p1, p2, k3 without unit; or as `vision_gt.optics.lenses`
        has them.
    covariance : (9, 9) array
        Of the first nine; zeros where they are taken as exact.

    Raises
    ------
    GtvalError
        For parameters that no camera can have.
    """

    name: str
    size: tuple[int, int]
    parameters: Array
    covariance: Array = field(default_factory=lambda: np.zeros((9, 9)))

    def __post_init__(self) -> None:
        parameters = np.asarray(self.parameters, dtype=float)
        covariance = np.asarray(self.covariance, dtype=float)
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "covariance", covariance)
        if parameters.shape == (COUNT,) and lens_of(parameters) == "brown":
            parameters = parameters[:9]
            object.__setattr__(self, "parameters", parameters)
        if parameters.shape not in {(9,), (COUNT,)} or not np.isfinite(parameters).all():
            raise GtvalError(f"camera {self.name}: expected nine finite intrinsic parameters")
        if covariance.shape != (9, 9):
            raise GtvalError(f"camera {self.name}: its covariance is {covariance.shape}")
        if (parameters[:2] <= 0).any() or min(self.size) <= 0:
            raise GtvalError(f"camera {self.name}: focal lengths and image size must be positive")

    @property
    def matrix(self) -> Array:
        """(3, 3) camera matrix."""
        fx, fy, cx, cy = self.parameters[:4]
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    @property
    def distortion(self) -> Array:
        """(5,) k1, k2, p1, p2, k3: the order of OpenCV; or k1 to k4 of a fisheye lens and 0."""
        return self.parameters[4:9]

    @property
    def lens(self) -> LensName:
        """Which model its lens has."""
        return lens_of(self.parameters)

    @property
    def named(self) -> dict[str, float]:
        """Its parameters by their names; k4 to k6 of a rational lens, which have no sigma, last."""
        found = {n: float(v) for n, v in zip(self.names, self.parameters, strict=False) if n}
        if self.lens == "rational":
            found |= dict(zip(("k4", "k5", "k6"), self.parameters[10:].tolist(), strict=True))
        return found

    @property
    def estimated(self) -> npt.NDArray[np.bool_]:
        """(9,) which of the parameters with a covariance the lens has."""
        return np.array([bool(name) for name in self.names])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters with a covariance, of nine places; '' for one without meaning."""
        if self.lens == "fisheye":
            return ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "")
        return PARAMETERS

    @property
    def sigmas(self) -> Array:
        """(9,) standard deviations of the parameters."""
        return np.sqrt(np.diagonal(self.covariance))


def stacked_parameters(cameras: Sequence[Camera]) -> Array:
    """(c, 9) parameters of cameras; (c, 13) where one has another lens than Brown's."""
    if all(camera.lens == "brown" for camera in cameras):
        return np.array([camera.parameters for camera in cameras])
    return np.array([thirteen(camera.parameters) for camera in cameras])


def project(points: Array, parameters: Array) -> Array:
    """Pixels at which points are seen.

    Parameters
    ----------
    points : (..., 3) array
        In the camera frame (x right, y down, z forward), metres.
    parameters : (..., 9 or 13) array
        Intrinsic parameters.

    Returns
    -------
    (..., 2) array
        Pixels, whether inside the image or not; NaN for points behind the camera.
    """
    points, parameters = np.asarray(points, dtype=float), np.asarray(parameters, dtype=float)
    z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    lens = distorted(points[..., :2] / z[..., None], parameters[..., 4:])
    return np.asarray(parameters[..., :2] * lens + parameters[..., 2:4])


def project_with_jacobians(points: Array, parameters: Array) -> tuple[Array, Array, Array]:
    """Pixels of points, with their derivatives.

    Parameters
    ----------
    points : (..., 3) array
        In the camera frame, metres.
    parameters : (..., 9 or 13) array
        Intrinsic parameters.

    Returns
    -------
    pixels : (..., 2) array
        NaN for points behind the camera.
    by_point : (..., 2, 3) array
        Derivative by the point, pixels per metre.
    by_parameters : (..., 2, 9) array
        Derivative by the first nine intrinsic parameters.
    """
    points = np.asarray(points, dtype=float)
    parameters = np.asarray(parameters, dtype=float)
    parameters = np.broadcast_to(parameters, (*points.shape[:-1], parameters.shape[-1]))
    z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    normalised = points[..., :2] / z[..., None]
    lens = distorted(normalised, parameters[..., 4:])
    by_normalised, by_coefficients = distortion_jacobians(normalised, parameters[..., 4:])
    focal, centre = parameters[..., :2], parameters[..., 2:4]
    pixels = focal * lens + centre
    # The derivative of x / z, y / z is the unit matrix beside -(x, y) / z, over z.
    by_point = np.empty((*points.shape[:-1], 2, 3))
    by_point[..., :2] = by_normalised
    by_point[..., 2] = -(by_normalised @ normalised[..., None])[..., 0]
    by_point *= (focal / z[..., None])[..., None]
    by_parameters = np.zeros((*points.shape[:-1], 2, 9))
    for axis in (0, 1):
        by_parameters[..., axis, axis] = lens[..., axis]
        by_parameters[..., axis, 2 + axis] = 1.0
    by_parameters[..., 4:] = focal[..., :, None] * by_coefficients
    return pixels, by_point, by_parameters


def distorted(normalised: Array, coefficients: Array) -> Array:
    """Where the lens puts undistorted image points.

    Parameters
    ----------
    normalised : (..., 2) array
        Undistorted image coordinates x / z, y / z.
    coefficients : (..., 5 or 9) array
        k1, k2, p1, p2, k3, and what other lenses have.

    Returns
    -------
    (..., 2) array
        Distorted coordinates x', y'.

    Notes
    -----
    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), and
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y.
    D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971).
    """
    x, y = normalised[..., 0], normalised[..., 1]
    k1, k2, p1, p2, k3 = _coefficients(coefficients)
    x2, y2 = x * x, y * y
    r2 = x2 + y2
    radial = _radial(r2, k1, k2, k3)
    if np.shape(coefficients)[-1] > _BROWN:
        radial = radial / denominator(r2, coefficients)[0]
    cross = 2 * x * y
    lens = np.empty((*r2.shape, 2))
    lens[..., 0] = x * radial + p1 * cross + p2 * (r2 + 2 * x2)
    lens[..., 1] = y * radial + p1 * (r2 + 2 * y2) + p2 * cross
    if np.shape(coefficients)[-1] > _BROWN and (wide := is_fisheye(coefficients)).any():
        return np.where(wide[..., None], fisheye(normalised, coefficients)[0], lens)
    return lens


def _radial(r2: Array, k1: Array, k2: Array, k3: Array) -> Array:
    """By how much the lens stretches points at squared distance r2 from the axis."""
    return 1 + r2 * (k1 + r2 * (k2 + r2 * k3))


def _coefficients(values: Array) -> list[Array]:
    """The five coefficients, each (...), of an array (..., 5)."""
    values = np.asarray(values, dtype=float)
    return [values[..., i] for i in range(5)]


def distortion_jacobians(normalised: Array, coefficients: Array) -> tuple[Array, Array]:
    """Derivatives of `distorted` by the image point (..., 2, 2) and the coefficients (..., 2, 5).

    Parameters
    ----------
    normalised : (..., 2) array
        Undistorted image coordinates x / z, y / z.
    coefficients : (..., 5 or 9) array
        k1, k2, p1, p2, k3, and what other lenses have.
    """
    x, y = normalised[..., 0], normalised[..., 1]
    r2, cross = x * x + y * y, 2 * x * y
    by_coefficients = np.empty((*r2.shape, 2, 5))
    for row, own in ((0, x), (1, y)):
        by_coefficients[..., row, 0] = own * r2
        by_coefficients[..., row, 1] = by_coefficients[..., row, 0] * r2
        by_coefficients[..., row, 2 + row] = cross
        by_coefficients[..., row, 3 - row] = r2 + 2 * own * own
        by_coefficients[..., row, 4] = by_coefficients[..., row, 1] * r2
    if np.shape(coefficients)[-1] > _BROWN:
        by_coefficients[..., [0, 1, 4]] /= denominator(r2, coefficients)[0][..., None, None]
        wide = is_fisheye(coefficients)
        if wide.any():
            own = fisheye(normalised, coefficients)[2]
            by_coefficients = np.where(wide[..., None, None], own, by_coefficients)
    return distortion_slopes(normalised, coefficients), by_coefficients


def distortion_slopes(normalised: Array, coefficients: Array) -> Array:
    """Derivative (..., 2, 2) of `distorted` by the image point.

    Parameters
    ----------
    normalised : (..., 2) array
        Undistorted image coordinates x / z, y / z.
    coefficients : (..., 5 or 9) array
        k1, k2, p1, p2, k3, and what other lenses have.
    """
    x, y = normalised[..., 0], normalised[..., 1]
    k1, k2, p1, p2, k3 = _coefficients(coefficients)
    x2, y2 = x * x, y * y
    r2 = x2 + y2
    radial = _radial(r2, k1, k2, k3)
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * k3 * r2))  # d radial / d(x, y) = slope * (x, y)
    if np.shape(coefficients)[-1] > _BROWN:
        below, steeper = denominator(r2, coefficients)
        slope = (slope - 2 * radial * steeper / below) / below
        radial = radial / below
    slopes = np.empty((*r2.shape, 2, 2))
    slopes[..., 0, 0] = radial + x2 * slope + 2 * p1 * y + 6 * p2 * x
    slopes[..., 0, 1] = slopes[..., 1, 0] = x * y * slope + 2 * (p1 * x + p2 * y)
    slopes[..., 1, 1] = radial + y2 * slope + 6 * p1 * y + 2 * p2 * x
    if np.shape(coefficients)[-1] > _BROWN and (wide := is_fisheye(coefficients)).any():
        return np.where(wide[..., None, None], fisheye(normalised, coefficients)[1], slopes)
    return slopes


def undistort(pixels: Array, parameters: Array) -> Array:
    """Directions from which pixels are lit, as undistorted image coordinates.

    Parameters
    ----------
    pixels : (..., 2) array
        Pixels.
    parameters : (..., 9 or 13) array
        Intrinsic parameters.

    Returns
    -------
    (..., 2) array
        x / z and y / z; NaN where the model has no inverse, which happens outside of the
        part of the image that calibration patterns have covered.
    """
    parameters = np.asarray(parameters, dtype=float)
    coefficients = parameters[..., 4:]
    wanted = (np.asarray(pixels, dtype=float) - parameters[..., 2:4]) / parameters[..., :2]
    if coefficients.shape[-1] > _BROWN and is_fisheye(coefficients).all():
        return without_fisheye(wanted, coefficients)
    found = wanted.copy()
    with np.errstate(all="ignore"):
        for step in range(_NEWTON_STEPS + 1):
            miss = wanted - distorted(found, coefficients)
            small = step and np.nanmax(np.abs(miss), initial=0.0) < _CONVERGED
            if small or step == _NEWTON_STEPS:
                break
            slope = distortion_slopes(found, coefficients)
            a, b, c, d = slope[..., 0, 0], slope[..., 0, 1], slope[..., 1, 0], slope[..., 1, 1]
            u, v = miss[..., 0], miss[..., 1]
            change = np.empty_like(found)
            change[..., 0], change[..., 1] = d * u - b * v, a * v - c * u
            found = found + change / (a * d - b * c)[..., None]
        a, b, c, d = slope[..., 0, 0], slope[..., 0, 1], slope[..., 1, 0], slope[..., 1, 1]
        bad = ~(np.abs(miss).max(-1) < _FOUND)
        # Beyond the turning point of the radial polynomial the model folds back on itself.
        bad |= ~((a * d - b * c > 0) & (a + d > 0))
    return np.where(bad[..., None], np.nan, found)


def inside_image(pixels: Array, size: tuple[int, int], margin: float = 0.0) -> Array:
    """(...) True for pixels (..., 2) inside an image, at least ``margin`` pixels from its rim."""
    width, height = size
    x, y = pixels[..., 0], pixels[..., 1]
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (x >= margin - 0.5)
            & (x <= width - 0.5 - margin)
            & (y >= margin - 0.5)
            & (y <= height - 0.5 - margin)
        )
