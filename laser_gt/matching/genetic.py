"""The document's genetic aligner, as published and improved.

Real-coded, three genes (x, y, theta). AD2.3, "Using two laser range finder with a genetic
algorithm": population 100, 300 or 1000 generations, the first population seeded with odometry
and with manual guesses, fitness the sum of squared distances to the closest points less the
worst five. The document does not print its operators; those used here are named below.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from laser_gt.matching.both_ways import both_ways
from laser_gt.matching.local import align
from laser_gt.matching.search import distinct, thinned
from laser_gt.scans.evidence import Prepared, evidence
from laser_gt.scans.nearest import DROPPED, NearestGrid
from laser_gt.scans.planar import rotation, wrapped
from validation.poses.angles import Array


@dataclass(frozen=True)
class GeneticSettings:
    """Size of the search, and which of its two forms.

    Parameters
    ----------
    population : int
        Individuals, 100 in the document.
    generations : int
        300 in the document when odometry is known, 1000 without.
    drop : int
        Number of worst points that do not count, as published: 5.
    overlap : float
        Share of the points that are expected to find a partner; the worse rest does not count.
    points : int
        Points scored, spread evenly over the surfaces.
    window : (3,) tuple
        Half widths of the first population about the guess: x, y (metres), theta (radians).
    seeds_sigma : (3,) tuple
        Scatter of the copies of the seeds in the first population.
    elite : int
        Best individuals that live on unchanged.
    immigrants : float
        Share of each generation drawn anew from the window, which keeps the search global.
    as_published : bool
        The document's fitness, all points, no polish.

    Notes
    -----
    Population, generations and drop are the document's. The others are judgements: a quarter of
    the points may see what the other scan does not; the window is that of pairs; seeds scatter as
    a search's cells do; a few survivors keep the best, a sixth of newcomers keeps it looking.
    """

    population: int = 100
    generations: int = 300
    drop: int = DROPPED
    overlap: float = 0.75
    points: int = 180
    window: tuple[float, float, float] = (3.0, 3.0, float(np.pi))
    seeds_sigma: tuple[float, float, float] = (0.1, 0.1, 0.05)
    elite: int = 4
    immigrants: float = 0.15
    as_published: bool = False


@dataclass(frozen=True)
class GeneticMatch:
    """The winner and how the search went.

    Parameters
    ----------
    pose : (3,) array
        Moving frame in the reference frame.
    fitness : float
        Of the winner, before the polish: square metres, summed as published, a mean otherwise.
    convergence : (generations + 1,) array
        Best fitness of each generation.
    finalists : (m, 3) array
        Distinct good individuals of the last population, polished one way, the winner's among them.
    """

    pose: Array
    fitness: float
    convergence: Array
    finalists: Array


def genetic_match(
    reference: Prepared,
    moving: Prepared,
    rng: np.random.Generator,
    seeds: Sequence[npt.ArrayLike] = (),
    settings: GeneticSettings | None = None,
    middle: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> GeneticMatch:
    """The pose of a sweep in the frame of another by a genetic search.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    rng : numpy.random.Generator
        Source of all chance: the same generator gives the same result.
    seeds : sequence of (3,) array_like
        Poses put into the first population: odometry, manual guesses.
    settings : GeneticSettings
        Size and form.
    middle : (3,) array_like
        Middle of the window of the first population, in the reference frame.

    Notes
    -----
    Parents by tournaments of two, blend crossover (BLX-0.3; angles along the shorter arc),
    normal mutation whose width shrinks over the generations from a tenth of the window to
    millimetres, elitism. The improved form trims by the expected overlap instead of by five
    points, looks distances up in a distance transform, limits them, and polishes the best
    distinct individuals, of which the one that agrees best with all that was seen wins. The winner
    ends as a match does, in the mean of both ways (`laser_gt.matching.both_ways`).
    """
    settings = settings or GeneticSettings()
    if settings.as_published:
        points = moving.sweep.points
    else:
        points = thinned(moving.sweep.points, settings.points)
    fitness = _Fitness(reference, points, settings)
    window = np.asarray(settings.window)
    population = _first(rng, np.asarray(middle, dtype=float), window, seeds, settings)
    value = fitness(population)
    scouts = np.empty((0, 3))
    if not settings.as_published and not len(seeds):
        population, value, scouts = _head_start(rng, population, value, fitness, middle, window)
    convergence = [float(value.min())]
    for generation in range(settings.generations):
        progress = generation / max(settings.generations - 1, 1)
        children = _children(rng, population, value, window, progress, settings)
        fresh = int(settings.immigrants * settings.population * (1 - progress))
        children[len(children) - fresh :] = _uniform(rng, np.asarray(middle), window, fresh)
        elite = np.argsort(value, kind="stable")[: settings.elite]
        population = np.concatenate([population[elite], children])
        value = np.concatenate([value[elite], fitness(children)])
        convergence.append(float(value.min()))
    population = wrapped(population)
    winner = int(value.argmin())
    if settings.as_published:
        best = population[winner]
        return GeneticMatch(best, convergence[-1], np.array(convergence), best[None])
    few = population[distinct(population, -value, 0.1, 0.1, 5)]
    polished = align(
        reference.surface, moving.surface, np.concatenate([few, scouts]), reach=0.3, stride=2
    )
    score = evidence(reference, moving, polished.pose, stride=2).score
    few = polished.pose[distinct(polished.pose, score, 0.05, 0.02, 3)]
    polished = align(reference.surface, moving.surface, few, reach=0.15)
    score = evidence(reference, moving, polished.pose).score
    pose, _ = both_ways(reference.surface, moving.surface, polished, int(score.argmax()))
    return GeneticMatch(
        pose,
        convergence[-1],
        np.array(convergence),
        polished.pose,
    )


PUBLISHED_CELL = 0.02
"""Cells of the table of closest points in metres, for the published fitness: the closest point that
the table gives is at most two diagonals of a cell (57 mm) further away than the true one."""


class _Fitness:
    """Fitness of individuals: the smaller the better."""

    LIMIT = 0.5
    """Distances beyond this count as this, in metres: how far off an outlier is says nothing. A
