"""Error ellipses of GST sentences, checked against the sigmas in the same sentence.

The standard gives the orientation of the major axis from true north, clockwise. Receivers are
known to count it from east. A GST sentence also holds the sigmas of latitude and longitude,
which only one meaning of the angle reproduces: that one is used, and it is said which.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rtk_gt.receivers.fixes import covariance_of_ellipse
from validation.poses.angles import Array

AGREEMENT = 0.1
"""Largest relative difference between stated and implied sigmas: GST is printed to 2 or 3 digits,
and 0.5 in the last of 2 digits is 5 % of each of the two that are compared."""


class EllipseRecord(NamedTuple):
    """One GST: axes in metres, orientation in degrees, sigmas in metres; NaN where empty."""

    major: float
    minor: float
    orientation: float
    sigma_latitude: float
    sigma_longitude: float
    sigma_altitude: float


def covariances_from_gst(
    records: Sequence[EllipseRecord | None],
) -> tuple[Array, tuple[str, ...]]:
    """Covariances (n, 3, 3) of east, north, up, NaN where there is no record, and remarks.

    Parameters
    ----------
    records : sequence of EllipseRecord or None
        One for each fix.

    Notes
    -----
    The sign of the covariance of east and north cannot be checked: clockwise from north and
    counter-clockwise from north give the same sigmas. Clockwise, as the standard has it, is
    taken; where the angle counts from east, counter-clockwise.
    """
    n = len(records)
    covariances = np.full((n, 3, 3), np.nan)
    stated = np.array([record is not None for record in records], dtype=bool)
    if not stated.any():
        return covariances, ()
    table = np.array([record for record in records if record is not None], dtype=float)
    angle = np.radians(table[:, 2])
    clockwise_from_north = covariance_of_ellipse(table[:, 0], table[:, 1], angle)
    from_east = covariance_of_ellipse(table[:, 0], table[:, 1], np.pi / 2 - angle)
    misfit = [_misfit(table, meaning) for meaning in (clockwise_from_north, from_east)]
    full, remark = np.zeros((len(table), 3, 3)), ""
    # The sigmas of the sentence itself are the diagonal; the ellipse adds the correlation.
    full[:, 0, 0], full[:, 1, 1] = table[:, 4] ** 2, table[:, 3] ** 2
    full[:, 2, 2] = table[:, 5] ** 2
    best = int(np.argmin(misfit))
    if misfit[best] <= AGREEMENT:
        _, _, cross = (clockwise_from_north, from_east)[best]
        # A covariance of printed numbers may be a hair too large for its sigmas.
        limit = 0.999 * table[:, 3] * table[:, 4]
        full[:, 0, 1] = full[:, 1, 0] = np.clip(np.nan_to_num(cross), -limit, limit)
        if best == 1 and misfit[0] > AGREEMENT:
            remark = (
                "The orientation in GST does not count from north as the standard says, but from "
                "east: only so does the ellipse give the sigmas of latitude and longitude."
            )
    else:
        remark = (
            "The error ellipses in GST do not fit the sigmas of latitude and longitude beside "
            f"them (off by {100 * misfit[best]:.0f} % at best); the ellipses were not used."
        )
    covariances[stated] = full
    return covariances, (remark,) if remark else ()


def _misfit(table: Array, meaning: tuple[Array, Array, Array]) -> float:
    """Median relative difference between the sigmas implied by the ellipses and those stated."""
    east, north, _ = (np.sqrt(np.maximum(part, 0)) for part in (*meaning[:2], meaning[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.maximum(
            np.abs(east - table[:, 4]) / table[:, 4], np.abs(north - table[:, 3]) / table[:, 3]
        )
    off = off[np.isfinite(off)]
    return float(np.median(off)) if len(off) else np.inf
