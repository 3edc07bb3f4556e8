"""Intrinsic parameters of RealSense cameras, as scripts write them to JSON."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import (
    OURS,
    Node,
    bad,
    brown_or_rational,
    fisheye_camera,
    made,
    named_numbers,
    numbers,
    whole,
)
from vision_gt.optics.formats.source import Source

_MODELS = (
    "none",
    "modifiedbrownconrady",
    "inversebrownconrady",
    "ftheta",
    "brownconrady",
    "kannalabrandt4",
)
"""In the order of librealsense's numbers for them (rs2_distortion)."""
_REFUSED = {
    "modifiedbrownconrady": "Brown's lens with the tangential part after the radial one",
    "inversebrownconrady": "Brown's lens backwards: from distorted image points to undistorted",
    "ftheta": "the field-of-view lens (F-Theta)",
}


def is_realsense(source: Source) -> bool:
    """Whether a file has intrinsic parameters with RealSense's names, at whatever depth."""
    return next(_streams("", source.root), None) is not None


def read_realsense(source: Source, name: str | None = None) -> list[Camera]:
    """The streams of a file, named by the keys that they are under."""
    found = dict(_streams("", source.root))
    wanted = [one for one in found if one == name] or list(found)
    return [_camera(source, one, found[one], len(found) == 1) for one in wanted]


def _streams(key: str, node: Any) -> Iterator[tuple[str, Node]]:
    """Nodes with a centre in RealSense's names, and the keys on the way to them."""
    if not isinstance(node, dict):
        return
    if {"fx", "fy", "ppx", "ppy"} <= set(node):
        yield key, node
        return
    for inner, value in node.items():
        yield from _streams(f"{key}.{inner}" if key else inner, value)


def _camera(source: Source, key: str, node: Node, alone: bool) -> Camera:
    path, within = source.path, f"{key}." if key else ""
    width, height = (whole(path, node.get(one), within + one) for one in ("width", "height"))
    size, name = (width, height), path.stem if alone and not key else key
    focal = named_numbers(path, node, ("fx", "fy", "ppx", "ppy"), within)
    lens = numbers(path, node.get("coeffs"), f"{within}coeffs", (4, 5))
    model = _model(node.get("model", node.get("distortion_model")))
    if model not in _MODELS:
        said = "expected a lens of RealSense, such as 'Brown Conrady'"
        raise bad(path, said, f"{within}model", str(node.get("model")))
    # Depth and rectified images have a lens by name, and all of its coefficients are 0: none.
    fisheye = model == "kannalabrandt4"
    if fisheye and lens[4:].any():
        raise bad(path, "the fisheye lens has four coefficients", f"{within}coeffs")
    if fisheye:
        return fisheye_camera(path, name, size, focal, lens[:4])
    if model != "ftheta" and not lens.any():
        return made(path, name, size, np.concatenate([focal, np.zeros(5)]))
    if model == "none" or (model in _REFUSED and not _is_brown(model, lens)):
        said = _REFUSED.get(model, "no lens, and yet coefficients that are not 0")
        said = f"{said}; {OURS}. Calibrate the camera: gtval vision calibrate"
        raise bad(path, said, f"{within}model", str(node.get("model")))
    return made(path, name, size, brown_or_rational(path, focal, lens, f"{within}coeffs"))


def _is_brown(model: str, lens: Array) -> bool:
    """Whether a modified Brown's lens is Brown's own: without its tangential part it is."""
    return model == "modifiedbrownconrady" and not lens[2:4].any()


def _model(said: Any) -> str:
    """A lens's name in letters alone: 'distortion.brown_conrady' is 'Brown Conrady'."""
    if isinstance(said, float):
        return _MODELS[int(said)] if said in range(len(_MODELS)) else ""
    return re.sub(r"^(rs2)?distortion|[^a-z0-9]", "", re.sub(r"[^a-z0-9]", "", str(said).lower()))
