"""How time and memory grow with the work: stops, frames, scans, minutes, poses, days.

    python benchmarks/growth.py [--short] [--most SIZE] [WORK ...]

Each size is worked out in a process of its own, whose data another process has made, so that time
and memory are those of the work: processor time of the work without imports, which a first run on
the least size has done, and the most memory that the process held. The exponent is the slope of the
logarithm of the time over that of the size, by least squares over all sizes; beside it the slope
between the last two. Asked is at most 1.15. The short form takes about a minute.
"""

import argparse
import json
import pickle
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ASKED = 1.15
ROOT = Path(__file__).parents[1]
Ready = Callable[[Path], Callable[[], object]]


@dataclass(frozen=True)
class Work:
    """One kind of work.

    ``make`` writes the data of a size to a folder; ``ready`` reads them and gives what is measured.
    """

    of: str
    sizes: tuple[int, ...]
    make: Callable[[int, Path], None]
    ready: Ready


def kept(folder: Path, value: object) -> None:
    (folder / "data.pkl").write_bytes(pickle.dumps(value))


def loaded(folder: Path) -> object:
    return pickle.loads((folder / "data.pkl").read_bytes())


def command(*arguments: str) -> Ready:
    """A command on a folder, its output thrown away."""

    def ready(folder: Path) -> Callable[[], object]:
        from click.testing import CliRunner

        from validation.cli import main

        words = [one.format(folder) for one in arguments]
        shutil.rmtree(folder / "kept", ignore_errors=True)  # of the run that imported

        def run() -> None:
            done = CliRunner().invoke(main, words)
            assert done.exit_code == 0, done.output

        return run

    return ready


def make_room(stops: int, folder: Path) -> None:
    from gtval.testing import make_room as room

    room(folder, seed=1, stops=stops)


def make_frames(frames: int, folder: Path) -> None:
    """Four cameras, ten frames a second each: what they detect, without images."""
    sys.path[:0] = [
        str(ROOT / "tests" / "vision_gt"),
        str(ROOT / "tests" / "vision_gt" / "driving"),
    ]
    import filmed_drives

    filmed_drives.camera_stream = lambda *given, **options: (given, options)
    drive = filmed_drives.filmed(1, frames / 40)
    kept(folder, (drive.streams, drive.odometry))


def solve_frames(folder: Path) -> Callable[[], object]:
    """Poses of all frames, the clocks of the cameras, one trajectory."""
    sys.path[:0] = [
        str(ROOT / "tests" / "vision_gt"),
        str(ROOT / "tests" / "vision_gt" / "driving"),
    ]
    from vision_gt.driving.drive import solve_drive
    from vision_gt.driving.stream import camera_stream

    seen, odometry = loaded(folder)  # type: ignore[misc]
    return lambda: solve_drive([camera_stream(*a, **b) for a, b in seen], odometry)


def make_scans(scans: int, folder: Path) -> None:
    sys.path.insert(0, str(ROOT / "tests" / "laser_gt"))
    from drives import drive_inputs_of

    from data_samples.motion.laser import laser_drive

    minutes = scans / SCANS_A_MINUTE
    kept(folder, drive_inputs_of(laser_drive(0, minutes=minutes)))


def make_hall(stops: int, folder: Path) -> None:
    """Stops with matches of their scans, as they are judged one by one."""
    sys.path.insert(0, str(ROOT / "tests" / "laser_gt" / "placing"))
    from laser_halls import hall

    kept(folder, hall(stops))


def place_stops(folder: Path) -> Callable[[], object]:
    """Poses by these matches, the check of the mount and the survey, tables, the comparison."""
    sys.path.insert(0, str(ROOT / "tests" / "laser_gt" / "placing"))
    hall = loaded(folder)
    return hall.compared  # type: ignore[attr-defined,no-any-return]


SCANS_A_MINUTE = 300


def solve_scans(folder: Path) -> Callable[[], object]:
    from laser_gt.driving.drive import solve_log

    inputs = loaded(folder)
    return lambda: solve_log(inputs, 1, lambda _what, _share: None)


