"""A moving base: receivers that tell where they are from another receiver on the vehicle."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import RTK_FIXED, RTK_FLOAT, Fixes, Ints
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

TOLD_FROM_BASE = "Positions are those of {0} and the way from there: an error of {0} is in both."


@dataclass(frozen=True)
class Baselines:
    """From the base to a receiver, at n times.

    Parameters
    ----------
    receiver : str
        Its name.
    times : (n,) array
        Seconds since 1970 UTC.
    east_north_up : (n, 3) array
        At the base, metres.
    kinds : (n,) int array
        Of the solution between the two, as GGA numbers them.
    covariances : (n, 3, 3) array
        Of east, north and up, m^2; NaN where not stated.
    lines : (n,) int array
        Where in the file.
    source : Path
        The file.
    """

    receiver: str
    times: Array
    east_north_up: Array
    kinds: Ints
    covariances: Array
    lines: Ints
    source: Path

    def __len__(self) -> int:
        return len(self.times)


def on_base(found: Baselines, base: Fixes, tolerance: float) -> Fixes:
    """Where a receiver was, from its base's positions at the same times.

    Parameters
    ----------
    found : Baselines
        From the base to the receiver.
    base : Fixes
        Where the base was.
    tolerance : float
        Seconds within which stamps are one time.

    Returns
    -------
    Fixes
        RTK-fixed where both are; else float, or what the base is where that is less. Covariances
        are those of both together: what comes from the base the receivers share.

    Raises
    ------
    InputError
        If they have no time in common.
    """
    at = np.clip(np.searchsorted(base.times, found.times), 1, max(len(base) - 1, 1))
    at = np.minimum(at, len(base) - 1)
    before = np.maximum(at - 1, 0)
    nearer = np.abs(base.times[before] - found.times) < np.abs(base.times[at] - found.times)
    at = np.where(nearer, before, at)
    rows = np.flatnonzero(np.abs(base.times[at] - found.times) <= tolerance)
    if len(rows) == 0:
        said = (
            f"no time in common with its base {base.receiver} (within {tolerance:g} s): "
            f"{found.times[0]:.3f} to {found.times[-1]:.3f} and {base.times[0]:.3f} to "
            f"{base.times[-1]:.3f} seconds since 1970; are both files of one drive?"
        )
        raise InputError([Problem(found.source, said, field="base", value=base.receiver)])
    where = at[rows]
    places = moved(base.geodetic[where], found.east_north_up[rows])
    own, of_base = found.kinds[rows], base.kinds[where]
    weaker = np.where(of_base == RTK_FLOAT, RTK_FLOAT, of_base)
    return Fixes(
        receiver=found.receiver,
        times=base.times[where],
        geodetic=places,
        kinds=np.where(of_base == RTK_FIXED, own, weaker),
        satellites=base.satellites[where],
        hdop=base.hdop[where],
        covariances=base.covariances[where] + found.covariances[rows],
        lines=found.lines[rows],
        source=found.source,
        level_digit=base.level_digit,
        notes=(TOLD_FROM_BASE.format(base.receiver),),
    )


def moved(geodetic: Array, east_north_up: Array) -> Array:
    """(n, 3) places east, north and up of others, latitude and longitude in radians.

    Notes
    -----
    One frame at the middle of all: over a drive of kilometres its axes differ from those at each
    place by some 1e-4, which over the few metres of a vehicle are tenths of a millimetre.
    """
    middle = geodetic[len(geodetic) // 2]
    frame = LocalFrame(float(middle[0]), float(middle[1]), float(middle[2]))
    return np.asarray(frame.to_geodetic(frame.from_geodetic(geodetic) + east_north_up))
