"""What a survey will be worth, before anyone goes to the room, and what would help it most.

The covariance of the joint adjustment depends on places and pairs alone, not on what is read. So
it can be had from a plan, and for a survey that exists it says what one more reading would change.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from survey.estimation.adjustment import Adjustment, adjust
from survey.estimation.geometry import rotate
from survey.estimation.network import build_network, distance_entries, start_parameters
from survey.estimation.reliability import added_reading_gain
from survey.readings.hidden_pairs import Pair
from survey.readings.instrument import reading_sigma
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.campaign.folder import Instrument, RobotFrame, Vframe
from validation.poses.angles import Array

_CHUNK = 2000
"""Candidates weighed at a time: with 300 unknowns, 5 MB."""


@dataclass(frozen=True)
class ExtraReading:
    """A reading that would help.

    Parameters
    ----------
    start, end : str
        What to measure.
    repeated : bool
        Whether the pair is in the survey already.
    before, after : float
        Uncertainty of the poses (or, without poses, of the world points) before and after it, all
        earlier extra readings taken as done; see `typical_uncertainty`.
    """

    start: str
    end: str
    repeated: bool
    before: float
    after: float


def planned_readings(
    vframe: Vframe,
    rig: RobotFrame,
    world: Mapping[str, Array],
    poses: Mapping[str, Array],
    instrument: Instrument,
    hidden: Collection[Pair] = (),
    *,
    repeat: int = 1,
) -> Readings:
    """The readings of a plan, each as long as the planned places are apart.

    Parameters
    ----------
    vframe, rig : Vframe, RobotFrame
        Nominal frame and robot frame.
    world : mapping of str to (2,) array
        Planned world points, metres, Vframe.
    poses : mapping of str to (3,) array
        Planned stops.
    instrument : Instrument
        Gives sigma; pairs outside its range are left out.
    hidden : collection of frozenset of two str
        Pairs that cannot be seen.
    repeat : int
        How often each pair is read.

    Notes
    -----
    All pairs within the Vframe, between Vframe and world points, and between world points and the
    marks of the stops.
    """
    places = planned_places(vframe, rig, world, poses)
    marks = [name for name in places if robot_point(name) is not None]
    pairs = [
        *combinations(vframe.points, 2),
        *((v, w) for w in world for v in vframe.points),
        *((m, w) for m in marks for w in world),
    ]
    chosen = []
    for a, b in pairs:
        distance = float(np.linalg.norm(places[a] - places[b]))
        in_range = instrument.range_min <= distance <= instrument.range_max
        if in_range and frozenset((a, b)) not in hidden:
            chosen += [(a, b, distance)] * repeat
    distances = np.array([distance for _, _, distance in chosen])
    return Readings(
        start=tuple(a for a, _, _ in chosen),
        end=tuple(b for _, b, _ in chosen),
        distance=distances,
        sigma=reading_sigma(instrument, distances),
    )


def planned_places(
    vframe: Vframe, rig: RobotFrame, world: Mapping[str, Array], poses: Mapping[str, Array]
) -> dict[str, Array]:
    """Nominal place of every Vframe point, world point and mark, metres, in the Vframe."""
    places = {name: np.array(point, dtype=float) for name, point in vframe.points.items()}
    places |= {name: np.asarray(point, dtype=float) for name, point in world.items()}
    for pose, state in poses.items():
        for name, point in rig.points.items():
            places[f"{pose}/{name}"] = state[:2] + rotate(state[2], np.array(point, dtype=float))
    return places


def planned_adjustment(
    vframe: Vframe,
    rig: RobotFrame,
    world: Mapping[str, Array],
    poses: Mapping[str, Array],
    readings: Readings,
) -> Adjustment:
    """The joint adjustment that planned readings will have; its covariance is the prediction.

    Raises
    ------
    GtvalError
        If the plan leaves something undetermined, naming it.
    """
    network, _ = build_network(vframe, rig, readings, list(world), list(poses))
    nominal = np.array(list(vframe.points.values()), dtype=float)
    return adjust(network, start_parameters(network, nominal, world, poses))


def repeated_stop_covariance(adjustment: Adjustment, pose: str) -> Array:
    """Covariance of the motion found when a stop is moved a little and surveyed again.

    Parameters
    ----------
    adjustment : Adjustment
        The survey, with the stop in it once.
    pose : str
        The stop.

    Returns
    -------
    (3, 3) array
        Of dx, dy, dtheta between the two stops, metres and radians.

    Notes
    -----
    The second stop has rows A (its marks and pose) and B (what it shares: world points, rig)
    equal to those of the first. Given the shared unknowns s, its own are G s with covariance
    (A^T A)^-1, G = -(A^T A)^-1 A^T B; and it adds the information B^T B + B^T A G about s. Errors
    of s move both stops alike and cancel to a large part.
    """
    own, shared = _own_and_shared(adjustment, pose)
    weight = np.ones(adjustment.jacobian.shape[0])
    weight[: len(adjustment.weight)] = np.sqrt(adjustment.weight)
    jacobian = adjustment.jacobian.multiply(weight[:, None]).tocsr()
    rows = np.unique(jacobian[:, own].nonzero()[0])
    A, B = jacobian[rows][:, own].toarray(), jacobian[rows][:, shared].toarray()
    alone = np.linalg.inv(A.T @ A)
    G = -alone @ A.T @ B
    information = B.T @ B + B.T @ A @ G
    pose_rows = adjustment.pose_rows([pose])
    needed = np.concatenate([shared, pose_rows])
    before = adjustment.cofactors.block(needed)
    n = len(shared)
    gain = np.linalg.solve(np.eye(n) + information @ before[:n, :n], information @ before[:n])
    after = before - before[:, :n] @ gain
    of_pose = np.searchsorted(own, pose_rows)
    G_pose = G[of_pose]
    second = alone[np.ix_(of_pose, of_pose)] + G_pose @ after[:n, :n] @ G_pose.T
    cross = G_pose @ after[:n, n:]
    return np.asarray(second + after[n:, n:] - cross - cross.T)


def _own_and_shared(
    adjustment: Adjustment, pose: str
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Columns of a stop's marks and pose, and of all that other stops may use too."""
    marks = [name for name in adjustment.network.points if (robot_point(name) or ("",))[0] == pose]
    own = np.sort(np.concatenate([adjustment.point_rows(marks), adjustment.pose_rows([pose])]))
    jacobian = adjustment.jacobian.tocsr()
    rows = np.unique(jacobian[:, own].nonzero()[0])
    touched = np.unique(jacobian[rows].nonzero()[1])
    return own, np.setdiff1d(touched, own)