def make_minutes(minutes: int, folder: Path) -> None:
    from data_samples.drives.drive import DriveSettings, loop_length, simulate_drive
    from data_samples.drives.files import write_drive

    usual = DriveSettings()
    loops = round(60 * minutes * usual.speed / loop_length(usual))
    write_drive(folder, simulate_drive(1, DriveSettings(loops=max(loops, 1))))


def make_often(minutes: int, folder: Path) -> None:
    """All receivers at 20 Hz, with three sensors."""
    from data_samples.drives.drive import DriveSettings, loop_length, simulate_drive
    from data_samples.drives.files import write_drive

    usual = DriveSettings(every=(0.05, 0.05))
    loops = round(60 * minutes * usual.speed / loop_length(usual))
    write_drive(folder, simulate_drive(1, replace(usual, loops=max(loops, 1))))


def two_tables(poses: int, folder: Path) -> None:
    """Stops all over a hall, and a system whose frame and mount are off."""
    import gtval

    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-50, 50, (poses, 2)), rng.uniform(-3.1, 3.1, poses)])
    c, s = np.cos(places[:, 2]), np.sin(places[:, 2])
    off = places + np.array([0.03, -0.02, 0.001]) + rng.normal(0, 0.004, places.shape)
    off[:, :2] += 0.02 * np.column_stack([c, s])
    sigmas = ([0.001] * 3, [0.004] * 3)
    tables = zip(("survey", "rig"), (places, off), sigmas, strict=True)
    kept(folder, [gtval.pose_table(name, table, sigmas=some) for name, table, some in tables])


def compare_tables(folder: Path) -> Callable[[], object]:
    import gtval

    truth, rig = loaded(folder)  # type: ignore[misc]
    return lambda: gtval.compare(truth, rig)


def explain_tables(folder: Path) -> Callable[[], object]:
    import gtval

    truth, rig = loaded(folder)  # type: ignore[misc]
    return lambda: gtval.explain(truth, [rig])


def two_trajectories(poses: int, folder: Path) -> None:
    """A robot in curves at 20 Hz, and a camera system 30 ms late whose errors last a second."""
    import gtval

    rng = np.random.default_rng(2)
    t = np.arange(poses) * 0.05
    way = np.column_stack([5 * np.cos(t / 7), 4 * np.sin(t / 5), np.sin(t / 3)])
    kick = rng.normal(0, 0.001, way.shape)
    lasting = np.zeros_like(way)
    for at in range(1, poses):
        lasting[at] = 0.95 * lasting[at - 1] + kick[at]
    for name, table, late in (("reference", way, 0.0), ("source", way + lasting, 0.03)):
        rows = np.column_stack([t + late, table])
        header = "time,x,y,theta"
        np.savetxt(folder / f"{name}.csv", rows, "%.6f", ",", header=header, comments="")
    assert gtval.read_trajectory(folder / "source.csv").system == "source"


def make_report(poses: int, folder: Path) -> None:
    """A campaign with two tables that were taken over."""
    two_tables(poses, folder)
    (folder / "survey").mkdir()
    truth, rig = loaded(folder)  # type: ignore[misc]
    for name, table in (("survey/published_poses.csv", truth), ("rig.csv", rig)):
        rows = np.column_stack([np.arange(poses), table.poses])
        header = "pose,x,y,theta"
        form = ["%d", "%.5f", "%.5f", "%.5f"]
        np.savetxt(folder / name, rows, form, ",", header=header, comments="")
    (folder / "campaign.toml").write_text(
        'name = "hall"\n[[published]]\nsystem = "rig"\nfile = "rig.csv"\n'
        "sigmas = [0.004, 0.004, 0.004]\n"
    )


def write_report(folder: Path) -> Callable[[], object]:
    from validation.campaign.folder import load_campaign
    from validation.report.files import report_files
    from validation.run import run_campaign

    done = run_campaign(load_campaign(folder))
    shutil.rmtree(folder / "kept", ignore_errors=True)  # figures of the run that imported
    return lambda: report_files(done)


