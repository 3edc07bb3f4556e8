"""Figures of a drive that cameras saw."""

import numpy as np
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY
from validation.figures.maps import in_metres
from validation.trajectories.clock.result import added
from vision_gt.driving.drive import DriveOutcome

MOST = 3000
"""Dots a camera: more do not show on a screen."""

WIDE = 20.0
"""Largest over smallest standard deviation from which on they are drawn on a logarithmic scale."""


def drive_map(outcome: DriveOutcome) -> Figure:
    """The way, and where each camera saw the robot."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.subplots()
    assert outcome.trajectory is not None
    axes.plot(*outcome.trajectory.positions.T, "-", color=GREY, linewidth=1.0, label="fused")
    for number, one in enumerate(outcome.streams):
        poses = one.poses[one.posed]
        some = poses[:: max(len(poses) // MOST, 1)]
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(*some[:, :2].T, ".", color=colour, markersize=3, label=f"camera {one.camera}")
        bad = one.poses[[v == "spurious" for v in one.verdicts]]
        axes.plot(*bad[:, :2].T, "x", color=colour, markersize=5)
    axes.legend(loc="best", fontsize=8)
    in_metres(axes)
    return figure


def drive_time(outcome: DriveOutcome) -> Figure:
    """Frames by camera over time, and how well the fused position is known."""
    figure = Figure(figsize=(9, 4.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1, 1])
    assert outcome.trajectory is not None
    trajectory = outcome.trajectory
    for number, one in enumerate(outcome.streams):
        colour = COLOURS[number % len(COLOURS)]
        times = one.times + (one.epoch - trajectory.epoch)
        clock = outcome.clocks.get(one.camera)
        if clock is not None and clock.verdict == "determined":
            times = times + added(clock, one.times + (one.epoch - clock.epoch))
        spurious = np.array([v == "spurious" for v in one.verdicts], dtype=bool)
        upper.plot(times[one.posed], np.full(one.posed.sum(), number), "|", color=colour)
        upper.plot(times[spurious], np.full(spurious.sum(), number + 0.25), "x", color=colour)
    upper.set_yticks(range(len(outcome.streams)), [f"camera {s.camera}" for s in outcome.streams])
    upper.set_ylim(-0.5, len(outcome.streams) - 0.3)
    sigmas = np.sqrt(np.diagonal(trajectory.covariances, axis1=1, axis2=2)[:, :2].max(1)) * 1e3
    lower.plot(trajectory.times, sigmas, "-", color=COLOURS[0], linewidth=0.9)
    if sigmas.max() > WIDE * sigmas.min():
        lower.set_yscale("log")
    else:
        lower.set_ylim(bottom=0)
    lower.set_ylabel("position sd [mm]")
    lower.set_xlabel("time [s]")
    for axes in (upper, lower):
        axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    return figure
