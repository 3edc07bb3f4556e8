"""Photographs of flat, patterned things, taken through the full camera model.

Each pixel is the mean of rays spread over its area, over the blur of the lens and over the time
that the shutter is open, so edges are where they should be to a small part of a pixel; then come
the falloff of the light, sun-blades, noise and the eight bits of the file.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform
from scipy.stats import norm, qmc

from validation.angles import Array
from vision_gt.camera import Camera, distortion_jacobians, project, undistort

Image = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]

_RAYS = 64
_REACH = 4.0
"""Pixels by which a thing's region is enlarged for blur."""
_ROW = 4096


@dataclass(frozen=True)
class Sheet:
    """A flat thing with a pattern of square cells of one grey each.

    Parameters
    ----------
    cells : (rows, columns) array
        Reflectance of each cell, 0 to 1; NaN where there is nothing.
    cell : (float, float)
        Width and height of a cell, metres.
    T_world_sheet : RigidTransform
        The outer corner of cell (0, 0) is the origin, x runs along the rows, y along the
        columns. The printed side is seen from where x runs right and y runs down, which is
        from -z.
    two_sided : bool
        Whether the back looks like the front, seen through.
    """

    cells: Array
    cell: tuple[float, float]
    T_world_sheet: RigidTransform
    two_sided: bool = False

    @property
    def corners(self) -> Array:
        """(4, 3) corners in the world, around the sheet."""
        rows, columns = self.cells.shape
        x, y = columns * self.cell[0], rows * self.cell[1]
        flat = np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]], dtype=float)
        return np.asarray(self.T_world_sheet.apply(flat))


@dataclass(frozen=True)
class Optics:
    """Lens, light and sensor.

    Parameters
    ----------
    blur : float
        Standard deviation of the lens blur, pixels.
    noise : float
        Standard deviation of the sensor noise, grey levels.
    falloff : float
        Share of the light that is lost in the corners of the image (vignetting).
    gradient : (float, float)
        Uneven light: change of brightness across the image's width and height, as a share.
    black, white : float
        Grey levels of reflectance 0 and 1 in full light.
    """

    blur: float = 0.7
    noise: float = 2.0
    falloff: float = 0.25
    gradient: tuple[float, float] = (0.0, 0.0)
    black: float = 30.0
    white: float = 205.0


@dataclass(frozen=True)
class SunBlade:
    """A stripe of sunlight over the image, so bright that the sensor saturates.

    Parameters
    ----------
    point : (float, float)
        A pixel on its middle.
    direction : float
        Of the stripe, radians from the image's x axis.
    width : float
        Pixels.
    strength : float
        Factor on the light inside it.
    """

    point: tuple[float, float]
    direction: float
    width: float
    strength: float = 6.0


@dataclass(frozen=True)
class Scene:
    """What a camera looks at.

    Parameters
    ----------
    sheets : sequence of Sheet
        Painted in this order, so the nearest come last.
    floor : float
        Reflectance of all that no sheet covers.
    texture : float
        Standard deviation of the floor's stains, as reflectance.
    blades : sequence of SunBlade
        In the image.
    """

    sheets: Sequence[Sheet]
    floor: float = 0.45
    texture: float = 0.03
    blades: Sequence[SunBlade] = field(default_factory=tuple)


def render(
    camera: Camera,
    T_world_camera: RigidTransform,
    scene: Scene,
    optics: Optics,
    rng: np.random.Generator,
    motion: RigidTransform | None = None,
) -> Image:
    """The photograph (height, width), 8-bit grey.

    Parameters
    ----------
    camera : Camera
        Its size and intrinsic parameters.
    T_world_camera : RigidTransform
        Where it is.
    scene, optics : Scene, Optics
        What it sees, and how.
    rng : numpy.random.Generator
        Source of the noise.
    motion : RigidTransform, optional
        Movement of the sheets while the shutter is open, in the world: motion blur.
    """
    reflectance = _background(camera, T_world_camera, scene)
    for sheet in scene.sheets:
        _paint(reflectance, camera, T_world_camera, sheet, optics, motion)
    return _develop(reflectance, camera, scene, optics, rng)


