"""The pictures of time.md, made by gtval itself: run `make images` after a change."""

from pathlib import Path

from matplotlib.figure import Figure

import gtval
import gtval.testing
from validation.figures.errors import COLOURS, GREY
from validation.figures.writing import write_figure
from validation.trajectories.figures.comparison import error_against_speed

IMAGES = Path(__file__).parent / "images"


def draw_fused(drive: gtval.testing.SampleMotion) -> Figure:
    """The fused trajectory over the poses of each camera."""
    cameras = [drive.cameras[name] for name in ("camera_2", "camera_3", "camera_4")]
    clocks = gtval.sync(drive.reference, cameras)
    fused = gtval.fuse(cameras, odometry=drive.odometry, clocks=clocks)
    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.subplots()
    places = fused.trajectory.positions
    axes.plot(*places.T, color=GREY, linewidth=0.8, label="fused")
    for camera, colour, size in zip(cameras, COLOURS[:3], (7, 5, 3), strict=True):
        places = camera.positions
        axes.plot(*places.T, ".", color=colour, markersize=size, alpha=0.5, label=camera.system)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.legend()
    axes.grid(visible=True, linewidth=0.3)
    return figure


def main() -> None:
    """Write docs/images/time_*.png."""
    drive = gtval.testing.make_motion(seed=1, minutes=3)
    errors = gtval.compare_in_time(drive.reference, drive.cameras["camera_2"])
    write_figure(IMAGES / "time_speed.png", error_against_speed(errors))
    write_figure(IMAGES / "time_fused.png", draw_fused(drive))


if __name__ == "__main__":
    main()
