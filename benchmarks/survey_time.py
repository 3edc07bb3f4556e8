"""`gtval survey` on a campaign of the document's size: process time and where it goes.

16 world points, 26 poses, 48 readings each. Whole processes in turn with one that only imports
the libraries; the user and system time of each is printed, and the ratio.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROUNDS = 7
GTVAL = str(Path(sys.executable).with_name("gtval"))
LIBRARIES = "import numpy, pydantic, rich.table, scipy.sparse.linalg"


def process_seconds(command: list[str]) -> float:
    """User and system time of a whole process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=one_thread)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        campaign = str(Path(folder) / "campaign")
        subprocess.run(
            [GTVAL, "simulate", campaign, "--seed", "1"], check=True, stdout=subprocess.DEVNULL
        )
        commands = {
            "gtval survey": [GTVAL, "survey", campaign],
            "import of the libraries": [sys.executable, "-c", LIBRARIES],
            "python -c pass": [sys.executable, "-c", "pass"],
        }
        for command in commands.values():
            process_seconds(command)
        taken = {name: [] for name in commands}
        for _ in range(ROUNDS):
            for name, command in commands.items():
                taken[name].append(process_seconds(command))
    bare = median(taken["import of the libraries"])
    print(f"{'process time':26} {'median':>9} {'least':>9} {'to imports':>11}")
    for name, times in taken.items():
        print(f"{name:26} {median(times):7.2f} s {min(times):7.2f} s {median(times) / bare:11.2f}")


if __name__ == "__main__":
    main()
