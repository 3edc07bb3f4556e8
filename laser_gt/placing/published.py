"""The document's own way: every stop matched with one reference, and nothing judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose, compose_jacobians, inverse
from validation.poses.angles import Array


@dataclass(frozen=True)
class Published:
    """Poses by the document's own way: every stop matched with the reference alone.

    Parameters
    ----------
    stops : tuple of str
        Names.
    poses : (n, 3) array
        Robot poses in the GTV frame.
    fitness : (n,) array
        Of the winner, square metres; 0 for the reference.
    reference : str
        The surveyed stop.
    by_reference : (3n, 3) array
        How the poses follow its surveyed pose.
    """

    stops: tuple[str, ...]
    poses: Array
    fitness: Array
    reference: str
    by_reference: Array


def published_poses(
    sweeps: Sequence[Prepared],
    mount: Array,
    trajectory: Array,
    reference: str,
    surveyed: Array,
    settings: GeneticSettings,
    seed: int,
) -> Published:
    """Every stop matched with one reference by the published genetic aligner.

    Parameters
    ----------
    sweeps : sequence of Prepared
        One for each stop, in the laser frame.
    mount : (3,) array
        Laser frame in the robot frame.
    trajectory : (n, 3) array
        Initial guess of the laser frames.
    reference : str
        The surveyed stop.
    surveyed : (3,) array
        Its robot pose in the GTV frame.
    settings : GeneticSettings
        Population and generations.
    seed : int
        Of all chance.

    Notes
    -----
    AD2.3, "Validation results" of the laser-based GT: reference pose, mount, match, inverse
    mount. Population 100, 300 generations, seeded with odometry, the worst five points dropped.
    """
    stops = tuple(sweep.name for sweep in sweeps)
    root = stops.index(reference)
    form = replace(settings, as_published=True)
    laser, back = compose(surveyed, mount), inverse(mount)
    poses, fitness = [], []
    for number, rng in enumerate(np.random.default_rng(seed).spawn(len(stops))):
        if number == root:
            poses.append(surveyed)
            fitness.append(0.0)
            continue
        guess = between(trajectory[root], trajectory[number])
        found = genetic_match(sweeps[root], sweeps[number], rng, [guess], form, middle=guess)
        poses.append(compose(compose(laser, found.pose), back))
        fitness.append(found.fitness)
    apart = between(surveyed, np.array(poses))
    by, _ = compose_jacobians(np.broadcast_to(surveyed, apart.shape), apart)
    return Published(stops, np.array(poses), np.array(fitness), reference, by.reshape(-1, 3))
