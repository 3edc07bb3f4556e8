"""World points that the Vframe alone does not give, located from the robot's marks too.

A mark on the wall that an obstacle hides from the Vframe is often read from many stops. Once those
stops are known it is as good a world point as any: it gets its start here, and its place and
covariance in the joint adjustment.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from survey.estimation.distance_fit import coordinate_sigma, place_fit
from survey.estimation.geometry import rotate
from survey.estimation.robot_frames import RobotFrameFit
from survey.estimation.vframe import VframeEstimate
from survey.estimation.world_points import (
    GOOD_REST,
    MOST_CIRCLES,
    TIE,
    NotLocated,
    circle_starts,
)
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array


def locate_from_marks(
    missing: Sequence[NotLocated],
    readings: Readings,
    vframe: VframeEstimate,
    frames: Sequence[RobotFrameFit],
    rig: RobotFrame,
) -> dict[str, Array]:
    """Places (2,) in metres, Vframe, of the points that marks and Vframe points determine together.

    Parameters
    ----------
    missing : sequence of NotLocated
        The points without a place.
    readings : Readings
        All readings.
    vframe : VframeEstimate
        The frame.
    frames : sequence of RobotFrameFit
        The stops that could be solved without these points.
    rig : RobotFrame
        Nominal rig.

    Notes
    -----
    A point is left open if it has fewer than three readings, if two places fit (within `TIE`), or
    if its readings contradict each other. The places are starts: what is uncertain in the stops is
    taken as independent from reading to reading here, and as it is in the joint adjustment.
    """
    known = dict(_known(vframe, frames, rig))
    found = {}
    for point in missing:
        own = readings.touching([point.name], list(known))
        if len(set(own.end)) < 3:
            continue
        places = np.array([known[end][0] for end in own.end])
        sigma = np.array([known[end][1] for end in own.end])
        fit = place_fit(places, sigma, own.distance, own.sigma)
        fits, costs = fit.solutions(circle_starts(places, own.distance, MOST_CIRCLES))
        if len(fits) == 0 or costs[0] > GOOD_REST * (len(own) - 2):
            continue
        if len(fits) == 1 or costs[1] - costs[0] > TIE:
            found[point.name] = fits[0]
    return found


def _known(
    vframe: VframeEstimate, frames: Sequence[RobotFrameFit], rig: RobotFrame
) -> Iterator[tuple[str, tuple[Array, float]]]:
    """Names of Vframe points and marks, their places (2,) and a coordinate's rms sigma, metres."""
    sigma = coordinate_sigma(vframe.covariance)
    yield from zip(vframe.names, zip(vframe.points, sigma, strict=True), strict=True)
    for frame in frames:
        for name, nominal in rig.points.items():
            arm = rotate(frame.state[2], np.asarray(nominal, dtype=float))
            by_pose = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
            variance = np.trace(by_pose @ frame.covariance @ by_pose.T) / 2
            variance += rig.mark_variance
            yield f"{frame.pose}/{name}", (frame.state[:2] + arm, float(np.sqrt(variance)))
