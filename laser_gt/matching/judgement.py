"""Judgement of a match: is it right, is it precise, and why not.

Neither a small residual nor a solver that says 'converged' makes a match right. What is asked
here is whether everything both sensors saw agrees with the pose, whether the pose is determined
in every direction, and whether another pose would do as well.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from laser_gt.matching.both_ways import both_ways
from laser_gt.matching.local import LAST_STEPS, Alignment, align
from laser_gt.matching.search import SearchSettings, distinct, global_match
from laser_gt.matching.verdicts import JudgementSettings, Match, with_verdict
from laser_gt.scans.evidence import Evidence, Prepared, evidence, intruder
from laser_gt.scans.nearest import published_fitness
from laser_gt.scans.planar import CONTRADICTION, transform, wrapped
from laser_gt.scans.scan import Flags
from validation.poses.angles import Array, wrap

NOTHING = np.array([1e-2, 1e-2, 1e-2])
"""Information taken for none, in 1 / square metres and 1 / square radians: a standard deviation of
ten, beyond any room and any heading, and near enough for the equations to be solved."""

FINISH = 5
"""Steps with all points at the end of a disturbed start. A judgement: with a third of the points
the start has ended within the noise of those, from where it is not far."""


NEAR = 3e-4
"""Steps of a disturbed start with a third of the points end below this, in metres and radians: a
tenth of the standard deviation from which on a match is imprecise, or less. The rest of the way has
all points."""


TOGETHER = 3 * NEAR
"""Starts that end within this of each other, in metres and radians, are at the same pose: what is
left to each of them is about one more step."""

SAME = np.array([0.008, 0.008, 0.004])
"""Floors of what is called the same pose, metres and radians. A judgement, a little more than what
an accepted match may be off."""

BACK = 3.0
"""Standard deviations of the pose found within which a disturbed start with a third of the points
is back at it, `SAME` at most. Measured on 160 pairs of rooms and corridors: of 1,244 starts that
came as near, all ended there with all points, one 0.6 of them away and the others 0.35."""

AS_GOOD, ENOUGH = 0.06, 0.5
"""Of two poses one is as good if of what both scans could see as much agrees, to a few points as
noise makes them, and if they see half as much. Along equal niches the pose a niche nearer lays more
of one scan over the other, and is no better for that."""

POLISHED = 0.05
"""Candidates come from a matcher that has polished them with all points; they are off by less than
this, in metres."""


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
        found = align(
            reference.surface, moving.surface, candidates, reach=POLISHED, small_step=NEAR
        )
        seen = evidence(reference, moving, found.pose)
        best = _preferred(found.pose, seen.score, guess, settings)
        again, back = _again(reference, moving, found, best, limits)
        again_score = np.full(len(again), seen.score[best])
        again_alike = np.zeros(len(again), dtype=bool)
        if not back.all():
            others = evidence(reference, moving, again[~back], stride=2)
            again_score[~back], again_alike[~back] = others.score, _alike(others, seen, best)
        # A judgement: a score higher by a tenth of all points is another pose, not noise.
        if again_score.max() < seen.score[best] + 0.1:
            break
        candidates = np.concatenate([found.pose, again[[again_score.argmax()]]])
    poses = np.concatenate([np.delete(found.pose, best, 0), again])
    scores = np.concatenate([np.delete(seen.score, best), again_score])
    alike = np.concatenate([np.delete(_alike(seen, seen, best), best), again_alike])
    loose = 3 * np.sqrt(np.diagonal(found.covariance[best]))
    same = _same(again, found.pose[best], max(SAME[0], loose[:2].max()), max(SAME[2], loose[2]))
    # A judgement: scores this near differ by a few points, as noise makes them.
    equal = again_score > seen.score[best] - 0.03
    spread = _spread(again[equal], found.pose[best])
    seen_pose, seen_covariance, information = _by_scans(
        reference, moving, found, best, guess, limits, spread
    )
    rivals = _rivals(poses, found.pose[best], seen_covariance)
    rival, rival_fitness = -np.inf, np.nan
    if rivals.any():
        # One that agrees in all that both see is as good, however little that is.
        level = np.where(alike, np.maximum(scores, seen.score[best]), scores)
        rival = float(level[rivals].max())
        rival_pose = poses[rivals][level[rivals].argmax()]
        rival_fitness = _fitness(reference, moving, rival_pose)
    surprise = _surprise(seen_pose, seen_covariance, guess, settings)
    pose, covariance = _with_guess(seen_pose, information, guess, settings)
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
            intruder=intruder(reference, moving, seen, best),
            scale=float(found.scale[best]),
            real_share=_real_share(found, best),
            eigenvalue_ratio=_eigenvalue_ratio(found.information[best]),
            returned=float(same.mean()),
            rival=rival - float(seen.score[best]),
            surprise=surprise,
            fitness=_fitness(reference, moving, pose),
            rival_fitness=rival_fitness,
            seen_pose=seen_pose,
            seen_covariance=seen_covariance,
        ),
        limits,
    )


def _alike(others: Evidence, seen: Evidence, best: int) -> Flags:
    """(k,) whether poses agree as well as the best in what both see, and see half as much."""
    enough = others.overlap >= ENOUGH * seen.overlap[best]
    return np.asarray(enough & (others.quality >= seen.quality[best] - AS_GOOD), dtype=bool)


def _fitness(reference: Prepared, moving: Prepared, pose: Array) -> float:
    """The document's fitness of a pose, square metres."""
    return published_fitness(reference.tree, transform(pose, moving.sweep.points))


