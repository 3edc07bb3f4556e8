"""Figures of a drive."""

import numpy as np
from matplotlib.figure import Figure

from laser_gt.driving.log import DriveOutcome
from laser_gt.scans.planar import compose, transform
from validation.figures.errors import COLOURS, GREY
from validation.figures.maps import in_metres
from validation.poses.angles import Array

CELL = 0.02
"""Metres of a cell of the map; a point of each is drawn, so that a long drive stays a small
picture."""


def map_points(outcome: DriveOutcome) -> Array:
    """(n, 2) end points of the keyframes' beams in the frame of the trajectory, one a cell."""
    laser = compose(outcome.trajectory.poses, outcome.mount)
    keyframes = outcome.keyframes.tolist()
    points = np.concatenate([transform(laser[k], outcome.sweeps[k].points) for k in keyframes])
    _, first = np.unique(np.floor(points / CELL), axis=0, return_index=True)
    return points[np.sort(first)]


def drive_map(outcome: DriveOutcome) -> Figure:
    """The map, the way, and the poses that no scan holds."""
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots()
    axes.plot(*map_points(outcome).T, ",", color=GREY, alpha=0.7)
    way = outcome.trajectory.positions
    axes.plot(*way.T, "-", color=COLOURS[0], linewidth=0.8, label="way of the robot")
    carried = way[~outcome.matched]
    if len(carried):
        label = f"carried on by odometry ({len(carried)})"
        axes.plot(*carried.T, "x", color=COLOURS[1], markersize=4, label=label)
    axes.legend(loc="best", fontsize=8)
    in_metres(axes)
    return figure


def drive_sigmas(outcome: DriveOutcome) -> Figure:
    """Standard deviations over time."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    sigmas = np.sqrt(np.diagonal(outcome.trajectory.covariances, axis1=1, axis2=2)) * 1e3
    times = outcome.trajectory.times
    upper.plot(times, sigmas[:, 0], "-", color=COLOURS[0], linewidth=0.8, label="x")
    upper.plot(times, sigmas[:, 1], "--", color=COLOURS[1], linewidth=0.8, label="y")
    upper.set_ylabel("position [mm]")
    upper.legend(loc="best", fontsize=8)
    lower.plot(times, sigmas[:, 2], "-", color=COLOURS[2], linewidth=0.8)
    lower.set_ylabel("heading [mrad]")
    lower.set_xlabel("time [s]")
    for axes in (upper, lower):
        axes.set_ylim(bottom=0)
        axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    return figure
