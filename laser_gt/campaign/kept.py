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
from laser_gt.placing.engines import Engine, EngineSettings, Matching
from laser_gt.placing.loops import Loop
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array

ARRAYS = ("guess", "pose", "covariance", "seen_pose", "seen_covariance")
"""Fields of a match that are arrays."""


def kept_file(engine: Engine) -> str:
    """Name of the file under results/ with the matches by an engine."""
    return f"laser_matching_{engine}.json"


def key_of(
    sweeps: Sequence[Prepared],
    poses: Array,
    pairs: Indices,
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
    engine: Engine,
) -> str:
    """SHA-256 of all that the matches of an engine depend on, this program's version included."""
    digest = hashlib.sha256(f"{version('gtval')} {engine} {settings!r}".encode())
    for one in sweeps:
        digest.update(one.name.encode())
        for view in one.sweep.views:
            scan = view.scan
            noise = (scan.sigma, scan.shared_sigma, scan.shared_beams)
            digest.update(repr((scan.range_min, scan.range_max, noise)).encode())
            for array in (scan.ranges, scan.angles, view.mount):
                digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
    digest.update(np.ascontiguousarray(poses).tobytes())
    digest.update(np.ascontiguousarray(pairs, dtype=np.int64).tobytes())
    for pair, one_decision in sorted(decisions.items()):
        guess = None if one_decision.guess is None else one_decision.guess.tolist()
        digest.update(repr((pair, one_decision.kind, guess, one_decision.by)).encode())
    return digest.hexdigest()


def matching_text(matching: Matching, key: str) -> str:
    """The matches as JSON, to be read by `read_matching`."""
    matches = [
        {field.name: _plain(getattr(one, field.name)) for field in fields(Match)}
        for one in matching.matches
    ]
    loops = [[*one.stops, one.chi_squared] for one in matching.loops]
    convergence = [[*pair, values.tolist()] for pair, values in matching.convergence.items()]
    content = {"key": key, "matches": matches, "loops": loops, "convergence": convergence}
    return json.dumps(content, separators=(",", ":")) + "\n"


def read_matching(path: Path, key: str, engine: Engine) -> Matching | None:
    """The matches that were kept; None where there are none of this key."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["key"] != key:
            return None
        return Matching(
            engine,
            [_match(one) for one in content["matches"]],
            [Loop((a, b, c), chi_squared) for a, b, c, chi_squared in content["loops"]],
            {(a, b): np.array(values) for a, b, values in content["convergence"]},
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None  # not kept, cut short, or of another form: matched anew


def _plain(value: Any) -> Any:
    """A value of a match as JSON has it."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _match(values: dict[str, Any]) -> Match:
    """A match from its values."""
    for name in ARRAYS:
        values[name] = None if values[name] is None else np.array(values[name], dtype=float)
    values["reasons"] = tuple(values["reasons"])
    return Match(**values)
