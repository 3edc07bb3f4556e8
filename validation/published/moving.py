"""A published ground truth that moves: a trajectory, judged at the stops of the survey."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validation.campaign.folder import Published
from validation.campaign.stored import system_of
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array, wrap
from validation.poses.common_origin import placed_by
from validation.poses.pose_table import PLANAR, PoseTable
from validation.poses.trajectory import Trajectory
from validation.results import Finding, Section, Size, SystemResult, Table
from validation.text_files.csv_text import csv_text
from validation.trajectories.alignment import umeyama
from validation.trajectories.formats import read_trajectory
from validation.trajectories.naming import name_standstills
from validation.trajectories.stops import (
    Stop,
    StopPoses,
    check_stops,
    find_standstills,
    poses_at_stops,
    read_stops,
)


@dataclass(frozen=True)
class _Stops:
    """Stops of a trajectory, and how they came about."""

    named: Sequence[Stop]
    nameless: int = 0
    file: Path | None = None


def moving_result(folder: Path, entry: Published, validation: PoseTable | None) -> SystemResult:
    """The poses at stops of a published trajectory, and the trajectory itself.

    Parameters
    ----------
    folder : Path
        Of the campaign; the entry's files are named relative to it.
    entry : Published
        Names the trajectory's file, and that of its stops if there is one.
    validation : PoseTable, optional
        Surveyed stops; the standstills of a trajectory without a file of stops get their names.

    Raises
    ------
    InputError
        If a file is bad, or saw none of the stops.
    """
    path = folder / entry.file
    trajectory = read_trajectory(
        path,
        system=entry.system,
        format=entry.format or None,
        unit=entry.unit,
        body=entry.body or None,
        topic=entry.topic or None,
    ).planar()
    trajectory = replace(_with_sigmas(trajectory, entry, path), frame=entry.frame)
    if not entry.judged:
        facts = {"trajectory": _facts(trajectory)}
        return SystemResult(facts=facts, trajectories=(trajectory,))
    stops = _stops(folder, entry, trajectory, validation)
    findings = _of_standstills(entry.system, stops)
    if not stops.named:
        facts = {"trajectory": _facts(trajectory)}
        return SystemResult(findings=findings, facts=facts, trajectories=(trajectory,))
    try:
        found = poses_at_stops(trajectory, stops.named)
    except GtvalError as error:
        said = f"{error}. Its stamps and those of the stops must be of one clock."
        raise InputError([Problem(stops.file or path, said)]) from None
    table = replace(
        found.table,
        provenance={
            "published": entry.source,
            "file": entry.file,
            "stops": entry.stops or "standstills found",
            "assumed_sigmas": entry.sigmas,
        },
    )
    if entry.frame == "own" and validation is not None:
        table, laid = _laid_onto(table, validation)
        findings.append(laid)
    findings += _of_stops(table, found, trajectory)
    return SystemResult(
        tables=[table],
        findings=findings,
        sections=[Section(f"Stops of {entry.system}", [stops_table(stops.named, found)])],
        files={} if entry.stops else {f"stops_{entry.system}.csv": _stops_csv(stops.named)},
        facts={
            "trajectory": _facts(trajectory),
            "stops": found.counts,
            "missing": found.missing,
            "inflation": found.inflation,
        },
        trajectories=(trajectory,),
    )


def at_stops(
    path: Path, validation: PoseTable, stops: Path | None = None, *, own_frame: bool = False
) -> SystemResult:
    """The poses of a single trajectory at the stops of a table.

    Parameters
    ----------
    path : Path
        The trajectory.
    validation : PoseTable
        Surveyed stops.
    stops : Path, optional
        When the robot stood where; without it the standstills are found.
    own_frame : bool
        Whether its frame is first laid onto the survey.

    Raises
    ------
    InputError
        As for `moving_result`.
    """
    said = Published.model_construct(
        system=system_of(path),
        file=str(path.absolute()),
        stops="" if stops is None else str(stops.absolute()),
        frame="own" if own_frame else "gtv",
    )
    return moving_result(Path(), said, validation)


def _with_sigmas(trajectory: Trajectory, entry: Published, path: Path) -> Trajectory:
    """The trajectory with the entry's standard deviations where it states none."""
    if entry.sigmas is None:
        return trajectory
    freedoms = trajectory.covariances.shape[1]
    if len(entry.sigmas) != freedoms:
        said = f"poses seen from above have {freedoms} numbers, and need as many sigmas"
        raise InputError([Problem(path, said, field="sigmas", value=str(entry.sigmas))])
    stated = trajectory.has_covariance[:, None, None]
    assumed = np.diag(np.square(entry.sigmas))
    return replace(trajectory, covariances=np.where(stated, trajectory.covariances, assumed))


def _stops(
    folder: Path, entry: Published, trajectory: Trajectory, validation: PoseTable | None
) -> _Stops:
    """Those of the file of stops, or standstills with the names of the surveyed stops."""
    if entry.stops:
        path = folder / entry.stops
        stated = read_stops(path)
        check_stops(stated, path)
        return _Stops(stated, file=path)
    found = find_standstills(trajectory)
    if validation is None or not len(found):
        return _Stops((), len(found))
    places = [_place(trajectory, start, end) for start, end in found]
    named = name_standstills(
        np.array(places), validation.poses[:, :2], validation.ids, same_frame=entry.frame == "gtv"
    )
    stops = [
        Stop(name, float(start) + trajectory.epoch, float(end) + trajectory.epoch)
        for name, (start, end) in zip(named.names, found, strict=True)
        if name
    ]
    return _Stops(stops, len(found) - len(stops))