def ray_offsets(blur: float, count: int = _RAYS) -> Array:
    """(count, 3) pixels to the right and down of a pixel's centre, and shutter times 0 to 1.

    The offsets are spread like the sum of a pixel's area and a normal blur, and are symmetric
    about the centre, so that no edge is shifted.
    """
    half = qmc.Sobol(5, seed=7).random(count // 2)
    area, lens = half[:, :2] - 0.5, blur * norm.ppf(np.clip(half[:, 2:4], 1e-3, 1 - 1e-3))
    offsets = np.column_stack([area + lens, half[:, 4] / 2])
    mirrored = np.column_stack([-offsets[:, :2], 1 - offsets[:, 2]])
    return np.concatenate([offsets, mirrored])


@lru_cache(maxsize=8)
def _rays(size: tuple[int, int], parameters: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Undistorted directions (h, w, 2) of all pixels and their slopes (h, w, 2, 2) by the pixel.

    Where the lens model has no inverse the nearest direction that has one is not known; such
    pixels see nothing (NaN).
    """
    width, height = size
    values = np.array(parameters)
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
    directions = undistort(pixels, values)
    slope, _by = distortion_jacobians(directions, values[4:])
    by_pixel = np.linalg.inv(np.where(np.isnan(slope), np.eye(2), slope)) / values[:2]
    return np.float32(directions), np.float32(by_pixel)


def _camera_rays(camera: Camera) -> tuple[Floats, Floats]:
    return _rays(camera.size, tuple(float(v) for v in camera.parameters))


def _background(camera: Camera, T_world_camera: RigidTransform, scene: Scene) -> Floats:
    """Reflectance (h, w) of the stained floor, the same stains from wherever it is seen."""
    if not scene.texture:
        return np.full(camera.size[::-1], scene.floor, dtype=np.float32)
    seen = _seen_stains(camera, T_world_camera.as_matrix().tobytes())
    return np.float32(scene.floor) + np.float32(scene.texture) * seen


def _seen_stains(camera: Camera, pose: bytes) -> Floats:
    """The stains (h, w) on the floor z = 0; kept, as fixed cameras look at them many times."""
    return _stains_from(camera.size, tuple(float(v) for v in camera.parameters), pose)


@lru_cache(maxsize=6)
def _stains_from(size: tuple[int, int], parameters: tuple[float, ...], pose: bytes) -> Floats:
    directions, _ = _rays(size, parameters)
    T_world_camera = np.frombuffer(pose).reshape(4, 4)
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    rays = directions @ R[:, :2].T.astype(np.float32) + R[:, 2].astype(np.float32)
    with np.errstate(all="ignore"):
        along = np.where(rays[..., 2] < -0.02, -t[2] / rays[..., 2], np.float32(50.0))
    x, y = t[0] + along * rays[..., 0], t[1] + along * rays[..., 1]
    stains = _stains()
    seen = cv2.remap(
        stains,
        ((x * 25) % (len(stains) - 1)).astype(np.float32),
        ((y * 25) % (len(stains) - 1)).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_WRAP,
    )
    return np.float32(np.nan_to_num(seen))


@lru_cache(maxsize=1)
def _stains() -> Floats:
    """A periodic (512, 512) texture of unit standard deviation, coarse and fine."""
    rng = np.random.default_rng(3)
    total = np.zeros((512, 512))
    for scale in (1.5, 4.0, 12.0):
        noise = rng.standard_normal((512, 512))
        blurred = cv2.GaussianBlur(np.tile(noise, (3, 3)), (0, 0), scale)[512:1024, 512:1024]
        total += blurred / blurred.std()
    return (total / total.std()).astype(np.float32)


def _paint(
    reflectance: Floats,
    camera: Camera,
    T_world_camera: RigidTransform,
    sheet: Sheet,
    optics: Optics,
    motion: RigidTransform | None,
) -> None:
    """Lay a sheet over what is already in the image, in place."""
    homography = _sheet_of_ray(T_world_camera, sheet.T_world_sheet)
    if homography is None or not (sheet.two_sided or _faces(T_world_camera, sheet)):
        return
    moved = _sheet_of_ray(T_world_camera, motion * sheet.T_world_sheet) if motion else homography
    if moved is None:
        return
    region = _region(camera, T_world_camera, sheet, motion)
    if region is None:
        return
    rows, columns = region
    directions, slopes = _camera_rays(camera)
    part, slope = directions[rows, columns], slopes[rows, columns]
    layers = _layers(sheet)
    value = _lookup(layers, sheet, homography, part)
    busy = _busy(value) if motion is None else np.ones(value.shape[:2], dtype=bool)
    busy &= ~np.isnan(part[..., 0])
    value[busy] = _mean_of_rays(
        layers, sheet, (homography, moved), part[busy], slope[busy], ray_offsets(optics.blur)
    )
    image = reflectance[rows, columns]
    image *= 1 - value[..., 1]
    image += value[..., 0]


def _sheet_of_ray(T_world_camera: RigidTransform, T_world_sheet: RigidTransform) -> Array | None:
    """(3, 3) homography from ray directions (x, y, 1) to the sheet's plane; None if edge-on."""
    T = (T_world_camera.inv() * T_world_sheet).as_matrix()
    plane = T[:3, [0, 1, 3]]
    if abs(np.linalg.det(plane)) < 1e-9:
        return None
    return np.asarray(np.linalg.inv(plane))


def _faces(T_world_camera: RigidTransform, sheet: Sheet) -> bool:
    """Whether the camera is on the printed side."""
    eye = sheet.T_world_sheet.inv().apply(T_world_camera.translation)
    return bool(eye[2] < 0)


def _region(
    camera: Camera, T_world_camera: RigidTransform, sheet: Sheet, motion: RigidTransform | None
) -> tuple[slice, slice] | None:
    """Rows and columns that the sheet may touch; None if it is not in the image."""
    outline = sheet.corners
    if motion is not None:
        outline = np.concatenate([outline, motion.apply(outline)])
    ends = np.roll(outline, -1, axis=0)
    along = np.linspace(0, 1, 9)[:, None, None]
    points = T_world_camera.inv().apply((outline + along * (ends - outline)).reshape(-1, 3))
    if (points[:, 2] < 0.05).any():
        return None
    # The radial polynomial folds back far outside of the image: only the plain pinhole tells
    # whether a point is there at all.
    pinhole = camera.parameters.copy()
    pinhole[4:] = 0
    straight = project(points, pinhole)
    width, height = camera.size
    near = (np.abs(straight - [width / 2, height / 2]) < 1.2 * np.array([width, height])).all(1)
    if not near.any():
        return None
    pixels = project(points[near], camera.parameters)
    low = np.floor(pixels.min(0) - _REACH).astype(int)
    high = np.ceil(pixels.max(0) + _REACH).astype(int) + 1
    if not near.all():  # partly far outside: all that is on that side
        low, high = np.zeros(2, dtype=int), np.array([width, height])
    x0, y0 = np.maximum(low, 0)
    x1, y1 = np.minimum(high, [width, height])
    if x0 >= x1 or y0 >= y1:
        return None
    return slice(int(y0), int(y1)), slice(int(x0), int(x1))


def _layers(sheet: Sheet) -> Floats:
    """(rows, columns, 2) reflectance times cover, and cover."""
    cover = ~np.isnan(sheet.cells)
    return np.stack([np.where(cover, sheet.cells, 0.0), cover], -1).astype(np.float32)


def _lookup(layers: Floats, sheet: Sheet, homography: Array, rays: Floats) -> Floats:
    """(..., 2) the layers where rays (..., 2) meet the sheet's plane; 0 outside of it."""
    h = homography.astype(np.float32)
    x, y = rays[..., 0], rays[..., 1]
    with np.errstate(all="ignore"):
        w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
        # w = 1 / depth of the meeting point: not positive behind the camera.
        w = np.where(w > 0, w, np.float32(np.nan))
        u = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / (w * np.float32(sheet.cell[0])) - 0.5
        v = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / (w * np.float32(sheet.cell[1])) - 0.5
    u, v = (np.nan_to_num(c, nan=-9.0, posinf=-9.0, neginf=-9.0) for c in (u, v))
    shape = u.shape
    padded = -(-u.size // _ROW) * _ROW
    maps = [np.full(padded, -9.0, dtype=np.float32) for _ in (u, v)]
    for target, source in zip(maps, (u, v), strict=True):
        target[: u.size] = np.clip(source, -9, 9999).ravel()
    found = cv2.remap(
        layers,
        maps[0].reshape(-1, _ROW),
        maps[1].reshape(-1, _ROW),
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(0, 0),
    )
    return np.asarray(found.reshape(-1, 2)[: u.size].reshape(*shape, 2), dtype=np.float32)


def _busy(value: Floats) -> npt.NDArray[np.bool_]:
    """Pixels within reach of an edge: elsewhere one ray is as good as many."""
    size = 2 * int(_REACH) - 1
    kernel = np.ones((size, size), dtype=np.uint8)
    busy = np.zeros(value.shape[:2], dtype=bool)
    for channel in (0, 1):
        layer = np.ascontiguousarray(value[..., channel])
        busy |= cv2.dilate(layer, kernel) != cv2.erode(layer, kernel)
    return busy


def _mean_of_rays(
    layers: Floats,
    sheet: Sheet,
    homographies: tuple[Array, Array],
    rays: Floats,
    slopes: Floats,
    offsets: Array,
) -> Floats:
    """(n, 2) mean of the layers over the rays of each pixel; rays (n, 2), slopes (n, 2, 2)."""
    total = np.zeros((len(rays), 2), dtype=np.float32)
    start, end = homographies
    for dx, dy, time in offsets:
        ray = rays + slopes[:, :, 0] * np.float32(dx) + slopes[:, :, 1] * np.float32(dy)
        homography = start if start is end else start + time * (end - start)
        total += _lookup(layers, sheet, homography, ray)
    return total / np.float32(len(offsets))


def _develop(
    reflectance: Floats, camera: Camera, scene: Scene, optics: Optics, rng: np.random.Generator
) -> Image:
    """Grey levels of reflectances (h, w)."""
    width, height = camera.size
    x = (np.arange(width, dtype=np.float32) - (width - 1) / 2) / (width / 2)
    y = (np.arange(height, dtype=np.float32) - (height - 1) / 2) / (height / 2)
    light = 1 - optics.falloff * (x**2 + y[:, None] ** 2) / 2
    light = light * (1 + optics.gradient[0] * x / 2 + optics.gradient[1] * y[:, None] / 2)
    for blade in scene.blades:
        light = light * _blade_light(blade, width, height)
    grey = light * (optics.black + (optics.white - optics.black) * reflectance)
    grey += optics.noise * rng.standard_normal(grey.shape, dtype=np.float32)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def _blade_light(blade: SunBlade, width: int, height: int) -> Floats:
    """Factor (h, w) on the light, with a soft border of about two pixels."""
    x = np.arange(width, dtype=np.float32)[None, :] - blade.point[0]
    y = np.arange(height, dtype=np.float32)[:, None] - blade.point[1]
    across = np.abs(-np.sin(blade.direction) * x + np.cos(blade.direction) * y)
    inside = 1 / (1 + np.exp(np.clip((across - blade.width / 2) / 0.7, -40, 40)))
    return (1 + (blade.strength - 1) * inside).astype(np.float32)
