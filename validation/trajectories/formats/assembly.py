"""From the columns of a file to a trajectory: checks that all formats share."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.poses.trajectory import FREEDOMS, Kind, Trajectory
from validation.trajectories.formats.covariances import checked_covariances
from validation.trajectories.formats.records import MAX_LOOKED_AT, Records
from validation.trajectories.formats.source import MAX_PROBLEMS, Asked, system_name
from validation.trajectories.formats.stamps import (
    MOST_DISORDER,
    UncertainUnitError,
    exact_times,
    lines_shown,
    order_of,
    unit_of,
)

SHORTEST_QUATERNION, LONGEST_QUATERNION = 0.9, 1.1
"""Lengths that rounding to one digit still gives: 0.5, 0.5, 0.5, 0.5 printed with an error of 0.05
each is 1 +- 0.1. What lies outside is no rotation."""
MOST_TURN = 4 * np.pi
"""Radians. Headings beyond it are of a robot that turns on and on, or in degrees."""
FARTHEST = 1e9
"""Metres: coordinates of the whole Earth stay within 7e6; what is larger is another column."""


def assembled(records: Records, asked: Asked, system: str | None = None) -> Trajectory:
    """The trajectory of what a reader found.

    Parameters
    ----------
    records : Records
        At least one row.
    asked : Asked
        What the user says.
    system : str, optional
        Name of the system; by default what the file says, or its name.

    Raises
    ------
    InputError
        For stamps of an uncertain unit or out of order, quaternions that are none, covariances that
        are none, angles that may be degrees.
    """
    if len(records.lines) == 0:
        raise records.source.error("the file has no pose")
    unit = _unit(records, asked)
    try:
        epoch, times = exact_times(records.stamps, unit, records.epoch)
    except GtvalError as error:
        raise records.source.error(str(error), records.lines[0]) from None
    kind, poses = _poses(records, asked)
    covariances = _covariances(records)
    rows = _rows_in_order(records, times)
    if rows is not None:
        times, poses, covariances = times[rows], poses[rows], covariances[rows]
    kind, poses, covariances = _flat(kind, poses, covariances, records)
    facts = {
        "file": records.source.path.name,
        "format": records.format,
        "unit_of_stamps": unit,
        **records.facts,
        "notes": list(records.notes),
    }
    try:
        return Trajectory(
            system or records.system or system_name(records.source.path),
            times,
            poses,
            kind,
            covariances,
            epoch=epoch,
            clock=records.clock,
            longest_interval=records.longest_interval,
            frame=records.frame,
            child_frame=records.child_frame,
            provenance=facts,
        )
    except GtvalError as error:
        raise records.source.error(str(error)) from error


def _unit(records: Records, asked: Asked) -> str:
    """The unit of the stamps: as asked for, as the file says, or as their size tells."""
    if asked.unit is not None:
        return asked.unit
    if records.unit is not None and not records.assumed:
        return records.unit
    # The first rows tell the rate and the size as well as all of them.
    values = np.array(list(map(float, records.stamps[:MAX_LOOKED_AT])))
    try:
        unit = unit_of(values)
    except UncertainUnitError as error:
        if records.unit is not None:
            return records.unit
        raise records.source.error(str(error), records.lines[0], "time") from None
    if records.unit is None:
        records.notes.append(f"stamps are in {unit}, as their size and rate tell")
        return unit
    # A rate alone does not overrule what the format says; the digits of a date do.
    if unit != records.unit and np.median(np.abs(values)) >= 1e12:
        records.notes.append(f"stamps are in {unit}, as their digits tell, not in {records.unit}")
        return unit
    return records.unit


def _poses(records: Records, asked: Asked) -> tuple[Kind, Array]:
    """Kind and rows of numbers of the poses."""
    source, positions = records.source, records.positions
    bad = [
        source.problem(f"farther than {FARTHEST:g} m", records.lines[row], "position")
        for row in np.flatnonzero((np.abs(positions) > FARTHEST).any(1))[:MAX_PROBLEMS]
    ]
    if bad:
        raise InputError(bad)
    plane = positions.shape[1] == 2
    if records.quaternions is not None:
        lengths = np.linalg.norm(records.quaternions, axis=1)
        wrong = (lengths < SHORTEST_QUATERNION) | (lengths > LONGEST_QUATERNION)
        bad = [
            source.problem(
                f"a quaternion of length {lengths[row]:.4g}, not 1",
                records.lines[row],
                "quaternion",
                " ".join(f"{number:g}" for number in records.quaternions[row]),
            )
            for row in np.flatnonzero(wrong)[:MAX_PROBLEMS]
        ]
        if bad:
            raise InputError(bad)
        return "space", np.column_stack([positions, records.quaternions])
    if records.angles is None:
        return "points_plane" if plane else "points_space", positions
    angles = _radians(records.angles, records, asked)
    if plane:
        return "plane", np.column_stack([positions, angles[:, 0]])
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

    quaternions = Rotation.from_euler("ZYX", angles).as_quat()
    return "space", np.column_stack([positions, quaternions])


def _radians(angles: Array, records: Records, asked: Asked) -> Array:
    """(n, k) angles in radians; whether they are in degrees is told, not guessed."""
    angles = angles.reshape(len(records.lines), -1)
    degrees = records.degrees if asked.degrees is None else asked.degrees
    if degrees is None:
        worst = int(np.abs(angles).max(1).argmax())
        if np.abs(angles[worst]).max() > MOST_TURN:
            raise records.source.error(
                "an angle of more than two turns: say whether it is in degrees (--degrees) or in "
                "radians (--radians)",
                records.lines[worst],
                "angle",
                f"{angles[worst][np.abs(angles[worst]).argmax()]:g}",
            )
        if not records.own:
            records.notes.append("angles are taken as radians")
    return np.radians(angles) if degrees else angles


def _rows_in_order(records: Records, times: Array) -> npt.NDArray[np.intp] | None:
    """Rows that make times increase; what was sorted or left out is noted.

    Raises
    ------
    InputError
        If more than `MOST_DISORDER` of the rows are out of order.
    """
    order = order_of(times)
    lines = np.asarray(records.lines)
    parts = [
        (order.back, "went back in time and", "sorted in"),
        (order.repeated, "repeated the stamp of another and", "left out"),
    ]
    if order.share > MOST_DISORDER:
        said = [
            f"{len(rows)} of {len(times)} rows {what.removesuffix(' and')} "
            f"({records.row} {lines_shown(lines[rows].tolist())})"
            for rows, what, _ in parts
            if len(rows)
        ]
        raise records.source.error(
            f"the stamps do not increase: {'; '.join(said)}. Are these two recordings, or is this "
            "another column?",
            int(lines[min([*order.back, *order.repeated])]),
            "time",
        )
    for rows, what, done in parts:
        if len(rows):
            were = "row" if len(rows) == 1 else "rows"
            where = f"{records.row} {lines_shown(lines[rows].tolist())}"
            records.notes.append(f"{len(rows)} {were} {what} {_was(len(rows))} {done}: {where}")
            records.facts["rows_left_out" if done == "left out" else "rows_sorted"] = len(rows)
    return order.rows


def _was(count: int) -> str:
    return "was" if count == 1 else "were"


def _flat(
    kind: Kind, poses: Array, covariances: Array, records: Records
) -> tuple[Kind, Array, Array]:
    """Poses in space that all lie in the plane z = 0 and turn about Z only, as such.

    Formats that know poses in space only are written so by robots that know the plane only; their
    variances of the other numbers mean nothing.
    """
    if kind != "space" or not _is_flat(records):
        return kind, poses, covariances
    records.notes.append("all poses have z = 0 and turn about Z only: read as poses in the plane")
    theta = 2 * np.arctan2(poses[:, 5], poses[:, 6])
    theta = np.where(theta > np.pi, theta - 2 * np.pi, theta)
    theta = np.where(theta <= -np.pi, theta + 2 * np.pi, theta)
    kept = np.ix_(range(len(poses)), [0, 1, 5], [0, 1, 5])
    return "plane", np.column_stack([poses[:, :2], theta]), covariances[kept]


def _covariances(records: Records) -> Array:
    """The covariances, repaired where printing them with few digits spoilt them.

    Raises
    ------
    InputError
        With every one that no rounding explains.
    """
    n = len(records.lines)
    if records.covariances is None:
        size = FREEDOMS[_kind_of(records)]
        return np.asarray(np.broadcast_to(np.nan, (n, size, size)))
    covariances = np.array(records.covariances, dtype=float)
    size = covariances.shape[1]
    flat = _is_flat(records)
    if flat and size == 6:
        # A robot in the plane states nothing about the other three.
        kept = np.ix_(range(n), [0, 1, 5], [0, 1, 5])
        covariances[kept] = checked_covariances(covariances[kept], records)
        return covariances
    return checked_covariances(covariances, records)


def _is_flat(records: Records) -> bool:
    """Whether all poses of a format in space lie in the plane."""
    return (
        records.quaternions is not None
        and not records.own
        and not records.positions[:, 2:].any()
        and not records.quaternions[:, :2].any()
    )


def _kind_of(records: Records) -> Kind:
    """The kind of poses, by what there is of orientation."""
    plane = records.positions.shape[1] == 2
    if records.quaternions is None and records.angles is None:
        return "points_plane" if plane else "points_space"
    return "plane" if plane else "space"


def facts_of(trajectory: Trajectory) -> Mapping[str, object]:
    """What a file says of itself, for people and scripts."""
    last = float(trajectory.times[-1]) if len(trajectory) else 0.0
    return {
        "system": trajectory.system,
        "kind": trajectory.kind,
        "poses": len(trajectory),
        "epoch": trajectory.epoch,
        "from_s": float(trajectory.times[0]),
        "to_s": last,
        "gaps": len(trajectory.gaps),
        "with_covariance": int(trajectory.has_covariance.sum()),
    }
