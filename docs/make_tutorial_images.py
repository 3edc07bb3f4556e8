# ruff: noqa: INP001  (a script, in no package)
"""The pictures of tutorial.md, from the campaign that it makes: run `make images` after a change."""

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from validation.campaign.folder import load_campaign
from validation.figures.errors import error_map
from validation.figures.writing import write_figure
from validation.results import Figure, Section
from validation.run import RunResult, run_campaign

IMAGES = Path(__file__).parent / "images"
ROOM = (
    "lab --seed 7 --stops 14 --blunders 2 --hand-points 2 --initial-guesses --bias 0.04 0 0".split()
)


def simulated(folder: Path, arguments: list[str]) -> RunResult:
    """A run of the campaign that `gtval simulate` makes in a folder."""
    command = [sys.executable, "-m", "validation", "simulate", *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
    return run_campaign(load_campaign(folder / arguments[0]))


def figure_named(sections: tuple[Section, ...], name: str) -> Figure:
    """One figure of a report."""
    figures = (block for section in sections for block in section.blocks)
    return next(one for one in figures if isinstance(one, Figure) and one.name == name)


def main() -> None:
    """Write docs/images/tutorial_*.png."""
    with tempfile.TemporaryDirectory() as folder:
        wrong = simulated(Path(folder), ROOM)
        residuals = figure_named(wrong.sections, "reading-residuals").draw()
        write_figure(IMAGES / "tutorial_residuals.png", residuals)
    without = [*ROOM[:5], *ROOM[7:]]
    with tempfile.TemporaryDirectory() as folder:
        right = simulated(Path(folder), without)
        survey = figure_named(right.sections, "robot-frames").draw()
        write_figure(IMAGES / "tutorial_survey.png", survey)
        comparison = right.evaluations[0].comparison
        walls = right.campaign.settings.room.walls
        errors = error_map(comparison, walls=walls, landmarks=right.landmarks)
        write_figure(IMAGES / "tutorial_errors.png", errors)


if __name__ == "__main__":
    main()
