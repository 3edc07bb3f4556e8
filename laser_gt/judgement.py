"""Judgement of a match: accept, look or reject, with the reasons.

Neither a small residual nor a solver that says 'converged' makes a match right. What is asked
here is whether everything both sensors saw agrees with the pose, whether the pose is determined
in every direction, and whether another pose would do as well.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from laser_gt.both_ways import both_ways
from laser_gt.evidence import Prepared, evidence, intruder
from laser_gt.global_matching import SearchSettings, distinct, global_match
from laser_gt.matching import Alignment, align
from laser_gt.scans import Flags
from validation.angles import Array, wrap

Verdict = Literal["accept", "look", "reject"]
FINISH = 5
"""Steps with all points at the end of a disturbed start."""
SEVERITY: dict[Verdict, int] = {"accept": 0, "look": 1, "reject": 2}


@dataclass(frozen=True)
class JudgementSettings:
    """Limits between accept, look and reject; each pair is (accept up to, reject beyond).

    Parameters
    ----------
    explained : (float, float)
        Share of all points that lie on the other sweep: at least, and reject below.
    agreement : (float, float)
        Share of the points that the other sensor could see and that are explained.
    violating : (float, float)
        Share of the points where the other sensor's beams have passed.
    intruder : float
        Longest surface in metres that may stand where the other scanner saw free space: more
        than a bin or a pair of legs.
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
    start_length, start_angle : float
        Size of the disturbances of the multi-start check.
    starts : int
        Their number.
    """

    explained: tuple[float, float] = (0.45, 0.2)
    agreement: tuple[float, float] = (0.85, 0.5)
    violating: tuple[float, float] = (0.06, 0.25)
    intruder: float = 0.5
    scale: tuple[float, float] = (1.6, 3.0)
    sigma_length: float = 0.006
    sigma_angle: float = 0.003
    real_share: float = 0.6
    eigenvalue_ratio: float = 0.01
    return_share: float = 0.6
    rival_margin: float = 0.08
    start_length: float = 0.12
    start_angle: float = 0.09
    starts: int = 8


@dataclass(frozen=True)
class MatchSettings:
    """How a pair is matched.

    Parameters
    ----------
    guess_length, guess_angle : float
        Standard deviation of the guess, metres and radians. Beyond ``local_length`` and
        ``local_angle`` a global search over three standard deviations is added.
    local_length, local_angle : float
        How far off a guess the local matcher alone is trusted with.
    search : SearchSettings
        Lattice of the global search.
    judgement : JudgementSettings
        Limits.
    """

    guess_length: float = 0.15
    guess_angle: float = 0.1
    local_length: float = 0.06
    local_angle: float = 0.06
    search: SearchSettings = field(default_factory=SearchSettings)
    judgement: JudgementSettings = field(default_factory=JudgementSettings)


@dataclass(frozen=True)
class Match:
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
    verdict : {"accept", "look", "reject"}
        What to do with it.
    reasons : tuple of str
        Why not 'accept'; empty if it is.
    engine : str
        What found it.
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
    pairs: int
    verdict: Verdict = "look"
    reasons: tuple[str, ...] = ()
    engine: str = "scanmatch"

    @property
    def sigma_length(self) -> float:
        """Standard deviation of the position along its worst direction, metres."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def sigma_angle(self) -> float:
        """Standard deviation of the heading, radians."""
        return float(np.sqrt(self.covariance[2, 2]))


def match(
    reference: Prepared,
    moving: Prepared,
    guess: npt.ArrayLike = (0.0, 0.0, 0.0),
    settings: MatchSettings | None = None,
) -> Match:
    """The pose of a sweep in the frame of another, judged.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array_like
        Moving frame in the reference frame, with the standard deviations of the settings.
    settings : MatchSettings
        How well the guess is known, and the limits.
    """
    settings = settings or MatchSettings()
    guess = np.asarray(guess, dtype=float)
    candidates = _candidates(reference, moving, guess, settings)
    return judged(reference, moving, guess, candidates, settings)


