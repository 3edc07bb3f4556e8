"""En numbers: whether two laboratories agree within the uncertainties that they state."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

COVERAGE = 2.0
"""Factor of the expanded uncertainties in an En number, by the standard."""


def en_numbers(differences: npt.ArrayLike, first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """En numbers of results of two laboratories.

    Parameters
    ----------
    differences : (...) array_like
        Result of the one minus that of the other.
    first, second : (...) array_like
        Their standard uncertainties, not expanded; NaN where not stated.

    Returns
    -------
    (...) array
        NaN where an uncertainty is not stated; up to 1 in size is satisfactory.

    Notes
    -----
    ``En = (x - X) / sqrt(U_x^2 + U_X^2)`` with U = 2 u. ISO 13528:2015, section 9.7; ISO/IEC
    17043:2010, B.3.1.3. It takes both results as independent: of a system whose frame was made
    from the survey, En numbers are too small.
    """
    first, second = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    both = COVERAGE * np.hypot(first, second)
    return np.asarray(np.asarray(differences, dtype=float) / both)


class Agreement(NamedTuple):
    """En numbers of one component: how many are satisfactory, and the largest and its stop."""

    name: str
    n: int
    satisfactory: int
    largest: float
    stop: str


def agreement(name: str, numbers: Array, ids: tuple[str, ...]) -> Agreement | None:
    """The En numbers of a component taken together; None where there is none.

    Parameters
    ----------
    name : str
        Of the component.
    numbers : (n,) array
        NaN where not known.
    ids : tuple of str
        The stops.
    """
    known = np.flatnonzero(np.isfinite(numbers))
    if not known.size:
        return None
    sizes = np.abs(numbers[known])
    worst = int(known[np.argmax(sizes)])
    inside = int((sizes <= 1).sum())
    return Agreement(name, len(known), inside, float(numbers[worst]), ids[worst])
