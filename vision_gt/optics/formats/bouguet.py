"""Files of MATLAB: Calib_Results.mat of Bouguet's toolbox, and others that are named."""

import numpy as np

from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import OURS, bad, made
from vision_gt.optics.formats.source import Source


def is_program(source: Source) -> bool:
    """Whether a file is a program of MATLAB."""
    return source.suffix == ".m"


def refuse_program(source: Source, _: str | None = None) -> list[Camera]:
    """Raise: a program can compute its numbers, so it is not read."""
    if source.data.startswith(b"MATLAB"):
        raise bad(source.path, "a file of MATLAB that is named as a program; name it .mat")
    if b"ocam" in source.data.lower():
        said = "a model of the omnidirectional toolbox (OCamCalib), which is not read"
        raise bad(source.path, said)
    raise bad(source.path, "a program of Bouguet's toolbox; give the Calib_Results.mat beside it")


def is_bouguet(source: Source) -> bool:
    """Whether a file is of MATLAB."""
    return source.suffix == ".mat"


def read_bouguet(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of a Calib_Results.mat."""
    path, found = source.path, source.root
    if "fc_left" in found or "om" in found:
        raise bad(path, "a file of two cameras; give each camera its own Calib_Results.mat")
    if np.size(found.get("kc", ())) == 4:
        raise bad(path, f"the coefficients of the toolbox's fisheye lens; {OURS}", "kc")
    if "fc" not in found:
        names = ", ".join(key for key in found if not key.startswith("__"))
        said = (
            "no Calib_Results.mat of Bouguet's toolbox, which has fc, cc and kc; write K and the "
        )
        said += "distortion to a file of OpenCV, with 1 pixel off MATLAB's centre"
        raise bad(path, said, "fc", names)
    values = {}
    for key, count in (("fc", 2), ("cc", 2), ("kc", 5), ("nx", 1), ("ny", 1)):
        if key not in found or np.size(found[key]) != count:
            raise bad(path, f"expected {count} numbers", key)
        values[key] = np.ravel(found[key]).astype(float)
    if "alpha_c" in found and np.any(np.abs(found["alpha_c"]) > 1e-12):
        raise bad(path, "a skew is not supported", "alpha_c")
    covariance = np.zeros((9, 9))
    if all(np.size(found.get(f"{k}_error", ())) == n for k, n in (("fc", 2), ("cc", 2), ("kc", 5))):
        # The toolbox states about three standard deviations.
        errors = np.concatenate([np.ravel(found[f"{k}_error"]) for k in ("fc", "cc", "kc")])
        covariance = np.diag((errors.astype(float) / 3) ** 2)
    parameters = np.concatenate([values["fc"], values["cc"], values["kc"]])
    size = int(values["nx"][0]), int(values["ny"][0])
    return [made(path, path.stem, size, parameters, covariance)]
