"""Comparing 100,000 poses with 100,000, beside evo_ape on the same poses.

Whole processes, reading included, one thread each; the files hold times, positions and
quaternions, evo's in its own format. Both align a frame.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from process_time import show
from scipy.spatial.transform import Rotation

POSES = 100_000
ROUNDS = 3
BIN = Path(sys.executable).parent


def write(folder: Path, name: str, rng: np.random.Generator) -> None:
    """NAME.csv, NAME.tum: a robot that goes in curves, at 100 Hz."""
    t = np.arange(POSES) * 0.01
    noise = 0.005 * rng.standard_normal((POSES, 3))
    turned = Rotation.from_euler("ZYX", np.column_stack([t / 5, 0.1 * np.sin(t), 0.1 * np.cos(t)]))
    xyz = np.column_stack([5 * np.cos(t / 7), 4 * np.sin(t / 5), np.sin(t / 9)]) + noise
    rows = np.column_stack([t, xyz, turned.as_quat()])
    form = {"fmt": "%.9f"}
    header = "time,x,y,z,qx,qy,qz,qw"
    np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", **form)
    np.savetxt(folder / f"{name}.tum", rows, **form)


def main() -> None:
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name in ("reference", "source"):
            write(folder, name, rng)
        csv = [str(folder / f"{name}.csv") for name in ("reference", "source")]
        tum = [str(folder / f"{name}.tum") for name in ("reference", "source")]
        commands = {
            "evo_ape": [str(BIN / "evo_ape"), "tum", *tum, "--align"],
            "gtval compare": [str(BIN / "gtval"), "compare", *csv, "--align", "frame"],
            "gtval compare --json": [
                *(str(BIN / "gtval"), "compare", *csv, "--align", "frame", "--json")
            ],
        }
        show(commands, ROUNDS, "evo_ape")


if __name__ == "__main__":
    main()
