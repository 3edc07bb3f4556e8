"""Start-up: how long `gtval --help` takes, beside Python itself and Python with click.

Whole processes, timed in turn so that a busy machine is busy for all of them; the median and
the fastest of each are printed, and their ratios to bare Python.
"""

import subprocess
import sys
import time
from pathlib import Path
from statistics import median

ROUNDS = 25
GTVAL = str(Path(sys.executable).with_name("gtval"))
COMMANDS = {
    "python -c pass": [sys.executable, "-c", "pass"],
    "python -c 'import click'": [sys.executable, "-c", "import click"],
    "python -c 'import numpy'": [sys.executable, "-c", "import numpy"],
    "gtval --version": [GTVAL, "--version"],
    "gtval --help": [GTVAL, "--help"],
}


def seconds(command: list[str]) -> float:
    """Wall time of a whole process."""
    started = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started


def main() -> None:
    for command in COMMANDS.values():
        seconds(command)  # the first run fills the caches
    taken = {name: [] for name in COMMANDS}
    for _ in range(ROUNDS):
        for name, command in COMMANDS.items():
            taken[name].append(seconds(command))
    bare = median(taken["python -c pass"])
    print(f"{'whole process':26} {'median':>9} {'fastest':>9} {'ratio':>7}")
    for name, times in taken.items():
        middle = median(times)
        print(f"{name:26} {1000 * middle:6.0f} ms {1000 * min(times):6.0f} ms {middle / bare:7.2f}")


if __name__ == "__main__":
    main()
