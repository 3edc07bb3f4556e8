"""The commands of what all systems share: run, compare, explain and the like."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "run",
        "validation.commands.run:run",
        "Do all that a campaign has data for: solve, compare, report.",
    ),
    Later(
        "open",
        "validation.commands.open_page:open_page",
        "Open one page for everything that needs a person, in the browser.",
    ),
    Later(
        "compare",
        "validation.commands.compare:compare",
        "Compare poses: REFERENCE with one or more SOURCE files, or a campaign's results.",
    ),
    Later(
        "report",
        "validation.commands.run:report",
        "Run a campaign and write its report: HTML, and tables as Markdown and LaTeX.",
    ),
    Later(
        "summary",
        "validation.commands.summary:summary",
        "Tell how the ground truth of several days was, and whether it got worse.",
    ),
    Later(
        "explain",
        "validation.commands.explain:explain",
        "Tell where errors come from: a mount, a frame, a few wrong poses, and whose.",
    ),
    Later(
        "sync",
        "validation.commands.sync:sync",
        "Tell how late the stamps of each SOURCE are by the clock of REFERENCE.",
    ),
    Later(
        "fuse",
        "validation.commands.fuse:fuse",
        "Fuse the poses of several SOURCES in one frame into one trajectory; smooth that of one.",
    ),
    Later(
        "convert",
        "validation.commands.convert:convert",
        "Convert a trajectory: poses at times, from one format of file to another.",
    ),
    Later(
        "clean",
        "validation.commands.clean:clean",
        "Remove what is kept of earlier runs: detections, matches, trials.",
    ),
]
