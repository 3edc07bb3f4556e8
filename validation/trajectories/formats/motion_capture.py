"""Exports of motion capture systems: OptiTrack Motive, Vicon Nexus and Tracker, Qualisys QTM."""

from collections.abc import Sequence

import numpy as np

from validation.poses.angles import Array
from validation.poses.trajectory import Clock
from validation.trajectories.formats.bare_columns import quaternions_of
from validation.trajectories.formats.records import Records, without_rows
from validation.trajectories.formats.source import (
    Asked,
    Rows,
    Source,
    cells_of,
    is_number,
    read_rows,
)

_LENGTHS = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3, "feet": 0.3048}
_LENGTHS |= {"inches": 0.0254, "m": 1.0, "mm": 1e-3, "cm": 1e-2}
VICON = {"objects", "segments", "global segments", "subjects"}
"""First lines of the parts of a Vicon export that hold poses."""
LEVEL = 0.2
"""How much flatter than the other two an axis' extent must be to be the vertical one. A robot on a
floor stays within some percent; a hand-carried rig does not, and its user is asked."""


def _chosen(source: Source, bodies: Sequence[str], asked: Asked, line: int) -> str:
    """The body that is asked for, or the only one.

    Raises
    ------
    InputError
        If there is none of that name, or several and none is asked for.
    """
    named = ", ".join(f"'{body}'" for body in bodies[:20])
    if not bodies:
        raise source.error("no rigid body; export rigid bodies, not markers only", line)
    if asked.body is not None:
        if asked.body not in bodies:
            raise source.error(f"no body '{asked.body}'; there is {named}", line)
        return asked.body
    if len(bodies) > 1:
        raise source.error(f"several bodies: {named}; choose one with --body NAME", line)
    return bodies[0]


def _tracked(rows: Rows, columns: Sequence[int]) -> tuple[Rows, list[str]]:
    """Rows in which the body was seen, and a note on the others."""
    cells = [rows.columns[column] for column in columns]
    lost = np.array([not any(c.strip() for c in row) for row in zip(*cells, strict=True)])
    if lost.all():
        raise rows.source.error("the body is never seen: all its cells are blank")
    if not lost.any():
        return rows, []
    notes = without_rows(~lost, rows.lines, "as the body was not seen")
    return rows.select(np.flatnonzero(~lost).tolist()), notes


def read_motive(source: Source, asked: Asked) -> Records:
    """A rigid body of a take that OptiTrack Motive exported as CSV.

    Notes
    -----
    Motive's own frame has Y up, and bodies too; both are turned by 90 degrees about X, so that Z is
    up. The file does not say which axis is up: it is told by the one along which the body hardly
    moves, or by the user.
    """
    head = [cells_of(line, ",") for line in source.lines[:12]]
    titles = next((k for k, cells in enumerate(head) if cells[:1] == ["Frame"]), None)
    if titles is None or titles < 3:
        raise source.error("no line 'Frame, Time (Seconds), …' below the header")
    facts = dict(zip(head[0][::2], head[0][1::2], strict=False))
    if (turned := facts.get("Rotation Type", "Quaternion")) != "Quaternion":
        raise source.error(
            f"rotations are exported as {turned}; export as Quaternion", 1, "Rotation Type", turned
        )
    if (space := facts.get("Coordinate Space", "Global")) != "Global":
        raise source.error("export in Global coordinates", 1, "Coordinate Space", space)
    scale = _LENGTHS.get(facts.get("Length Units", "Meters").lower())
    if scale is None:
        raise source.error("not a length", 1, "Length Units", facts["Length Units"])
    width = len(head[titles])
    blocks = [cells + [""] * (width - len(cells)) for cells in head[1:titles] if any(cells)]
    kinds, bodies, parts = blocks[0], blocks[1], blocks[-1]
    rigid = [k for k in range(2, width) if kinds[k] == "Rigid Body"]
    body = _chosen(source, list(dict.fromkeys(bodies[k] for k in rigid)), asked, titles)
    found = {(parts[k], head[titles][k]): k for k in rigid if bodies[k] == body}
    wanted = [("Position", axis) for axis in "XYZ"] + [("Rotation", axis) for axis in "XYZW"]
    if missing := [" ".join(one) for one in wanted if one not in found]:
        raise source.error(f"'{body}' has no column {', '.join(missing)}", titles + 1)
    rows = read_rows(source, titles + 1, ",", head[titles], comments=False)
    rows, notes = _tracked(rows, [found[one] for one in wanted[:3]])
    values = rows.numbers([1, *(found[one] for one in wanted)])
    positions, quaternions = values[:, 1:4] * scale, values[:, 4:]
    up = asked.up or _vertical(source, positions)
    if up == "y":
        positions, quaternions = _z_up(positions, quaternions)
        notes.append("Y was up: turned by 90 degrees about X, so that Z is up")
    rate = facts.get("Export Frame Rate", "")
    return Records(
        source,
        "motive",
        rows.lines,
        rows.text(1),
        positions,
        unit="s",
        quaternions=quaternions,
        clock=Clock("capture", float(rate) if is_number(rate) else None),
        child_frame=body,
        facts={
            "body": body,
            "take": facts.get("Take Name", ""),
            "started": facts.get("Capture Start Time", ""),
        },
        notes=notes,
    )


