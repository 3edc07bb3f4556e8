"""A simulated campaign as a campaign folder."""

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from data_samples.faults.room_faults import decimals
from data_samples.rooms.rooms import Room
from data_samples.rooms.simulate import SimulatedCampaign
from validation.poses.angles import Array
from validation.poses.pose_table import to_csv
from validation.text_files.json_text import json_text
from validation.text_files.writing import write_files

SETTINGS_FILE = "truth/settings.json"
"""Names what the folder was made from; a folder that holds it is a simulated campaign."""

_OPTIONAL = (
    "survey/hand_points.csv",
    "survey/initial_guesses.csv",
    "survey/known_lengths.csv",
    "survey/walls.csv",
    "laser/scans.csv",
    "laser/odometry.csv",
    "truth/laser_mount.csv",
)
_FIRST_READING = datetime(2024, 3, 4, 9, 0, 0)  # noqa: DTZ001  (people note local time)
_BETWEEN_READINGS = timedelta(seconds=20)
"""Two people, one at the laser and one at the mark, take about so long."""


def write_campaign(
    folder: Path,
    simulated: SimulatedCampaign,
    seed: int | None = None,
    more: Mapping[str, str] | None = None,
    images: Mapping[str, bytes] | None = None,
) -> None:
    """Write all files of a simulated campaign; its truth goes to ``truth/``.

    Parameters
    ----------
    folder : Path
        Made if missing. Files of an earlier simulation are replaced.
    simulated : SimulatedCampaign
        What to write.
    seed : int, optional
        Noted in the truth.
    more : mapping of str to str, optional
        Further files, of other systems; the text for campaign.toml is added to its end.
    images : mapping of str to bytes, optional
        Further files.

    Raises
    ------
    GtvalError
        If the folder cannot be written.
    """
    contents = campaign_files(simulated, seed)
    for name, text in (more or {}).items():
        contents[name] = contents.get(name, "") + text
    write_files(folder, {**contents, **(images or {})})
    for name in _OPTIONAL:
        if name not in contents:
            (folder / name).unlink(missing_ok=True)


def campaign_files(simulated: SimulatedCampaign, seed: int | None = None) -> dict[str, str]:
    """Texts of all files of a simulated campaign, by their names relative to its folder."""
    room, truth = simulated.room, simulated.truth
    rig, vframe = list(simulated.robot_frame.points), list(room.vframe.points)
    marks = [
        [stop, point, *xy]
        for stop, points in zip(room.stop_names, truth.marks, strict=True)
        for point, xy in zip(rig, points, strict=True)
    ]
    files = {
        "campaign.toml": _campaign_toml(simulated, seed),
        "survey/readings.csv": _readings(simulated),
        "truth/world_points.csv": _named_points("world_point", room.world_names, room.world_points),
        "truth/vframe_points.csv": _named_points("point", vframe, truth.vframe_points),
        "truth/rig_points.csv": _named_points("point", rig, truth.rig_points),
        "truth/marks.csv": _csv(["pose", "point", "x", "y"], marks),
        "truth/poses.csv": to_csv(truth.poses),
        "truth/blunders.csv": _faults(simulated),
        SETTINGS_FILE: _settings_json(simulated, seed),
    }
    if simulated.initial_guesses is not None:
        guesses = zip(simulated.initial_guesses.ids, simulated.initial_guesses.poses, strict=True)
        files["survey/initial_guesses.csv"] = _csv(
            ["pose", "x", "y", "theta"],
            [[name, *(f"{v:.3f}" for v in pose)] for name, pose in guesses],
        )
    if simulated.hand_points:
        files["survey/hand_points.csv"] = _csv(
            ["world_point", "x", "y", "sigma"],
            [
                [name, *xy, simulated.settings.hand_sigma]
                for name, xy in simulated.hand_points.items()
            ],
        )
    for table in simulated.systems:
        files[f"published/poses_{table.system}.csv"] = to_csv(table)
    return files