def _candidates(
    reference: Prepared, moving: Prepared, guess: Array, settings: MatchSettings
) -> Array:
    """(k, 3) poses worth a judgement: from the guess, and from a search if it is uncertain."""
    # Two standard deviations of the guess; at least 0.3 m, a judgement: half of a doorway.
    reach = max(0.3, 2 * settings.guess_length)
    local = align(
        reference.surface, moving.surface, guess, reach=reach, small_step=NEAR, covariance=False
    ).pose
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


def _rivals(poses: Array, pose: Array, covariance: Array) -> Flags:
    """(k,) whether poses are others than the one found, and not what its covariance allows.

    Along a corridor every place is as good as another, and the covariance says so: that is
    imprecise, and no rival.
    """
    # A judgement: 10 cm and 3 degrees are beyond the noise of any match and within any guess.
    other = ~_same(poses, pose, 0.1, 0.05)
    apart = wrapped(poses - pose)
    squared = (apart * np.linalg.solve(covariance, apart.T).T).sum(-1)
    return np.asarray(other & (squared > CONTRADICTION), dtype=bool)


def _again(
    reference: Prepared, moving: Prepared, found: Alignment, best: int, limits: JudgementSettings
) -> tuple[Array, Flags]:
    """(k, 3), (k,) where disturbed starts end, and which of them are back at the pose found.

    Most of the way with every third point, the rest with all: with a third of them all the way,
    they would end elsewhere by the noise of those alone, which is no sign of doubt. What is no
    further than that from the pose found would end there (`BACK`); others that have come together
    go the rest of the way as one.
    """
    pose = found.pose[best]
    near = np.minimum(BACK * np.sqrt(np.diagonal(found.covariance[best])), SAME)
    ends = align(
        reference.surface,
        moving.surface,
        pose + _disturbances(limits),
        reach=0.25,
        stride=3,
        max_steps=20,
        small_step=NEAR,
        covariance=False,
        home=(pose, near),
    ).pose
    away = np.flatnonzero((np.abs(wrapped(ends - pose)) > near).any(-1))
    back = np.ones(len(ends), dtype=bool)
    back[away] = False
    ends[back] = pose
    if away.size:
        apart = np.abs(wrapped(ends[away, None] - ends[away])).max(-1)
        first, which = np.unique((apart < TOGETHER).argmax(1), return_inverse=True)
        ends[away] = align(
            reference.surface,
            moving.surface,
            ends[away[first]],
            reach=0.0,
            max_steps=FINISH,
            small_step=NEAR / 3,
            covariance=False,
        ).pose[which]
    return ends, back


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


