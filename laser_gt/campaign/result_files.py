"""Files that laser GT leaves under results/ beside the poses."""

import numpy as np

from laser_gt.campaign.kept import kept_file, matching_text
from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.placing.engines import Matching
from validation.text_files.csv_text import csv_text

MATCH_COLUMNS = (
    "reference", "moving", "verdict", "x", "y", "theta", "xx", "xy", "xt", "yy", "yt", "tt",
    "explained", "violating", "hidden", "agreement", "intruder", "scale", "real_share",
    "eigenvalue_ratio", "returned", "rival", "surprise", "fitness", "rival_fitness",
    "guess_x", "guess_y", "guess_theta", "reasons",
)  # fmt: skip


def result_files(outcome: LaserOutcome) -> dict[str, str]:
    """The matches of each engine: as a table, and as later commands use them again."""
    tables = {
        f"laser_matches_{engine}.csv": matches_csv(matching)
        for engine, matching in outcome.matchings.items()
    }
    return {**tables, **kept_files(outcome)}


def kept_files(outcome: LaserOutcome) -> dict[str, str]:
    """The matches of each engine as later commands use them again."""
    return {
        kept_file(engine): matching_text(matching, outcome.keys[engine])
        for engine, matching in outcome.matchings.items()
    }


def matches_csv(matching: Matching) -> str:
    """Every match with its covariance, what it was judged by, verdict and reasons."""
    rows = []
    upper = np.triu_indices(3)
    for one in matching.matches:
        numbers = np.array([
            *one.pose, *one.covariance[upper], one.explained, one.violating, one.hidden,
            one.agreement, one.intruder, one.scale, one.real_share, one.eigenvalue_ratio,
            one.returned, one.rival, one.surprise, one.fitness, one.rival_fitness, *one.guess,
        ])  # fmt: skip
        finite = np.where(np.isfinite(numbers), numbers, np.nan).tolist()
        rows.append([one.reference, one.moving, one.verdict, *finite, "; ".join(one.reasons)])
    return csv_text(MATCH_COLUMNS, rows)
