"""Are two walls parallel? From distances between them at positions along the first.

AD2.3, "Definition of the validation frame": the two short walls of the room were not parallel,
"more than 2cm of difference between 2 points 3m away each other", so the walls could not serve
as the frame and an explicit one was laid on the floor.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtr, ndtri

from validation.poses.angles import Array
from validation.results import Finding, Size

SIGNIFICANT = 0.05
"""p-value below which walls are called not parallel, and not straight: usual."""


@dataclass(frozen=True)
class WallPair:
    """Two walls compared.

    Parameters
    ----------
    wall_a, wall_b : str
        Their names.
    readings : int
        Distances measured.
    span : float
        From the first to the last position along wall a, metres.
    angle : float
        From wall a to wall b, radians, positive where they move apart as the position grows; NaN
        without two different positions.
    sigma : float
        Its standard deviation if the readings' sigmas hold.
    p_value : float
        Two-sided chance of an angle at least as large between parallel walls.
    p_straight : float
        Chance of readings at least as far off a straight line; NaN with fewer than three.
    """

    wall_a: str
    wall_b: str
    readings: int
    span: float
    angle: float
    sigma: float
    p_value: float
    p_straight: float

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Confidence interval of the angle, radians."""
        half = float(ndtri((1 + confidence) / 2)) * self.sigma
        return self.angle - half, self.angle + half


def compare_walls(
    wall_a: str, wall_b: str, position: Array, distance: Array, sigma: Array
) -> WallPair:
    """The angle between two walls.

    Parameters
    ----------
    wall_a, wall_b : str
        Their names.
    position : (n,) array
        Where along wall a each distance was measured, metres.
    distance : (n,) array
        From wall a to wall b, at right angles to wall a, metres.
    sigma : (n,) array
        Standard deviation of the distances, metres.

    Raises
    ------
    ValueError
        If there is no reading.

    Notes
    -----
    distance = c + s position by weighted least squares; the angle is arctan(s). The stated sigmas
    are used rather than the scatter, of which two readings show none.
    """
    if len(position) == 0:
        raise ValueError("no reading between these walls")
    weight = 1 / np.square(np.broadcast_to(sigma, position.shape))
    mean = (weight * position).sum() / weight.sum()
    spread = float((weight * (position - mean) ** 2).sum())
    span = float(np.ptp(position))
    if span == 0:
        return WallPair(wall_a, wall_b, len(position), span, np.nan, np.nan, np.nan, np.nan)
    slope = float((weight * (position - mean) * distance).sum() / spread)
    level = (weight * distance).sum() / weight.sum()
    rest = distance - level - slope * (position - mean)
    dof = len(position) - 2
    return WallPair(
        wall_a,
        wall_b,
        readings=len(position),
        span=span,
        angle=float(np.arctan(slope)),
        sigma=float(1 / np.sqrt(spread) / (1 + slope**2)),
        p_value=float(2 * ndtr(-abs(slope) * np.sqrt(spread))),
        p_straight=float(chdtrc(dof, (weight * rest**2).sum())) if dof > 0 else np.nan,
    )


def wall_findings(pair: WallPair) -> Iterator[Finding]:
    """What the angle means for somebody who wants to use the walls as a frame."""
    who = f"walls {pair.wall_a} and {pair.wall_b}"
    if np.isnan(pair.angle):
        positions = "one reading" if pair.readings == 1 else "all readings at one position"
        yield Finding(
            "warning",
            f"{positions}: the angle between them cannot be seen. Measure at two positions, as "
            "far apart as the wall allows.",
            who,
            "one_position",
        )
        return
    low, high = (np.tan(limit) * pair.span * 1000 for limit in pair.interval())
    seen = (
        f"{np.degrees(pair.angle):+.3f}° ± {np.degrees(pair.sigma):.3f}° (1 sigma), "
        f"{np.tan(pair.angle) * pair.span * 1000:+.1f} mm over the {pair.span:.2f} m measured"
    )
    angle = Size.normal("angle", pair.angle, pair.sigma, "rad")
    if pair.p_value < SIGNIFICANT:
        yield Finding(
            "warning",
            f"Not parallel: {seen} (p = {pair.p_value:.2g}). Do not take them as the axes of a "
            "frame; lay one on the floor.",
            who,
            "not_parallel",
            (angle,),
        )
    else:
        yield Finding(
            "note",
            f"No angle seen: {seen} (p = {pair.p_value:.2g}). The walls may still move by "
            f"{low:+.1f} to {high:+.1f} mm over that length (95 % confidence).",
            who,
            "no_angle_seen",
        )
    if pair.p_straight < SIGNIFICANT:
        yield Finding(
            "warning",
            f"The distances do not lie on a straight line (p = {pair.p_straight:.2g}): a wall is "
            "not straight, or a reading is wrong, and the angle means little.",
            who,
            "not_straight",
            (Size("p-value of a straight line", pair.p_straight),),
        )
