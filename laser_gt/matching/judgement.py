"""Judgement of a match: accept, look or reject, with the reasons.

Neither a small residual nor a solver that says 'converged' makes a match right. What is asked
here is whether everything both sensors saw agrees with the pose, whether the pose is determined
in every direction, and whether another pose would do as well.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from laser_gt.matching.both_ways import both_ways
from laser_gt.matching.local import Alignment, align
from laser_gt.matching.search import SearchSettings, distinct, global_match
from laser_gt.matching.verdicts import JudgementSettings, Match, with_verdict
from laser_gt.scans.evidence import Prepared, evidence, intruder
from laser_gt.scans.nearest import published_fitness
from laser_gt.scans.planar import transform, wrapped
from laser_gt.scans.scan import Flags
from validation.poses.angles import Array, wrap

FINISH = 5
"""Steps with all points at the end of a disturbed start. A judgement: with half of the points the
start has ended within the noise of those, from where it is not far."""


@dataclass(frozen=True)
class MatchSettings:
    """How a pair is matched.

    Parameters
    ----------
    guess_length, guess_angle : float
        Standard deviation of the guess, metres and radians. A judgement: that of odometry over
        the few metres between two stops. Beyond ``local_length`` and
        ``local_angle`` a global search over three standard deviations is added.
    local_length, local_angle : float
        How far off a guess the local matcher alone is trusted with. A judgement: three of these
        standard deviations are 0.18 m and 10 degrees, less than walls and furniture are apart.
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


def match(
    reference: Prepared,
    moving: Prepared,
    guess: npt.ArrayLike = (0.0, 0.0, 0.0),
    settings: MatchSettings | None = None,
    start: npt.ArrayLike | None = None,
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
    start : (3,) array_like, optional
        Where to look first, if some other matcher has been there; the guess if not given.
    """
    settings = settings or MatchSettings()
    guess = np.asarray(guess, dtype=float)
    first = guess if start is None else np.asarray(start, dtype=float)
    candidates = _candidates(reference, moving, first, settings)
    return judged(reference, moving, guess, candidates, settings)


def judged(
    reference: Prepared,
    moving: Prepared,
    guess: Array,
    candidates: Array,
    settings: MatchSettings,
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
        # A judgement: a score higher by a tenth of all points is another pose, not noise.
        if again_seen.score.max() < seen.score[best] + 0.1:
            break
        candidates = np.concatenate([found.pose, again.pose[[again_seen.score.argmax()]]])
    poses = np.concatenate([np.delete(found.pose, best, 0), again.pose])
    scores = np.concatenate([np.delete(seen.score, best), again_seen.score])
    loose = 3 * np.sqrt(np.diagonal(found.covariance[best]))
    # Floors of "the same": a judgement, a little more than what an accepted match may be off.
    same = _same(again.pose, found.pose[best], max(0.008, loose[:2].max()), max(0.004, loose[2]))
    # A judgement: 10 cm and 3 degrees are beyond the noise of any match and within any guess.
    rivals = ~_same(poses, found.pose[best], 0.1, 0.05)
    rival, rival_fitness = -np.inf, np.nan
    if rivals.any():
        rival = float(scores[rivals].max())
        rival_pose = poses[rivals][scores[rivals].argmax()]
        rival_fitness = _fitness(reference, moving, rival_pose)
    # A judgement: scores this near differ by a few points, as noise makes them.
    equal = again_seen.score > seen.score[best] - 0.03
    spread = _spread(again.pose[equal], found.pose[best])
    pose, covariance = both_ways(
        reference.surface, moving.surface, found.pose[best], found.covariance[best]
    )
    covariance = covariance + spread
    surprise = _surprise(pose, covariance, guess, settings)
    pose, covariance = _with_guess(pose, covariance, guess, settings)
    return with_verdict(
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
            surprise=surprise,
            fitness=_fitness(reference, moving, pose),
            rival_fitness=rival_fitness,
        ),
        limits,
    )


def _fitness(reference: Prepared, moving: Prepared, pose: Array) -> float:
    """The document's fitness of a pose, square metres."""
    moved = transform(pose, moving.sweep.points)
    return published_fitness(reference.sweep.points, moved)


def _candidates(
    reference: Prepared, moving: Prepared, guess: Array, settings: MatchSettings
) -> Array:
    """(k, 3) poses worth a judgement: from the guess, and from a search if it is uncertain."""
    # Two standard deviations of the guess; at least 0.3 m, a judgement: half of a doorway.
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
    difference = wrapped(poses - pose)
    return np.asarray(difference.T @ difference / len(poses))


def _prior(settings: MatchSettings) -> Array:
    """(3, 3) covariance of the guess."""
    length, angle = settings.guess_length, settings.guess_angle
    return np.diag([length**2, length**2, angle**2])


def _surprise(pose: Array, covariance: Array, guess: Array, settings: MatchSettings) -> float:
    """Squared distance of a pose from its guess in standard deviations of both."""
    if not np.isfinite(covariance).all():
        return 0.0
    difference = wrapped(pose - guess)
    return float(difference @ np.linalg.solve(covariance + _prior(settings), difference))


def _with_guess(
    pose: Array, covariance: Array, guess: Array, settings: MatchSettings
) -> tuple[Array, Array]:
    """Pose and covariance of what the scans and the guess say together.

    Where the scans determine nothing (along a corridor), that is the guess; where they determine
    a direction to millimetres, the guess does not move it by a hundredth of that.
    """
    prior = _prior(settings)
    if not np.isfinite(covariance).all():
        return guess.copy(), prior
    gain = covariance @ np.linalg.inv(covariance + prior)
    difference = wrapped(guess - pose)
    joint = gain @ prior
    together = wrapped(pose + gain @ difference)
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
