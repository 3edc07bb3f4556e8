"""Whether covariances are in another unit than their positions: square metres beside millimetres.

Who writes millimetres as metres seldom thinks of the covariances, and the other way round. Read as
they stand they are a million times too small or too large: each small thing is then a cause, or
nothing is.
"""

from dataclasses import dataclass

import numpy as np

from validation.explain.fitting.conventions import SURE, plane_fit
from validation.poses.angles import Array
from validation.statistics.units import PER_METRE

FEWEST = 8
"""Poses from which on it is looked for: the fit takes six of their sixteen coordinates."""
RAYLEIGH = float(np.sqrt(2 * np.log(2)))
"""Median length of a plane error over the standard deviation of a coordinate."""
FITS = 2.0
"""Times by which what is left may differ from what is stated in the unit that is told. A judgement:
standard deviations ten times too large, as cautious people state, are then not taken for square
centimetres, beside a survey that is half as noisy as the system."""
UNITS = ("millimetres", "centimetres")


@dataclass(frozen=True)
class CovarianceUnit:
    """How the covariances of two tables are to be read.

    Parameters
    ----------
    words : str
        What is wrong, for a sentence; empty if nothing is.
    validation, gt : float
        Factors on the standard deviations of positions.
    ratio : float
        What is left of the positions over what is stated, as the covariances stand.
    """

    words: str = ""
    validation: float = 1.0
    gt: float = 1.0
    ratio: float = float("nan")

    def read(self, covariances: Array, factor: float) -> Array:
        """Covariances (..., 3, 3) with the standard deviations of positions times a factor."""
        size = np.array([factor, factor, 1.0])
        return np.asarray(covariances * size[:, None] * size)


AS_STATED = CovarianceUnit()


def covariance_unit(
    validation: Array, gt: Array, ours: Array, theirs: Array, shrink: float
) -> CovarianceUnit:
    """The unit of the covariances, where chi-squared leaves no doubt.

    Parameters
    ----------
    validation, gt : (n, 3) array
        Poses, both in metres.
    ours, theirs : (n, 3, 3) array
        Their covariances; those of the GT read in the unit of its positions.
    shrink : float
        Metres in one of the units in which the GT table has its positions.

    Notes
    -----
    Sum of the squares of what a frame, a scale and a mount leave of the positions, by its median,
    so that wrong poses do not count; its density under each unit. Another unit is told where it is
    a million times as likely and what is left is then as large as stated, within `FITS`.
    """
    n = len(gt)
    if n < FEWEST:
        return AS_STATED
    z, w = (one[:, 0] + 1j * one[:, 1] for one in (validation, gt))
    typical, _ = plane_fit(z, np.column_stack([w, np.ones(n), np.exp(1j * gt[:, 2])]))
    spread = typical / RAYLEIGH * np.sqrt(2 * n / (2 * n - 6))
    own, other = (
        float(np.trace(c[:, :2, :2], axis1=1, axis2=2).mean()) / 2 for c in (ours, theirs)
    )
    if not own + other > 0:
        return AS_STATED

    def cost(first: float, second: float) -> tuple[float, float]:
        sigma = np.sqrt(first**2 * own + second**2 * other)
        ratio = float(spread / sigma)
        return 2 * n * (ratio**2 / 2 + float(np.log(sigma))), ratio

    now, ratio = cost(1.0, 1.0)
    tried = []
    if shrink != 1:
        unit = "square metres, and its positions are not in metres"
        tried.append((f"this system's covariances are in {unit}", 1.0, 1 / shrink))
    for unit in UNITS if shrink == 1 else ():
        f, said = 1 / PER_METRE[unit], f"in square {unit}, and the positions in metres"
        tried += [
            (f"this system's covariances are {said}", 1.0, f),
            (f"the validation's covariances are {said}", f, 1.0),
            (f"the covariances of both tables are {said}", f, f),
        ]
    told = [(cost(first, second), words, first, second) for words, first, second in tried]
    fits = [one for one in told if now - one[0][0] > SURE and 1 / FITS < one[0][1] < FITS]
    if not fits:
        return AS_STATED
    _, words, first, second = min(fits)
    return CovarianceUnit(words, first, second, ratio)
