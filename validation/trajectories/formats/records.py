"""What a reader of any format hands over."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import Clock
from validation.trajectories.formats.source import Source
from validation.trajectories.formats.stamps import lines_shown

MAX_LOOKED_AT = 1000
"""Rows that show how many decimals a column has, and how often poses come: programs print all
alike."""


@dataclass
class Records:
    """What a reader found in a file; one row a pose.

    Parameters
    ----------
    source : Source
        The file.
    format : str
        Name of the format.
    lines : sequence of int
        Line, or number of the message, of each row.
    stamps : sequence of str, or array of int
        As written; integers are in ``unit``.
    positions : (n, 2 or 3) array
        Metres.
    unit : str, optional
        Of the stamps, where the file or its format says it.
    quaternions : (n, 4) array, optional
        x, y, z, w.
    angles : (n,) array, optional
        Headings of poses in the plane, in radians, or degrees if ``degrees`` says so.
    degrees : bool, optional
        Whether the file says that angles are in degrees.
    covariances : (n, m, m) array, optional
        NaN where not stated.
    digit : float, optional
        The last digit of printed covariances, such as 1e-6.
    clock, frame, child_frame, epoch, longest_interval
        As of a trajectory, where the file states them.
    facts : dict
        More for the provenance.
    notes : list of str
        What was left out or taken for granted.
    assumed : bool
        Whether the unit is what the format usually has, and the size of the stamps may overrule it.
    row : str
        What ``lines`` counts.
    own : bool
        Whether gtval wrote it: nothing has to be taken for granted.
    """

    source: Source
    format: str
    lines: Sequence[int]
    stamps: Sequence[str] | npt.NDArray[np.int64]
    positions: Array
    unit: str | None = None
    quaternions: Array | None = None
    angles: Array | None = None
    degrees: bool | None = None
    covariances: Array | None = None
    digit: float | None = None
    clock: Clock = field(default_factory=Clock)
    frame: str = ""
    child_frame: str = ""
    system: str = ""
    epoch: int | None = None
    longest_interval: float | None = None
    facts: dict[str, object] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    assumed: bool = False
    row: str = "line"
    own: bool = False


def without_rows(keep: npt.NDArray[np.bool_], lines: Sequence[int], what: str) -> list[str]:
    """A note on rows that were left out; nothing if there are none."""
    left = np.flatnonzero(~keep)
    if not len(left):
        return []
    where = lines_shown([lines[row] for row in left.tolist()])
    return [f"{len(left)} of {len(keep)} rows were left out, {what}: line {where}"]
