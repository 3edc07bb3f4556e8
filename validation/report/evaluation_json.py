"""Comparisons as nested dicts, for ``--json``."""

import numpy as np

from validation.statistics.evaluation import Evaluation


def evaluation_json(evaluation: Evaluation) -> dict[str, object]:
    """Everything known of one system's errors, keyed by stop and component.

    Lengths in metres, angles in radians; what is not available is NaN, which
    `validation.text_files.json_text.as_json` turns into null.
    """
    comparison = evaluation.comparison
    names = [component.name for component in comparison.components]
    return {
        "system": evaluation.system,
        "n": len(comparison),
        "errors": {
            pose: dict(zip(names, errors, strict=True))
            for pose, errors in zip(comparison.ids, comparison.errors, strict=True)
        },
        "nees": dict(zip(comparison.ids, comparison.nees, strict=True)),
        "nees_interval": list(comparison.nees_interval),
        "nees_not_available": comparison.unavailable,
        "nees_test": comparison.test,
        "missing_in_gt": comparison.missing_in_gt,
        "missing_in_validation": comparison.missing_in_validation,
        "follows": None
        if comparison.follows is None
        else {"stops": comparison.follows.ids, "what": comparison.follows.what},
        "zero_by_construction": {
            "stops": comparison.constructed,
            "means": comparison.constructed_means,
        },
        "mean_sigmas_stated": dict(zip(names, comparison.mean_sigmas, strict=True)),
        "statistics": {
            one.component.name: {
                "unit": one.component.unit,
                **{key: value for key, value in vars(one).items() if key != "component"},
                "bias_is_significant": one.bias_is_significant,
                "bias_below_limit": one.bias.holds,
            }
            for one in evaluation.statistics
        },
    }


def position_json(evaluation: Evaluation) -> dict[str, object]:
    """What of a system's errors at stops has the same name for poses in time."""
    distances = evaluation.comparison.distances
    return {
        "rms_position_m": float(np.sqrt(np.square(distances).mean())),
        "max_position_m": float(distances.max()),
        "n": len(evaluation.comparison),
    }
