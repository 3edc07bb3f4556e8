"""Validation poses from hand-laser readings in arrays."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from gtval.arguments import said_plainly
from survey.estimation.solve import SurveySolution
from survey.estimation.solve import solve_survey as solve
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.errors import GtvalError

__all__ = ["SurveySolution", "solve_survey"]

Points = Mapping[str, tuple[float, float]]


@said_plainly
def solve_survey(
    start: Sequence[str],
    end: Sequence[str],
    distance: npt.ArrayLike,
    *,
    sigma: npt.ArrayLike,
    world_points: Sequence[str],
    vframe: Points,
    vframe_sigma: float,
    robot_frame: Points,
    marking_sigma: float,
    robust: bool = False,
) -> SurveySolution:
    """World points and robot poses from distances, all adjusted together.

    Parameters
    ----------
    start, end : sequence of str
        The two points of each of n readings, in any order: names of Vframe points and world
        points, and 'STOP/POINT' for the marks of the robot frame at a stop.
    distance : (n,) array_like
        Metres, corrected for the instrument's offset and scale.
    sigma : float or (n,) array_like
        Standard deviations of the readings, metres.
    world_points : sequence of str
        Names of the world points.
    vframe : mapping of str to (float, float)
        Nominal Vframe points on the floor, metres: they define the GTV frame.
    vframe_sigma : float
        Standard deviation of each coordinate of a marked Vframe point, metres.
    robot_frame : mapping of str to (float, float)
        Points of the rig whose marks are read, in the robot frame, metres.
    marking_sigma : float
        How well a mark on the floor stands for its point of the rig, metres.
    robust : bool
        Weigh large residuals down (Huber).

    Returns
    -------
    SurveySolution
        ``pose_table()`` has the validation poses; ``suspicions`` the readings that do not fit;
        ``left_out`` those that are not used because a point of theirs has no position.

    Raises
    ------
    GtvalError
        If readings name unknown points, the labels are contradicted, nothing can be located, or
        the adjustment fails.

    Notes
    -----
    AD2.3, "Determination of the coordinates of the world-points" and "Validation poses".

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1)
    >>> solution = gtval.solve_survey(**room.survey)
    >>> errors = gtval.compare(room.truth, solution.pose_table())
    >>> bool(errors.comparison.distances.max() < 0.01)
    True
    """
    n = len(start)
    distances = np.asarray(distance, dtype=float)
    bad = np.flatnonzero(~(np.isfinite(distances) & (distances > 0)))
    if bad.size:
        at = int(bad[0])
        said = f"reading {at}, {start[at]} to {end[at]}: {distances[at]} is no distance in metres"
        raise GtvalError(said)
    readings = Readings(
        tuple(start),
        tuple(end),
        np.array(distance, dtype=float),
        np.broadcast_to(np.asarray(sigma, dtype=float), (n,)).copy(),
    )
    frame = Vframe(points=dict(vframe), sigma=vframe_sigma)
    rig = RobotFrame(points=dict(robot_frame), marking_sigma=marking_sigma)
    return solve(frame, rig, readings, world_points, robust=robust)
