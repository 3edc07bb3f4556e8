"""How much quicker a batch of starts is than a loop of filterpy filters, one for each start.

The peer is an ExtendedKalmanFilter of filterpy for every start, with the same measurement equation,
covariances, passes and stopping rule. It is run on the first starts of every unknown and scaled to
all of them; the batch runs all. Processor time, so that a busy machine does not matter.

    python benchmarks/convergence.py [--starts 10000] [--loop-starts 10]
"""

import argparse
import sys
import time

import numpy as np

from survey.estimation.distance_fit import DistanceFit
from survey.estimation.geometry import rotate
from survey.estimation.iterated_ekf import Model, iterated_ekf
from survey.studies.convergence import random_starts
from validation.poses.angles import Array

REQUIRED = 50.0
RIG = np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.4]])
VFRAME = np.array([[0.0, 0.0], [2.5, 0.0], [0.0, 2.5], [2.5, 2.5]])
SIGMA, KNOWN_SIGMA, MARK_SIGMA = 0.003, 0.002, 0.001


def room(rng: np.random.Generator) -> list[tuple[str, DistanceFit, Array]]:
    """16 world points with 4 readings and 26 poses with 48, in a room of 8 m by 10 m."""
    turn = 2 * np.pi * np.arange(16) / 16
    world = np.stack([4 * np.cos(turn), 5 * np.sin(turn)], axis=-1) + rng.normal(0, 0.2, (16, 2))
    problems = []
    for i, point in enumerate(world):
        problem = problem_of(rng, VFRAME, None, np.append(point, 0.0))
        problems.append((f"world point {i + 1}", problem, point))
    known, body = np.repeat(world, 3, axis=0), np.tile(RIG, (16, 1))
    for i in range(26):
        state = np.append(rng.uniform([-2, -3], [2, 3]), rng.uniform(-np.pi, np.pi))
        problem = problem_of(rng, known, body, state)
        problems.append((f"pose {i + 1}", problem, state))
    return problems


def problem_of(
    rng: np.random.Generator, known: Array, body: Array | None, state: Array
) -> DistanceFit:
    """A point or pose with noisy readings."""
    arm = np.zeros(2) if body is None else rotate(state[2], body)
    distance = np.linalg.norm(known - state[:2] - arm, axis=-1)
    distance = distance + rng.normal(0, SIGMA, len(distance))
    sigma = np.full(len(distance), SIGMA)
    mark_sigma = 0.0 if body is None else MARK_SIGMA
    known_sigma = np.full(len(distance), KNOWN_SIGMA)
    return DistanceFit(known, body, distance, sigma, known_sigma, mark_sigma)


def single(problem: DistanceFit) -> Model:
    """The batch's measurement equation for one state, with R as a matrix."""
    many = problem.equations

    def evaluate(state: Array) -> tuple[Array, Array, Array]:
        h, H, variance = many(state[None])
        return h[0], H[0], np.diag(variance[0])

    return evaluate


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=10_000)
    parser.add_argument("--loop-starts", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    seconds = {"world points": [0.0, 0.0], "poses": [0.0, 0.0]}
    differing = 0
    problems = room(rng)
    _, problem, state = problems[0]
    problem.ends(state[None])
    iterated_ekf(single(problem), state, problem.prior_sigma)  # the first call loads libraries
    for name, problem, state in problems:
        kind = "poses" if name.startswith("pose") else "world points"
        starts = random_starts(state, 5.0, options.starts, rng)
        begun = time.process_time()
        ended = problem.ends(starts)
        seconds[kind][0] += time.process_time() - begun
        model = single(problem)
        begun = time.process_time()
        loop = [iterated_ekf(model, s, problem.prior_sigma) for s in starts[: options.loop_starts]]
        looped = time.process_time() - begun
        seconds[kind][1] += looped * options.starts / options.loop_starts
        for i, one in enumerate(loop):
            off = one.state - ended.state[i]
            off[2:] = np.angle(np.exp(1j * off[2:]))
            same = one.converged == ended.converged[i]
            differing += not (same and (not one.converged or np.abs(off).max() < 1e-8))
    total = np.sum(list(seconds.values()), axis=0)
    print(f"{options.starts} starts for each of 16 world points (4 readings) and 26 poses (48)")
    print(f"{'':14s}{'batch [s]':>11s}{'loop [s]':>11s}{'ratio':>8s}")
    for kind, (batch, loop) in [*seconds.items(), ("all", total)]:
        print(f"{kind:14s}{batch:11.2f}{loop:11.1f}{loop / batch:8.0f}")
    print(f"starts that end differently: {differing} of {42 * options.loop_starts}")
    ratio = total[1] / total[0]
    good = ratio >= REQUIRED and differing == 0
    print(f"{'ok' if good else 'FAILED'}: {ratio:.0f} times quicker, {REQUIRED:g} wanted")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