def _by_scans(
    reference: Prepared,
    moving: Prepared,
    found: Alignment,
    best: int,
    guess: Array,
    limits: JudgementSettings,
    spread: Array,
) -> tuple[Array, Array, Array]:
    """Pose, covariance and information of what both scans say without the guess.

    In the directions that they do not determine (`_undetermined`) the pose is put back to the
    guess, wherever chance or a search has moved it, and the information is none.
    """
    free, determined = _undetermined(found, best, limits.real_share)
    start = found.pose[best]
    if free.shape[1] and np.isfinite(found.covariance[best]).all():
        start = wrapped(start + (np.eye(3) - determined) @ wrapped(guess - start))
    loose = BACK * np.sqrt(np.diagonal(found.covariance[best]))
    pose, covariance = _finest(reference, moving, start, np.maximum(loose, SAME))
    if not np.isfinite(covariance).all():
        return guess.copy(), np.diag(1 / NOTHING), np.zeros((3, 3))
    if free.shape[1]:
        pose = wrapped(pose + (np.eye(3) - determined) @ wrapped(guess - pose))
        spread = determined @ spread @ determined.T
    information = determined.T @ np.linalg.inv(covariance + spread) @ determined
    covariance = np.asarray(np.linalg.inv(information + np.diag(NOTHING)))
    return pose, (covariance + covariance.T) / 2, information


def _finest(
    reference: Prepared, moving: Prepared, start: Array, near: Array
) -> tuple[Array, Array]:
    """Pose and covariance both ways from where the scans lie over each other already.

    By the short lines, too; where these lead further away than (3,) metres and radians, without.
    """
    one, other = reference.fine, moving.fine
    found = align(one, other, start, reach=POLISHED, max_steps=LAST_STEPS, covariance=False)
    if not (np.abs(wrapped(found.pose[0] - start)) < near).all():
        one, other = reference.surface, moving.surface
        found = align(one, other, start, reach=POLISHED, max_steps=LAST_STEPS, covariance=False)
    return both_ways(one, other, found)


def _undetermined(found: Alignment, best: int, real_share: float) -> tuple[Array, Array]:
    """(3, k) directions that the scans do not determine, and the (3, 3) projection along them.

    In coordinates in which all information is the identity, they are those of which too little
    is real: the rest is scatter of normals.
    """
    fake = found.fake[best]
    total = found.information[best] + fake
    total = total + (1e-9 * np.trace(total) + 1e-9) * np.eye(3)
    whitener = np.linalg.inv(np.linalg.cholesky(total))
    share, axes = np.linalg.eigh(whitener @ fake @ whitener.T)
    free = (whitener.T @ axes)[:, share > 1 - real_share]
    return free, np.eye(3) - free @ free.T @ total


def _surprise(pose: Array, covariance: Array, guess: Array, settings: MatchSettings) -> float:
    """Squared distance of a pose from its guess in standard deviations of both."""
    difference = wrapped(pose - guess)
    return float(difference @ np.linalg.solve(covariance + _prior(settings), difference))


def _with_guess(
    pose: Array, information: Array, guess: Array, settings: MatchSettings
) -> tuple[Array, Array]:
    """Pose and covariance of what the scans and the guess say together.

    Where the scans determine nothing (along a corridor), that is the guess; where they determine
    a direction to millimetres, the guess does not move it by a hundredth of that.
    """
    known = np.linalg.inv(_prior(settings))
    joint = np.linalg.inv(information + known)
    together = wrapped(pose + joint @ known @ wrapped(guess - pose))
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
