"""Offsets of three receivers: the closed form beside the published nested optimisation.

Same data in the same run: 600 and 60,000 steps with noise, and 600 with 2 % false fixes of
30 cm. Processor time of one thread, median of the rounds; errors against the truth.
"""

import time
from collections.abc import Callable
from statistics import median

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from data_samples.drives import ANTENNAS, OFFSETS, RECEIVERS
from rtk_gt.frames import LocalFrame
from rtk_gt.nested import nested_offsets
from rtk_gt.noise import PUBLISHED_NOISE
from rtk_gt.offsets import estimate_offsets
from rtk_gt.pose_covariance import reference_covariance, simulated_covariance
from rtk_gt.steps import Steps

TAPE = np.array([1.79, 1.79, 1.15])
FRAME = LocalFrame.from_degrees(36.714459075, -4.47895882833333, 38.8887)
FALSE_SIZE = 0.3
DRIVES = 20


def steps(count: int, seed: int, false_share: float = 0.0) -> Steps:
    """A drive that turns fully and tilts by up to 5 degrees."""
    generator = np.random.default_rng(seed)
    s = np.linspace(0, 1, count)
    angles = np.column_stack(
        [
            np.pi * np.sin(2 * np.pi * s),
            np.radians(5) * np.sin(6.6 * np.pi * s),
            np.radians(2.5) * np.cos(10 * np.pi * s),
        ]
    )
    R = Rotation.from_euler("ZYX", angles).as_matrix()
    positions = np.einsum("tij,rj->tri", R, ANTENNAS) - OFFSETS
    positions[:, :, :2] += np.column_stack([100 * s, 50 * s])[:, None]
    positions += generator.standard_normal(positions.shape) * 0.0064 * np.array([1, 1, 1.75])
    false = generator.random((count, 3)) < false_share
    direction = generator.standard_normal((count, 3, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    positions += FALSE_SIZE * false[..., None] * direction
    return Steps(RECEIVERS, np.arange(float(count)), positions, np.full((count, 3), 4), FRAME)


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Median processor time of one call, after one to warm up."""
    work()
    taken = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return median(taken)


def rms(values: npt.ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    print(f"{'steps':>8} {'closed form':>13} {'nested LM':>12} {'ratio':>7}   (processor time)")
    for count, rounds in ((600, 15), (60_000, 3)):
        data = steps(count, 1)
        direct = seconds(lambda data=data: estimate_offsets(data), rounds)
        nested = seconds(lambda data=data: nested_offsets(data, TAPE), max(rounds // 3, 1))
        print(f"{count:8d} {1000 * direct:10.1f} ms {1000 * nested:9.1f} ms {nested / direct:7.1f}")

    generator = np.random.default_rng(0)
    print("\nnested LM from offsets that are off by hundreds of metres (10 random starts):")
    data, good = steps(600, 1), 0
    for _ in range(10):
        found = nested_offsets(data, TAPE, OFFSETS + 300 * generator.standard_normal((3, 3)))
        good += np.abs(found.offsets.values - OFFSETS).max() < 0.05
    print(f"  {good} of 10 end within 5 cm of the truth; the closed form needs no start")

    errors = {"closed form, robust": [], "closed form, least squares": [], "nested LM": []}
    for seed in range(DRIVES):
        data = steps(600, seed, 0.02)
        runs = (
            estimate_offsets(data),
            estimate_offsets(data, robust=False),
            nested_offsets(data, TAPE),
        )
        for name, run in zip(errors, runs, strict=True):
            errors[name].append((run.offsets.values - OFFSETS)[1:])
    print(f"\nroot mean square error of the offsets with 2 % false fixes, {DRIVES} drives of 600:")
    for name, found in errors.items():
        print(f"  {name:28} {1000 * rms(found):7.2f} mm")

    once = seconds(lambda: reference_covariance(ANTENNAS, PUBLISHED_NOISE), 20)
    start, used = time.perf_counter(), time.process_time()
    sampled = simulated_covariance(ANTENNAS, PUBLISHED_NOISE, 10**7, np.random.default_rng(0))
    wall, used = time.perf_counter() - start, time.process_time() - used
    printed = np.array([1.4472e-5, 3.6903e-5, 1.0407e-4, 1.5434e-5, 5.2093e-5, 1.5840e-4])
    reference = reference_covariance(ANTENNAS, PUBLISHED_NOISE)
    worst = [100 * np.abs(np.diagonal(W) / printed - 1).max() for W in (reference, sampled)]
    print("\nW*, diagonal against the printed one (Eq. 23):")
    print(f"  first order   {1000 * once:6.2f} ms, off by {worst[0]:.2f} %")
    print(f"  10^7 samples  {used:6.2f} s of processor, off by {worst[1]:.2f} %")
    print(f"                {wall:6.2f} s by the clock, on two threads")


if __name__ == "__main__":
    main()
