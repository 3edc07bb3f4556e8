"""Headings correlated as AD2.3 did: text, a table and figures for a report."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from validation.errors import GtvalError
from validation.poses.trajectory import Trajectory
from validation.results import Figure, Section, Table, Text
from validation.trajectories.clock.correlation import (
    STEP,
    WINDOW,
    Fault,
    HeadingCorrelation,
    Peak,
    correlate_headings,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

WORDS: dict[Fault, str] = {
    "edge": "at the window's edge",
    "flips": "half-turned images",
    "drift": "odometry drifts",
}
"""Of single peaks; that images are repeated is told once, with the column without it."""
WAY = (
    f"The headings are sampled every {1000 * STEP:.0f} ms, each image repeated until the next, and "
    f"a camera is moved by up to {WINDOW:g} s to either side of {{odometry}}: the delay is where "
    "the correlation has its maximum, as in RAWSEEDS AD2.3. The delay is added to a camera's "
    "stamps; stamps that are late have a negative one."
)
FAULTS = (
    "What is known to be wrong with it. An image that is repeated is on average older than the "
    "sample it stands at: {repeated}. Where the robot turns evenly every delay fits, and the "
    "maximum may stand anywhere, also at the edge of the window, which says nothing. The "
    "odometry's heading drifts, so that a whole signal is not one shape. Markers that are taken "
    "for each other turn an image by half a turn. And the maximum has no interval: the columns "
    "'fits from' and 'fits to' are only what the number of images cannot tell apart."
)


def correlation_section(odometry: Trajectory, cameras: Sequence[Trajectory]) -> Section:
    """Delays of cameras against odometry by cross-correlation, with what is wrong with them.

    Parameters
    ----------
    odometry : Trajectory
        With headings.
    cameras : sequence of Trajectory
        A camera that cannot be correlated is named with the reason.
    """
    found: list[HeadingCorrelation] = []
    left_out: list[Text] = []
    for camera in cameras:
        try:
            found.append(correlate_headings(odometry, camera))
        except GtvalError as error:
            left_out.append(Text(f"{camera.system}: {error}."))
    title = f"Headings correlated with {odometry.system}"
    way = Text(WAY.format(odometry=odometry.system))
    if not found:
        return Section(title, [way, *left_out])
    late = [f"{one.camera} by {1000 * one.held_s:.0f} ms" for one in found if one.repeats > 1]
    repeated = f"cameras look late ({', '.join(late)})" if late else "here none is repeated"
    faults = Text(FAULTS.format(repeated=repeated))
    told = [Text(_seen(one)) for one in found]
    return Section(
        title, [way, *left_out, *_figures(found), correlation_table(found), *told, faults]
    )


def correlation_table(found: Sequence[HeadingCorrelation]) -> Table:
    """The delays of whole signals and of parts."""
    rows: list[list[str | float | None]] = []
    for one in found:
        named = [("whole, as it came", one.before), ("whole, cleaned", one.after)]
        named += [(f"part {number + 1}", peak) for number, peak in enumerate(one.parts)]
        start = one.start_s + WINDOW
        for name, peak in named:
            seconds = (peak.delay_s, one.without_repeats(peak), peak.low_s, peak.high_s)
            rows.append(
                [
                    one.camera,
                    name,
                    *(_shown(1000 * value) for value in seconds),
                    _shown(peak.height),
                    ", ".join(WORDS[fault] for fault in one.faults(peak) if fault in WORDS),
                    _shown(peak.first_s - start),
                    _shown(peak.last_s - start),
                ]
            )
    return Table(
        "Delays by the maximum of the correlation of headings",
        [
            "camera", "of", "delay [ms]", "without repeats [ms]", "fits from [ms]", "fits to [ms]",
            "correlation", "known faults", "from [s]", "to [s]",
        ],
        rows,
        ["", "", ".0f", ".0f", ".0f", ".0f", ".4f", "", ".1f", ".1f"],
        f"Delays are whole steps of {1000 * STEP:.0f} ms. Without repeats: half of what an image "
        "stands for is added. Cleaned: without images far from the odometry's heading.",
    )  # fmt: skip


def _shown(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _seen(one: HeadingCorrelation) -> str:
    """What a camera's signal holds that spoils the correlation."""
    return (
        f"{one.camera}: of {len(one.times)} images {int(one.spurious.sum())} are far from "
        f"the odometry's heading, "
        f"{one.flips} of them turned by about half a turn; over its {len(one.parts)} parts "
        f"the odometry drifts by {np.degrees(one.drift):.1f} degrees."
    )


def _figures(found: Sequence[HeadingCorrelation]) -> list[Figure]:
    """Pictures of the signals, of the parts, and of the part with the largest delay."""
    names, odometry = ", ".join(one.camera for one in found), found[0].odometry
    figures = [
        Figure(
            "correlated_signals",
            f"Headings in the frame of {odometry}, as they came (above) and without what is "
            f"spurious (below). The line is {odometry}.",
            f"Headings of {names} over time on that of {odometry}.",
            partial(_draw, "aligned_signals", found),
        ),
        Figure(
            "correlated_parts",
            "The parts in which each camera sees the robot and it turns, each with its delay.",
            f"Headings of {names} in their parts; the delays are in the table.",
            partial(_draw, "selected_parts", found),
        ),
    ]
    parts = [(i, j, peak) for i, one in enumerate(found) for j, peak in enumerate(one.parts)]
    if told := [part for part in parts if np.isfinite(part[2].delay_s)]:
        number, part, peak = max(told, key=_size)
        name = f"part {part + 1} of {found[number].camera}"
        figures.append(
            Figure(
                "correlated_closer",
                f"A closer view of the largest delay, {name}: whether the two are apart by that "
                "much is seen where the robot turns fastest.",
                f"Headings in {name}, delay {1000 * peak.delay_s:.0f} ms, and the correlation.",
                partial(_draw, "closer_view", found[number], number, part),
            )
        )
    return figures


def _size(part: tuple[int, int, Peak]) -> float:
    return abs(part[2].delay_s)


def _draw(name: str, *of: object) -> "MatplotlibFigure":
    from validation.trajectories.figures import signals  # noqa: PLC0415  (half a second)

    figure: MatplotlibFigure = getattr(signals, name)(*of)
    return figure