judgement: more than noise and first guesses make, less than from one wall to the next."""

    def __init__(self, reference: Prepared, points: Array, settings: GeneticSettings) -> None:
        self.grid = reference.surface.grid
        if settings.as_published:
            self.grid = NearestGrid(reference.sweep.points, cell=PUBLISHED_CELL)
        self.points = np.ascontiguousarray(points.T)
        self.settings = settings

    def __call__(self, poses: Array) -> Array:
        """(k,) fitness of (k, 3) poses."""
        moved = rotation(poses[:, 2]) @ self.points + poses[:, :2, None]
        x, y = moved[:, 0], moved[:, 1]
        if self.settings.as_published:
            squared = self.grid.squared_distance(x, y)
            keep = squared.shape[1] - self.settings.drop
            return np.asarray(np.partition(squared, keep - 1, axis=1)[:, :keep].sum(1))
        distance = np.minimum(self.grid.distance(x, y), self.LIMIT)
        keep = max(int(self.settings.overlap * distance.shape[1]), 1)
        kept = np.partition(distance, keep - 1, axis=1)[:, :keep]
        return np.asarray((kept * kept).mean(1), dtype=float)


def _uniform(rng: np.random.Generator, middle: Array, window: Array, count: int) -> Array:
    """(count, 3) individuals anywhere in the window."""
    return middle + rng.uniform(-1, 1, (count, 3)) * window


def _first(
    rng: np.random.Generator,
    middle: Array,
    window: Array,
    seeds: Sequence[npt.ArrayLike],
    settings: GeneticSettings,
) -> Array:
    """The first population: the seeds, scattered copies of them, and chance."""
    population = _uniform(rng, middle, window, settings.population)
    if len(seeds):
        given = np.asarray(seeds, dtype=float).reshape(-1, 3)[: settings.population]
        copies = given[np.arange(settings.population // 2) % len(given)]
        copies = copies + rng.normal(0, settings.seeds_sigma, copies.shape)
        population[len(population) - len(copies) :] = copies
        population[: len(given)] = given
    return population


HEAD_START = 20
"""Individuals tried for each place that chance fills in the first population. A judgement: they
cost as much as twenty generations, a fifteenth of the whole."""


def _head_start(
    rng: np.random.Generator,
    population: Array,
    value: Array,
    fitness: _Fitness,
    middle: npt.ArrayLike,
    window: Array,
) -> tuple[Array, Array, Array]:
    """The first population with its worse half replaced by the best of many drawn by chance.

    Costs as much as twenty generations and finds the right basin where there is no seed. The
    third array holds the ten best, which are polished in the end whatever became of them.
    """
    size = len(population)
    drawn = _uniform(rng, np.asarray(middle), window, HEAD_START * size)
    drawn_value = np.concatenate([fitness(part) for part in np.array_split(drawn, HEAD_START)])
    chosen = distinct(drawn, -drawn_value, 0.3, 0.2, size // 2)
    keep = np.argsort(value, kind="stable")[: size - len(chosen)]
    return (
        np.concatenate([population[keep], drawn[chosen]]),
        np.concatenate([value[keep], drawn_value[chosen]]),
        drawn[chosen[:10]],
    )


def _children(
    rng: np.random.Generator,
    population: Array,
    value: Array,
    window: Array,
    progress: float,
    settings: GeneticSettings,
) -> Array:
    """The next generation but for the elite."""
    count = settings.population - settings.elite
    rivals = rng.integers(len(population), size=(2, 2, count))
    first_wins = value[rivals[0]] <= value[rivals[1]]
    mother, father = population[np.where(first_wins, rivals[0], rivals[1])]
    away = wrapped(father - mother)
    share = rng.uniform(-0.3, 1.3, (count, 3))
    width = window * 0.1 * (0.01**progress)
    mutated = rng.random((count, 3)) < 0.4  # a judgement: of three numbers about one
    return np.asarray(mother + share * away + mutated * rng.normal(0, 1, (count, 3)) * width)
