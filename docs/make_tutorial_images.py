"""The pictures of tutorial.md, from the campaign that it makes: `make images` after a change."""

import csv
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from validation.campaign.folder import load_campaign
from validation.figures.errors import error_map
from validation.figures.writing import write_figure
from validation.results import Figure, Section
from validation.run import run_campaign

IMAGES = Path(__file__).parent / "images"
ROOM = [
    *("simulate", "lab", "--seed", "3", "--stops", "14", "--blunders", "2", "--hand-points", "2"),
    *("--initial-guesses", "--bias", "0.04", "0", "0"),
]
"""As in the tutorial."""


def measure_again(campaign: Path) -> None:
    """Set the wrong readings aside and add right ones, as the tutorial does."""
    wrong = csv.DictReader((campaign / "truth" / "blunders.csv").read_text().splitlines())
    path = campaign / "survey" / "readings.csv"
    lines = path.read_text().splitlines()
    lines = [lines[0] + ",use,note", *(line + ",yes," for line in lines[1:])]
    for one in wrong:
        row = int(one["line"]) - 1
        time, start, end, distance, observer, *_ = lines[row].split(",")
        lines[row] = f"{time},{start},{end},{distance},{observer},no,measured again"
        right = float(distance) - float(one["size"])
        lines.append(f"2024-03-05T09:00,{start},{end},{right:.3f},B,yes,")
    path.write_text("\n".join(lines) + "\n")


def write_named(sections: Sequence[Section], name: str, path: Path) -> None:
    """Write one figure of a report."""
    figures = (block for section in sections for block in section.blocks)
    found = next(one for one in figures if isinstance(one, Figure) and one.name == name)
    write_figure(path, found.draw())


def main() -> None:
    """Write docs/images/tutorial_*.png."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "validation", *ROOM]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
        campaign = Path(folder) / "lab"
        wrong = run_campaign(load_campaign(campaign))
        write_named(wrong.sections, "reading-residuals", IMAGES / "tutorial_residuals.png")
        measure_again(campaign)
        right = run_campaign(load_campaign(campaign))
        write_named(right.sections, "robot-frames", IMAGES / "tutorial_survey.png")
        walls = right.campaign.settings.room.walls
        comparison = right.evaluations[0].comparison
        errors = error_map(comparison, walls=walls, landmarks=right.landmarks)
        write_figure(IMAGES / "tutorial_errors.png", errors)


if __name__ == "__main__":
    main()
