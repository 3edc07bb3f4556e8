"""Every command of the program, and a use of each on small samples."""

from collections.abc import Iterator

import click

from validation.cli import main

BOARD = "--columns 10 --rows 6 --square 0.1"
USES = {
    "accuracy": "{room} --start 1 --end 2 --dx 0.01 --dy 0.01 --dtheta 0.02",
    "clean": "{room} --dry-run",
    "compare": "{ad23}",
    "convergence": "{room} --starts 20",
    "convert": "{files}/motion.tum {out}.csv",
    "demo": "{out}",
    "enter": "{room} --status",
    "explain": "{ad23}",
    "fuse": "{files}/camera.csv --output {out}.csv",
    "instrument-check": "{room}/survey/known_lengths.csv --tolerance 0.0015",
    "journal-merge": "{entered}",
    "laser check-mount": "{room} --pair 2-3",
    "laser drive": "{scanned} --dry-run",
    "laser decide": "{decided} 1 2 reject",
    "laser inspect": "{decided}",
    "laser solve": "{room} --dry-run",
    "open": "{room} --status",
    "plan": "{room}",
    "report": "{room}",
    "rtk camera": "{drive} left_camera {drive}/sensors/left_camera_points.csv --lens {lens}",
    "rtk clock": "{drive} {drive}/sensors/imu.csv",
    "rtk cloud": "{drive} left_scanner {drive}/scans/left_scanner.csv {out}.ply",
    "rtk coverage": "{drive}",
    "rtk dgps": "{drive} {drive}/sensors/consumer.nmea",
    "rtk export": "{solved} --to {out}.geojson",
    "rtk imu": "{drive} {drive}/sensors/imu.csv",
    "rtk noise": "{files}/standing.csv",
    "rtk plan": "--almanac {files}/sky.alm --day 2026-11-30 --at 45.5 9.2 150",
    "rtk reference-covariance": "{drive} --samples 1000",
    "rtk run": "{drive} --dry-run",
    "rtk scanner": "{drive} left_scanner {drive}/scans/left_scanner.csv --ground -2.2",
    "rtk sensor-path": "{drive} left_camera {files}/times.csv --output {out}.csv",
    "rtk solve": "{drive} --dry-run",
    "run": "{room} --no-report",
    "simulate": "{out} --stops 3 --world-points 6",
    "simulate-almanac": "{out}.alm --day 2026-11-30",
    "simulate-drive": "{out} --loops 1",
    "simulate-motion": "{out} --minutes 0.5",
    "study": "{files}/study.toml --folder {out} --workers 1",
    "summary": "{ad23} --page {out}.html",
    "survey": "{room} --dry-run",
    "vision calibrate": "{vision}/vision/calibration/1 --workers 1 {board}",
    "vision check-displacement": "{vision}/truth/camera_1.yaml "
    "{vision}/vision/displacement/1/first.png {vision}/vision/displacement/1/second.png 0.6 "
    "{board}",
    "vision check-survey": "{vision} --workers 1",
    "vision check-table": "{vision} --workers 1",
    "sync": "{files}/camera.csv {files}/motion.tum",
    "vision convert-camera": "{vision}/truth/camera_1.yaml {out}.yaml --format ros",
    "vision decide": "{vision} vision/calibration/1/01.png use",
    "vision look": "{vision} --stop 1 --workers 1 --output {out}",
    "vision plan": "{files}/hall",
    "vision pose": "{vision}/vision/calibration/1/01.png "
    "--intrinsics {vision}/truth/camera_1.yaml {board}",
    "vision print-patterns": "{out} --campaign {vision} --svg",
    "vision solve": "{vision} --workers 1 --dry-run",
    "walls-check": "{room}/survey/walls.csv --tolerance 0.0015",
}
"""Arguments of each command; the samples are made by the fixture of their name."""
FORMS = {
    "compare: trajectories": "{motion}/gt/mocap.csv {motion}/gt/camera_2.csv --align frame+time",
    "compare: at stops": "{motion}/gt/survey.csv {motion}/gt/mocap.csv --stops {motion}/stops.csv",
    "explain: trajectories": "{motion}/gt/mocap.csv {motion}/gt/camera_2.csv",
    "fuse: with odometry": "{motion}/gt/mocap.csv --odometry {motion}/gt/odometry.csv "
    "--output {out}.csv",
    "rtk plan: base and log": "--almanac {files}/sky.alm --log {drive}/rtk/rear.nmea "
    "--base 36.715 -4.479 40 --mask 15",
    "simulate-motion: a scanner": "{out} --minutes 0.5 --laser",
    "sync: a drive": "{motion}/gt/odometry.csv {motion}/gt/mocap.csv",
}
"""Other forms of a command, by its name and what they are of."""


def commands() -> Iterator[tuple[str, click.Command]]:
    """The names and commands of all that is no group."""

    def below(group: click.Group, names: tuple[str, ...]) -> Iterator[tuple[str, click.Command]]:
        context = click.Context(group)
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            assert command is not None
            if isinstance(command, click.Group):
                yield from below(command, (*names, name))
            else:
                yield " ".join((*names, name)), command

    return below(main, ())
