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
    from gtval.campaigns import (
        Campaign,
        ControlChart,
        RunResult,
        Summary,
        control_chart,
        load_campaign,
        run_campaign,
        summarise,
        write_run,
    )
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
    from gtval.trajectories import (
        ClockEstimate,
        Clocks,
        Fused,
        Stop,
        TimeComparison,
        TimeExplanation,
        Trajectory,
        compare_in_time,
        explain_in_time,
        find_standstills,
        fuse,
        poses_at_stops,
        read_trajectory,
        sync,
        write_trajectory,
    )
    from validation.errors import GtvalError, InputError
    from validation.results import Finding

__all__ = ["Campaign", "RunResult", "load_campaign", "run_campaign", "write_run"]
__all__ += ["ControlChart", "Summary", "control_chart", "summarise"]
__all__ += ["Evaluation", "Explanation", "compare", "explain", "findings"]
__all__ += ["Camera", "MarkerPlace", "locate_markers"]
__all__ += ["Fixes", "Offsets", "VehiclePath"]
__all__ += ["find_offsets", "find_path", "fixes", "path_table", "read_fixes"]
__all__ += ["Match", "Scan", "match_scans"]
__all__ += ["SurveySolution", "solve_survey"]
__all__ += ["PoseTable", "pose_table", "read_poses", "write_poses"]
__all__ += ["Trajectory", "read_trajectory", "write_trajectory"]
__all__ += ["ClockEstimate", "Clocks", "Fused", "fuse", "sync"]
__all__ += ["TimeComparison", "TimeExplanation", "compare_in_time", "explain_in_time"]
__all__ += ["Stop", "find_standstills", "poses_at_stops"]
__all__ += ["Finding", "GtvalError", "InputError"]

__getattr__ = lazily(
    __name__,
    {
        "gtval.campaigns": "Campaign RunResult load_campaign run_campaign write_run ControlChart "
        "Summary control_chart summarise",
        "gtval.judging": "Evaluation Explanation compare explain findings",
        "gtval.markers": "Camera MarkerPlace locate_markers",
        "gtval.receivers": "Fixes Offsets VehiclePath find_offsets find_path fixes "
        "path_table read_fixes",
        "gtval.scans": "Match Scan match_scans",
        "gtval.surveys": "SurveySolution solve_survey",
        "gtval.tables": "PoseTable pose_table read_poses write_poses",
        "gtval.trajectories": "Trajectory read_trajectory write_trajectory ClockEstimate Clocks "
        "sync Fused fuse TimeComparison TimeExplanation compare_in_time explain_in_time Stop "
        "find_standstills poses_at_stops",
        "validation.errors": "GtvalError InputError",
        "validation.results": "Finding",
    },
)


def __dir__() -> list[str]:
    """The names above, also before they are loaded."""
    return __all__
