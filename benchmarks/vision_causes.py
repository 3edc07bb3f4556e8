"""What is wrong with rendered campaigns of images is named first, and nothing is invented.

Each seed is a room with two cameras and eight stops, rendered and solved as it is, and then once
with each mistake that people make: in campaign.toml, in camera files, in names of images, or in the
room itself, of which the stops are then rendered anew. A line a campaign: whether the cause was
named first, and what was said; of the good one also its poses against the truth. A seed takes a
minute and a half.

    python benchmarks/vision_causes.py --seeds 901 902 [--only marker_side] [--cameras 4]
"""

import argparse
import re
import shutil
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from trials.vision_mistakes import (
    MISTAKES,
    NOTHING,
    REFUSED,
    Case,
    Expected,
    ImpossibleError,
    Mistake,
)
from trials.vision_rooms import Room, made, score, solve

from validation.errors import GtvalError
from validation.results import Finding
from vision_gt.campaign.findings import vision_findings
from vision_gt.campaign.outcome import VisionOutcome

CAUSES = {
    "print_size",
    "focal_length",
    "exchanged",
    "camera_moved",
    "marker_moved",
    "reference_turned",
    "reference_place",
    "bar_place",
    "dima_place",
    "corner_noise",
}
"""Codes of findings that name a cause."""
WRONG_BOARD = re.compile(r"stated\.|rows and columns exchanged")
"""What is said of images of a board that was stated wrongly."""


def named(outcome: VisionOutcome) -> list[Finding]:
    """Causes that are told, the first first."""
    found = vision_findings(outcome)
    return [
        one
        for one in found
        if one.code in CAUSES
        or (one.code == "image" and WRONG_BOARD.search(one.text))
        or (one.code == "part_missing" and "Probably" in one.text)
    ]


def right(told: list[Finding], expected: Expected) -> bool:
    """Whether the first cause is the one."""
    if expected.code == NOTHING:
        return not told
    if not told or not re.fullmatch(expected.code, told[0].code):
        return False
    said = re.split(" Or: | The images alone", told[0].text)[0]
    words = all(re.search(w, said) for w in expected.words) and expected.moment(said)
    return words and (told[0].severity == "error" or not expected.error)


def spoilt(room: Room, folder: Path, mistake: Mistake, seed: int) -> tuple[bool, list[Finding]]:
    """Whether a mistake is named first, and the causes that are told."""
    shutil.copytree(room.folder, folder)
    expected = mistake(Case(room, folder, np.random.default_rng(seed)))
    try:
        told = named(solve(folder, 1))
    except GtvalError as error:
        told = [Finding("error", str(error), "vision", REFUSED)]
    return right(told, expected), told


def main() -> None:
    """Print the lines, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[901])
    parser.add_argument("--only", nargs="*", default=list(MISTAKES))
    parser.add_argument("--cameras", type=int, default=2)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    met, tried = Counter[str](), Counter[str]()
    for seed in given.seeds:
        with tempfile.TemporaryDirectory() as name:
            begin = time.process_time()
            room = made(Path(name) / "good", seed, given.cameras, given.workers)
            told = named(room.good)
            tried["clean"] += 1
            met["clean"] += not told
            lines = [f"{one.severity} {one.text}" for one in told]
            spent, (rms, nees) = time.process_time() - begin, score(room)
            print(
                f"{seed} clean {not told} {spent:.0f} s; poses {1e3 * rms:.1f} mm, NEES {nees:.2f}",
                *lines,
                sep="\n    ",
            )
            for what in given.only:
                begin = time.process_time()
                try:
                    good, told = spoilt(room, Path(name) / what, MISTAKES[what], seed)
                except ImpossibleError as error:
                    print(f"{seed} {what} not made: {error}", flush=True)
                    continue
                tried[what] += 1
                met[what] += good
                lines = [f"{one.severity} {one.subject}: {one.text[:160]}" for one in told]
                spent = f"{time.process_time() - begin:.0f} s"
                print(f"{seed} {what} {good} {spent}", *lines, sep="\n    ", flush=True)
    for what, count in tried.items():
        print(f"{what:20s} {met[what]:3d} of {count}")


if __name__ == "__main__":
    main()
