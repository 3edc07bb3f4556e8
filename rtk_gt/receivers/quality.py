"""How good a receiver's fixes are by its own account: by kind, and by named parts of the site."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.receivers.fixes import FIX_NAMES, NO_FIX, Bools, Fixes
from validation.poses.angles import Array

_ORDER = (4, 5, 3, 2, 9, 1)
"""Kinds of fixes, the best first; others follow."""


@dataclass(frozen=True)
class KindQuality:
    """The fixes of one kind.

    Parameters
    ----------
    kind : str
        'RTK fixed', 'RTK float', ...
    epochs : int
        How many.
    share : float
        Of all epochs that the receiver reported.
    horizontal, vertical : (float, float), optional
        Stated standard deviations in metres, median and 95th percentile: the longer axis of the
        ellipse, and up; None where not stated.
    satellites, hdop : float, optional
        Medians; None where not stated.
    """

    kind: str
    epochs: int
    share: float
    horizontal: tuple[float, float] | None
    vertical: tuple[float, float] | None
    satellites: float | None
    hdop: float | None


@dataclass(frozen=True)
class AreaQuality:
    """The fixes in a named area.

    Parameters
    ----------
    area : str
        Its name.
    kinds : tuple of KindQuality
        Each kind of fix; shares are of the fixes in the area, as epochs without a position are in
        none.
    """

    area: str
    kinds: tuple[KindQuality, ...]


def area_qualities(
    areas: Mapping[str, Array], record: Fixes, positions: Array
) -> tuple[AreaQuality, ...]:
    """Quality of a receiver's fixes in each named area.

    Parameters
    ----------
    areas : mapping of str to (k, 2) array
        Corners of each in the local frame, metres.
    record : Fixes
        Of the receiver.
    positions : (n, 3) array
        Of its fixes in that frame.
    """
    found = []
    for name, corners in areas.items():
        here = replace(record.select(inside(corners, positions[:, :2])), without_fix=0)
        found.append(AreaQuality(name, qualities(here)))
    return tuple(found)


def inside(corners: Array, points: Array) -> Bools:
    """(n,) whether points (n, 2) are in a polygon of corners (k, 2): by the crossings of a ray."""
    start, end = corners, np.roll(corners, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    rise = end[:, 1] - start[:, 1]
    share = (y - start[:, 1]) / np.where(rise == 0, 1.0, rise)
    crossed = spans & (x < start[:, 0] + share * (end[:, 0] - start[:, 0]))
    return np.asarray(crossed.sum(1) % 2 == 1)


def qualities(record: Fixes) -> tuple[KindQuality, ...]:
    """Epochs and stated errors of each kind of fix, the best kind first."""
    present = {int(kind) for kind in np.unique(record.kinds)}
    order = [*(k for k in _ORDER if k in present), *sorted(present - set(_ORDER))]
    found = [_quality(record, kind) for kind in order]
    if record.without_fix:
        share = record.without_fix / record.epochs
        name = FIX_NAMES[NO_FIX]
        found.append(KindQuality(name, record.without_fix, share, None, None, None, None))
    return tuple(found)


def _quality(record: Fixes, kind: int) -> KindQuality:
    rows = record.kinds == kind
    axes = semi_axes(record.covariances[rows])
    known = record.satellites[rows & (record.satellites >= 0)]
    hdop = record.hdop[rows & np.isfinite(record.hdop)]
    return KindQuality(
        FIX_NAMES[kind],
        int(rows.sum()),
        float(rows.sum()) / record.epochs,
        _middle_and_high(axes[:, 0]),
        _middle_and_high(axes[:, 2]),
        float(np.median(known)) if len(known) else None,
        float(np.median(hdop)) if len(hdop) else None,
    )


def semi_axes(covariances: Array) -> Array:
    """(n, 3) standard deviations: longer and shorter axis of the ellipse, and up, metres."""
    axes = np.full((len(covariances), 3), np.nan)
    stated = np.isfinite(covariances).all((1, 2))
    values = np.linalg.eigvalsh(covariances[stated][:, :2, :2])
    axes[stated, :2] = np.sqrt(np.maximum(values[:, ::-1], 0.0))
    axes[stated, 2] = np.sqrt(covariances[stated, 2, 2])
    return axes


def _middle_and_high(values: Array) -> tuple[float, float] | None:
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return None
    return float(np.median(values)), float(np.quantile(values, 0.95))