def uncertainty_weights(adjustment: Adjustment) -> Array:
    """(u,) weights that turn the variances of all unknowns into one number to make small.

    Notes
    -----
    The mean square uncertainty of a rig point over all stops: x and y count fully, the heading
    times the mean squared arm of the rig. Without stops, that of a world point's coordinates.
    """
    network = adjustment.network
    weights = np.zeros(len(adjustment.cofactors))
    if network.poses:
        arm = float((network.rig**2).sum(-1).mean())
        per_pose = np.array([1.0, 1.0, arm]) / len(network.poses)
        weights[adjustment.pose_rows(network.poses)] = np.tile(per_pose, len(network.poses))
        return weights
    names = world_names(adjustment)
    weights[adjustment.point_rows(names)] = 1 / max(len(names), 1)
    return weights


def world_names(adjustment: Adjustment) -> list[str]:
    """Names of the world points of a network."""
    network = adjustment.network
    others = set(network.fixed.tolist()) | set(network.mark.tolist())
    return [name for i, name in enumerate(network.points) if i not in others]


def typical_uncertainty(adjustment: Adjustment) -> float:
    """Root mean square uncertainty in the plane of a rig point (or world point), metres."""
    return float(np.sqrt(uncertainty_weights(adjustment) @ adjustment.cofactors.variances))


