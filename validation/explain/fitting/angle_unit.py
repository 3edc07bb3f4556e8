"""Whether headings are degrees that were taken for radians."""

import numpy as np
from scipy import special

from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable

CERTAIN = 1e-6
"""Chance of so good an agreement by accident below which headings are refused: a tool that looks
at a hundred tables a day meets one such accident in thirty years."""

FEWEST = 5
"""Headings, none of them beyond a turn, with fewer of which nothing is said: of 200,000
tables of three that are right, 4 % agree as well as to 0.04 rad when read as degrees."""
BEYOND = 1e-3
"""The same where most headings are larger than a turn: seldom does anybody write such in radians,
and then they differ from the other table's by whole turns. 30 tables of 8 stops in degrees were
doubted, but only 8 of them refused, without it."""
APART, CLOSER = 0.2, 5.0
"""What makes one look: headings that differ by more than 0.2 rad, beyond any sensor's noise, and
agree five times better when read as degrees. A judgement: it decides only whether a warning is
given."""


def angle_unit_doubt(validation: PoseTable, gt: PoseTable) -> str:
    """Why one table's headings are perhaps in degrees, in words; empty if nothing says so.

    Parameters
    ----------
    validation, gt : PoseTable
        Planar poses at the same n stops.

    Raises
    ------
    GtvalError
        If it is certain: the agreement is no accident (`chance_of_agreement` below `CERTAIN`), and
        a heading is larger than a turn, which nobody writes in radians. If most are, `BEYOND` is
        enough.
    """
    a, b = validation.poses[:, 2], gt.poses[:, 2]
    if len(a) < 3:
        return ""
    as_is = _spread(a - b)
    read = {
        gt.system: (_spread(a - np.radians(b)), b),
        validation.system: (_spread(np.radians(a) - b), a),
    }
    system = min(read, key=lambda name: read[name][0])
    converted, headings = read[system]
    if all(np.mean(np.abs(one) > 2 * np.pi) > 0.5 for one in (a, b)):
        return (
            f"most headings of '{validation.system}' and of '{gt.system}' are larger than a turn: "
            "both look like degrees. They are taken as radians, as stated; if they are degrees, "
            "write radians: degrees times 0.0174533."
        )
    if as_is <= APART or converted >= as_is / CLOSER:
        return ""
    beyond_a_turn = np.abs(headings) > 2 * np.pi
    if len(a) < FEWEST and not beyond_a_turn.any():
        return ""
    text = (
        f"the angles of '{system}' look like degrees: read so, they agree with the other "
        f"table's to {converted:.3f} rad instead of {as_is:.2f} rad. "
    )
    most = BEYOND if beyond_a_turn.mean() > 0.5 else CERTAIN
    if beyond_a_turn.any() and chance_of_agreement(len(a), converted) < most:
        raise GtvalError(f"{text}Write radians: degrees times 0.0174533")
    return f"{text}They are taken as radians, as stated; if they are degrees, write radians."


def chance_of_agreement(n: int, spread: float) -> float:
    """Chance that n headings in radians agree so well by accident when read as degrees.

    Parameters
    ----------
    n : int
        Poses.
    spread : float
        Median distance from the common direction, in radians.

    Notes
    -----
    Headings that were taken for degrees by mistake shrink to nearly one direction, so that the
    differences are as the other table's headings: independent, each direction as likely as any
    other. At least half of the n, m = ceil(n / 2), lie within the spread s of a direction, hence
    all of these within 2 s of one of them. For a given one, each of the n - 1 others does so with
    chance p = 2 * 2 s / (2 pi). There are n choices of that one, and two tables that may be the
    one in degrees, so the chance is at most 2 n P(K >= m - 1) with K binomial (n - 1, p).
    """
    p = min(2 * spread / np.pi, 1.0)
    others = (n + 1) // 2 - 1
    tail = float(special.bdtrc(others - 1, n - 1, p)) if others else 1.0
    return min(2 * n * tail, 1.0)


def _spread(difference: Array) -> float:
    """Median distance from the direction most have in common, so that a frame's turn is none."""
    turned = np.exp(1j * difference)
    return float(np.median(np.abs(wrap(np.angle(turned / np.median(turned))))))
