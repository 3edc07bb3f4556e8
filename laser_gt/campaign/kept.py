"""Matches kept from one command to the next, by the hash of all that they depend on."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.logs.decisions import Decision
from laser_gt.matching.verdicts import VERDICTS, Match
from laser_gt.placing.engines import (
    Engine,
    EngineSettings,
    Matcher,
    Matching,
    PairJob,
    Raw,
    Report,
    match_pair,
)
from laser_gt.placing.loops import Loop
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.scan import Indices
from validation.pieces.processors import processors
from validation.pieces.store import FOLDER, KeptPieces, code_of, key_of
from validation.pieces.work import done_once
from validation.poses.angles import Array

ARRAYS = ("guess", "pose", "covariance", "seen_pose", "seen_covariance")
"""Fields of a match that are arrays."""
CODE = ("laser_gt.scans", "laser_gt.matching", "laser_gt.placing.engines")
"""What the match of a pair is made by."""
SECONDS = {"scanmatch": 0.025, "genetic": 0.3}
"""That a match takes: 600 of one room took 15 s, 46 by the genetic aligner 14 s."""
WORTH_A_POOL = 3.0
"""Seconds of work from which on other processes save more than they take to start: with 3 s two
processes took nine tenths of the time of one."""


def kept_file(engine: Engine) -> str:
    """Name of the file under results/ with the matches by an engine."""
    return f"laser_matching_{engine}.json"


class KeptPairs(KeptPieces):
    """Matches of single pairs that earlier runs made, and those that this one adds.

    Parameters
    ----------
    folder : Path
        Of the campaign.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / FOLDER / "laser_pairs.jsonl", "matches of scans")

    def written(self, result: Raw, _job: PairJob) -> dict[str, Any]:
        """A match as values that JSON has."""
        return {"match": _values(result.match), "curve": _plain(result.curve)}

    def read(self, told: dict[str, Any], _job: PairJob) -> Raw:
        """The match that a line of the file holds."""
        curve = told["curve"]
        return Raw(_match(told["match"]), curve=None if curve is None else np.array(curve))

    def matcher(self, workers: int | None = None, most_new: int | None = None) -> Matcher:
        """What gives the matches of pairs, those that are kept and new ones.

        Parameters
        ----------
        workers : int, optional
            Processes; by default one for each processor, where there are enough pairs.
        most_new : int, optional
            Pairs that may be matched; with more it raises `ManyPairsError`, and none is.
        """

        def matched(jobs: Sequence[PairJob], report: Report) -> list[Raw]:
            if not jobs:
                return []
            if most_new is not None and sum(pair_key(job) not in self for job in jobs) > most_new:
                raise ManyPairsError
            many = processors(workers)
            few = many if len(jobs) * SECONDS[jobs[0].engine] > WORTH_A_POOL else 1
            tell = partial(report, f"{jobs[0].engine}: {len(jobs)} pairs")
            return done_once(match_pair, jobs, pair_key, self, self, few, tell)

        return matched


class ManyPairsError(Exception):
    """More pairs are to be matched than was allowed."""


def pair_key(job: PairJob) -> str:
    """Hash of all that the match of a pair depends on."""
    form = job.settings
    own = form.initial if job.engine == "scanmatch" else (form.genetic, form.seed)
    told = (job.names, job.engine, own, job.limits)
    sweeps = (job.reference.digest, job.moving.digest)
    guess = np.ascontiguousarray(job.guess, dtype=float).tobytes()
    return key_of(code_of(*CODE), repr(told).encode(), *(one.encode() for one in sweeps), guess)


def matching_key(
    sweeps: Sequence[Prepared],
    settings: EngineSettings,
    engine: Engine,
    poses: Array,
    pairs: Indices,
    decisions: Mapping[tuple[str, str], Decision],
) -> str:
    """Hash of all that the matches of an engine depend on."""
    told = [repr((engine, settings)), *(f"{one.name} {one.digest}" for one in sweeps)]
    for pair, one_decision in sorted(decisions.items()):
        guess = None if one_decision.guess is None else one_decision.guess.tolist()
        told.append(repr((pair, one_decision.kind, guess, one_decision.by)))
    arrays = (np.ascontiguousarray(poses), np.ascontiguousarray(pairs, dtype=np.int64))
    return key_of(
        code_of(*CODE, "laser_gt.placing"),
        *(one.encode() for one in told),
        *(one.tobytes() for one in arrays),
    )


def matching_text(matching: Matching, key: str) -> str:
    """The matches as JSON, to be read by `read_matching`.

    Parameters
    ----------
    matching : Matching
        What was matched.
    key : str
        Of `matching_key`.
    """
    matches = [_values(one) for one in matching.matches]
    loops = [[*one.stops, one.chi_squared] for one in matching.loops]
    raw = [[_values(one.match), one.row, _plain(one.curve)] for one in matching.raw.values()]
    content = {"key": key, "matches": matches, "loops": loops, "raw": raw}
    return json.dumps(content, separators=(",", ":")) + "\n"


def read_matching(path: Path, key: str, engine: Engine) -> Matching | None:
    """The matches that were kept; None where there are none of this key."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["key"] != key:
            return None
        raw = _raw(content)
        return Matching(
            engine,
            [_match(one) for one in content["matches"]],
            [Loop((a, b, c), chi_squared) for a, b, c, chi_squared in content["loops"]],
            {pair: one.curve for pair, one in raw.items() if one.curve is not None},
            raw,
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None  # not kept, cut short, or of another form: matched anew


def _raw(content: Mapping[str, Any]) -> dict[tuple[str, str], Raw]:
    """The matches before loops and decisions, by their pairs."""
    found = {}
    for values, row, curve in content["raw"]:
        one = _match(values)
        known = None if curve is None else np.array(curve)
        found[one.reference, one.moving] = Raw(one, row, known)
    return found


def _values(one: Match) -> dict[str, Any]:
    """A match as plain values."""
    return {field.name: _plain(getattr(one, field.name)) for field in fields(Match)}


def _plain(value: Any) -> Any:
    """A value of a match as JSON has it."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _match(values: dict[str, Any]) -> Match:
    """A match from its values."""
    for name in ARRAYS:
        values[name] = None if values[name] is None else np.array(values[name], dtype=float)
    if values["verdict"] not in VERDICTS:
        raise ValueError(values["verdict"])
    values["reasons"] = tuple(values["reasons"])
    return Match(**values)
