"""The document's two filters, transcribed as they are printed.

For comparison only: the second listing takes its inputs as variances where the first squares
them, robot-frame points are given "covariance 0.010" (a standard deviation of 10 cm if it is
one), and every reading is taken as independent. Plain loops, so that they can be read beside
the page (AD2.3, pages 15, 24 and 25).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from survey.estimation.robot_frames import pose_readings
from survey.estimation.solve import SurveySolution
from survey.estimation.world_points import place_readings
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.poses.angles import Array

PASSES = 20
LASER_SIGMA = 0.008
VFRAME_SIGMA = 0.002
ROBOT_POINT_COVARIANCE = 0.010
WORLD_POINT_COVARIANCE = 0.000004
WORLD_POINT_PRIOR = 100.0
ROBOT_POSE_PRIOR = (1000.0, 1000.0, 100.0)
"""All as printed."""


@dataclass(frozen=True)
class PublishedEstimate:
    """What a listing leaves behind: state x and covariance P."""

    x: Array
    P: Array


def world_point_filter(
    d: Sequence[float],
    vframe_points: Sequence[Sequence[float]],
    start: Sequence[float],
    sigma: tuple[float, float] = (LASER_SIGMA, VFRAME_SIGMA),
) -> PublishedEstimate:
    """A world point by the first listing.

    Parameters
    ----------
    d : sequence of m floats
        Distances, metres.
    vframe_points : sequence of m pairs
        The Vframe point of each, metres.
    start : pair
        First guess, metres.
    sigma : pair
        Standard deviations of the readings and of the Vframe coordinates; squared in R.
    """
    x = np.array(start, dtype=float)
    P = np.eye(2)
    for _ in range(PASSES):
        P = np.eye(2) * WORLD_POINT_PRIOR**2
        for k in range(len(d)):
            xw1, yw1 = vframe_points[k]
            R = np.diag([sigma[0], sigma[1], sigma[1]]) ** 2
            x1, x2 = x
            h = (xw1 - x1) ** 2 + (yw1 - x2) ** 2 - d[k] ** 2
            H = np.array([-2 * (xw1 - x1), -2 * (yw1 - x2)])
            W = np.array([-2 * d[k], 2 * (xw1 - x1), 2 * (yw1 - x2)])
            S = H @ P @ H + W @ R @ W
            K = P @ H / S
            P = P - np.outer(K, K) * S
            x = x + K * (-h)
    return PublishedEstimate(x, P)


def robot_frame_filter(
    d: Sequence[float],
    world_points: Sequence[Sequence[float]],
    robot_points: Sequence[Sequence[float]],
    start: Sequence[float],
    variances: tuple[float, float, float] = (
        LASER_SIGMA,
        WORLD_POINT_COVARIANCE,
        ROBOT_POINT_COVARIANCE,
    ),
) -> PublishedEstimate:
    """A robot frame by the second listing.

    Parameters
    ----------
    d : sequence of m floats
        Distances, metres.
    world_points, robot_points : sequences of m pairs
        World point (Vframe) and robot-frame point of each, metres.
    start : triple
        First guess x, y, theta.
    variances : triple
        Diagonal of R for readings, world points and robot-frame points; *not* squared, as
        printed. Give variances to have the filter with consistent units.
    """
    x = np.array(start, dtype=float)
    P = np.eye(3)
    for _ in range(PASSES):
        P = np.diag(ROBOT_POSE_PRIOR)
        for k in range(len(d)):
            xw1, yw1 = world_points[k]
            xr1, yr1 = robot_points[k]
            v_d, v_w, v_r = variances
            R = np.diag([v_d, v_w, v_w, v_r, v_r])
            x1, x2, x3 = x
            c, s = np.cos(x3), np.sin(x3)
            dx = xw1 - (xr1 * c - yr1 * s + x1)
            dy = yw1 - (xr1 * s + yr1 * c + x2)
            h = dx**2 + dy**2 - d[k] ** 2
            H = np.array(
                [
                    -2 * dx,
                    -2 * dy,
                    2 * dx * (xr1 * s + yr1 * c) + 2 * dy * (-xr1 * c + yr1 * s),
                ]
            )
            W = np.array(
                [
                    -2 * d[k],
                    2 * dx,
                    2 * dy,
                    -2 * dx * c - 2 * dy * s,
                    2 * dx * s - 2 * dy * c,
                ]
            )
            S = H @ P @ H + W @ R @ W
            K = P @ H / S
            P = P - np.outer(K, K) * S
            x = x + K * (-h)
    return PublishedEstimate(x, P)


@dataclass(frozen=True)
class AsPublished:
    """What the two listings make of the readings of a survey.

    Parameters
    ----------
    world : mapping of str to PublishedEstimate
        World points by the first, metres.
    frames : mapping of str to PublishedEstimate
        Robot frames by the second, metres and radians.
    lost_from_origin, own_from_origin : mapping of str to float
        How far from this program's world point the first listing, and this program's filter, end
        when started at the Vframe's origin, metres; infinite where it ends nowhere.
    """

    world: Mapping[str, PublishedEstimate]
    frames: Mapping[str, PublishedEstimate]
    lost_from_origin: Mapping[str, float]
    own_from_origin: Mapping[str, float]


def as_published_estimates(
    solution: SurveySolution, readings: Readings, vframe: Vframe, rig: RobotFrame
) -> AsPublished:
    """The two listings, started from this program's solution, and from the Vframe's origin.

    Parameters
    ----------
    solution : SurveySolution
        Says which world points and robot frames there are, and where they start.
    readings : Readings
        The readings that it was found from.
    vframe : Vframe
        Nominal frame.
    rig : RobotFrame
        Nominal robot frame.

    Notes
    -----
    AD2.3, "Determination of the coordinates of the world-points": a local method "might not
    converge, if not properly initialized, and indeed it happened when we were initializing it in
    the origin of the Vframe".
    """
    world, frames, lost, own_lost = {}, {}, {}, {}
    for point in solution.world.points:
        own = readings.touching([point.name], list(vframe.points))
        places, distances = [vframe.points[name] for name in own.end], list(own.distance)
        world[point.name] = world_point_filter(distances, places, list(point.position))
        with np.errstate(all="ignore"):  # it may end anywhere
            strayed = world_point_filter(distances, places, (0.0, 0.0)).x
        lost[point.name] = _away(strayed, point.position)
        ended = place_readings(own, solution.vframe).ends(np.zeros((1, 2))).state[0]
        own_lost[point.name] = _away(ended, point.position)
    for frame in solution.frames:
        pose = pose_readings(frame.pose, readings, solution.world, rig)
        known, body = pose.known.tolist(), pose.body.tolist()
        frames[frame.pose] = robot_frame_filter(list(pose.distance), known, body, list(frame.state))
    return AsPublished(world, frames, lost, own_lost)


def _away(place: Array, solution: Array) -> float:
    """Distance in metres; infinite for a place that is none."""
    off = float(np.linalg.norm(place - solution))
    return off if np.isfinite(off) else float("inf")