def _vertical(source: Source, positions: Array) -> str:
    """The axis that is up: 'y' or 'z', where the motion leaves one only."""
    extent = np.ptp(positions, axis=0)
    for name, axis in (("y", 1), ("z", 2)):
        others = np.delete(extent, axis)
        if extent[axis] < LEVEL * others.min():
            return name
    raise source.error(
        "which axis is up is not in the file, nor does the motion tell it; say --up y (as Motive "
        "has it by default) or --up z"
    )


def _z_up(positions: Array, quaternions: Array) -> tuple[Array, Array]:
    """Positions and orientations with Z up, of those with Y up: (x, y, z) becomes (x, -z, y)."""
    turned = positions[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    # The same exchange of axes, before and behind: a level body stays the identity.
    return turned, quaternions[:, [0, 2, 1, 3]] * [1.0, -1.0, 1.0, 1.0]


def read_vicon(source: Source, asked: Asked) -> Records:
    """An object or segment of a CSV that Vicon Tracker or Nexus exported.

    Notes
    -----
    The rows are 'Objects', the rate, the names, the titles, the units. RX RY RZ are a rotation
    vector, RX RY RZ RW a quaternion. Frame 1 is at time 0.
    """
    lines = source.lines
    rate = cells_of(lines[1], ",")[0] if len(lines) > 1 else ""
    if not is_number(rate) or float(rate) <= 0:
        raise source.error("expected the rate in Hz", 2, "rate", rate)
    titles = cells_of(lines[3], ",") if len(lines) > 3 else []
    if titles[:2] != ["Frame", "Sub Frame"]:
        raise source.error("expected 'Frame,Sub Frame,RX,RY,RZ,…'", 4)
    width = len(titles)
    starts = {c: k for k, c in enumerate(cells_of(lines[2], ",")) if c}
    ends = [*sorted(starts.values())[1:], width]
    body = _chosen(source, list(starts), asked, 3)
    low = starts[body]
    high = ends[sorted(starts.values()).index(low)]
    units = (cells_of(lines[4], ",") if len(lines) > 4 else []) + [""] * width
    found = {titles[k]: k for k in range(low, min(high, width))}
    turns = [name for name in ("RX", "RY", "RZ", "RW") if name in found]
    if missing := [n for n in ("RX", "RY", "RZ", "TX", "TY", "TZ") if n not in found]:
        raise source.error(f"'{body}' has no column {', '.join(missing)}", 4)
    scale = _LENGTHS.get(units[found["TX"]])
    if scale is None:
        raise source.error("not a length", 5, "TX", units[found["TX"]])
    names = [title or f"column {k + 1}" for k, title in enumerate(titles)]
    body_end = _end_of_part(lines)
    rows = read_rows(_until(source, body_end), 5, ",", names, comments=False)
    wanted = [found[name] for name in ("TX", "TY", "TZ")]
    rows, notes = _tracked(rows, wanted)
    positions = rows.numbers(wanted) * scale
    turned = rows.numbers([found[name] for name in turns])
    if len(turns) == 3:
        unit = units[found["RX"]]
        if unit not in {"deg", "rad"}:
            raise source.error("expected deg or rad", 5, "RX", unit)
        turned = np.radians(turned) if unit == "deg" else turned
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

        turned = np.asarray(Rotation.from_rotvec(turned).as_quat())
        notes.append("RX RY RZ are taken as a rotation vector")
    frames = rows.numbers([0, 1])
    sub = max(int(frames[:, 1].max()) + 1, 1)
    stamps = [repr(one) for one in ((frames[:, 0] - 1 + frames[:, 1] / sub) / float(rate)).tolist()]
    return Records(
        source,
        "vicon",
        rows.lines,
        stamps,
        positions,
        unit="s",
        quaternions=turned,
        clock=Clock("capture", float(rate) * sub),
        child_frame=body,
        facts={"body": body},
        notes=notes,
    )


def _end_of_part(lines: Sequence[str]) -> int:
    """The line behind the first part of a Vicon export: blank, or another part's title."""
    for number in range(5, len(lines)):
        first = lines[number].strip(" ,")
        if not first or first[0].isalpha():
            return number
    return len(lines)


def _until(source: Source, end: int) -> Source:
    """The first lines of a source."""
    if end >= len(source.lines):
        return source
    return Source(source.path, "\n".join(source.lines[:end]).encode(errors="surrogateescape"))


def read_qualisys(source: Source, asked: Asked) -> Records:
    """A rigid body of a 6DOF file (TSV) that Qualisys Track Manager exported.

    Notes
    -----
    Rot[0] to Rot[8] are the rotation matrix column by column: in published files Rot[7] is
    -sin(roll) cos(pitch), which Rx(roll) Ry(pitch) Rz(yaw) has in its row 2, column 3. Where they
    are missing, these angles, the standard definition of Track Manager, are used. Millimetres.
    """
    facts, titles = _qualisys_head(source)
    rate = (facts.get("FREQUENCY") or [""])[0]
    if not is_number(rate) or float(rate) <= 0:
        raise source.error("expected the rate in Hz", None, "FREQUENCY", rate)
    names = [name for name in facts.get("BODY_NAMES", []) if name]
    body = _chosen(source, names, asked, (titles or 1))
    if titles is None:
        raise source.error("no line 'X, Y, Z, …' below the header; export with column headers")
    header = [cell.strip() for cell in source.lines[titles].split("\t")]
    while header and not header[-1]:
        header.pop()
    found = _body_columns(header, names.index(body), body)
    if missing := [axis for axis in "XYZ" if axis not in found]:
        raise source.error(f"'{body}' has no column {', '.join(missing)}", titles + 1)
    rows = read_rows(source, titles + 1, "\t", header, comments=False)
    rows, notes = _tracked(rows, [found[axis] for axis in "XYZ"])
    matrix = [f"Rot[{k}]" for k in range(9)]
    angles = ["Roll", "Pitch", "Yaw"]
    if all(name in found for name in matrix):
        values = rows.numbers([found[name] for name in (*"XYZ", *matrix)])
        seen = np.asarray(values[:, 3:].any(1))
        notes += without_rows(seen, rows.lines, "as the body was not seen")
        rows, values = rows.select(np.flatnonzero(seen).tolist()), values[seen]
        turned = values[:, 3:].reshape(-1, 3, 3).transpose(0, 2, 1)
        quaternions = quaternions_of(turned, source, rows.lines)
    elif all(name in found for name in angles):
        values = rows.numbers([found[name] for name in (*"XYZ", *angles)])
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

        quaternions = Rotation.from_euler("XYZ", values[:, 3:], degrees=True).as_quat()
        notes.append("no rotation matrix: angles are taken by Track Manager's own definition")
    else:
        raise source.error(f"'{body}' has neither Rot[0] to Rot[8] nor angles", titles + 1)
    stamps = rows.text(header.index("Time")) if "Time" in header else None
    if stamps is None:
        # Exported without these columns, every line is a frame.
        told = header[0] == "Frame"
        frames = rows.numbers([0])[:, 0] if told else np.asarray(rows.lines) - titles - 1.0
        stamps = [repr(one) for one in ((frames - 1) / float(rate)).tolist()]
    else:
        rows.numbers([header.index("Time")])
    return Records(
        source,
        "qualisys",
        rows.lines,
        stamps,
        values[:, :3] * 1e-3,
        unit="s",
        quaternions=np.asarray(quaternions),
        clock=Clock("capture", float(rate)),
        child_frame=body,
        facts={"body": body, "started": " ".join(facts.get("TIME_STAMP", []))},
        notes=notes,
    )


def _qualisys_head(source: Source) -> tuple[dict[str, list[str]], int | None]:
    """What the header says, and the number of the line with the titles of the columns."""
    facts: dict[str, list[str]] = {}
    for number, line in enumerate(source.lines[:40]):
        cells = [cell.strip() for cell in line.split("\t")]
        if cells[0] == "Frame" or {"X", "Y", "Z"} <= {cell.split(" ")[-1] for cell in cells}:
            return facts, number
        if cells[0] and cells[0][0].isalpha():
            facts[cells[0]] = cells[1:]
    return facts, None


def _body_columns(header: Sequence[str], place: int, body: str) -> dict[str, int]:
    """Columns of the body of that place; each body's begin with its X, with or without its name."""
    found: dict[str, int] = {}
    seen = -1
    for column, cell in enumerate(header):
        title = cell.removeprefix(body).strip() if cell.startswith(body) else cell
        title = title.rsplit(" ", 1)[-1] if " " in title else title
        if title == "X":
            seen += 1
        if seen == place and title not in found:
            found[title] = column
    return found


def motion_capture_fault(source: Source, form: str) -> str | None:
    """Why a file is no export of a motion capture system, None if it is one."""
    first = cells_of(source.lines[0], "," if form != "qualisys" else "\t")
    start = (first or [""])[0].strip()
    expected = {"motive": "Format Version", "qualisys": "NO_OF_FRAMES"}
    if form == "vicon":
        return None if start.lower() in VICON else "the first line is not 'Objects' or 'Segments'"
    return None if start == expected[form] else f"the first line is not '{expected[form]} …'"
