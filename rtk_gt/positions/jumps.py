"""Jumps and false fixes that last, of one receiver or two."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rtk_gt.lasting.errors import SHORT, errors_of_one
from rtk_gt.lasting.jumps import SeenSizes
from rtk_gt.lasting.lasting_error import LastingError, left_out
from rtk_gt.positions.heading import Headings
from rtk_gt.receivers.fixes import Bools, Fixes
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame


class PositionJumps(NamedTuple):
    """Errors that begin with a jump, and the sizes of jumps that are seen."""

    lasting: Sequence[LastingError]
    seen_of_all: SeenSizes


def of_first(steps: Steps, *, search: bool) -> PositionJumps:
    """What the motion of the first receiver tells; nothing where the fixes are not to be judged."""
    own = replace(
        steps,
        receivers=steps.receivers[:1],
        positions=steps.positions[:, :1],
        kinds=steps.kinds[:, :1],
    )
    found, least = errors_of_one(own)
    if not search:
        return PositionJumps([], least)
    return PositionJumps([one for one in found if one.stays or one.epochs >= SHORT], least)


def without_jumps(
    record: Fixes, frame: LocalFrame, errors: Sequence[LastingError]
) -> tuple[Array, Bools, Array]:
    """Positions of the first receiver without its errors that last.

    Parameters
    ----------
    record : Fixes
        Of the first receiver.
    frame : LocalFrame
        Of the positions.
    errors : sequence of LastingError
        Those that end leave their fixes out; those that stay are taken out of what follows.

    Returns
    -------
    positions : (n, 3) array
        Metres.
    left_out : (n,) bool array
        Fixes with an error that ends, and those beside a jump.
    covariances : (n, 3, 3) array
        Of what was taken out, m^2.
    """
    positions = frame.from_geodetic(record.geodetic)
    out = np.zeros(len(record), dtype=bool)
    covariances = np.zeros((len(record), 3, 3))
    for error in errors:
        if 0 not in error.receivers:
            continue
        begin, end = left_out(error)
        out |= (record.times > begin) & (record.times < end)
        if error.stays:
            after = record.times >= error.start - 1e-6
            positions[after] -= error.size
            covariances[after] += error.covariance
    return positions, out, covariances


def with_jumps(found: Headings, errors: Sequence[LastingError]) -> Headings:
    """Positions with headings whose covariance has that of the jumps taken out of the first."""
    covariances = found.noise_covariances.copy()
    for error in errors:
        if error.stays and 0 in error.receivers:
            covariances[found.times >= error.start - 1e-6, :3, :3] += error.covariance
    return replace(found, noise_covariances=covariances)
