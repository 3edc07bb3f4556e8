"""Accuracy and repeatability of stops that were visited again and again, as ISO 9283 has them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array, circular_mean, wrap

CYCLES = 30
"""Visits that ISO 9283:1998 asks for (table 9); with fewer the numbers are told with that."""
FEWEST = 3
"""Visits from which on there is a standard deviation of distances worth the name. A judgement: of
two visits both are equally far from their middle, and the deviation is zero whatever happens."""
MOST = 1000
"""Poses beyond which a table is a path and no list of stops: the standard's test has 150."""
SAME_PLACE = 0.25
"""Stops closer than this (metres) are the same place, where nothing else is stated. A judgement:
well below the distance of stops that are meant to differ, and above how well one drives back."""
SAME_HEADING = 0.35
"""Radians (20 degrees) by which visits of one place may differ: the error of a wrong mount changes
by a third of its size over so much."""


class PoseRepeats(NamedTuple):
    """Accuracy and repeatability of one pose, in metres and radians.

    Parameters
    ----------
    place : str
        Which pose.
    n : int
        Visits.
    accuracy, repeatability : float
        AP_P and RP_l, of positions.
    accuracy_angle, repeatability_angle : float
        AP_a (signed) and RP_a, of the heading; NaN where there is none.
    """

    place: str
    n: int
    accuracy: float
    repeatability: float
    accuracy_angle: float
    repeatability_angle: float

    @property
    def enough(self) -> bool:
        """Whether there are as many visits as the standard asks for."""
        return self.n >= CYCLES


def pose_repeats(
    positions: npt.ArrayLike, angles: npt.ArrayLike | None = None, place: str = ""
) -> PoseRepeats:
    """AP and RP of one pose, from attained minus commanded poses.

    Parameters
    ----------
    positions : (n, d) array_like
        Attained minus commanded, metres; d is 2 or 3.
    angles : (n,) array_like, optional
        The same of one angle, radians.
    place : str
        Name of the pose.

    Raises
    ------
    ValueError
        With fewer than two visits.

    Notes
    -----
    ISO 9283:1998, sections 7.2.1 and 7.2.2: AP_P is the distance of the barycentre of the attained
    positions from the commanded one, RP_l = l + 3 S_l with the mean and the standard deviation
    (n - 1) of the distances from the barycentre, AP_a the mean angle minus the commanded one, and
    RP_a = 3 S_a. For a ground truth the surveyed pose stands for the commanded one, so that the
    noise of the survey is in both. The 3 S are no interval of stated confidence.
    """
    positions = np.asarray(positions, dtype=float)
    n = len(positions)
    if n < 2:
        raise ValueError("repeatability takes two visits at least")
    centre = positions.mean(0)
    lengths = np.linalg.norm(positions - centre, axis=1)
    nan = float("nan")
    mean, deviation = nan, nan
    if angles is not None:
        turned = np.asarray(angles, dtype=float)
        mean = float(circular_mean(turned))
        deviation = float(wrap(turned - mean).std(ddof=1))
    return PoseRepeats(
        *(place, n, float(np.linalg.norm(centre))),
        *(float(lengths.mean() + 3 * lengths.std(ddof=1)), mean, 3 * deviation),
    )


def same_places(
    positions: Array,
    headings: Array | None = None,
    radius: float = SAME_PLACE,
    angle: float = SAME_HEADING,
) -> list[list[int]]:
    """Rows of stops that are visits of one pose, each row once; only places visited again.

    Parameters
    ----------
    positions : (n, d) array
        Of the stops, metres.
    headings : (n,) array, optional
        Radians.
    radius, angle : float
        How far a visit may be from the first one. Where a further stop with such a heading is less
        than twice the radius away, the stops are no visits but poses along a path.
    """
    if len(positions) > MOST:
        return []
    left = np.ones(len(positions), dtype=bool)
    found = []
    for row in range(len(positions)):
        if not left[row]:
            continue
        away = np.linalg.norm(positions - positions[row], axis=1)
        around = np.flatnonzero(away < 2 * radius)
        away = away[around]
        if headings is not None:
            alike = np.abs(wrap(headings[around] - headings[row])) <= angle
            around, away = around[alike], away[alike]
        near = around[away <= radius]
        alone = not (away[away > radius] < 2 * radius).any()
        if alone and len(near) >= FEWEST and left[near].all():
            found.append([int(one) for one in near])
            left[near] = False
    return found
