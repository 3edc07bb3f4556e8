"""Markers of another family than the stated one, where images show none of that."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from validation.errors import InputError
from validation.poses.angles import Array
from vision_gt.images.files import Image, read_image
from vision_gt.images.other_boards import FAMILIES, smallest_family
from vision_gt.images.reading import drawn_apart, read_codes
from vision_gt.patterns.dictionaries import ARTOOLKITPLUS, Family

_LOOKED_AT = 6
"""Images that are looked through for anything: enough, if each shows two markers."""
_LEAST, _MORE = 4, 3
"""Codes without a wrong cell that have to be read, in all these images, and times those of the
stated family. Of chance codes the families with few cells have one in some images."""
_BORDERS = (1, 2)


def family_instead(paths: Sequence[Path], stated: Family) -> tuple[str, int, list[int]] | None:
    """The family that images show where they hardly show the stated one.

    Parameters
    ----------
    paths : sequence of Path
        Images of the robot.
    stated : Family
        Of its markers, as campaign.toml has it.

    Returns
    -------
    (str, int, list of int) or None
        Name, cells of the border, and ids; None where nothing is clearly more often seen.
    """
    step = max(len(paths) // _LOOKED_AT, 1)
    every = [Family(name, border) for name in (ARTOOLKITPLUS, *FAMILIES) for border in _BORDERS]
    seen: dict[Family, list[int]] = {family: [] for family in (stated, *every)}
    for path in paths[::step][:_LOOKED_AT]:
        try:
            image = drawn_apart(read_image(path))
        except InputError:
            continue
        quads = _quadrangles(image)
        for family in seen:
            seen[family] += np.unique(read_codes(image, quads, family, 0).numbers).tolist()
    best = max(seen, key=lambda family: len(seen[family]))
    count = len(seen[best])
    if best == stated or count < max(_LEAST, _MORE * len(seen[stated])):
        return None
    ids = sorted(set(seen[best]))
    name = best.name if best.name == ARTOOLKITPLUS else smallest_family(best.name, ids[-1])
    return name, best.border, ids


def _quadrangles(image: Image) -> Array:
    """(n, 4, 2) outlines that might be markers of any family, pixels."""
    detector = cv2.aruco.ArucoDetector(Family(FAMILIES[0]).dictionary)
    found, _, others = detector.detectMarkers(np.ascontiguousarray(image))
    return np.array([*found, *others], dtype=float).reshape(-1, 4, 2)
