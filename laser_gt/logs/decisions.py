"""Decisions about matches, whoever or whatever made them: an append-only CSV that runs obey.

Columns: time, reference, moving (stops), decision (accept, reject, guess), x, y, theta (for a
guess: the moving laser frame in the reference laser frame; metres, radians), by, note. The last
decision about a pair counts; a pair named the other way round is the same pair.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from laser_gt.scans.planar import inverse
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, CsvTable, read_csv

KINDS = ("accept", "reject", "guess")
HEADER = "time,reference,moving,decision,x,y,theta,by,note"
COLUMNS = (
    Column("time", required=False, blank=True),
    Column("reference"),
    Column("moving"),
    Column("decision"),
    Column("x", "number", required=False, blank=True, low=-1e4, high=1e4, unit="m"),
    Column("y", "number", required=False, blank=True, low=-1e4, high=1e4, unit="m"),
    Column("theta", "number", required=False, blank=True, low=-20, high=20, unit="rad"),
    Column("by", required=False, blank=True),
    Column("note", required=False, blank=True),
)


@dataclass(frozen=True)
class Decision:
    """What was decided about a pair.

    Parameters
    ----------
    reference, moving : str
        Stops.
    kind : {"accept", "reject", "guess"}
        Take it, leave it, or match again from ``guess``.
    guess : (3,) array or None
        Moving laser frame in the reference laser frame.
    by, note : str
        Who or what decided, and why.
    """

    reference: str
    moving: str
    kind: str
    guess: Array | None = None
    by: str = ""
    note: str = ""

    def turned(self) -> "Decision":
        """The same decision with the pair named the other way round."""
        guess = None if self.guess is None else inverse(self.guess)
        return Decision(self.moving, self.reference, self.kind, guess, self.by, self.note)


def read_decisions(path: Path, stops: Iterable[str]) -> dict[tuple[str, str], Decision]:
    """The decision that counts for each pair, under both of its names; none without the file.

    Parameters
    ----------
    path : Path
        The file.
    stops : iterable of str
        Stops that have scans.

    Raises
    ------
    InputError
        Naming every bad place: unknown stops, unknown words, a guess without a pose.
    """
    if not path.exists():
        return {}
    known = set(stops)
    table = read_csv(path, COLUMNS)
    decisions: dict[tuple[str, str], Decision] = {}
    for row in range(len(table)):
        decision = _decision(table, row, known)
        if decision is not None:
            decisions[decision.reference, decision.moving] = decision
            decisions[decision.moving, decision.reference] = decision.turned()
    table.raise_problems()
    return decisions


def _decision(table: CsvTable, row: int, known: set[str]) -> Decision | None:
    """The decision of a row; None if it is bad, which is recorded."""
    count = len(table.problems)
    pair = (table.text["reference"][row], table.text["moving"][row])
    for name, stop in zip(("reference", "moving"), pair, strict=True):
        if stop and stop not in known:
            table.flag(row, name, "no scan of this stop; expected the name of a scanned stop")
    if pair[0] == pair[1] and pair[0]:
        table.flag(row, "moving", "the same stop twice; a pair has two")
    kind = table.text["decision"][row]
    if kind not in KINDS:
        table.flag(row, "decision", f"expected one of {', '.join(KINDS)}")
    pose = np.array([table.numbers[name][row] for name in ("x", "y", "theta")])
    if kind == "guess" and not np.isfinite(pose).all():
        table.flag(row, "x", "a guess needs x, y and theta")
    if len(table.problems) > count:
        return None
    return Decision(
        *pair,
        kind,
        pose if kind == "guess" else None,
        table.text["by"][row],
        table.text["note"][row],
    )


def append_decisions(path: Path, decisions: Sequence[Decision], time: str = "") -> None:
    """Add decisions to the end of the file, which is made if missing.

    Raises
    ------
    GtvalError
        For a kind that does not exist, or if the file cannot be written.
    """
    for decision in decisions:
        if decision.kind not in KINDS:
            raise InputError(
                [Problem(path, f"expected one of {', '.join(KINDS)}", value=decision.kind)]
            )
    lines = [_line(decision, time) for decision in decisions]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        start = "" if path.exists() and path.stat().st_size else HEADER + "\n"
        if not start and not path.read_bytes().endswith(b"\n"):
            start = "\n"
        with path.open("a", encoding="utf-8") as stream:
            stream.write(start + "".join(lines))
    except OSError as error:
        raise GtvalError(f"cannot write {path}: {error.strerror or error}") from error


def _line(decision: Decision, time: str) -> str:
    """A row of the file."""
    pose = ["", "", ""] if decision.guess is None else [f"{v:.6f}" for v in decision.guess]
    text = [part.replace('"', "'").replace("\n", " ") for part in (decision.by, decision.note)]
    quoted = [f'"{part}"' if part else "" for part in text]
    cells = [time, decision.reference, decision.moving, decision.kind, *pose, *quoted]
    return ",".join(cells) + "\n"
