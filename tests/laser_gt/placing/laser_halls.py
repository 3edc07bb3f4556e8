"""Halls of any number of stops with matches of their scans, without scans."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.spatial import cKDTree

from laser_gt.campaign.inputs import as_surveyed
from laser_gt.campaign.pose_tables import pose_tables
from laser_gt.matching.verdicts import JudgementSettings, Match, with_verdict
from laser_gt.placing.engines import Matching
from laser_gt.placing.loops import with_loops
from laser_gt.placing.mounts import check_mount
from laser_gt.placing.solution import LaserSolution, solve
from laser_gt.placing.survey_check import shape_of, survey_doubt
from laser_gt.placing.switches import decided
from laser_gt.scans.planar import between, compose, inverse_covariance_of
from validation.poses.pose_table import PoseTable
from validation.statistics.comparison import Comparison, compare

MOUNT, MOUNT_SIGMAS = np.array([0.178, 0.1915, 1.57]), np.array([0.005, 0.005, 0.01])
NOISE = np.array([0.003, 0.003, 0.0015])
"""Of a match, metres and radians."""
ALONE = 0.3
"""Share of its variance that a match has alone; half of the rest is of either of its scans."""
OWN, SHARED = np.array([0.002, 0.002, 0.001]), np.array([0.0008, 0.0008, 0.0003])
"""Of a surveyed pose alone, and what it has of each error that all share."""
GUESS = (0.15, 0.1)
FLAWLESS = {
    "explained": 0.9, "violating": 0.0, "hidden": 0.1, "agreement": 0.97, "intruder": 0.0,
    "scale": 1.0, "real_share": 0.9, "eigenvalue_ratio": 0.5, "returned": 1.0,
    "rival": -np.inf, "surprise": 1.0,
}  # fmt: skip


@dataclass
class Hall:
    """True poses, a survey of some of them, matches as judged one by one, and a guess."""

    true: np.ndarray
    survey: PoseTable
    matches: list[Match]
    guess: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(str(number) for number in range(len(self.true)))

    def solved(self) -> LaserSolution:
        """Poses by the matches, those that may be wrong decided."""
        told, loops = with_loops(self.matches)
        matching = Matching("scanmatch", decided(self.names, self.guess, told, GUESS), loops)
        known = as_surveyed(self.survey)
        return solve(self.names, MOUNT, MOUNT_SIGMAS, self.guess, matching, known, GUESS)

    def compared(self) -> Comparison:
        """The poses held against the survey, as a run does it, with all that it looks at."""
        solution, known = self.solved(), as_surveyed(self.survey)
        check_mount(self.names, MOUNT, MOUNT_SIGMAS, solution.matching.matches, known)
        rows = np.array([solution.stops.index(stop) for stop in known.stops], dtype=np.intp)
        shape = shape_of(solution.graph, rows)
        survey_doubt(known.stops, shape, known.poses, known.covariance)
        return compare(self.survey, table_of(solution))


def table_of(solution: LaserSolution) -> PoseTable:
    (table,) = pose_tables(SimpleNamespace(solutions={"scanmatch": solution}, published=None))
    return table


def hall(stops: int, seed: int = 1, share: float = 1.0, columns: int = 20) -> Hall:
    """Stops in rows of 2 m, each matched with its six neighbours, a tenth of them in doubt.

    Two in a hundred matches are wrong by half a metre. A share of the stops is surveyed, with
    errors of which a number are common to all.
    """
    rng = np.random.default_rng(seed)
    wide = int(np.ceil(np.sqrt(stops)))
    row, along = np.divmod(np.arange(stops), wide)
    along = np.where(row % 2 == 0, along, wide - 1 - along)
    places = 2.0 * np.column_stack([along, row]) + rng.uniform(-0.4, 0.4, (stops, 2))
    true = np.column_stack([places, rng.uniform(-np.pi, np.pi, stops)])
    laser = compose(true, np.broadcast_to(MOUNT, true.shape))
    scans = NOISE * np.sqrt((1 - ALONE) / 2)
    seen = compose(laser, rng.normal(0, 1, laser.shape) * scans)
    _, near = cKDTree(places).query(places, min(7, stops))
    pairs = sorted({tuple(sorted((i, int(j)))) for i in range(stops) for j in near[i, 1:]})
    guess = laser + np.cumsum(rng.normal(0, 1, (stops, 3)) * [0.02, 0.02, 0.005], axis=0)
    return Hall(
        true,
        _surveyed(rng, true, max(2, round(share * stops)), columns),
        [_match(rng, laser, seen, *pair) for pair in pairs],
        guess,
    )


def _match(
    rng: np.random.Generator, laser: np.ndarray, seen: np.ndarray, start: int, end: int
) -> Match:
    """A match of two scans, of which each has noise as a pose of the laser, in all its matches."""
    guess, kind = between(laser[start], laser[end]), rng.uniform()
    numbers, off = dict(FLAWLESS), rng.normal(0, 1, 3) * NOISE * np.sqrt(ALONE)
    if kind < 0.05:
        numbers["explained"] = 0.2  # imprecise
    elif kind < 0.10:
        numbers["violating"] = 0.1  # may be wrong
        if kind > 0.08:
            off = rng.normal(0, 0.5, 3) * [1, 1, 0.3]
    half = np.diag(NOISE**2) / 2
    spread = half + inverse_covariance_of(between(laser[end], laser[start]), half)
    pose = between(seen[start], seen[end]) + off
    one = Match(str(start), str(end), guess, pose, spread, **numbers)
    return with_verdict(one, JudgementSettings())


def _surveyed(rng: np.random.Generator, true: np.ndarray, count: int, columns: int) -> PoseTable:
    rows = np.sort(rng.choice(len(true), count, replace=False))
    factor = rng.normal(0, 1, (count, 3, columns)) * SHARED[:, None]
    off = rng.normal(0, 1, (count, 3)) * OWN + factor @ rng.normal(0, 1, columns)
    covariances = np.diag(OWN**2) + factor @ np.swapaxes(factor, 1, 2)
    ids = tuple(str(row) for row in rows)
    flat = factor.reshape(3 * count, columns)
    return PoseTable("survey", ids, true[rows] + off, covariances, factor=flat)
