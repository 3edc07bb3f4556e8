"""A match of two sweeps and the verdict on it: accept, look or reject, with the reasons."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from laser_gt.scans.planar import CONTRADICTION
from validation.poses.angles import Array
from validation.shown import Shown

Verdict = Literal["accept", "look", "reject"]
VERDICTS: tuple[Verdict, ...] = ("accept", "look", "reject")
"""From the best to the worst: the worst of all checks is the verdict."""


@dataclass(frozen=True)
class JudgementSettings:
    """Limits between accept, look and reject; each pair is (accept up to, reject beyond).

    All are judgements where nothing else is said. How many wrong matches pass them together is
    measured: tests count them in simulated rooms.

    Parameters
    ----------
    explained : (float, float)
        Share of all points that lie on the other sweep: at least, and reject below.
    agreement : (float, float)
        Share of the points that the other sensor could see and that are explained.
    violating : (float, float)
        Share of the points where the other sensor's beams have passed.
    intruder : (float, float)
        Longest surface in metres that may stand where the other scanner saw free space: more
        than a bin or a pair of legs; and beyond which loops do not outweigh it: walls are longer
        than window panes and cupboards.
    scale : (float, float)
        Residuals over what noise explains.
    sigma_length, sigma_angle : float
        Largest standard deviation of an accepted match, metres and radians. 6 mm and 3 mrad
        keep three standard deviations inside 20 mm and 10 mrad.
    real_share : float
        Least share of the information, in every direction, that scattering normals do not fake.
    eigenvalue_ratio : float
        Least ratio of the smallest to the largest eigenvalue of the information on position.
    return_share : float
        Least share of disturbed starts that come back to the same pose.
    rival_margin : float
        A different pose with a score less than this below the best makes the match ambiguous.
    contradiction : float
        Squared distance from the guess, in standard deviations of both, beyond which the match
        contradicts it: exceeded by one right match in a thousand, for 3 degrees of freedom.
    start_length, start_angle : float
        Size of the disturbances of the multi-start check.
    starts : int
        Their number.
    """

    explained: tuple[float, float] = (0.45, 0.2)
    agreement: tuple[float, float] = (0.85, 0.5)
    violating: tuple[float, float] = (0.06, 0.25)
    intruder: tuple[float, float] = (0.5, 2.5)
    scale: tuple[float, float] = (1.6, 3.0)
    sigma_length: float = 0.006
    sigma_angle: float = 0.003
    real_share: float = 0.6
    eigenvalue_ratio: float = 0.01
    return_share: float = 0.6
    rival_margin: float = 0.12
    contradiction: float = CONTRADICTION
    start_length: float = 0.12
    start_angle: float = 0.09
    starts: int = 8


@dataclass(frozen=True, repr=False)
class Match(Shown):
    """A pose of one sweep in the frame of another, and how far it can be trusted.

    Parameters
    ----------
    reference, moving : str
        Stops.
    guess, pose : (3,) array
        Before and after, moving frame in the reference frame.
    covariance : (3, 3) array
        Of the pose: noise of both sweeps, widened by the spread of the starts.
    explained, violating, hidden, agreement : float
        See `Evidence`; agreement is explained over not hidden.
    intruder : float
        Longest surface where the other scanner saw free space, in metres.
    scale : float
        Residuals over what noise explains.
    real_share : float
        Least share of real information over the directions.
    eigenvalue_ratio : float
        Smallest over largest eigenvalue of the information on position.
    returned : float
        Share of disturbed starts that came back.
    rival : float
        Score of the best different pose found, less the score of this one; -inf for none.
    surprise : float
        Squared distance of what the scans say from the guess, in standard deviations of both.
    fitness : float
        As the document has it, square metres: see `published_fitness`.
    rival_fitness : float
        That of the best different pose found, which is wrong where this one is right; nan for none.
    verdict : {"accept", "look", "reject"}
        What to do with it.
    reasons : tuple of str
        What speaks against it, and what outweighs that.
    changed : bool
        Whether only things that one scan shows and the other does not hold it up, and no longer
        ones than may have been moved or be glass.
    """

    reference: str
    moving: str
    guess: Array
    pose: Array
    covariance: Array
    explained: float
    violating: float
    hidden: float
    agreement: float
    intruder: float
    scale: float
    real_share: float
    eigenvalue_ratio: float
    returned: float
    rival: float
    surprise: float
    fitness: float = np.nan
    rival_fitness: float = np.nan
    verdict: Verdict = "look"
    reasons: tuple[str, ...] = ()
    changed: bool = False

    @property
    def sigma_length(self) -> float:
        """Standard deviation of the position along its worst direction, metres."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def sigma_angle(self) -> float:
        """Standard deviation of the heading, radians."""
        return float(np.sqrt(self.covariance[2, 2]))


def with_verdict(found: Match, limits: JudgementSettings) -> Match:
    """The match with its verdict: the worst of all checks, each with a sentence."""
    not_explained = (
        (found.explained, *limits.explained,
         f"only {found.explained:.0%} of the points lie on the other scan"),
        (-found.scale, -limits.scale[0], -limits.scale[1],
         f"residuals are {found.scale:.1f} times what range noise explains"),
    )  # fmt: skip
    not_there = (
        (found.agreement, *limits.agreement,
         f"of the points that both could see, only {found.agreement:.0%} agree"),
        (-found.violating, -limits.violating[0], -limits.violating[1],
         f"{found.violating:.0%} of the points lie where the other scanner saw free space"),
    )  # fmt: skip
    different = _graded(not_there)
    if found.intruder > limits.intruder[0]:
        text = f"a surface of {found.intruder:.1f} m stands where the other scanner saw free space"
        different.append(("look", text))
    rest = _graded(not_explained) + [("look", text) for text in _doubts(found, limits)]
    remarks = different + rest
    verdicts: list[Verdict] = ["accept", *(verdict for verdict, _ in remarks)]
    worst = max(verdicts, key=VERDICTS.index)
    return replace(
        found,
        verdict=worst,
        reasons=tuple(text for _, text in remarks),
        changed=worst == "look" and not rest and found.intruder <= limits.intruder[1],
    )


def _graded(
    values: Sequence[tuple[float, float, float, str]],
) -> list[tuple[Verdict, str]]:
    """What is below the first limit of each (value, look, reject, text), and how bad it is."""
    return [
        ("reject" if value < bad else "look", text)
        for value, good, bad, text in values
        if value < good
    ]


def _doubts(found: Match, limits: JudgementSettings) -> list[str]:
    """Reasons to look that no number of explained points can outweigh."""
    corridor = found.real_share < limits.real_share
    corridor |= found.eigenvalue_ratio < limits.eigenvalue_ratio
    not_determined = (
        "the scans do not determine one direction (a corridor?): "
        f"eigenvalue ratio {found.eigenvalue_ratio:.3f}, real share {found.real_share:.0%}"
    )
    checks = [
        (corridor, not_determined),
        (found.sigma_length > limits.sigma_length,
         f"standard deviation of the position {found.sigma_length * 1e3:.1f} mm"),
        (found.sigma_angle > limits.sigma_angle,
         f"standard deviation of the heading {found.sigma_angle * 1e3:.1f} mrad"),
        (found.returned < limits.return_share,
         f"only {found.returned:.0%} of the disturbed starts come back to this pose"),
        (found.rival > -limits.rival_margin,
         "a different pose agrees about as well with what was seen"),
        (found.surprise > limits.contradiction,
         f"it contradicts its guess: {np.sqrt(found.surprise):.1f} standard deviations away"),
    ]  # fmt: skip
    return [text for bad, text in checks if bad]
