"""Matches kept from one command to the next, by the hash of all that they depend on."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.logs.decisions import Decision
from laser_gt.matching.verdicts import Match
from laser_gt.placing.engines import Engine, EngineSettings, Matching, Raw
from laser_gt.placing.loops import Loop
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array

ARRAYS = ("guess", "pose", "covariance", "seen_pose", "seen_covariance")
"""Fields of a match that are arrays."""


def kept_file(engine: Engine) -> str:
    """Name of the file under results/ with the matches by an engine."""
    return f"laser_matching_{engine}.json"


def base_of(sweeps: Sequence[Prepared], settings: EngineSettings, engine: Engine) -> str:
    """SHA-256 of what a single match depends on, its guess apart; of this program's version too."""
    digest = hashlib.sha256(f"{version('gtval')} {engine} {settings!r}".encode())
    for one in sweeps:
        digest.update(one.name.encode())
        for view in one.sweep.views:
            scan = view.scan
            noise = (scan.sigma, scan.shared_sigma, scan.shared_beams)
            digest.update(repr((scan.range_min, scan.range_max, noise)).encode())
            for array in (scan.ranges, scan.angles, view.mount):
                digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
    return digest.hexdigest()


def key_of(
    base: str, poses: Array, pairs: Indices, decisions: Mapping[tuple[str, str], Decision]
) -> str:
    """SHA-256 of all that the matches of an engine depend on: that of `base_of`, and the rest."""
    digest = hashlib.sha256(base.encode())
    digest.update(np.ascontiguousarray(poses).tobytes())
    digest.update(np.ascontiguousarray(pairs, dtype=np.int64).tobytes())
    for pair, one_decision in sorted(decisions.items()):
        guess = None if one_decision.guess is None else one_decision.guess.tolist()
        digest.update(repr((pair, one_decision.kind, guess, one_decision.by)).encode())
    return digest.hexdigest()


def matching_text(matching: Matching, key: str) -> str:
    """The matches as JSON, to be read by `read_matching` and `read_raw`.

    Parameters
    ----------
    matching : Matching
        What was matched.
    key : str
        Of `base_of` and of `key_of`, a space between them.
    """
    matches = [_values(one) for one in matching.matches]
    loops = [[*one.stops, one.chi_squared] for one in matching.loops]
    raw = [
        [_values(one.match), one.sigmas, one.row, _plain(one.curve)]
        for one in matching.raw.values()
    ]
    base, _, key = key.partition(" ")
    content = {"base": base, "key": key, "matches": matches, "loops": loops, "raw": raw}
    return json.dumps(content, separators=(",", ":")) + "\n"


def read_matching(path: Path, key: str, engine: Engine) -> Matching | None:
    """The matches that were kept; None where there are none of this key."""
    base, _, key = key.partition(" ")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["base"] != base or content["key"] != key:
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


def read_raw(path: Path, base: str) -> dict[tuple[str, str], Raw]:
    """Single matches that were kept of the same scans and settings; none where there are none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return _raw(content) if content["base"] == base else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _raw(content: Mapping[str, Any]) -> dict[tuple[str, str], Raw]:
    """The matches before loops and decisions, by their pairs."""
    found = {}
    for values, (length, angle), row, curve in content["raw"]:
        one = _match(values)
        known = None if curve is None else np.array(curve)
        found[one.reference, one.moving] = Raw(one, (length, angle), row, known)
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
    values["reasons"] = tuple(values["reasons"])
    return Match(**values)
