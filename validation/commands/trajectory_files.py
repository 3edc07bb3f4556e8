"""Which of the files of a command line are trajectories."""

from collections.abc import Iterable
from pathlib import Path


def moves(path: Path) -> bool:
    """Whether a file holds a trajectory."""
    from validation.trajectories.formats import is_trajectory

    return path.is_file() and is_trajectory(path)


def refuse_tables(paths: Iterable[Path]) -> None:
    """Raise for tables of stops beside a trajectory as the reference."""
    from validation.errors import InputError, Problem

    text = "not poses at times, as the reference is; give the table of stops first"
    problems = [Problem(path, text) for path in paths if path.exists() and not moves(path)]
    if problems:
        raise InputError(problems)
