"""Which readings say something of the same unknown: the frame, one world point, or one stop."""

from collections.abc import Collection

from survey.readings.point_names import robot_point

Pair = frozenset[str]
FRAME = ""
"""Key of the group of readings within the Vframe; the others' are world points and stops."""


def group_key(pair: Pair, world: Collection[str]) -> str:
    """The stop ('7/'), else the world point, else `FRAME`, that a pair's reading says something of.

    Parameters
    ----------
    pair : frozenset of str
        The two points.
    world : collection of str
        Names of the world points.
    """
    for name in pair:
        point = robot_point(name)
        if point is not None:
            return f"{point[0]}/"
    return next((name for name in sorted(pair) if name in world), FRAME)
