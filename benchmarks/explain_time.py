"""`gtval explain` on the AD2.3 campaign: process time, and how much of it is imports.

Whole processes in turn, their user and system time; asked is under 2 s for the explanation. Beside
it one process that only imports the libraries, and one that imports all that the explanation does.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from process_time import show

ROUNDS = 9
ASKED = 2.0
GTVAL = str(Path(sys.executable).with_name("gtval"))
LIBRARIES = "import numpy, scipy.special, pydantic, rich.table, rich.console"
OWN = "import validation.cli, validation.explain.telling.section, validation.campaign.folder"


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
        show(commands, ROUNDS, "imports of the libraries")
    print(f"asked: under {ASKED:g} s")


if __name__ == "__main__":
    main()
