"""The tables, the JSON and the files of a study."""

from typing import Any

import numpy as np

from data_samples.studies.study import Ranged, Study
from validation.report.cells import Value
from validation.results import Table
from validation.text_files.csv_text import csv_text
from validation.text_files.json_text import json_text

FILES = ("rooms.csv", "poses.csv", "findings.csv")
MARK = "study.json"
"""All of the study for scripts; says that the folder is that of a study."""
SHOWN = ("error", "warning")
"""Severities of the findings that are printed; files and JSON have the notes, too."""


def honesty_table(study: Study) -> Table:
    """One row a setting and system: how far off the poses are, and whether they say so."""
    rows: list[list[Value]] = []
    for one in study.honesty:
        first: list[Value] = [one.setting, one.system, one.trials, 100 * one.poses / one.stops]
        rms = [float(1e3 * value) for value in one.rms]
        inside = [100 * value for value in one.inside]
        rows.append([*first, *rms, *inside, *one.nees, one.verdict(study.plan.confidence)])
    level = f"{100 * study.plan.confidence:g} %"
    columns = [
        *("setting", "system", "rooms", "placed [%]", "rms x [mm]", "rms y [mm]"),
        *("rms theta [mrad]", "inside [%]", "low", "high", "NEES / 3", "low", "high", "intervals"),
    ]
    return Table(
        "Poses against the truth",
        columns,
        rows,
        ["", "", "d", ".1f", ".2f", ".2f", ".2f", ".1f", ".1f", ".1f", ".3f", ".3f", ".3f", ""],
        f"inside: errors in x, y and theta inside the {level} interval that the pose states; of "
        f"right ones {level}. NEES / 3: of right covariances 1. Both with {level} intervals over "
        "the rooms, as errors of one room are alike",
    )


def rooms_table(study: Study) -> Table:
    """One row a setting: rooms, and those without a result."""
    rows: list[list[Value]] = []
    for label, trials in study.trials.items():
        why = sorted({one.refused for one in trials if one.refused})
        more = f" (and {len(why) - 1} other reasons)" if len(why) > 1 else ""
        first = (why[0][:120] + more) if why else ""
        rows.append([label, len(trials), study.refused(label), first])
    return Table("Rooms", ["setting", "rooms", "without a result", "why"], rows, ["", "d", "d", ""])


def power_table(study: Study, *, notes: bool = False) -> Table:
    """One row a setting and finding: in how many rooms it was found."""
    rows: list[list[Value]] = []
    for one in study.power:
        if notes or one.severity in SHOWN:
            what = (one.setting, one.severity, one.code, one.found, one.trials)
            rows.append([*what, *(100 * value for value in one.share), one.times])
    return Table(
        "What was found",
        ["setting", "severity", "code", "found", "rooms", "share [%]", "low", "high", "places"],
        rows,
        ["", "", "", "d", "d", ".1f", ".1f", ".1f", ".1f"],
        f"Share of the rooms in which it was found, with its {100 * study.plan.confidence:g} % "
        "interval; places: in how many of such a room, on average",
    )


def study_files(study: Study) -> dict[str, str]:
    """The tables as CSV, and all as JSON, by the names of their files."""
    tables = (rooms_table(study), honesty_table(study), power_table(study, notes=True))
    files = zip(FILES, tables, strict=True)
    told = {name: csv_text(one.columns, one.rows) for name, one in files}
    return {**told, MARK: json_text(study_json(study))}


def study_json(study: Study) -> dict[str, Any]:
    """The study for scripts, lengths in metres and angles in radians."""
    return {
        "name": study.plan.name,
        "confidence": study.plan.confidence,
        "seeds": [study.plan.seeds.start, study.plan.seeds.stop - 1],
        "settings": [
            {
                "setting": label,
                "values": study.plan.settings[label].model_dump(),
                "rooms": len(trials),
                "refused": study.refused(label),
                "reasons": sorted({one.refused for one in trials if one.refused}),
            }
            for label, trials in study.trials.items()
        ],
        "poses": [
            {
                "setting": one.setting,
                "system": one.system,
                "rooms": one.trials,
                "poses": one.poses,
                "stops": one.stops,
                "rms": np.asarray(one.rms),
                "inside": _ranged(one.inside),
                "nees_over_3": _ranged(one.nees),
                "intervals": one.verdict(study.plan.confidence),
            }
            for one in study.honesty
        ],
        "power": [
            {
                "setting": one.setting,
                "severity": one.severity,
                "code": one.code,
                "found": one.found,
                "rooms": one.trials,
                "share": _ranged(one.share),
                "places": one.times,
            }
            for one in study.power
        ],
    }


def _ranged(one: Ranged) -> dict[str, float]:
    return one._asdict()
