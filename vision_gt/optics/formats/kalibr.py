"""Camera files of Kalibr, of data sets that follow EuRoC, and of Basalt."""

import re
from typing import Any

import numpy as np

from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import (
    FISHEYE_LENSES,
    FOCAL,
    NO_LENS,
    OURS,
    PINHOLE_LENSES,
    bad,
    brown_or_rational,
    fisheye_camera,
    made,
    named_numbers,
    numbers,
    refuse_other_lens,
    whole,
)
from vision_gt.optics.formats.source import Source

_KB4 = ("k1", "k2", "k3", "k4")
_RADTAN8 = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def is_kalibr(source: Source) -> bool:
    """Whether a file is a chain of cameras of Kalibr."""
    root = source.root
    return any(re.fullmatch(r"cam\d+", key) and isinstance(root[key], dict) for key in root)


def read_kalibr(source: Source, name: str | None = None) -> list[Camera]:
    """The cameras of a chain, or the named one."""
    root = source.root
    named = sorted(
        (key for key in root if re.fullmatch(r"cam\d+", key)), key=lambda key: int(key[3:])
    )
    wanted = [field for field in named if name == field] or named
    return [_camera(source, field, root[field]) for field in wanted]


def is_euroc(source: Source) -> bool:
    """Whether a file is one camera by itself, as the data sets of EuRoC have it."""
    return "intrinsics" in source.root and "resolution" in source.root


def read_euroc(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of a sensor.yaml."""
    return [_camera(source, "", source.root)]


def _camera(source: Source, field: str, node: Any) -> Camera:
    path, within = source.path, f"{field}." if field else ""
    if not isinstance(node, dict):
        raise bad(path, "expected the parameters of a camera", field)
    refuse_other_lens(path, node, within)
    model, lens_model = node.get("camera_model"), str(node.get("distortion_model") or "").lower()
    if model != "pinhole":
        raise bad(path, "expected pinhole", f"{within}camera_model", str(model or ""))
    known = PINHOLE_LENSES | FISHEYE_LENSES
    if lens_model not in known | NO_LENS:
        wanted = " or ".join(sorted(known))
        raise bad(path, f"expected {wanted}", f"{within}distortion_model", lens_model)
    focal = numbers(path, node.get("intrinsics"), f"{within}intrinsics", (4,))
    pair = numbers(path, node.get("resolution"), f"{within}resolution", (2,))
    width, height = (whole(path, float(one), f"{within}resolution") for one in pair)
    name, size = field or path.stem, (width, height)
    if lens_model in NO_LENS:
        return made(path, name, size, np.concatenate([focal, np.zeros(5)]))
    key = "distortion_coeffs" if field else "distortion_coefficients"
    fisheye = lens_model in FISHEYE_LENSES
    values = numbers(path, node.get(key), within + key, (4,) if fisheye else (4, 5))
    if fisheye:
        return fisheye_camera(path, name, size, focal, values)
    return made(path, name, size, brown_or_rational(path, focal, values, within + key))


def is_basalt(source: Source) -> bool:
    """Whether a file is a calibration of Basalt: value0, with a list of cameras."""
    value = source.root.get("value0")
    return isinstance(value, dict) and isinstance(value.get("intrinsics"), list)


def read_basalt(source: Source, name: str | None = None) -> list[Camera]:
    """The cameras of a calibration.json, named cam0, cam1, ... as Kalibr names them."""
    value = source.root["value0"]
    named = {f"cam{i}": i for i in range(len(value["intrinsics"]))}
    wanted = [one for one in named if one == name] or list(named)
    return [_basalt_camera(source, one, value, named[one]) for one in wanted]


def _basalt_camera(source: Source, name: str, value: Any, at: int) -> Camera:
    """One of Basalt's cameras.

    Its 'kb4' is Kannala and Brandt's lens, 'pinhole-radtan8' OpenCV's rational one; its rpmax says
    how far from the axis that holds, which `undistort` finds out by itself.
    """
    path, field = source.path, f"value0.intrinsics.{at}"
    node, sizes = value["intrinsics"][at], value.get("resolution")
    inner = node.get("intrinsics") if isinstance(node, dict) else None
    if not isinstance(inner, dict):
        raise bad(path, "expected the parameters of a camera", field)
    refuse_other_lens(path, {"camera_type": node.get("camera_type")}, f"{field}.")
    pair = sizes[at] if isinstance(sizes, list) and at < len(sizes) else None
    found = numbers(path, pair, f"value0.resolution.{at}", (2,))
    width, height = (whole(path, float(one), f"value0.resolution.{at}") for one in found)
    within, size = f"{field}.intrinsics.", (width, height)
    focal = named_numbers(path, inner, FOCAL, within)
    match node.get("camera_type"):
        case "pinhole":
            return made(path, name, size, np.concatenate([focal, np.zeros(5)]))
        case "kb4":
            lens = named_numbers(path, inner, _KB4, within)
            return fisheye_camera(path, name, size, focal, lens)
        case "pinhole-radtan8":
            lens = named_numbers(path, inner, _RADTAN8, within)
            return made(path, name, size, brown_or_rational(path, focal, lens, field))
        case other:
            said = f"expected pinhole, pinhole-radtan8 or kb4; {OURS}"
            raise bad(path, said, f"{field}.camera_type", str(other))