def judged(
    reference: Prepared,
    moving: Prepared,
    guess: Array,
    candidates: Array,
    settings: MatchSettings,
    engine: str = "scanmatch",
) -> Match:
    """The best of candidate poses, (k, 3), polished and judged, whatever engine found them."""
    limits = settings.judgement
    for _ in range(2):
        found = align(reference.surface, moving.surface, candidates, reach=0.15)
        seen = evidence(reference, moving, found.pose)
        best = _preferred(found.pose, seen.score, guess, settings)
        starts = found.pose[best] + _disturbances(limits)
        again = _again(reference, moving, starts)
        again_seen = evidence(reference, moving, again.pose, stride=2)
        if again_seen.score.max() < seen.score[best] + 0.1:
            break
        candidates = np.concatenate([found.pose, again.pose[[again_seen.score.argmax()]]])
    poses = np.concatenate([np.delete(found.pose, best, 0), again.pose])
    scores = np.concatenate([np.delete(seen.score, best), again_seen.score])
    loose = 3 * np.sqrt(np.diagonal(found.covariance[best]))
    same = _same(again.pose, found.pose[best], max(0.008, loose[:2].max()), max(0.004, loose[2]))
    rivals = ~_same(poses, found.pose[best], 0.1, 0.05)
    rival = float(scores[rivals].max()) if rivals.any() else -np.inf
    equal = again_seen.score > seen.score[best] - 0.03
    spread = _spread(again.pose[equal], found.pose[best])
    pose, covariance = both_ways(
        reference.surface, moving.surface, found.pose[best], found.covariance[best]
    )
    pose, covariance = _with_guess(pose, covariance + spread, guess, settings)
    return _with_verdict(
        Match(
            reference=reference.name,
            moving=moving.name,
            guess=guess,
            pose=pose,
            covariance=covariance,
            explained=float(seen.explained[best]),
            violating=float(seen.violating[best]),
            hidden=float(seen.hidden[best]),
            agreement=float(seen.explained[best] / max(1 - seen.hidden[best], 1e-9)),
            intruder=intruder(reference, moving, found.pose[best]),
            scale=float(found.scale[best]),
            real_share=_real_share(found, best),
            eigenvalue_ratio=_eigenvalue_ratio(found.information[best]),
            returned=float(same.mean()),
            rival=rival - float(seen.score[best]),
            pairs=int(found.pairs[best]),
            engine=engine,
        ),
        limits,
    )


def _candidates(
    reference: Prepared, moving: Prepared, guess: Array, settings: MatchSettings
) -> Array:
    """(k, 3) poses worth a judgement: from the guess, and from a search if it is uncertain."""
    reach = max(0.3, 2 * settings.guess_length)
    local = align(reference.surface, moving.surface, guess, reach=reach).pose
    sure = settings.guess_length <= settings.local_length
    sure &= settings.guess_angle <= settings.local_angle
    if sure:
        return local
    search = replace(
        settings.search,
        window=min(settings.search.window, 3 * settings.guess_length + 0.1),
        heading_window=min(settings.search.heading_window, 3 * settings.guess_angle + 0.1),
    )
    wide = global_match(reference, moving, guess, search)
    poses = np.concatenate([local, wide.alignment.pose])
    scores = evidence(reference, moving, poses, stride=2).score
    return poses[distinct(poses, scores, 0.02, 0.01, 4)]


def _preferred(poses: Array, scores: Array, guess: Array, settings: MatchSettings) -> int:
    """The pose with the best score, less a little for its distance from the guess.

    Along a corridor every place scores about the same, and the guess is all there is to go by.
    The discount, a hundredth a squared standard deviation and at most a tenth, is small against
    the difference between a right and a wrong pose.
    """
    length = (poses[:, :2] - guess[:2]) / settings.guess_length
    angle = wrap(poses[:, 2] - guess[2]) / settings.guess_angle
    discount = np.minimum(0.01 * ((length**2).sum(-1) + angle**2), 0.1)
    return int((scores - discount).argmax())


def _disturbances(settings: JudgementSettings) -> Array:
    """(starts, 3) offsets around the circle, headings alternating."""
    angle = 2 * np.pi * np.arange(settings.starts) / settings.starts
    turn = np.where(np.arange(settings.starts) % 2 == 0, 1.0, -1.0)
    return np.column_stack(
        [
            settings.start_length * np.cos(angle),
            settings.start_length * np.sin(angle),
            settings.start_angle * turn,
        ]
    )


def _same(poses: Array, pose: Array, length: float, angle: float) -> Flags:
    """(k,) whether poses agree within a length and an angle."""
    near = np.hypot(*(poses[:, :2] - pose[:2]).T) < length
    turned = np.abs(wrap(poses[:, 2] - pose[2]))
    return np.asarray(near & (turned < angle), dtype=bool)