def _csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Plain CSV text; numbers read back to the last bit."""
    cells = ([repr(float(c)) if isinstance(c, float) else str(c) for c in row] for row in rows)
    return "".join(",".join(row) + "\n" for row in [header, *cells])


def _named_points(column: str, names: Sequence[str], places: Array) -> str:
    """Names and coordinates (n, 2)."""
    return _csv([column, "x", "y"], [[n, *xy] for n, xy in zip(names, places, strict=True)])


def _readings(simulated: SimulatedCampaign) -> str:
    """The readings in the order taken; observers A and B take turns at the stops."""
    readings = simulated.readings
    digits = decimals(simulated.settings.instrument)
    stops = {name: number for number, name in enumerate(simulated.room.stop_names)}
    rows = []
    for row, (start, end, shown) in enumerate(
        zip(readings.start, readings.end, simulated.shown, strict=True)
    ):
        stop = stops.get(start.partition("/")[0], 0) if "/" in start else 0
        time = (_FIRST_READING + row * _BETWEEN_READINGS).isoformat()
        rows.append([time, start, end, f"{shown:.{digits}f}", "AB"[stop % 2]])
    return _csv(["time", "from", "to", "distance", "observer"], rows)


def _faults(simulated: SimulatedCampaign) -> str:
    """Wrong readings, by their line in the readings file."""
    readings = simulated.readings
    rows = [
        [fault.row + 2, readings.start[fault.row], readings.end[fault.row], fault.kind, fault.size]
        for fault in simulated.truth.faults
    ]
    return _csv(["line", "from", "to", "kind", "size"], rows)


def _settings_json(simulated: SimulatedCampaign, seed: int | None) -> str:
    """What the campaign was made from."""
    return json_text(
        {
            "seed": seed,
            "room": simulated.room.settings,
            "vframe": simulated.room.vframe,
            "survey": simulated.settings,
        }
    )


def _campaign_toml(simulated: SimulatedCampaign, seed: int | None) -> str:
    """The campaign's settings: what a lab would know, nothing of the truth."""
    room = simulated.room
    described = f"Simulated hand-laser survey of {len(room.stop_names)} stops"
    if seed is not None:
        described += f", seed {seed}"
    tables = [
        "# A simulated campaign: a synthetic room and a hand-laser survey of it. What is true is\n"
        "# in truth/, for judging the results; nothing that computes them reads it.\n\n"
        + _entries(
            {
                "name": "Synthetic room",
                "description": described,
                "date": _FIRST_READING.date().isoformat(),
            }
        ),
        "[instrument]\n" + _entries(simulated.settings.instrument.model_dump()),
        "[vframe]\n" + _entries(room.vframe.model_dump()),
        "[robot_frame]\n" + _entries(simulated.robot_frame.model_dump()),
        "[survey]\n" + _entries({"world_points": room.world_names}),
        "[room]\n" + _walls(room),
    ]
    tables += [
        "[[published]]\n"
        + _entries(
            {
                "system": table.system,
                "file": f"published/poses_{table.system}.csv",
                "source": "simulated: true poses with noise, and a bias where one was asked for",
            }
        )
        for table in simulated.systems
    ]
    return "\n".join(tables)


def _walls(room: Room) -> str:
    """Closed polylines of walls and obstacles, to the centimetre, as one would measure them."""
    lines = [
        f"    {_value(np.round([*outline, outline[0]], 2).tolist())},"
        for outline in (room.outline, *room.obstacles)
    ]
    return "\n".join(["walls = [  # then what stands in the room", *lines, "]"]) + "\n"


def _entries(table: Mapping[str, object]) -> str:
    """Lines `key = value` of a TOML table."""
    return "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _value(value: object) -> str:
    """A value as TOML: for plain strings and numbers the same as JSON."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{json.dumps(key)} = {_value(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return json.dumps(value)
