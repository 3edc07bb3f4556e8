"""An uncertainty budget after the GUM: what each source contributes, and what all make."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

INFINITE = float("inf")


class Contribution(NamedTuple):
    """One line of a budget.

    Parameters
    ----------
    name : str
        'survey', 'frame', 'mount', 'clock', 'noise', ...
    uncertainty : float
        Standard uncertainty of the input, times its sensitivity: in the unit of the result.
    freedom : float
        Degrees of freedom by which it is known; infinite where it is stated.
    evaluation : {"A", "B"}
        From repeated observations (A), or from what is known otherwise (B).
    data : str
        Name of the data that it is estimated from: lines with one name are one estimate, whose
        degrees of freedom count once. Empty: from data of its own.
    """

    name: str
    uncertainty: float
    freedom: float = INFINITE
    evaluation: str = "B"
    data: str = ""


class Budget(NamedTuple):
    """Contributions put together.

    Parameters
    ----------
    name, unit : str
        Of the result: 'x', 'm'.
    contributions : tuple of Contribution
        Lines.
    combined : float
        Combined standard uncertainty u_c.
    freedom : float
        Effective degrees of freedom.
    coverage : float
        Coverage factor k for the level of confidence.
    expanded : float
        U = k u_c.
    confidence : float
        Level.
    missing : tuple of str
        Sources of which nothing is known: they are not in the sum.
    """

    name: str
    unit: str
    contributions: tuple[Contribution, ...]
    combined: float
    freedom: float
    coverage: float
    expanded: float
    confidence: float
    missing: tuple[str, ...] = ()


def budget(
    name: str,
    unit: str,
    contributions: Sequence[Contribution],
    confidence: float = 0.95,
    missing: Sequence[str] = (),
) -> Budget:
    """Combined and expanded uncertainty of independent contributions.

    Parameters
    ----------
    name, unit : str
        Of the result.
    contributions : sequence of Contribution
        Independent of each other, sensitivities already in them.
    confidence : float
        Level of confidence of the expanded uncertainty.
    missing : sequence of str
        Sources of which nothing is known.

    Notes
    -----
    JCGM 100:2008 (GUM): u_c^2 is the sum of the squares (equation 10), the effective degrees of
    freedom are those of Welch and Satterthwaite, ``u_c^4 / sum(u_i^4 / nu_i)`` (G.2b), cut to a
    whole number, and k is the quantile of Student's t (G.1d). Assumes a result that is linear
    in its inputs and nearly normal. Lines from the same data count as one in the second sum.
    """
    combined = float(np.sqrt(sum(one.uncertainty**2 for one in contributions)))
    shares: dict[str, tuple[float, float]] = {}
    for row, one in enumerate(contributions):
        data = one.data or str(row)
        square, freedom = shares.get(data, (0.0, INFINITE))
        shares[data] = square + one.uncertainty**2, min(freedom, one.freedom)
    lost = sum(square**2 / freedom for square, freedom in shares.values())
    freedom = float(np.floor(combined**4 / lost + 1e-9)) if lost > 0 else INFINITE
    freedom = max(freedom, 1.0)
    probability = (1 + confidence) / 2
    if np.isinf(freedom):
        coverage = float(special.ndtri(probability))
    else:
        coverage = float(special.stdtrit(freedom, probability))
    return Budget(
        *(name, unit, tuple(contributions), combined, freedom, coverage),
        *(coverage * combined, confidence, tuple(missing)),
    )
