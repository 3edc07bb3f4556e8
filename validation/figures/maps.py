"""Axes of a map."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def in_metres(axes: "Axes") -> None:
    """Equal axes in metres, with a fine grid."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(visible=True, linewidth=0.4, alpha=0.5)