def _again(reference: Prepared, moving: Prepared, starts: Array) -> Alignment:
    """Where disturbed starts end: most of the way with every other point, the rest with all.

    With half of the points all the way, they would end elsewhere by the noise of those alone,
    which is no sign of doubt.
    """
    near = align(reference.surface, moving.surface, starts, reach=0.25, stride=2, max_steps=20)
    return align(reference.surface, moving.surface, near.pose, reach=0.0, max_steps=FINISH)


def _spread(poses: Array, pose: Array) -> Array:
    """(3, 3) second moment of poses about a pose."""
    if not len(poses):
        return np.zeros((3, 3))
    difference = np.column_stack([poses[:, :2] - pose[:2], wrap(poses[:, 2] - pose[2])])
    return np.asarray(difference.T @ difference / len(poses))


def _with_guess(
    pose: Array, covariance: Array, guess: Array, settings: MatchSettings
) -> tuple[Array, Array]:
    """Pose and covariance of what the scans and the guess say together.

    Where the scans determine nothing (along a corridor), that is the guess; where they determine
    a direction to millimetres, the guess does not move it by a hundredth of that.
    """
    prior = np.diag([settings.guess_length**2, settings.guess_length**2, settings.guess_angle**2])
    if not np.isfinite(covariance).all():
        return guess.copy(), prior
    gain = covariance @ np.linalg.inv(covariance + prior)
    difference = guess - pose
    difference[2] = wrap(difference[2])
    joint = gain @ prior
    together = pose + gain @ difference
    together[2] = wrap(together[2])
    return together, (joint + joint.T) / 2


def _real_share(found: Alignment, best: int) -> float:
    """Least share of real information over the directions of the total."""
    fake = found.fake[best]
    total = found.information[best] + fake
    try:
        lower = np.linalg.inv(np.linalg.cholesky(total + 1e-9 * np.trace(total) * np.eye(3)))
    except np.linalg.LinAlgError:
        return 0.0
    return float(1 - np.linalg.eigvalsh(lower @ fake @ lower.T)[-1])


def _eigenvalue_ratio(information: Array) -> float:
    """Smallest over largest eigenvalue of the information on position, the heading free."""
    heading = max(float(information[2, 2]), 1e-9)
    cross = information[:2, 2]
    position = information[:2, :2] - np.outer(cross, cross) / heading
    values = np.linalg.eigvalsh(position)
    return float(max(values[0], 0.0) / max(values[1], 1e-9))


def _with_verdict(found: Match, limits: JudgementSettings) -> Match:
    """The match with its verdict: the worst of all checks, each with a sentence."""
    graded = [
        (found.explained, *limits.explained,
         f"only {found.explained:.0%} of the points lie on the other scan"),
        (found.agreement, *limits.agreement,
         f"of the points that both could see, only {found.agreement:.0%} agree"),
        (-found.violating, -limits.violating[0], -limits.violating[1],
         f"{found.violating:.0%} of the points lie where the other scanner saw free space"),
        (-found.scale, -limits.scale[0], -limits.scale[1],
         f"residuals are {found.scale:.1f} times what range noise explains"),
    ]  # fmt: skip
    remarks: list[tuple[Verdict, str]] = [
        ("reject" if value < bad else "look", text)
        for value, good, bad, text in graded
        if value < good
    ]
    remarks += [("look", text) for text in _doubts(found, limits)]
    verdicts: list[Verdict] = ["accept", *(verdict for verdict, _ in remarks)]
    worst = max(verdicts, key=SEVERITY.__getitem__)
    return replace(found, verdict=worst, reasons=tuple(text for _, text in remarks))


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
        (found.intruder > limits.intruder,
         f"a surface of {found.intruder:.1f} m stands where the other scanner saw free space"),
        (found.sigma_length > limits.sigma_length,
         f"standard deviation of the position {found.sigma_length * 1e3:.1f} mm"),
        (found.sigma_angle > limits.sigma_angle,
         f"standard deviation of the heading {found.sigma_angle * 1e3:.1f} mrad"),
        (found.returned < limits.return_share,
         f"only {found.returned:.0%} of the disturbed starts come back to this pose"),
        (found.rival > -limits.rival_margin,
         "a different pose agrees as well with what was seen"),
    ]  # fmt: skip
    return [text for bad, text in checks if bad]
