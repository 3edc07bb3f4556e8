"""Decisions about matches, whoever or whatever made them: an append-only CSV that runs obey.

Columns: time, reference, moving (stops), decision (accept, reject, guess, open), x, y, theta (for a
guess: the moving laser frame in the reference laser frame; metres, radians), by, note. The last
decision about a pair counts; a pair named the other way round is the same pair. 'open' takes back
what was decided before.
"""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from laser_gt.logs.decisions import KINDS, Decision
from validation.errors import InputError, Problem
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.reading import is_empty
from validation.text_files.writing import append_rows

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
HEADER = tuple(column.name for column in COLUMNS)


def read_decisions(path: Path, stops: Collection[str]) -> dict[tuple[str, str], Decision]:
    """The decision that counts for each pair, under both of its names; none without the file.

    Parameters
    ----------
    path : Path
        The file.
    stops : collection of str
        Stops that have scans.

    Raises
    ------
    InputError
        Naming every bad place: unknown stops, unknown words, a guess without a pose.
    """
    decisions: dict[tuple[str, str], Decision] = {}
    for _, decision in decision_history(path, stops):
        one, other = (decision.reference, decision.moving), (decision.moving, decision.reference)
        decisions[one], decisions[other] = decision, decision.turned()
        if decision.kind == "open":
            del decisions[one], decisions[other]
    return decisions


def decision_history(path: Path, stops: Collection[str]) -> list[tuple[str, Decision]]:
    """All decisions with their times, in the order made; none without the file.

    Parameters
    ----------
    path : Path
        The file.
    stops : collection of str
        Stops that have scans.

    Raises
    ------
    InputError
        As of `read_decisions`.
    """
    if is_empty(path):
        return []
    table = read_csv(path, COLUMNS)
    rows = [(table.text["time"][row], _decision(table, row, stops)) for row in range(len(table))]
    table.raise_problems()
    return [(time, decision) for time, decision in rows if decision is not None]


def _decision(table: CsvTable, row: int, known: Collection[str]) -> Decision | None:
    """The decision of a row; None if it is bad, which is recorded."""
    count = len(table.problems)
    pose = np.array([table.numbers[name][row] for name in ("x", "y", "theta")])
    text = {name: table.text[name][row] for name in table.text}
    decision = Decision(
        text["reference"],
        text["moving"],
        text["decision"],
        None if np.isnan(pose).all() else pose,
        text["by"],
        text["note"],
    )
    for name, expected in _faults(decision, known):
        table.flag(row, name, expected)
    return None if len(table.problems) > count else decision


def _faults(decision: Decision, known: Collection[str]) -> Iterator[tuple[str, str]]:
    """Columns of a decision that are bad, and what is expected there."""
    for name, stop in (("reference", decision.reference), ("moving", decision.moving)):
        if stop and stop not in known:
            yield name, "no scan of this stop; expected the name of a scanned stop"
    if decision.moving and decision.reference == decision.moving:
        yield "moving", "the same stop twice; a pair has two"
    if decision.kind not in KINDS:
        yield "decision", f"expected one of {', '.join(KINDS)}"
    guess = decision.guess
    if decision.kind == "guess":
        if guess is None or len(guess) != 3 or not np.isfinite(guess).all():
            yield "x", "a guess needs 3 numbers: x, y and theta"
    elif guess is not None:
        yield "x", "only a guess has x, y and theta; leave them blank, or write 'guess'"


def append_decision(path: Path, decision: Decision, stops: Collection[str], time: str) -> None:
    """Add a decision to the end of the file; see `append_decisions`."""
    append_decisions(path, [decision], stops, time)


def append_decisions(
    path: Path, decisions: Sequence[Decision], stops: Collection[str], time: str
) -> None:
    """Add decisions to the end of the file, which is made if missing, all at once.

    They are on the disk when this returns.

    Parameters
    ----------
    path : Path
        The file.
    decisions : sequence of Decision
        What was decided.
    stops : collection of str
        Stops that have scans.
    time : str
        When.

    Raises
    ------
    GtvalError
        If a decision is not one that `read_decisions` would take, or the file cannot be
        written.
    """
    problems, rows = [], []
    for decision in decisions:
        kind = decision.kind
        values = {"reference": decision.reference, "moving": decision.moving, "decision": kind}
        problems += [
            Problem(path, expected, None, name, values.get(name))
            for name, expected in _faults(decision, stops)
        ]
        pose = ["", "", ""] if decision.guess is None else [f"{v:.6f}" for v in decision.guess]
        said = [" ".join(text.split()) for text in (decision.by, decision.note)]
        rows.append([time, *values.values(), *pose, *said])
    if problems:
        raise InputError(problems)
    append_rows(path, HEADER, rows)