def make_days(days: int, folder: Path) -> None:
    """Campaigns whose results are statistics of one system."""
    rng = np.random.default_rng(3)
    for day in range(days):
        results = folder / f"day_{day}" / "results"
        results.mkdir(parents=True)
        (results.parent / "campaign.toml").write_text(f'name = "day {day}"\n')
        rows = ["system,component,n,mean,std,ci95_low,ci95_high"]
        for name in ("x", "y", "theta"):
            mean = rng.normal(0, 0.001)
            rows.append(f"rig,{name},20,{mean},0.002,{mean - 0.001},{mean + 0.001}")
        (results / "statistics.csv").write_text("\n".join(rows) + "\n")


POSES = (100, 1000, 10_000, 100_000)
WORKS = {
    "survey": Work("stops", (26, 100, 500, 2000), make_room, command("survey", "{}")),
    "run": Work("stops", (26, 100, 500, 2000), make_room, command("run", "{}")),
    "vision": Work("frames", (100, 1000, 5000, 20_000), make_frames, solve_frames),
    "laser at stops": Work("stops", (26, 100, 500, 2000), make_hall, place_stops),
    "laser": Work("scans", (300, 1000, 3000), make_scans, solve_scans),
    "rtk": Work("minutes", (10, 30, 60, 120), make_minutes, command("rtk", "solve", "{}")),
    "run at 20 Hz": Work("minutes", (10, 30, 60), make_often, command("run", "{}")),
    "compare": Work("stops", POSES, two_tables, compare_tables),
    "explain": Work("stops", POSES, two_tables, explain_tables),
    "compare in time": Work(
        "poses",
        POSES,
        two_trajectories,
        command("compare", "{}/reference.csv", "{}/source.csv", "--align", "frame"),
    ),
    "explain in time": Work(
        "poses", POSES, two_trajectories, command("explain", "{}/reference.csv", "{}/source.csv")
    ),
    "report": Work("stops", POSES, make_report, write_report),
    "summary": Work("days", (20, 100, 400), make_days, command("summary", "{}", "--no-page")),
}
SHORT = 2
"""Sizes of the short form, the least ones."""


def measure(work: Work, least: Path, folder: Path) -> dict[str, float]:
    """Processor time of the work in this process, and the most memory it held."""
    work.ready(least)()  # imports, and what is made once
    run = work.ready(folder)
    started = time.process_time()
    run()
    taken = time.process_time() - started
    return {"seconds": taken, "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}


def child(*arguments: str) -> str:
    """What this script prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, "--child", *arguments],
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout


def show(name: str, sizes: tuple[int, ...]) -> None:
    """Make, measure and print one kind of work."""
    work, seconds = WORKS[name], []
    with tempfile.TemporaryDirectory() as made:
        folders = [Path(made) / str(size) for size in sizes]
        for size, folder in zip(sizes, folders, strict=True):
            folder.mkdir()
            child("make", name, str(size), str(folder))
            told = json.loads(child("do", name, str(folders[0]), str(folder)).splitlines()[-1])
            seconds.append(told["seconds"])
            line = f"{name:16} {size:7d} {work.of:8} {told['seconds']:9.2f} s"
            print(f"{line} {told['megabytes']:7.0f} MB", flush=True)
    if len(sizes) > 1:
        logs, times = np.log(sizes), np.log(seconds)
        slope, last = np.polyfit(logs, times, 1)[0], np.diff(times)[-1] / np.diff(logs)[-1]
        met = "met" if slope <= ASKED else "MISSED"
        print(f"{name:16} exponent {slope:5.2f}, at the end {last:5.2f}   asked: {ASKED}   {met}")


def main() -> None:
    if sys.argv[1:2] == ["--child"]:
        what, name, *rest = sys.argv[2:]
        if what == "make":
            WORKS[name].make(int(rest[0]), Path(rest[1]))
        else:
            print(json.dumps(measure(WORKS[name], Path(rest[0]), Path(rest[1]))))
        return
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--short", action="store_true", help="the two least sizes only")
    parser.add_argument("--most", type=int, help="leave out larger sizes")
    parser.add_argument("works", nargs="*", metavar="WORK", help=", ".join(WORKS))
    asked = parser.parse_args()
    for name in asked.works or WORKS:
        sizes = WORKS[name].sizes[: SHORT if asked.short else None]
        show(name, tuple(size for size in sizes if not asked.most or size <= asked.most))


if __name__ == "__main__":
    main()
