"""The picture of a plan: what is seen, by how many cameras, and how well."""

import numpy as np
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY, MARKERS, Walls
from vision_gt.planning.plan import HEADINGS, CameraPlan, over_headings, place_sigma


def plan_picture(plan: CameraPlan, walls: Walls = ()) -> Figure:
    """Two maps: number of cameras that see each place, and predicted standard deviation there.

    Parameters
    ----------
    plan : CameraPlan
        Worked out.
    walls : sequence of polylines
        In the GTV frame, metres.
    """
    figure = Figure(figsize=(9.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    count = plan.seen.sum(0)
    shown = left.scatter(
        *plan.grid.points.T, c=np.minimum(count, 3), s=2, marker="s", cmap="Blues", vmin=0, vmax=3,
        linewidths=0, rasterized=True,
    )  # fmt: skip
    bar = figure.colorbar(shown, ax=left, shrink=0.6, ticks=[0, 1, 2, 3])
    bar.ax.set_yticklabels(["0", "1", "2", "3+"])
    left.set_title("cameras that see the floor", fontsize=9)
    place = over_headings(1e3 * place_sigma(plan.over_floor.best))
    where = plan.over_floor.poses[::HEADINGS, :2]
    shown = right.scatter(*where.T, c=place, s=9, marker="s", cmap="viridis_r", linewidths=0)
    figure.colorbar(shown, ax=right, shrink=0.6, label="best camera: place [mm]")
    right.set_title("predicted standard deviation", fontsize=9)
    for axes in (left, right):
        for wall in walls:
            axes.plot(*np.array(wall).T, color=GREY, linewidth=1.0)
        outline = np.vstack([plan.grid.outline, plan.grid.outline[:1]])
        axes.plot(*outline.T, "--", color="black", linewidth=0.8)
        for i, one in enumerate(plan.given.mounts):
            colour, marker = COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]
            ahead = one.T_gtv_camera.rotation.as_matrix()[:2, 2]
            axes.plot(*one.eye[:2], marker, color=colour, markersize=6)
            axes.annotate(
                one.camera.name, one.eye[:2], xytext=(5, 5), textcoords="offset points", fontsize=8
            )
            axes.quiver(*one.eye[:2], *ahead, color=colour, angles="xy", scale=8, width=0.006)
        for name, pose in plan.given.stops.items():
            axes.plot(*pose[:2], "+", color="black", markersize=5)
            axes.annotate(name, pose[:2], xytext=(3, -7), textcoords="offset points", fontsize=6)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]", fontsize=8)
        axes.tick_params(labelsize=7)
    left.set_ylabel("y [m]", fontsize=8)
    return figure
