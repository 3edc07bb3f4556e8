"""Numbers of a survey for scripts, and its landmarks."""

from survey.campaign.cause_words import cause_facts, folded
from survey.campaign.findings import fitted_reading_sigma, single_findings
from survey.campaign.outcome import SurveyOutcome
from survey.campaign.result_files import adjusted_points


def survey_facts(outcome: SurveyOutcome) -> dict[str, object]:
    """Numbers of a survey for scripts."""
    solution = outcome.solution
    if solution is None:
        return {"source": "published"}
    late = tuple(solution.from_marks)
    return {
        "source": "readings" if solution.poses else "published",
        "readings": len(solution.used),
        "readings_left_out": len(solution.left_out),
        "world_points": {
            name: [float(v) for v in place]
            for name, place in zip(solution.world.names, solution.world.positions, strict=True)
        },
        "world_points_from_marks": {
            name: [float(v) for v in place]
            for name, place in zip(late, adjusted_points(solution, late)[0], strict=True)
        },
        "world_points_open": {
            point.name: point.reason
            for point in solution.world.missing
            if point.name not in solution.from_marks
        },
        "poses_open": {pose.pose: pose.reason for pose in solution.not_posed},
        "labelling": {
            "status": solution.labelling.status,
            "decided_by": list(solution.labelling.decided_by),
            "mirror_images_open": [dict(o.meaning) for o in solution.labelling.open_mirrors]
            if solution.labelling.status == "unconfirmed"
            else [],
        },
        "degrees_of_freedom": solution.adjustment.degrees_of_freedom,
        "m0": solution.adjustment.m0,
        "reading_sigma_stated": float(solution.used.sigma.mean()) if len(solution.used) else None,
        "reading_sigma_from_residuals": fitted_reading_sigma(solution),
        "published_inconsistent": [
            name
            for name, bad in zip(
                outcome.published.names, outcome.published.inconsistent, strict=True
            )
            if bad
        ]
        if outcome.published is not None
        else [],
        "causes": cause_facts(outcome, folded(outcome, single_findings(outcome))[1]),
        "suspected_blunders": [
            [
                {
                    "from": solution.used.start[i],
                    "to": solution.used.end[i],
                    "line": solution.used.line[i],
                    "size": float(size),
                    "w": float(w),
                }
                for i, size, w in zip(s.candidates, s.size, s.w, strict=True)
            ]
            for s in solution.suspicions
        ],
    }


def landmarks(outcome: SurveyOutcome) -> dict[str, tuple[float, float]]:
    """World points for the room map."""
    if outcome.solution is None:
        return {}
    world = outcome.solution.world
    places = {**dict(zip(world.names, world.positions, strict=True)), **outcome.solution.from_marks}
    return {name: (float(x), float(y)) for name, (x, y) in places.items()}
