"""The sources that are compared with each other, and the verdicts on their cells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validation.explain.fitting.noise import Mask
from validation.explain.sources.copies import Copies
from validation.explain.sources.hat_values import SourceVariances
from validation.explain.sources.tails import Tails
from validation.poses.angles import Array, wrap

CELLS = ("position", "heading")
Certainty = Literal["sure", "likely", "undecided"]


@dataclass(frozen=True)
class Sources:
    """Poses of S sources at n stops, systematic parts taken out.

    Parameters
    ----------
    names : tuple of str
        The sources, the validation first.
    ids : tuple of str
        The stops.
    poses : (S, n, 3) array
        NaN where missing (or known only by construction).
    covariances : (S, n, 3, 3) array
        NaN where not stated.
    sensors : mapping of str to tuple of str
        Sources that share a sensor, by its name.
    lost_freedom : (S, 2) array
        Degrees of freedom that taking out the systematic part cost.
    contradicted : bool
        Whether stated covariances were scaled to the errors, so that their level is not known.
    """

    names: tuple[str, ...]
    ids: tuple[str, ...]
    poses: Array
    covariances: Array
    sensors: Mapping[str, tuple[str, ...]]
    lost_freedom: Array
    contradicted: bool = False

    @property
    def known(self) -> bool:
        """Whether all noise is known beforehand."""
        return bool(self.stated.all()) and not self.contradicted

    @property
    def present(self) -> Mask:
        """(S, n) True where there is a pose."""
        return np.asarray(np.isfinite(self.poses).all(-1))

    @property
    def stated(self) -> Mask:
        """(S,) True where all covariances are stated."""
        stated = np.isfinite(self.covariances).all((-1, -2))
        return np.asarray((stated | ~self.present).all(1) & self.present.any(1))


@dataclass(frozen=True)
class Verdict:
    """One cell that does not fit.

    Parameters
    ----------
    stop : str
        Name of the pose.
    cell : {"position", "heading"}
        Which part of it.
    blamed : tuple of str
        The source held responsible; several where it is any one (or, of one sensor, all) of them.
    certainty : {"sure", "likely", "undecided"}
        'likely' if only the other cell of the stop decides; 'undecided' if one of several.
    p_value : float
        Chance of such a disagreement without a gross error, for this question alone.
    table_p_value : float
        Chance of such a disagreement anywhere in a table of good poses.
    size : float
        Length or angle by which the source is off the others, in metres or radians.
    witnesses : tuple of str
        The sources that agree with each other.
    reason : str
        Why, in words.
    """

    stop: str
    cell: str
    blamed: tuple[str, ...]
    certainty: Certainty
    p_value: float
    table_p_value: float
    size: float
    witnesses: tuple[str, ...]
    reason: str


@dataclass(frozen=True)
class Arbitration:
    """What the table of sources against stops shows.

    Parameters
    ----------
    sources : tuple of str
        The S sources, the validation first.
    ids : tuple of str
        The n stops.
    verdicts : tuple of Verdict
        All cells that do not fit, stop by stop.
    suspects : tuple of Verdict
        Cells that stand out less: one is to be expected in every second table of good poses.
        They count as good everywhere else.
    present : (S, n) array of bool
        Whether the source has the pose.
    bad : (S, n, 2) array of bool
        Cells of which the source is held responsible.
    doubtful : (S, n, 2) array of bool
        Cells of which it may be responsible.
    scores : (S, n, 2) array
        Distance of each source from the others in standard deviations; NaN where it is alone.
    noise : (S, 2) array
        Standard deviations used, in metres and radians.
    variances : SourceVariances
        From the differences between independent sources, the cells above left out.
    false_alarm : float
        Chance of any verdict in a clean table.
    questions : int
        Asked of the table.
    tails : Tails, optional
        How heavy the tails of errors are.
    copies : tuple of Copies
        Sources that are copies of one another, each group one witness.
    rate : float
        Chance of any verdict in a table of good poses, by the tails that this table shows.
    """

    sources: tuple[str, ...]
    ids: tuple[str, ...]
    verdicts: tuple[Verdict, ...]
    suspects: tuple[Verdict, ...]
    present: Mask
    bad: Mask
    doubtful: Mask
    scores: Array
    noise: Array
    variances: SourceVariances
    false_alarm: float
    questions: int
    tails: Tails | None = None
    copies: tuple[Copies, ...] = ()
    rate: float = 0.05

    @property
    def usable(self) -> Mask:
        """(S, n, 2) True where a cell is there and beyond suspicion."""
        return self.present[..., None] & ~self.bad & ~self.doubtful


def differences(a: Array, b: Array, kind: int) -> Array:
    """(..., 2) differences of positions or (..., 1) of headings."""
    if kind == 0:
        return a[..., :2] - b[..., :2]
    return wrap(a[..., 2:] - b[..., 2:])


def listed(names: Sequence[str]) -> str:
    """'a', 'a and b', 'a, b and c'."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def reason_for(
    blamed: Sequence[str],
    witnesses: Sequence[str],
    certainty: str,
    sides: Sequence[tuple[str, ...]] = (),
) -> str:
    """Why, in words.

    ``sides`` are those who may be wrong, sources of one sensor together as they are one witness.
    """
    if certainty == "undecided":
        shared = [side for side in sides if len(side) > 1]
        if not shared:
            return f"{listed(blamed)} disagree, and no other source tells which of them is wrong"
        against = " or ".join(listed(side) for side in sides if len(side) == 1)
        them = " and ".join(listed(side) for side in shared)
        return (
            f"{them} agree, but count as one witness, against {against}: nothing tells which side "
            "is wrong"
            if against
            else f"{them} disagree, and no other source tells which of them is wrong"
        )
    agree = listed(witnesses)
    if certainty == "likely":
        return f"{agree} agree with each other"
    if len(witnesses) == 1:
        return f"they are of one sensor and moved together, away from {agree}"
    return f"{agree} agree with each other without it"
