"""A match of two sweeps and the verdict on it, with the reasons.

What is imprecise is not wrong: a match whose covariance says how little it knows goes into the
graph with that covariance. Only what may be wrong has to be confirmed.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from laser_gt.scans.planar import CONTRADICTION
from validation.poses.angles import Array
from validation.shown import Shown

Verdict = Literal["accepted", "imprecise", "may be wrong", "refuted"]
VERDICTS: tuple[Verdict, ...] = ("accepted", "imprecise", "may be wrong", "refuted")
"""From the best to the worst: the worst of all checks is the verdict."""
USED: tuple[Verdict, ...] = ("accepted", "imprecise")
"""Verdicts of matches that go into the graph as they are."""


@dataclass(frozen=True)
class JudgementSettings:
    """Limits of the verdicts.

    All are judgements where nothing else is said. How many wrong matches pass them together is
    measured: tests count them in simulated rooms.

    Parameters
    ----------
    explained : float
        Share of all points that lie on the other sweep; with less a match is imprecise.
    agreement : (float, float)
        Share of the points that the other sensor could see and that are explained: with less than
        the first a match may be wrong, with less than the second it is refuted.
    violating : (float, float)
        Share of the points where the other sensor's beams have passed: above the first it may be
        wrong, above the second it is refuted.
    intruder : float
        Longest surface in metres that may stand where the other scanner saw free space: more
        than a bin or a pair of legs.
    scale : (float, float)
        Residuals over what noise explains: above the first it is imprecise, above the second it
        may be wrong.
    sigma_length, sigma_angle : float
        Largest standard deviation of an accepted match, metres and radians; above, it is
        imprecise. 6 mm and 3 mrad keep three standard deviations inside 20 mm and 10 mrad.
    real_share : float
        Least share of the information, in every direction, that scattering normals do not fake.
        A direction with less is left to the guess, and the match is imprecise.
    eigenvalue_ratio : float
        Least ratio of the smallest to the largest eigenvalue of the information on position;
        below, it is imprecise.
    return_share : float
        Least share of disturbed starts that come back to the same pose; below, it may be wrong.
    rival_margin : float
        A different pose with a score less than this below the best makes the match ambiguous: it
        may be wrong.
    contradiction : float
        Squared distance from the guess, in standard deviations of both, beyond which the match
        contradicts it, and may be wrong: exceeded by one right match in a thousand, for 3 degrees
        of freedom.
    start_length, start_angle : float
        Size of the disturbances of the multi-start check.
    starts : int
        Their number.
    """

    explained: float = 0.45
    agreement: tuple[float, float] = (0.85, 0.5)
    violating: tuple[float, float] = (0.06, 0.25)
    intruder: float = 0.5
    scale: tuple[float, float] = (2.0, 3.0)
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
    seen_pose, seen_covariance : (3,), (3, 3) arrays
        What the scans alone say, without the guess; a standard deviation of ten metres or radians
        where they say nothing.
    verdict : {"accepted", "imprecise", "may be wrong", "refuted"}
        Whether it goes into the graph, as it is or once it is confirmed.
    reasons : tuple of str
        What speaks against it, and what outweighs that.
    precise : bool
        Whether it would be accepted if it is right.
    ambiguous : bool
        Whether a different pose agrees about as well.
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
    seen_pose: Array | None = None
    seen_covariance: Array | None = None
    verdict: Verdict = "may be wrong"
    reasons: tuple[str, ...] = ()
    precise: bool = False
    ambiguous: bool = False

    @property
    def used(self) -> bool:
        """Whether it goes into the graph as it is."""
        return self.verdict in USED

    @property
    def by_scans(self) -> tuple[Array, Array]:
        """Pose and covariance without the guess, where they are known apart."""
        if self.seen_pose is None or self.seen_covariance is None:
            return self.pose, self.covariance
        return self.seen_pose, self.seen_covariance

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
    weaknesses = _weaknesses(found, limits)
    remarks: list[tuple[Verdict, str]] = [
        *(
            ("refuted" if bad else "may be wrong", text)
            for bad, text in _contradicted(found, limits)
        ),
        *(("may be wrong", text) for text in _doubts(found, limits)),
        *(("imprecise", text) for text in weaknesses),
    ]
    verdicts: list[Verdict] = ["accepted", *(verdict for verdict, _ in remarks)]
    return replace(
        found,
        verdict=max(verdicts, key=VERDICTS.index),
        reasons=tuple(text for _, text in remarks),
        precise=not weaknesses,
        ambiguous=_ambiguous(found, limits),
    )


def objections(found: Match, limits: JudgementSettings) -> tuple[str, ...]:
    """The reasons of a match that say that it may be wrong, those that it is imprecise left out."""
    weaknesses = set(_weaknesses(found, limits))
    return tuple(reason for reason in found.reasons if reason not in weaknesses)


def _contradicted(found: Match, limits: JudgementSettings) -> list[tuple[bool, str]]:
    """What one scan shows and the other denies, and whether that refutes the match."""
    agreement, violating = limits.agreement, limits.violating
    checks = [
        (found.agreement < agreement[0], found.agreement < agreement[1],
         f"of the points that both could see, only {found.agreement:.0%} agree"),
        (found.violating > violating[0], found.violating > violating[1],
         f"{found.violating:.0%} of the points lie where the other scanner saw free space"),
        (found.intruder > limits.intruder, False,
         f"a surface of {found.intruder:.1f} m stands where the other scanner saw free space"),
    ]  # fmt: skip
    return [(bad, text) for doubtful, bad, text in checks if doubtful]


def _doubts(found: Match, limits: JudgementSettings) -> list[str]:
    """Other reasons why a match may be wrong."""
    checks = [
        (found.scale > limits.scale[1],
         f"residuals are {found.scale:.1f} times what range noise explains"),
        (found.returned < limits.return_share,
         f"only {found.returned:.0%} of the disturbed starts come back to this pose"),
        (_ambiguous(found, limits),
         "a different pose agrees about as well with what was seen"),
        (found.surprise > limits.contradiction,
         f"it contradicts its guess: {np.sqrt(found.surprise):.1f} standard deviations away"),
    ]  # fmt: skip
    return [text for bad, text in checks if bad]


def _ambiguous(found: Match, limits: JudgementSettings) -> bool:
    """Whether a different pose agrees about as well."""
    return found.rival > -limits.rival_margin


def _weaknesses(found: Match, limits: JudgementSettings) -> list[str]:
    """Reasons why a match knows little, though what it knows is right."""
    corridor = found.real_share < limits.real_share
    corridor |= found.eigenvalue_ratio < limits.eigenvalue_ratio
    not_determined = (
        "the scans do not determine one direction (a corridor?): "
        f"eigenvalue ratio {found.eigenvalue_ratio:.3f}, real share "
        f"{max(found.real_share, 0.0):.0%}"
    )
    checks = [
        (corridor, not_determined),
        (found.explained < limits.explained,
         f"only {found.explained:.0%} of the points lie on the other scan"),
        (limits.scale[0] < found.scale <= limits.scale[1],
         f"residuals are {found.scale:.1f} times what range noise explains"),
        (found.sigma_length > limits.sigma_length,
         f"standard deviation of the position {found.sigma_length * 1e3:.1f} mm"),
        (found.sigma_angle > limits.sigma_angle,
         f"standard deviation of the heading {found.sigma_angle * 1e3:.1f} mrad"),
    ]  # fmt: skip
    return [text for bad, text in checks if bad]
