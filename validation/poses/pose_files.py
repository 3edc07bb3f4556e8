"""The files that pose tables leave under results/: the same for all systems."""

import contextlib
import re
from collections.abc import Iterable
from functools import partial

from validation.errors import FaultyResultError, GtvalError, shown
from validation.poses.common_origin import follows_files
from validation.poses.joint import joint_files
from validation.poses.pose_table import PoseTable, csv_lines
from validation.poses.tum_text import tum_lines
from validation.text_files.writing import Content, text_of

_SYSTEM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
"""File systems take names of 255 bytes, of which what stands around this one needs some 30."""


def pose_files(tables: Iterable[PoseTable]) -> dict[str, Content]:
    """poses_<system>.csv of each table, and poses_<system>.tum where its stops are numbered.

    Raises
    ------
    FaultyResultError
        If a system's name cannot be part of a file name, or two tables have one name.
    """
    files: dict[str, Content] = {}
    for table in tables:
        if not _SYSTEM.fullmatch(table.system):
            raise FaultyResultError(
                f"the system name {shown(table.system)} cannot be part of a file name; use at most "
                "100 letters, digits, '_', '-' and '.'"
            )
        if f"poses_{table.system}.csv" in files:
            raise FaultyResultError(f"two tables are called '{table.system}'")
        files[f"poses_{table.system}.csv"] = text_of(partial(csv_lines, table), table.poses.size)
        files |= joint_files(table) | follows_files(table)
        # Stops without numbers have no time to stand in a trajectory.
        with contextlib.suppress(GtvalError):
            files[f"poses_{table.system}.tum"] = text_of(tum_lines(table), table.poses.size)
    return files