def _place(trajectory: Trajectory, start: float, end: float) -> Array:
    """Median position of an interval."""
    inside = (trajectory.times >= start) & (trajectory.times <= end)
    return np.asarray(np.median(trajectory.positions[inside], axis=0))


def _laid_onto(table: PoseTable, validation: PoseTable) -> tuple[PoseTable, Finding]:
    """The table in the frame of the survey, by the rotation and shift that fits its stops best."""
    surveyed = set(validation.ids)
    common = [name for name in table.ids if name in surveyed]
    if len(common) < 3:
        said = f"'{table.system}' has {len(common)} stops in common with the survey; a frame of "
        raise GtvalError(f"{said}its own needs 3")
    here, there = table.select(common).poses[:, :2], validation.select(common).poses[:, :2]
    rotation, shift, _ = umeyama(there, here)
    turn = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    poses = table.poses.copy()
    poses[:, :2] = poses[:, :2] @ rotation.T + shift
    whole = np.eye(len(table.components))
    whole[:2, :2] = rotation
    if table.components == PLANAR:
        poses[:, 2] = wrap(poses[:, 2] + turn)
    text = (
        f"The frame of '{table.system}' is its own: it was turned by {np.degrees(turn):.3f} "
        f"degrees and shifted so that its {len(common)} stops fit the survey; a wrong frame "
        "cannot be seen."
    )
    moved = replace(table, poses=poses, covariances=whole @ table.covariances @ whole.T)
    moved = placed_by(moved, validation, common, headings=False)
    return moved, Finding("note", text, table.system, "frame_fitted")


def _of_standstills(system: str, stops: _Stops) -> list[Finding]:
    """What became of the standstills that were found."""
    if stops.file is not None:
        return []
    named, whole = len(stops.named), len(stops.named) + stops.nameless
    advice = "A file of stops (pose, from, to) says which is which: key `stops` of [[published]]."
    counted = (Size("standstills without a name", stops.nameless, "stops"),)
    if not named:
        text = f"'{system}' stands still {whole} times, and none of them could be given the name of"
        text = f"{text} a surveyed stop. {advice}"
        return [Finding("warning", text, system, "standstills", counted)]
    text = f"'{system}' stands still {whole} times; {named} of them are surveyed stops by their "
    return [Finding("note", f"{text}place. {advice}", system, "standstills", counted)]


def _of_stops(table: PoseTable, found: StopPoses, trajectory: Trajectory) -> list[Finding]:
    """Stops without a pose, stops in which the robot moves, and what the covariance holds."""
    system, findings = table.system, []
    if found.missing:
        listed = "; ".join(f"{name}: {why}" for name, why in list(found.missing.items())[:5])
        more = f"; and {len(found.missing) - 5} more" if len(found.missing) > 5 else ""
        text = f"'{system}' has no pose at {len(found.missing)} stops ({listed}{more})."
        count = Size("stops without a pose", len(found.missing), "stops")
        findings.append(Finding("warning", text, system, "stops_missing", (count,)))
    if found.moved:
        listed = ", ".join(f"{name} ({1000 * way:.0f} mm)" for name, way in found.moved.items())
        text = (
            f"'{system}' moves while it stands at: {listed}. Check the times of these stops; their "
            "poses are taken as that much less certain."
        )
        ways = tuple(Size(f"way at {name}", way, "m") for name, way in found.moved.items())
        findings.append(Finding("warning", text, system, "stop_moved", ways))
    if not trajectory.has_covariance.all():
        text = (
            f"The covariances of '{system}' at stops come from the scatter of its poses. An error "
            "that stays the same while the robot stands is not in them."
        )
        findings.append(Finding("note", text, system, "scatter_only"))
    return findings


def stops_table(stops: Sequence[Stop], found: StopPoses) -> Table:
    """When the robot stood where, and how many poses say so."""
    row = {name: number for number, name in enumerate(found.table.ids)}
    sigmas = np.sqrt(np.diagonal(found.table.covariances, axis1=1, axis2=2))
    codes = [("sigma " + c.name, f"m{c.unit}") for c in found.table.components]
    return Table(
        f"Stops of {found.table.system}",
        ["stop", "from [s]", "to [s]", "poses", "left out", *(f"{a} [{b}]" for a, b in codes)],
        [
            [
                stop.name,
                stop.start,
                stop.end,
                found.counts.get(stop.name, 0),
                found.left_out.get(stop.name, 0),
                *(
                    (1000 * sigmas[row[stop.name]]).tolist()
                    if stop.name in row
                    else [None] * len(codes)
                ),
            ]
            for stop in stops
        ],
        ["", ".2f", ".2f", "", "", *(".2f",) * len(codes)],
        note="Poses far from the median of their stop are left out. Neighbours in time are "
        "correlated, which the standard deviations count.",
    )


def _stops_csv(stops: Sequence[Stop]) -> str:
    return csv_text(["pose", "from", "to"], [[s.name, s.start, s.end] for s in stops])


def _facts(trajectory: Trajectory) -> dict[str, object]:
    """Numbers of a trajectory for run.json."""
    times = trajectory.times
    seen = float(np.diff(times)[np.diff(times) <= trajectory.gap].sum())
    return {
        "poses": len(times),
        "start_s": float(times[0]) + trajectory.epoch,
        "end_s": float(times[-1]) + trajectory.epoch,
        "median_interval_s": float(np.median(np.diff(times))) if len(times) > 1 else None,
        "gaps": len(trajectory.gaps),
        "coverage": seen / float(times[-1] - times[0]) if len(times) > 1 else None,
    }
