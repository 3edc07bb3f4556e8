"""Camera files of programs that follow cameras: camodocal (VINS) and ORB-SLAM."""

from pathlib import Path

import numpy as np

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import (
    FOCAL,
    Node,
    bad,
    brown_or_rational,
    fisheye_camera,
    made,
    named_numbers,
    refuse_other_lens,
    whole,
)
from vision_gt.optics.formats.source import Source

_BROWN = ("k1", "k2", "p1", "p2")
_EQUIDISTANT = ("k2", "k3", "k4", "k5")
"""camodocal counts Kannala and Brandt's coefficients from the linear one, which is 1."""


def is_camodocal(source: Source) -> bool:
    """Whether a file is of camodocal, as VINS and others have it."""
    return isinstance(source.root.get("projection_parameters"), dict)


def read_camodocal(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of a file of camodocal."""
    path, root = source.path, source.root
    refuse_other_lens(path, root)
    model = str(root.get("model_type")).upper()
    if model not in {"PINHOLE", "KANNALA_BRANDT"}:
        raise bad(path, "expected PINHOLE or KANNALA_BRANDT", "model_type", model)
    names = FOCAL if model == "PINHOLE" else ("mu", "mv", "u0", "v0")
    focal = named_numbers(path, root["projection_parameters"], names, "projection_parameters.")
    width, height = (whole(path, root.get(key), key) for key in ("image_width", "image_height"))
    name = root.get("camera_name")
    shown = name if isinstance(name, str) else path.stem
    if model == "KANNALA_BRANDT":
        node = root["projection_parameters"]
        lens = named_numbers(path, node, _EQUIDISTANT, "projection_parameters.")
        return [fisheye_camera(path, shown, (width, height), focal, lens)]
    node = root.get("distortion_parameters") or {}
    lens = named_numbers(path, node, _BROWN, "distortion_parameters.")
    return [made(path, shown, (width, height), np.concatenate([focal, lens, [0.0]]))]


def is_orb_slam(source: Source) -> bool:
    """Whether a file is one of settings of ORB-SLAM."""
    return bool(_prefixes(source.root))


def read_orb_slam(source: Source, name: str | None = None) -> list[Camera]:
    """The camera of a file of settings, or both, named Camera1 and Camera2 as in the file.

    The parameters are those of images as they are recorded, of Camera.width: ORB-SLAM itself
    scales both to Camera.newWidth.
    """
    path, root = source.path, source.root
    if any(key in root for key in ("LEFT.K", "RIGHT.K")):
        said = (
            "settings of ORB-SLAM for two cameras: Camera.fx is of rectified images, LEFT.K and "
            "RIGHT.K are of those as recorded; give a file with the one that you mean"
        )
        raise bad(path, said, "LEFT.K")
    if "Camera.model" in root and "Camera.type" not in root:
        said = "settings of OpenVSLAM or stella_vslam, which are not read"
        raise bad(path, said, "Camera.model", str(root["Camera.model"]))
    named = _prefixes(root)
    wanted = [one for one in named if one == name] or named
    shown = {one: one if len(named) > 1 else path.stem for one in named}
    return [_settings(path, root, one, shown[one]) for one in wanted]


def _prefixes(root: Node) -> list[str]:
    return [one for one in ("Camera", "Camera1", "Camera2") if f"{one}.fx" in root]


def _settings(path: Path, root: Node, camera: str, name: str) -> Camera:
    own = {key.removeprefix(f"{camera}."): value for key, value in root.items()}
    own = {key: own[key] for key in own if f"{camera}.{key}" in root}
    width, height = (whole(path, root.get(key), key) for key in ("Camera.width", "Camera.height"))
    kind = str(root.get("Camera.type", "PinHole")).lower()
    focal = named_numbers(path, own, FOCAL, f"{camera}.")
    if kind == "kannalabrandt8":
        lens = named_numbers(path, own, ("k1", "k2", "k3", "k4"), f"{camera}.")
        return fisheye_camera(path, name, (width, height), focal, lens)
    if kind not in {"pinhole", "rectified"}:
        said = "expected PinHole, Rectified or KannalaBrandt8"
        raise bad(path, said, "Camera.type", str(root.get("Camera.type")))
    lens = _distortion(path, own, camera)
    if kind == "rectified" and lens.any():
        said = "of rectified images, and yet with distortion; leave out one of the two"
        raise bad(path, said, "Camera.type", "Rectified")
    return made(path, name, (width, height), brown_or_rational(path, focal, lens, camera))


def _distortion(path: Path, own: Node, camera: str) -> Array:
    """(5,) of Brown's lens: zeros where a file has none at all, k3 where it has no other."""
    if not any(key in own for key in (*_BROWN, "k3", "k4")):
        return np.zeros(5)
    if "k4" in own:
        said = "Brown's lens has no k4; a fisheye lens is Camera.type 'KannalaBrandt8'"
        raise bad(path, said, f"{camera}.k4")
    k3 = named_numbers(path, own, ("k3",), f"{camera}.") if "k3" in own else np.zeros(1)
    return np.concatenate([named_numbers(path, own, _BROWN, f"{camera}."), k3])
