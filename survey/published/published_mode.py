"""What the document's filters, as printed, make of the same readings."""

from collections.abc import Iterator

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.estimation.robot_frames import pose_readings
from survey.estimation.solve import SurveySolution
from survey.published.as_published import robot_frame_filter, world_point_filter
from validation.poses.angles import wrap
from validation.results import Table

MM = 1e3


def published_mode_tables(outcome: SurveyOutcome) -> Iterator[Table]:
    """World points and robot frames by the two listings, less those of this program."""
    solution = outcome.solution
    if solution is None or outcome.file is None:
        return
    vframe = outcome.campaign.settings.vframe
    rows = []
    for point in solution.world.points:
        own = outcome.file.used.touching([point.name], list(vframe.points))
        literal = world_point_filter(
            list(own.distance), [vframe.points[name] for name in own.end], list(point.position)
        )
        rows.append(
            (
                point.name,
                *literal.x,
                *(MM * (literal.x - point.position)),
                *(MM * np.sqrt(np.diagonal(literal.P))),
            )
        )
    yield Table(
        "World points by the document's listing",
        (
            "world point",
            "x [m]",
            "y [m]",
            "dx [mm]",
            "dy [mm]",
            "its sigma x [mm]",
            "its sigma y [mm]",
        ),
        rows,
        ("", ".6f", ".6f", "+.3f", "+.3f", ".1f", ".1f"),
        note="d: listing less this program's world point, before the joint adjustment.",
    )
    if solution.frames:
        yield _frames(outcome, solution)


def _frames(outcome: SurveyOutcome, solution: SurveySolution) -> Table:
    """Robot frames by the second listing."""
    rig = outcome.campaign.settings.robot_frame
    readings = outcome.file.used if outcome.file is not None else solution.used
    rows = []
    for frame in solution.frames:
        own = pose_readings(frame.pose, readings, solution.world, rig)
        literal = robot_frame_filter(
            list(own.distance),
            [(float(x), float(y)) for x, y in own.known],
            [(float(x), float(y)) for x, y in own.body],
            list(frame.state),
        )
        off = literal.x - frame.state
        rows.append(
            (
                frame.pose,
                *literal.x,
                *(MM * off[:2]),
                MM * float(wrap(off[2])),
                *(MM * np.sqrt(np.diagonal(literal.P))),
            )
        )
    return Table(
        "Robot frames by the document's listing",
        (
            "pose",
            "x [m]",
            "y [m]",
            "theta [rad]",
            "dx [mm]",
            "dy [mm]",
            "dtheta [mrad]",
            "its sigma x [mm]",
            "its sigma y [mm]",
            "its sigma theta [mrad]",
        ),
        rows,
        ("", ".4f", ".4f", ".4f", "+.2f", "+.2f", "+.2f", ".1f", ".1f", ".1f"),
        note=(
            "R as printed: not squared, so its standard deviations are far too large. "
            "d: listing less this program's single-pose filter."
        ),
    )
