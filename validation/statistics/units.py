"""Whether coordinates are in another unit than metres: from the same points in metres."""

import numpy as np
import numpy.typing as npt

PER_METRE = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 1 / 0.0254, "feet": 1 / 0.3048}
CLOSE = 0.05
"""How near a ratio of lengths comes to that of a unit, relatively. A judgement: survey instruments
and maps are wrong by less, and the units differ by factors of 2.5 and more."""
ALIKE = 0.1
"""How far the two shapes may differ, relatively. A judgement: of unlike shapes no ratio is told."""


def unit_of_ratio(ratio: float) -> str:
    """The unit that is so many times in a metre; empty if it is none of the usual ones."""
    near = (unit for unit, times in PER_METRE.items() if abs(ratio / times - 1) < CLOSE)
    return next(near, "")


def unit_of_points(points: npt.ArrayLike, metres: npt.ArrayLike) -> str:
    """The unit of coordinates, if it is not the metre and the same points in metres show it.

    Parameters
    ----------
    points, metres : (n, k) array_like
        The same n points, in frames that may be turned and shifted; the second in metres.

    Returns
    -------
    str
        'feet'; empty for metres, for fewer than three points, and where the shapes differ.
    """
    first, second = (np.asarray(one, dtype=float) for one in (points, metres))
    if len(first) < 3:
        return ""
    far, true = (np.linalg.norm(one - one.mean(0), axis=1) for one in (first, second))
    size = float(np.linalg.norm(true))
    ratio = float(np.linalg.norm(far)) / size if size else 0.0
    unit = unit_of_ratio(ratio)
    return unit if unit and np.linalg.norm(far / ratio - true) < ALIKE * size else ""
