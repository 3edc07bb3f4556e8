"""What a user writes with the names of gtval, for a strict type checker; nothing runs it."""

from pathlib import Path

import numpy as np
import pytest

import gtval
from gtval.plugins import Campaign, Finding, Progress, System, SystemResult
from gtval.testing import SampleRoom, make_room


def judge(folder: Path) -> list[str]:
    """A campaign run, and its tables compared and explained again."""
    done: gtval.RunResult = gtval.run_campaign(gtval.load_campaign(folder))
    survey, rig = done.tables
    errors: gtval.Evaluation = gtval.compare(survey, rig, acceptable_bias=(0.02, 0.01))
    reason: gtval.Explanation = gtval.explain(survey, [rig], references={rig.system: "?"})
    gtval.write_poses(rig, folder / "rig.csv")
    page: Path = gtval.write_run(done)[0]
    bias: float = errors.statistics[0].mean
    return [str(page), str(bias), *(one.text for one in gtval.findings(reason))]


def measure(image: np.ndarray[tuple[int, int], np.dtype[np.uint8]]) -> gtval.MarkerPlace:
    """Scans, readings, markers and fixes."""
    scan = gtval.Scan(np.ones(90), np.linspace(0.0, 1.5, 90))
    match: gtval.Match = gtval.match_scans(scan, scan, (0.0, 0.0, 0.1))
    camera = gtval.Camera("1", (1280, 960), np.array([1e3, 1e3, 640, 480, 0, 0, 0, 0, 0]))
    places: tuple[gtval.MarkerPlace, ...] = gtval.locate_markers(
        image, camera, {14: 0.16}, "6X6_250"
    )
    records = [gtval.fixes(name, [0.0], [[36.7, -4.4, 39.0]]) for name in ("a", "b", "c")]
    path: gtval.VehiclePath = gtval.find_path(
        records, gtval.find_offsets(records), heights=(0.1, 0.1, 0.1)
    )
    table: gtval.PoseTable = gtval.path_table(path)
    solution: gtval.SurveySolution = gtval.solve_survey(
        ("O", "1/O"),
        ("W", "W"),
        [1.0, 2.0],
        sigma=0.002,
        world_points=["W"],
        vframe={"O": (0.0, 0.0), "X": (2.5, 0.0)},
        vframe_sigma=0.002,
        robot_frame={"O": (0.0, 0.0), "X": (0.6, 0.0)},
        marking_sigma=0.001,
    )
    stops: tuple[str, ...] = table.ids + make_room(Path("room"), seed=2).truth.ids
    assert match.verdict == "accepted"
    assert solution.pose_table() is not None
    assert stops
    return places[0]


def drive(folder: Path) -> str:
    """Poses in time: clocks, errors, causes, fusion, stops."""
    mocap = gtval.read_trajectory(folder / "mocap.csv", unit="s")
    cameras: list[gtval.Trajectory] = [gtval.read_trajectory(folder / "camera.csv")]
    clocks: gtval.Clocks = gtval.sync(mocap, cameras)
    delay: float = clocks["camera"].delay_s
    fused: gtval.Fused = gtval.fuse(cameras, odometry=mocap, clocks=clocks)
    errors: gtval.TimeComparison = gtval.compare_in_time(mocap, fused.trajectory, align="frame")
    reason: gtval.TimeExplanation = gtval.explain_in_time(mocap, cameras[0].shifted(delay))
    stops: tuple[gtval.Stop, ...] = gtval.find_standstills(mocap)
    table: gtval.PoseTable = gtval.poses_at_stops(mocap, stops)
    written: tuple[Path, ...] = gtval.write_trajectory(mocap, folder / "copy.tum")
    return f"{errors.answer(0.05).verdict} {reason.name} {table.ids} {written}"


class Rig:
    """A system of one's own."""

    name = "rig"

    def has_data(self, campaign: Campaign) -> bool:
        """Whether the campaign states it."""
        return self.name in campaign.extra

    def solve(self, campaign: Campaign, progress: Progress, **_choices: object) -> SystemResult:
        """Nothing but a finding."""
        progress(f"reading {campaign.folder}", 0.0)
        return SystemResult(findings=[Finding("note", "No poses.", "rig", "none")])


SYSTEM: System = Rig()


def test_it(gtval_room: SampleRoom) -> None:
    """A fixture with its type."""
    with pytest.raises(gtval.GtvalError):
        gtval.read_poses(gtval_room.folder / "none.csv", system="rig")
    with pytest.raises(gtval.InputError):
        make_room(gtval_room.folder, stops=3)