def candidate_pairs(
    adjustment: Adjustment, instrument: Instrument, hidden: Collection[Pair] = ()
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]:
    """Readings that could be added: new pairs and repeated ones.

    Returns
    -------
    first, second : (c,) array of int
        Rows in ``network.points``.
    sigma : (c,) array
        Metres.
    """
    network = adjustment.network
    frame, marks = network.fixed, network.mark
    world = np.array(
        [network.points.index(name) for name in world_names(adjustment)], dtype=np.intp
    )
    upper = np.triu_indices(len(frame), 1)
    first = np.concatenate(
        [frame[upper[0]], np.repeat(frame, len(world)), np.repeat(marks, len(world))]
    )
    second = np.concatenate(
        [frame[upper[1]], np.tile(world, len(frame)), np.tile(world, len(marks))]
    )
    places = adjustment.parameters.points
    distance = np.linalg.norm(places[first] - places[second], axis=-1)
    usable = (distance >= instrument.range_min) & (distance <= instrument.range_max)
    names = network.points
    usable &= np.array(
        [frozenset((names[a], names[b])) not in hidden for a, b in zip(first, second, strict=True)],
        dtype=bool,
    )
    return first[usable], second[usable], reading_sigma(instrument, distance[usable])


def best_extra_readings(
    adjustment: Adjustment, instrument: Instrument, hidden: Collection[Pair] = (), count: int = 8
) -> list[ExtraReading]:
    """The readings that help most, one after the other.

    Parameters
    ----------
    adjustment : Adjustment
        The survey or plan.
    instrument : Instrument
        Gives their sigma and range.
    hidden : collection of frozenset of two str
        Pairs that cannot be seen.
    count : int
        How many.

    Notes
    -----
    Greedy: each candidate's effect is a rank-one update of the covariance; the best is taken as
    done before the next is sought, so that they do not all mend the same spot.
    """
    first, second, sigma = candidate_pairs(adjustment, instrument, hidden)
    if len(first) == 0:
        return []
    network = adjustment.network
    there = {frozenset(pair) for pair in zip(network.first, network.second, strict=True)}
    weights = uncertainty_weights(adjustment)
    found = []
    for _ in range(count):
        gain = _weighted_gain(adjustment, first, second, sigma, weights)
        best = int(gain.argmax())
        updated = with_extra_reading(adjustment, int(first[best]), int(second[best]), sigma[best])
        found.append(
            ExtraReading(
                start=network.points[first[best]],
                end=network.points[second[best]],
                repeated=frozenset((first[best], second[best])) in there,
                before=typical_uncertainty(adjustment),
                after=typical_uncertainty(updated),
            )
        )
        there.add(frozenset((first[best], second[best])))
        adjustment = updated
    return found


def _weighted_gain(
    adjustment: Adjustment,
    first: npt.NDArray[np.intp],
    second: npt.NDArray[np.intp],
    sigma: Array,
    weights: Array,
) -> Array:
    """(c,) decrease of the weighted sum of variances by each candidate."""
    parts = [
        added_reading_gain(adjustment, first[at], second[at], sigma[at]) @ weights
        for at in np.array_split(np.arange(len(first)), len(first) // _CHUNK + 1)
    ]
    return np.concatenate(parts)


def with_extra_reading(adjustment: Adjustment, first: int, second: int, sigma: float) -> Adjustment:
    """The adjustment with the covariance that one more reading leaves; nothing else is changed."""
    points = adjustment.parameters.points
    entries = distance_entries(points[[first]], points[[second]])[0]
    columns = np.array([2 * first, 2 * first + 1, 2 * second, 2 * second + 1])
    row = np.zeros(len(adjustment.cofactors))
    row[columns] = entries
    along = adjustment.cofactors.times(row)
    variance = sigma**2 + float(along[columns] @ entries)
    return replace(adjustment, cofactors=adjustment.cofactors.less(along, variance))


def weak_points(readings: Readings, vframe: Vframe, world: Sequence[str]) -> dict[str, int]:
    """World points with fewer than three Vframe points in view, and how many they have.

    With two, two places fit equally well, which no covariance shows.
    """
    seen: dict[str, set[str]] = {name: set() for name in world}
    own = readings.touching(list(world), list(vframe.points))
    for point, end in zip(own.start, own.end, strict=True):
        seen[point].add(end)
    return {name: len(ends) for name, ends in seen.items() if len(ends) < 3}


def diagonal_blocks(adjustment: Adjustment, rows: npt.NDArray[np.intp], size: int) -> Array:
    """Covariances (n, size, size) of n things that take ``size`` of the given rows each."""
    return adjustment.cofactors.blocks(rows.reshape(-1, size))
