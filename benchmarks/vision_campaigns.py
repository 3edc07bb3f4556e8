"""Rendered campaigns of four cameras and 26 stops: robot poses beside the document's way.

Each seed is a room of its own, made by `gtval simulate --vision` and computed by `gtval run`. One
line each for vision and for the document's way from the same images: stops with a pose; mean and
standard deviation of the errors against the truth; for vision the mean NEES against the
validation poses, with its 95 % interval. A seed takes a minute or two.

    python benchmarks/vision_campaigns.py [seed ...]
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from validation.cli import main as gtval
from validation.poses.angles import Array
from validation.poses.pose_table import from_csv, pose_difference

SYSTEMS = {"vision": "this package", "vision_as_published": "the document's way"}


def command(*words: str) -> str:
    """What a command prints."""
    done = CliRunner().invoke(gtval, list(words), catch_exceptions=False)
    if done.exit_code != 0:
        raise SystemExit(done.output)
    return done.stdout


def errors(folder: Path, system: str) -> Array:
    """(n, 3) errors against the truth: millimetres, millimetres, milliradians."""
    truth = from_csv(folder / "truth" / "poses.csv", system="truth")
    poses = from_csv(folder / "results" / f"poses_{system}.csv", system=system)
    return 1e3 * pose_difference(truth.select(poses.ids).poses, poses.poses)


def said(facts: dict, code: str) -> list[str]:
    """What findings of a kind say of vision."""
    return [f["text"] for f in facts["findings"] if f["code"] == code and f["subject"] == "vision"]


def show(seed: int, folder: Path) -> bool:
    """One room; whether vision is as good as asked."""
    command("simulate", str(folder), "--vision", "--seed", str(seed))
    facts = json.loads(command("run", str(folder), "--no-report", "--json"))
    good = True
    for system, name in SYSTEMS.items():
        off = errors(folder, system)
        mean, spread = off.mean(0), off.std(0, ddof=1)
        print(
            f"{seed:5d}  {name:18s}  {len(off):2d} stops   mean {mean[0]:+6.1f} {mean[1]:+6.1f} mm "
            f"{mean[2]:+6.2f} mrad   std {spread[0]:6.1f} {spread[1]:6.1f} mm {spread[2]:6.2f} mrad"
        )
        if system == "vision":
            good = bool((np.abs(mean) < [5, 5, 3]).all() and (spread < [10, 10, 5]).all())
    fits = said(facts, "nees_inside")
    for text in said(facts, "coverage") + fits:
        print(f"       {text}")
    return good and bool(fits)


def main(seeds: list[int]) -> None:
    met = []
    for seed in seeds:
        with tempfile.TemporaryDirectory() as name:
            met.append(show(seed, Path(name) / "campaign"))
    print("asked: means below 5 mm and 3 mrad, standard deviations below 10 mm and 5 mrad, NEES in")
    print(f"its interval: met by {sum(met)} of {len(met)} rooms")


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or [71])
