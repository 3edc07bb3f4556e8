"""Rendered drives: real images through detection, clocks and fusion, beside AD2.3's own way.

Each seed is a campaign of its own, as `gtval simulate --vision --drive` makes it, with 3 % of the
frames in which two markers have each other's prints. All images are rendered, and all is solved
from them: lenses, network, markers, the drive. Four cameras of 10 Hz that are late by up to 340 ms,
jitter of 3 ms, lost frames. A line a camera (frames, what became of those with exchanged prints,
error of the delay and half of its interval, and the error of the largest correlation of headings,
as it came, cleaned, and of each part), and a line a drive (rms of fused positions and headings
where a camera sees the robot, mean squared error over covariance, 3 expected). A drive of two
minutes takes most of an hour of one processor, nearly all of it for rendering, and 1.5 GB in
FOLDER; images that are there are used again.

    python benchmarks/vision_filmed.py FOLDER [--seeds 501 502] [--seconds 120] [--workers 1]
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from data_samples.rendering.drive import DriveSettings
from data_samples.room_campaign import write_room
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.simulate import SimulationSettings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.trajectory import Trajectory
from validation.solving import solve_validation
from validation.systems import installed_systems
from validation.trajectories.clock.correlation import correlate_headings
from validation.trajectories.formats import read_trajectory
from vision_gt.campaign.solve import solve_campaign
from vision_gt.drive_campaign.solve import CampaignDrive, solve_campaign_drive
from vision_gt.driving.stream import Mask, Stream

SPURIOUS = 0.03


def made(folder: Path, seed: int, seconds: float, workers: int) -> None:
    """A campaign with all of its images, where it is not there yet."""
    done = folder / "truth/all_rendered"
    if done.exists():
        return
    write_room(
        folder,
        seed,
        RoomSettings(stops=6),
        SimulationSettings(),
        vision=VisionSettings(),
        drive=DriveSettings(seconds=seconds, spurious=SPURIOUS),
        workers=workers,
    )
    done.touch()


def solved(folder: Path, workers: int) -> CampaignDrive:
    """What the program makes of a campaign."""
    campaign = load_campaign(folder)
    vision = solve_campaign(solve_validation(campaign, installed_systems()), workers=workers)
    drive = solve_campaign_drive(campaign, vision, workers=workers)
    assert drive is not None
    return drive


def misprinted(folder: Path, stream: Stream) -> Mask:
    """(n,) frames of a camera in which prints are exchanged."""
    lines = (folder / "truth/drive_spurious.csv").read_text().split()[1:]
    wrong = [float(Path(line).stem) for line in lines if Path(line).parent.name == stream.camera]
    stamps = stream.times + stream.epoch
    return np.asarray(np.abs(stamps[:, None] - np.array([*wrong, np.inf])).min(1) < 1e-3)


def published(odometry: Trajectory, stream: Stream, true: float) -> str:
    """Errors of the delays by AD2.3's way, milliseconds: as it came, cleaned, by parts."""
    seen = stream.trajectory()
    try:
        assert seen is not None
        one = correlate_headings(odometry, seen)
    except (AssertionError, GtvalError) as error:
        return f"not told ({error})"
    peaks = [one.before, one.after, *one.parts]
    told = []
    for peak in peaks:
        faults = [fault for fault in one.faults(peak) if fault != "repeats"]
        told.append(" ".join([f"{1e3 * (peak.delay_s - true):+.0f}", *faults]))
    return ", ".join(told)


def errors(folder: Path, trajectory: Trajectory, delay: float = 0.0) -> tuple[Array, Mask]:
    """(n, 3) errors of a trajectory, and which of its poses are within the drive."""
    truth = read_trajectory(folder / "truth/drive.csv")
    times = trajectory.times_since(truth.epoch) + delay
    true = np.column_stack([truth.poses[:, :2], np.unwrap(truth.poses[:, 2])])
    at = np.column_stack([np.interp(times, truth.times, column) for column in true.T])
    off = trajectory.poses - at
    off[:, 2] = wrap(off[:, 2])
    return off, (times >= 0) & (times <= truth.times[-1])


def show(folder: Path, seed: int, seconds: float, workers: int) -> tuple[int, int]:
    """Lines of a drive; delays in their intervals, and delays told."""
    begin = time.monotonic()
    made(folder, seed, seconds, workers)
    rendered = time.monotonic()
    drive = solved(folder, workers)
    outcome, held, told = drive.outcome, 0, 0
    spent = f"rendered in {rendered - begin:.0f} s, solved in {time.monotonic() - rendered:.0f} s"
    print(f"{seed}: {spent}")
    assert drive.odometry is not None
    assert outcome.trajectory is not None
    true = json.loads((folder / "truth/drive_clocks.json").read_text())
    for stream in outcome.streams:
        wrong = misprinted(folder, stream)
        verdicts = np.array(stream.verdicts)
        counts = dict(zip(*np.unique(verdicts[wrong], return_counts=True), strict=True))
        said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        good = (
            f"{len(stream)} frames, {np.sum(verdicts[~wrong] == 'kept')} of {np.sum(~wrong)} kept"
        )
        delay = true[stream.camera]["delay_s"]
        own = stream.trajectory()
        if own is not None and wrong[stream.posed].any():
            off = errors(folder, own, delay)[0][wrong[stream.posed]]
            said += f" off by {1e3 * np.linalg.norm(off[:, :2], axis=1).max():.1f} mm at most"
        clock = outcome.clocks.get(stream.camera)
        line = "delay not told"
        if clock is not None and clock.verdict == "determined":
            off, half = clock.delay_s - delay, (clock.high_s - clock.low_s) / 2
            held, told = held + (clock.low_s <= delay <= clock.high_s), told + 1
            line = f"delay {1e3 * delay:+.1f} ms, off by {1e3 * off:+.2f}, half {1e3 * half:.2f}"
        print(f"  camera {stream.camera}: {good}; exchanged prints: {said or 'none'}; {line}")
        print(
            f"    AD2.3's way off by [ms]: {published(drive.odometry, stream, delay)}", flush=True
        )
    off, inside = errors(folder, outcome.trajectory)
    some = inside & outcome.supported
    off, covariances = off[some], outcome.trajectory.covariances[some]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariances), off)
    rms = 1e3 * np.sqrt([np.square(off[:, :2]).sum(1).mean(), np.square(off[:, 2]).mean()])
    print(f"  fused: {rms[0]:.2f} mm, {rms[1]:.2f} mrad, NEES {squares.mean():.2f}", flush=True)
    return held, told


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[501, 502])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    counts = [
        show(given.folder / str(seed), seed, given.seconds, given.workers) for seed in given.seeds
    ]
    print("delays in their intervals: {} of {} told".format(*np.sum(counts, axis=0)))


if __name__ == "__main__":
    main()
