"""Which first guesses lead the filter to the solution, and which elsewhere.

AD2.3 tried "a lot of" first guesses around one world point, and guesses "in a radius of about
half-meter" around the robot poses, saw the filter end at one place, and takes this as evidence
that there is no other. Here thousands of random guesses are iterated for every unknown, each is
classified by where it ends, and the radius found is stated with what a sample can prove.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from survey.estimation.distance_fit import DistanceFit
from survey.estimation.iterated_ekf import PASSES
from validation.poses.angles import Array, wrap

REACHES_SOLUTION, REACHES_OTHER, NOT_CONVERGED = 0, 1, 2
HEADING_LIMITS = (np.pi, np.pi / 6, np.pi / 3, np.pi / 2)
"""Largest heading errors of the first guess for which radii are given; pi stands for any. A
judgement: what people can tell by eye, by the floor tiles, or hardly at all."""
RADII = 50
"""Radii tested, in equal steps to the largest: of 10 cm where that is 5 m."""
CONFIDENCE = 0.95
"""Of the statement how few starts fail: usual."""
_SAME = 1e-5
"""Ends nearer than this, in metres and radians, are one place: the filter stops at steps below
1e-9, and converges quadratically."""
_MOST_OTHERS = 20
"""Other solutions listed. A judgement: nobody reads more."""


@dataclass(frozen=True)
class Region:
    """How far a first guess may be off, as far as the starts tell.

    Parameters
    ----------
    heading_limit : float
        Heading errors of the starts considered, radians; pi for any (and for points).
    radius : float
        Largest radius tested without a failure inside, metres; 0 if the smallest had one.
    starts : int
        Starts inside it.
    failures_below : float
        At 95 % confidence, less than this share of starts drawn like these, inside the radius,
        leads elsewhere; 1 where there was no start.
    limited_by_test : bool
        Whether nothing failed up to the largest radius tested: the region may be larger.
    """

    heading_limit: float
    radius: float
    starts: int
    failures_below: float
    limited_by_test: bool


@dataclass(frozen=True)
class OtherSolution:
    """Another place where the filter rests, its cost, and how many starts lead there."""

    state: Array
    cost: float
    starts: int


@dataclass(frozen=True)
class Convergence:
    """Where many starts lead.

    Parameters
    ----------
    solution : (n,) array
        Where the filter rests when started at the given solution.
    cost : float
        Chi-squared there.
    starts : (b, n) array
        First guesses.
    outcome : (b,) array of int
        REACHES_SOLUTION, REACHES_OTHER or NOT_CONVERGED.
    others : tuple of OtherSolution
        The best first, at most 20.
    regions : tuple of Region
        For any heading first, then for the limits.
    radius : float
        Largest distance of a start, metres.
    passes : int
        Passes allowed.
    """

    solution: Array
    cost: float
    starts: Array
    outcome: npt.NDArray[np.int8]
    others: tuple[OtherSolution, ...]
    regions: tuple[Region, ...]
    radius: float
    passes: int

    @property
    def counts(self) -> tuple[int, int, int]:
        """Starts that reach the solution, reach another, do not converge."""
        found = np.bincount(self.outcome, minlength=3)
        return int(found[0]), int(found[1]), int(found[2])

    @property
    def better_elsewhere(self) -> OtherSolution | None:
        """A place that fits better than the solution, if any start found one."""
        best = self.others[0] if self.others else None
        return best if best is not None and best.cost < self.cost else None


def explore_convergence(
    problem: DistanceFit,
    solution: Array,
    rng: np.random.Generator,
    *,
    starts: int = 10_000,
    radius: float = 5.0,
    passes: int = PASSES,
) -> Convergence:
    """Where random first guesses around a solution lead.

    Parameters
    ----------
    problem : DistanceFit
        What is to be found.
    solution : (n,) array
        Its solution.
    rng : numpy.random.Generator
        Draws the starts.
    starts : int
        How many.
    radius : float
        Their largest distance from the solution, metres.
    passes : int
        Passes allowed to each.

    Raises
    ------
    ValueError
        If the filter does not rest near the given solution.
    """
    home = problem.ends(np.asarray(solution, dtype=float)[None], passes)
    if not home.converged[0]:
        raise ValueError("the filter does not converge even from the solution")
    guesses = random_starts(home.state[0], radius, starts, rng)
    ended = problem.ends(guesses, passes)
    there = ended.converged & _near(ended.state, home.state[0])
    outcome = np.where(there, REACHES_SOLUTION, REACHES_OTHER)
    outcome[~ended.converged] = NOT_CONVERGED
    elsewhere = ended.converged & ~there
    return Convergence(
        solution=home.state[0],
        cost=float(home.cost[0]),
        starts=guesses,
        outcome=outcome.astype(np.int8),
        others=_grouped(ended.state[elsewhere], ended.cost[elsewhere]),
        regions=regions(home.state[0], guesses, ~there, radius),
        radius=radius,
        passes=passes,
    )


def random_starts(solution: Array, radius: float, count: int, rng: np.random.Generator) -> Array:
    """First guesses (count, n) around a solution, every distance and direction equally likely.

    Distances, not areas, are evenly drawn, so that the near ones, which matter most, are many.
    Headings are drawn from the whole circle.
    """
    away = radius * rng.random(count)
    direction = rng.uniform(-np.pi, np.pi, count)
    position = solution[:2] + away[:, None] * np.stack(
        [np.cos(direction), np.sin(direction)], axis=-1
    )
    heading = solution[2:] + rng.uniform(-np.pi, np.pi, (count, len(solution) - 2))
    return np.concatenate([position, heading], axis=-1)


def regions(
    solution: Array, starts: Array, failed: npt.NDArray[np.bool_], largest: float
) -> tuple[Region, ...]:
    """Radii without failure, for any heading and for limited heading errors.

    Parameters
    ----------
    solution : (n,) array
        Centre.
    starts : (b, n) array
        First guesses.
    failed : (b,) array of bool
        Which of them did not reach the solution.
    largest : float
        Largest radius tested, metres.

    Notes
    -----
    Radii are fixed beforehand and tested from the smallest upwards until one holds a failure.
    Testing in a fixed order at one level keeps that level for all statements together, so the
    bound on the share of failures among n starts without one, 1 - 0.05^(1/n), about 3 / n, holds
    for the radius that is found.
    """
    away = np.linalg.norm(starts[:, :2] - solution[:2], axis=-1)
    turned = np.abs(wrap(starts[:, 2:] - solution[2:])).max(axis=-1, initial=0.0)
    limits = HEADING_LIMITS if len(solution) == 3 else HEADING_LIMITS[:1]
    radii = largest * np.arange(1, RADII + 1) / RADII
    found = []
    for limit in limits:
        considered = turned <= limit
        nearest = away[considered & failed].min(initial=np.inf)
        good = radii[radii < nearest]
        radius = float(good[-1]) if good.size else 0.0
        inside = int((considered & (away <= radius)).sum())
        found.append(
            Region(
                heading_limit=float(limit),
                radius=radius,
                starts=inside,
                failures_below=float(1 - (1 - CONFIDENCE) ** (1 / inside)) if inside else 1.0,
                limited_by_test=bool(nearest == np.inf),
            )
        )
    return tuple(found)


def _near(states: Array, place: Array) -> npt.NDArray[np.bool_]:
    """(b,) whether states are one place, headings being the same after full turns."""
    same_position = (np.abs(states[:, :2] - place[:2]) < _SAME).all(-1)
    same_heading = (np.abs(wrap(states[:, 2:] - place[2:])) < _SAME).all(-1)
    return np.asarray(same_position & same_heading)


def _grouped(states: Array, costs: Array) -> tuple[OtherSolution, ...]:
    """Different places among the ends, the best first."""
    order = np.argsort(costs, kind="stable")
    states, costs = states[order], costs[order]
    groups: list[OtherSolution] = []
    while len(states) and len(groups) < _MOST_OTHERS:
        same = _near(states, states[0])
        groups.append(OtherSolution(states[0], float(costs[0]), int(same.sum())))
        states, costs = states[~same], costs[~same]
    return tuple(groups)


def smallest_region(found: Sequence[Convergence], heading_limit: float = np.pi) -> Region:
    """The region that serves for all of them: that of the smallest radius.

    Raises
    ------
    ValueError
        If there is none.
    """
    fitting = [
        region
        for one in found
        for region in one.regions
        if region.heading_limit == heading_limit or len(one.regions) == 1
    ]
    return min(fitting, key=lambda region: region.radius)
