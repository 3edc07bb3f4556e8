"""Process time of whole commands, run in turn so that a busy machine is busy for all of them."""

import os
import resource
import subprocess
from statistics import median


def process_seconds(command: list[str]) -> float:
    """User and system time of a whole process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=one_thread)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def show(commands: dict[str, list[str]], rounds: int, base: str) -> None:
    """Median and least time of each command, and the ratio of its median to that of one of them.

    A first run of each, which fills the caches, is not counted.
    """
    for command in commands.values():
        process_seconds(command)
    taken: dict[str, list[float]] = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            taken[name].append(process_seconds(command))
    unit = median(taken[base])
    print(f"{'process time':26} {'median':>9} {'least':>9} {'ratio':>7}")
    for name, times in taken.items():
        print(f"{name:26} {median(times):7.2f} s {min(times):7.2f} s {median(times) / unit:7.2f}")
