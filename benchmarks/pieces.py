"""Two processes against one, a cluster of two workers against one, and runs that are killed.

    python benchmarks/pieces.py [--kills N] [FOLDER]

FOLDER is where a room with scanners, cameras and a drive is made, or was made by an earlier call.
Ratios are of wall time, each the median of three in turn, without the start of processes but for
the first jobs of each. Of a killed run it is told how many pieces were done again, and by how much
processor time killed and second run together exceed one whole run.
"""

import argparse
import json
import os
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.campaign.inputs import load_inputs
from laser_gt.campaign.solve import engine_settings
from laser_gt.matching.judgement import MatchSettings
from laser_gt.placing.engines import PairJob, match_pair
from laser_gt.placing.guesses import first_trajectory
from laser_gt.scans.planar import between
from laser_gt.settings import LaserSettings
from validation.campaign.folder import load_campaign
from validation.pieces.cluster import on_cluster
from validation.pieces.processes import as_they_end
from vision_gt.images.jobs import MarkerJob, detect_one, one_thread
from vision_gt.patterns.dictionaries import Family

MANY = 3
"""Times that each piece is done: some seconds of work for each second that processes start."""
CLUSTER = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
Work = Callable[[], object]
Function = Callable[[Any], object]
SIMULATE = ("simulate", "--seed", "5", "--stops", "16", "--laser", "--vision", "--drive", "10")


def command(*arguments: str) -> tuple[str, ...]:
    return (sys.executable, "-m", "gtval", *arguments)


def frames(folder: Path) -> list[MarkerJob]:
    """Every frame of the drive."""
    paths = sorted((folder / "vision" / "drive").rglob("*.png"))
    return [MarkerJob(path, Family("APRILTAG_36H11"), tuple(range(30))) for path in paths]


def pairs(folder: Path) -> list[PairJob]:
    """Every pair of stops."""
    campaign = load_campaign(folder)
    settings = campaign.section("laser", LaserSettings)
    inputs = load_inputs(campaign, settings)
    poses = first_trajectory(inputs.sweeps, inputs.laser_odometry).poses
    form = engine_settings(settings)
    count = len(inputs.sweeps)
    return [
        PairJob(
            *(inputs.sweeps[i], inputs.sweeps[j], between(poses[i], poses[j])),
            *(MatchSettings(0.2, 0.1), form, "scanmatch"),
        )
        for i in range(count)
        for j in range(i + 1, count)
    ]


def taken(work: Work) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def ratio(name: str, one: Work, two: Work, asked: float) -> None:
    times = [(taken(one), taken(two)) for _ in range(3)]
    first, second = (statistics.median(column) for column in zip(*times, strict=True))
    met = "met" if first / second >= asked else "MISSED"
    print(f"{name:30} {first:7.2f} s {second:7.2f} s  ratio {first / second:.2f}, {asked}: {met}")


def processes(
    name: str, function: Function, jobs: Sequence[Any], prepare: Callable[[], None] | None
) -> None:
    """One process, and two."""

    def work(workers: int) -> Work:
        return lambda: list(as_they_end(function, jobs, workers, prepare=prepare))

    ratio(f"{name}, processes", work(1), work(2), 1.7)


def clusters(
    name: str, function: Function, jobs: Sequence[Any], prepare: Callable[[], None] | None
) -> None:
    """A cluster of one worker, and one of two."""
    from distributed import LocalCluster

    def on(made: LocalCluster, some: Sequence[Any]) -> Work:
        def work() -> None:
            with on_cluster(made.scheduler_address):
                list(as_they_end(function, some, 1, prepare=prepare))

        return work

    with closing_all(LocalCluster(**CLUSTER, n_workers=count) for count in (1, 2)) as (one, two):
        for made in (one, two):
            on(made, jobs[:8])()  # imports
        ratio(f"{name}, cluster", on(one, jobs), on(two, jobs), 1.6)


@contextmanager
def closing_all(made: Iterable[Any]) -> Iterator[list[Any]]:
    with ExitStack() as stack:
        yield [stack.enter_context(one) for one in made]


def of_group(group: int) -> float:
    """Processor time of all processes of a group, those that have ended and were waited for too."""
    total = 0.0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            told = path.read_text().rpartition(")")[2].split()
            if int(told[2]) == group:
                total += sum(map(int, told[11:15])) / os.sysconf("SC_CLK_TCK")
    return total


def kills(folder: Path, number: int) -> None:
    """Runs that are killed at a random moment, and run again."""

    def fresh() -> None:
        for name in ("kept", "results", "report"):
            shutil.rmtree(folder / name, ignore_errors=True)

    def used() -> float:
        told = resource.getrusage(resource.RUSAGE_CHILDREN)
        return told.ru_utime + told.ru_stime

    def digest() -> dict[str, bytes]:
        return {
            str(path): path.read_bytes()
            for name in ("results", "report")
            for path in sorted((folder / name).rglob("*"))
            if path.is_file()
        }

    run = command("run", str(folder), "--json")
    fresh()
    before, started = used(), time.perf_counter()
    subprocess.run(run, check=True, capture_output=True)
    whole, wall = used() - before, time.perf_counter() - started
    expected = digest()
    count = sum(path.read_bytes().count(b"}\n") for path in (folder / "kept").iterdir())
    print(f"a whole run: {wall:.1f} s, {whole:.1f} s of processor time, {count} pieces")
    rng = np.random.default_rng(1)
    more, again = [], []
    for _kill in range(number):
        fresh()
        at = float(rng.uniform(0.05, 0.98)) * wall
        going = subprocess.Popen(run, stdout=subprocess.DEVNULL, start_new_session=True)
        time.sleep(at)
        first = of_group(going.pid)
        os.killpg(going.pid, signal.SIGKILL)
        going.wait()
        before = used()
        kept = list((folder / "kept").glob("*"))
        there = sum(path.read_bytes().count(b"}\n") for path in kept)
        done = subprocess.run(run, check=True, capture_output=True, text=True)
        pieces = json.loads(done.stdout)["pieces"]
        new = sum(one["done"] for one in pieces.values())
        more.append((first + used() - before - whole) / whole)
        again.append((there + new - count) / count)
        same = digest() == expected
        print(
            f"killed after {at:5.1f} s: {100 * more[-1]:5.1f} % more processor time, "
            f"{there} pieces kept, {new} done, same results: {same}",
            flush=True,
        )
    print(
        f"{number} kills: processor time {100 * np.mean(more):.1f} % more on average, at most "
        f"{100 * max(more):.1f} %; pieces done twice and kept twice {100 * max(again):.1f} %"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--no-ratios", action="store_true")
    parser.add_argument("folder", type=Path, nargs="?")
    asked = parser.parse_args()
    with nullcontext(asked.folder) if asked.folder else tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        if not (folder / "campaign.toml").exists():
            subprocess.run(command(*SIMULATE, str(folder)), check=True, capture_output=True)
        if not asked.no_ratios:
            images, matches = MANY * frames(folder), 4 * MANY * pairs(folder)
            print(f"{len(images)} images, {len(matches)} pairs of scans")
            one_thread()  # of OpenCV, also where one process does all
            for name, function, jobs, prepare in (
                ("images", detect_one, images, one_thread),
                ("pairs of scans", match_pair, matches, None),
            ):
                processes(name, function, jobs, prepare)
                clusters(name, function, jobs, prepare)
        if asked.kills:
            kills(folder, asked.kills)


if __name__ == "__main__":
    main()
