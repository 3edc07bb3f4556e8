"""Prove how good a ground truth is, from a notebook or a test.

Importing this package costs next to nothing: each name below is loaded when it is first used.
Lengths are in metres, angles in radians, times in seconds. Results are frozen.

Examples
--------
>>> import gtval
>>> survey = gtval.pose_table("survey", [[0.0, 0.0, 0.0], [1.0, 0.0, 1.5]], sigmas=[0.002] * 3)
>>> rig = gtval.pose_table("rig", [[0.01, 0.0, 0.0], [1.01, 0.0, 1.5]], sigmas=[0.005] * 3)
>>> gtval.compare(survey, rig).comparison.errors.round(3).tolist()
[[-0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]]
"""

from gtval.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true; importing typing costs more than the rest

if TYPE_CHECKING:
    from gtval.campaigns import Campaign, RunResult, load_campaign, run_campaign, write_run
    from gtval.judging import Evaluation, Explanation, compare, explain, findings
    from gtval.markers import Camera, MarkerPlace, locate_markers
    from gtval.receivers import (
        Fixes,
        Offsets,
        VehiclePath,
        find_offsets,
        find_path,
        fixes,
        path_table,
        read_fixes,
    )
    from gtval.scans import Match, Scan, match_scans
    from gtval.surveys import SurveySolution, solve_survey
    from gtval.tables import PoseTable, pose_table, read_poses, write_poses
    from validation.errors import GtvalError, InputError
    from validation.results import Finding

__all__ = [
    "Camera",
    "Campaign",
    "Evaluation",
    "Explanation",
    "Finding",
    "Fixes",
    "GtvalError",
    "InputError",
    "MarkerPlace",
    "Match",
    "Offsets",
    "PoseTable",
    "RunResult",
    "Scan",
    "SurveySolution",
    "VehiclePath",
    "compare",
    "explain",
    "find_offsets",
    "find_path",
    "findings",
    "fixes",
    "load_campaign",
    "locate_markers",
    "match_scans",
    "path_table",
    "pose_table",
    "read_fixes",
    "read_poses",
    "run_campaign",
    "solve_survey",
    "write_poses",
    "write_run",
]

__getattr__ = lazily(
    __name__,
    {
        "gtval.campaigns": ("Campaign", "RunResult", "load_campaign", "run_campaign", "write_run"),
        "gtval.judging": ("Evaluation", "Explanation", "compare", "explain", "findings"),
        "gtval.markers": ("Camera", "MarkerPlace", "locate_markers"),
        "gtval.receivers": (
            *("Fixes", "Offsets", "VehiclePath"),
            *("find_offsets", "find_path", "fixes", "path_table", "read_fixes"),
        ),
        "gtval.scans": ("Match", "Scan", "match_scans"),
        "gtval.surveys": ("SurveySolution", "solve_survey"),
        "gtval.tables": ("PoseTable", "pose_table", "read_poses", "write_poses"),
        "validation.errors": ("GtvalError", "InputError"),
        "validation.results": ("Finding",),
    },
)


def __dir__() -> list[str]:
    """The names above, also before they are loaded."""
    return __all__
