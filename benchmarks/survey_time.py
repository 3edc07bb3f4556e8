"""`gtval survey` on a campaign of the document's size: process time and where it goes.

16 world points, 26 poses, 48 readings each. Whole processes in turn with one that only imports
the libraries; the user and system time of each is printed, and the ratio.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from process_time import show

ROUNDS = 7
ASKED = 2.5
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


if __name__ == "__main__":
    main()
