"""The survey's files under results/."""

from collections.abc import Sequence

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.estimation.solve import SurveySolution
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable, to_csv
from validation.text_files.csv_text import csv_text


def survey_files(outcome: SurveyOutcome) -> dict[str, str | bytes]:
    """Relative names and contents; poses_survey.csv is written by whoever runs the systems."""
    solution = outcome.solution
    if solution is None:
        return {}
    files: dict[str, str | bytes] = {
        "world_points.csv": _world_points(solution, joint=False),
        "world_points_joint.csv": _world_points(solution, joint=True),
        "vframe_points.csv": _vframe(solution),
        "readings_checked.csv": _readings(solution),
    }
    if solution.frames:
        single = PoseTable(
            "survey_single",
            tuple(frame.pose for frame in solution.frames),
            np.array([frame.state for frame in solution.frames]),
            np.array([frame.covariance for frame in solution.frames]),
            sources=("single-pose filter",) * len(solution.frames),
        )
        files["survey_single_poses.csv"] = to_csv(single)
    return files


def labelling_status(solution: SurveySolution) -> str:
    """'mirror image possible' where nothing excludes it, else 'ok'."""
    return "mirror image possible" if solution.labelling.status == "unconfirmed" else "ok"


def adjusted_points(solution: SurveySolution, names: Sequence[str]) -> tuple[Array, Array]:
    """Positions (n, 2) and covariances (n, 2, 2) of named points after the joint adjustment."""
    adjustment = solution.adjustment
    rows = adjustment.point_rows(names).reshape(-1, 2)
    place = {name: i for i, name in enumerate(adjustment.network.points)}
    positions = adjustment.parameters.points[[place[name] for name in names]].reshape(-1, 2)
    return positions, adjustment.cofactors.blocks(rows)


def _world_points(solution: SurveySolution, *, joint: bool) -> str:
    """World points by trilateration from the nominal Vframe, or after the joint adjustment."""
    names = solution.world.names
    positions = solution.world.positions
    covariances = np.array([point.covariance for point in solution.world.points])
    if joint:
        names = solution.joint_names
        positions, covariances = adjusted_points(solution, names)
    status = labelling_status(solution)
    rows: list[Sequence[object]] = [
        (name, *p, c[0, 0], c[0, 1], c[1, 1], status)
        for name, p, c in zip(names, positions, covariances, strict=True)
    ]
    rows += [
        (point.name, "", "", "", "", "", point.reason)
        for point in solution.world.missing
        if point.name not in names
    ]
    return csv_text(("world_point", "x", "y", "var_x", "cov_xy", "var_y", "status"), rows)


def _vframe(solution: SurveySolution) -> str:
    names = solution.vframe.names
    positions, covariances = adjusted_points(solution, names)
    rows = [
        (name, *p, c[0, 0], c[0, 1], c[1, 1])
        for name, p, c in zip(names, positions, covariances, strict=True)
    ]
    return csv_text(("vframe_point", "x", "y", "var_x", "cov_xy", "var_y"), rows)


def _readings(solution: SurveySolution) -> str:
    used, adjustment, tests = solution.used, solution.adjustment, solution.reliability
    n = len(used)
    residual = adjustment.residual[:n] * used.sigma
    suspicion = np.zeros(n, dtype=int)
    for number, suspected in enumerate(solution.suspicions, 1):
        fresh = suspected.candidates[suspicion[suspected.candidates] == 0]
        suspicion[fresh] = number
    rows = [
        (
            used.line[i],
            used.start[i],
            used.end[i],
            used.distance[i],
            used.sigma[i],
            residual[i],
            adjustment.redundancy[i],
            tests.w[i],
            tests.minimal_detectable[i],
            adjustment.weight[i],
            suspicion[i] or "",
        )
        for i in range(n)
    ]
    heading = (
        "line",
        "from",
        "to",
        "distance",
        "sigma",
        "residual",
        "redundancy",
        "w",
        "minimal_detectable",
        "weight",
        "suspicion",
    )
    return csv_text(heading, rows)
