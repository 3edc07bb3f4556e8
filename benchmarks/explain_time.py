"""`gtval explain` on the AD2.3 campaign: process time, and how much of it is imports.

Whole processes in turn, their user and system time; asked is under 2 s for the explanation. Beside
it one process that only imports the libraries, and one that imports all that the explanation does.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROUNDS = 9
ASKED = 2.0
GTVAL = str(Path(sys.executable).with_name("gtval"))
LIBRARIES = "import numpy, scipy.special, pydantic, rich.table, rich.console"
OWN = "import validation.cli, validation.explain.section, validation.campaign"


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
        subprocess.run([GTVAL, "demo", campaign], check=True, stdout=subprocess.DEVNULL)
        commands = {
            "gtval explain CAMPAIGN": [GTVAL, "explain", campaign],
            "imports of the libraries": [sys.executable, "-c", LIBRARIES],
            "imports, gtval's own too": [sys.executable, "-c", f"{LIBRARIES}; {OWN}"],
            "python -c pass": [sys.executable, "-c", "pass"],
        }
        for command in commands.values():
            process_seconds(command)
        taken: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(ROUNDS):
            for name, command in commands.items():
                taken[name].append(process_seconds(command))
    bare = median(taken["imports of the libraries"])
    print(f"{'process time':26} {'median':>9} {'least':>9} {'to libraries':>13}")
    for name, times in taken.items():
        print(f"{name:26} {median(times):7.2f} s {min(times):7.2f} s {median(times) / bare:13.2f}")
    print(f"asked: under {ASKED:.0f} s")


if __name__ == "__main__":
    main()
