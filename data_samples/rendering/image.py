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

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera, distortion_jacobians, project, undistort

Image = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]

_RAYS = 32
_REACH = 4.0
"""Pixels by which a thing's region is enlarged for blur."""
_ROW = 1024
"""Width of the array that OpenCV maps in one call; its sides must stay below 32,768."""


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
    rays : int
        Rays of each pixel near an edge: a power of two.
    """

    blur: float = 0.7
    noise: float = 2.0
    falloff: float = 0.25
    gradient: tuple[float, float] = (0.0, 0.0)
    black: float = 30.0
    white: float = 205.0
    rays: int = _RAYS


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
    return np.asarray(directions, dtype=np.float32), np.asarray(by_pixel, dtype=np.float32)


def _camera_rays(camera: Camera) -> tuple[Floats, Floats]:
    return _rays(camera.size, tuple(float(v) for v in camera.parameters))


def _background(camera: Camera, T_world_camera: RigidTransform, scene: Scene) -> Floats:
    """Reflectance (h, w) of the stained floor, the same stains from wherever it is seen."""
    if not scene.texture:
        return np.full(camera.size[::-1], scene.floor, dtype=np.float32)
    seen = _seen_stains(camera, T_world_camera.as_matrix().tobytes())
    return np.asarray(scene.floor + scene.texture * seen, dtype=np.float32)


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
    return np.asarray(np.nan_to_num(seen), dtype=np.float32)


@lru_cache(maxsize=1)
def _stains() -> Floats:
    """A periodic (512, 512) texture of unit standard deviation, coarse and fine."""
    rng = np.random.default_rng(3)
    total = np.zeros((512, 512))
    for scale in (1.5, 4.0, 12.0):
        noise = rng.standard_normal((512, 512))
        blurred = cv2.GaussianBlur(np.tile(noise, (3, 3)), (0, 0), scale)[512:1024, 512:1024]
        total += blurred / blurred.std()
    return np.asarray(total / total.std(), dtype=np.float32)


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
    scale = np.diag([1 / sheet.cell[0], 1 / sheet.cell[1], 1.0])
    start, end = scale @ homography, scale @ moved
    value = _mean_of_rays(layers, (start, start), part.reshape(-1, 2), None, np.zeros((1, 3)))
    value = value.reshape(*part.shape[:2], 2)
    busy = _busy(value) if motion is None else np.ones(value.shape[:2], dtype=bool)
    busy &= ~np.isnan(part[..., 0])
    if busy.any():
        offsets = ray_offsets(optics.blur, optics.rays)
        value[busy] = _mean_of_rays(layers, (start, end), part[busy], slope[busy], offsets)
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


def _mean_of_rays(
    layers: Floats,
    homographies: tuple[Array, Array],
    rays: Floats,
    slopes: Floats | None,
    offsets: Array,
) -> Floats:
    """(n, 2) mean of the layers over the rays of each pixel.

    Parameters
    ----------
    layers : (rows, columns, 2) array
        What is looked up; 0 outside of it.
    homographies : (3, 3) arrays
        From ray directions to cells, as the shutter opens and closes.
    rays : (n, 2) array
        Of the pixels' centres.
    slopes : (n, 2, 2) array or None
        Change of the ray by the pixel.
    offsets : (k, 3) array
        From `ray_offsets`.
    """
    n = len(rays)
    padded = -(-n // _ROW) * _ROW
    start, end = (h.astype(np.float32) for h in homographies)
    # Homogeneous cell coordinates are linear in the offset: the parts are made once.
    base = start[:, :2] @ _padded(rays, padded).T + start[:, 2:]
    parts = []
    if slopes is not None:
        parts = [start[:, :2] @ _padded(slopes[:, :, axis], padded).T for axis in (0, 1)]
    if start is not end and not np.array_equal(start, end):
        parts.append((end - start)[:, :2] @ _padded(rays, padded).T + (end - start)[:, 2:])
    total = np.zeros((padded // _ROW, _ROW, 2), dtype=np.float32)
    point = np.empty_like(base)
    for offset in offsets.astype(np.float32):
        np.copyto(point, base)
        for share, part in zip(offset, parts, strict=False):
            point += share * part
        # The last coordinate is one over the depth: not positive behind the camera.
        with np.errstate(all="ignore"):
            depth = np.where(point[2] > 0, 1 / point[2], np.float32(0))
        maps = [point[i] * depth - np.float32(0.5) for i in (0, 1)]
        maps[0][depth == 0] = -9
        total += cv2.remap(
            layers,
            np.clip(np.nan_to_num(maps[0], nan=-9), -9, 9999).reshape(-1, _ROW),
            np.clip(np.nan_to_num(maps[1], nan=-9), -9, 9999).reshape(-1, _ROW),
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(0, 0),
        )
    return np.asarray(total.reshape(-1, 2)[:n] / np.float32(len(offsets)), dtype=np.float32)


def _padded(values: Floats, length: int) -> Floats:
    """(length, 2) the values, then zeros."""
    out = np.zeros((length, values.shape[1]), dtype=np.float32)
    out[: len(values)] = values
    return out


def _busy(value: Floats) -> npt.NDArray[np.bool_]:
    """Pixels within reach of an edge: elsewhere one ray is as good as many."""
    size = 2 * int(_REACH) - 1
    kernel = np.ones((size, size), dtype=np.uint8)
    busy = np.zeros(value.shape[:2], dtype=bool)
    for channel in (0, 1):
        layer = np.ascontiguousarray(value[..., channel])
        busy |= cv2.dilate(layer, kernel) != cv2.erode(layer, kernel)
    return busy


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
    return np.asarray(1 + (blade.strength - 1) * inside, dtype=np.float32)
