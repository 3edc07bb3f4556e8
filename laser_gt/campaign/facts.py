"""Numbers of a laser GT for scripts."""

import numpy as np

from laser_gt.campaign.outcome import LaserOutcome


def laser_facts(outcome: LaserOutcome) -> dict[str, object]:
    """Numbers for ``--json`` and results/run.json."""
    facts: dict[str, object] = {
        "stops": len(outcome.inputs.stops),
        "initial": outcome.trajectory.source,
        "reference": list(outcome.surveyed.stops),
        "engines": {
            engine: {
                "pairs": len(matching.matches),
                **matching.counts,
                "loops": len(matching.loops),
                "loops_open": matching.open_loops,
                "poses": len(outcome.solutions[engine].stops) if engine in outcome.solutions else 0,
            }
            for engine, matching in outcome.matchings.items()
        },
    }
    facts["noise"] = {
        name: {"independent": one.independent, "shared": one.shared, "beams": one.length}
        for name, one in outcome.noise.items()
    }
    check = outcome.mount_check
    if check is not None:
        facts["mount"] = {
            "stated": check.stated.tolist(),
            "found": check.found.mount.tolist(),
            "sigmas": check.found.sigmas.tolist(),
            "difference": check.difference.tolist(),
            "agrees": bool(check.agrees),
            "tells": check.tells,
            "least_shown": check.least_shown.tolist(),
            "turn": check.found.turn,
            "pairs": check.found.pairs,
        }
    if outcome.published is not None:
        facts["as_published"] = {
            "reference": outcome.published.reference,
            "fitness": np.round(outcome.published.fitness, 6).tolist(),
        }
    return facts
