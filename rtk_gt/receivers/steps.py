"""Positions of several receivers brought together by their times."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from rtk_gt.receivers.assumptions import SIMULTANEOUS
from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Fixes, Ints
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import FrameVectors, LocalFrame


@dataclass(frozen=True)
class Steps:
    """Where the receivers were at common times.

    Parameters
    ----------
    receivers : tuple of str
        r names, the reference receiver first.
    times : (t,) array
        Seconds since 1970 UTC, increasing.
    positions : (t, r, 3) array
        In the local frame, metres, as recorded or corrected; NaN where a receiver has none.
    kinds : (t, r) int array
        Fix kinds, -1 where there is no fix.
    frame : LocalFrame
        The frame of the positions.
    """

    receivers: tuple[str, ...]
    times: Array
    positions: Array
    kinds: Ints
    frame: LocalFrame

    def __len__(self) -> int:
        return len(self.times)

    @property
    def complete(self) -> Bools:
        """(t,) True where all receivers are RTK-fixed at the same time."""
        return np.asarray((self.kinds == RTK_FIXED).all(1))

    def select(self, rows: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> "Steps":
        """The chosen steps."""
        return replace(
            self, times=self.times[rows], positions=self.positions[rows], kinds=self.kinds[rows]
        )

    def corrected(self, offsets: FrameVectors) -> "Steps":
        """The steps with the offset of each receiver added (Blanco 2009, Eq. 6).

        Parameters
        ----------
        offsets : FrameVectors
            (r, 3), in the frame of these steps.

        Raises
        ------
        GtvalError
            If the offsets belong to another frame.
        """
        return replace(self, positions=self.positions + offsets.within(self.frame))


def receiver_pairs(count: int) -> list[tuple[int, int]]:
    """All pairs (i, j), i < j, of ``count`` receivers: (0, 1), (0, 2), (1, 2) of three."""
    return list(combinations(range(count), 2))


def pair_differences(positions: Array) -> Array:
    """(..., p, 3) position of j minus position of i for each pair, of (..., r, 3) positions."""
    first, second = np.array(receiver_pairs(positions.shape[-2]), dtype=int).reshape(-1, 2).T
    return np.asarray(positions[..., second, :] - positions[..., first, :])


def common_steps(
    records: Sequence[Fixes], frame: LocalFrame, tolerance: float = SIMULTANEOUS
) -> Steps:
    """The times at which any receiver has a fix, with what each has at that time.

    Parameters
    ----------
    records : sequence of Fixes
        One for each receiver, with increasing times.
    frame : LocalFrame
        Frame of the positions.
    tolerance : float
        Stamps within so many seconds are taken as one time.

    Raises
    ------
    GtvalError
        If there are no fixes, or a record has two within the tolerance.
    """
    stamps = np.concatenate([record.times for record in records])
    if len(stamps) == 0:
        raise GtvalError("none of the receivers has a single fix")
    order = np.argsort(stamps, kind="stable")
    group = np.empty(len(stamps), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(np.diff(stamps[order]) > tolerance)])
    total = int(group.max()) + 1
    positions = np.full((total, len(records), 3), np.nan)
    kinds = np.full((total, len(records)), -1, dtype=np.int64)
    times = np.zeros(total)
    at = 0
    for column, record in enumerate(records):
        rows = group[at : at + len(record)]
        at += len(record)
        if len(np.unique(rows)) != len(rows):
            raise GtvalError(
                f"receiver {record.receiver} has two fixes within {tolerance:g} s; set a smaller "
                "tolerance"
            )
        positions[rows, column] = frame.from_geodetic(record.geodetic)
        kinds[rows, column] = record.kinds
        times[rows] = record.times
    names = tuple(record.receiver for record in records)
    return Steps(names, times, positions, kinds, frame)
