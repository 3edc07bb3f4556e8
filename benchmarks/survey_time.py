"""`gtval survey` on campaigns of the document's size and larger: process time and memory.

16 world points, 26 poses (500, 2,000), 48 readings each. Whole processes in turn with one that
only imports the libraries; the user and system time of each is printed, and the ratio.
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from process_time import process_seconds, show

ROUNDS = 7
ASKED = 2.5
LARGE = {500: "4 s, 400 MB", 2000: "30 s, 1,000 MB, results/ 20 MB"}
"""Stops, and what is asked for at most."""
GTVAL = str(Path(sys.executable).with_name("gtval"))
LIBRARIES = "import numpy, pydantic, rich.table, scipy.sparse.linalg"


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
        show(commands, ROUNDS, "import of the libraries")
    print(f"asked: under {ASKED:g} s")
    for stops, asked in LARGE.items():
        large(stops, asked)


def large(stops: int, asked: str) -> None:
    """Once: time, memory and the size of the results of a large survey."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = Path(folder) / "campaign"
        command = [GTVAL, "simulate", str(campaign), "--seed", "1", "--stops", str(stops)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        unit = process_seconds([sys.executable, "-c", LIBRARIES])
        taken = process_seconds([GTVAL, "survey", str(campaign)])
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
        files = [path.stat().st_size for path in (campaign / "results").rglob("*.*")]
    print(
        f"{stops} stops: {taken:.2f} s, ratio {taken / unit:.1f} to the libraries, "
        f"{memory:.0f} MB of memory, results {sum(files) / 1e6:.1f} MB (asked: {asked})"
    )


if __name__ == "__main__":
    main()
