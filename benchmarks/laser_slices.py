"""Stops out of a log of a real building: how many are placed, and what is accepted and wrong.

Slices of 40 scans, every first, second, third and sixth of the log of building 079 in Freiburg,
are campaigns of their own: half a turn, the first stop surveyed, guesses from the odometry of the
log or (``--drift 1``) from one that drifts. The log's own poses, made by another program, are off
by 36 mm in the median of relations that were checked by hand, and by up to 0.4 m here and there.
So an accepted match that is further from them than 5 cm or 2 degrees and three standard deviations
counts as wrong unless PLICP, started at the log's pose, agrees with it, and more points of its
scans lie on the other. Needs the folder laser/fr079 of real scans.
"""

import gzip
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from laser_freiburg import FOLDER, OFFSET, drifting
from laser_lines import Lines, arguments
from trials.plicp import plicp

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.campaign.solve import solve_campaign
from laser_gt.logs.carmen import read_carmen
from laser_gt.matching.verdicts import Match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose, inverse, transform, wrapped
from validation.campaign.folder import load_campaign
from validation.poses.angles import Array
from validation.solving import solve_validation
from validation.systems import installed_systems

STOPS = 40
ASKED = {1: 0.9, 2: 0.85, 3: 0.75, 6: 0.5}
"""Share of the stops that must be placed, by how many scans apart they are."""
CLOSE = np.array([0.05, np.deg2rad(2)])
SIGMAS = 3.0
TOML = """name = "slice"

[instrument]
model = "none"

[vframe]

[robot_frame]

[survey]
published_sigmas = [0.03, 0.03, 0.02]

[laser]
genetic = false
format = "carmen"
scans = "laser/log.log"

[laser.scanners.front]
mount = [{0}, {1}, {2}]
"""


def written(folder: Path, lines: Sequence[str], times: Array, odometry: Array, row: Array) -> None:
    """A campaign of the scans in some rows of the log, with some odometry."""
    for name in ("laser", "survey"):
        (folder / name).mkdir()
    log, last = [], len(lines[0].split()) - 14
    for one in range(max(row[0] - 3, 0), min(row[-1] + 4, len(lines))):
        words = lines[one].split()
        poses = [*compose(odometry[one], OFFSET), *odometry[one]]
        words[last : last + 6] = [f"{value:.6f}" for value in poses]
        log.append(" ".join(words))
    stops = [f"{number + 1},{times[one]:.6f}" for number, one in enumerate(row)]
    x, y, theta = odometry[row[0]]
    texts = {
        "laser/log.log": [*log],
        "laser/stops.csv": ["pose,time", *stops],
        "survey/published_poses.csv": ["pose,x,y,theta", f"1,{x:.6f},{y:.6f},{theta:.6f}"],
        "campaign.toml": [TOML.format(*OFFSET)],
    }
    for name, text in texts.items():
        (folder / name).write_text("\n".join(text) + "\n", encoding="utf-8")


def solved(folder: Path) -> LaserOutcome:
    """What laser GT makes of it."""
    campaign = solve_validation(load_campaign(folder), installed_systems())
    return solve_campaign(campaign, engines=("scanmatch",), need_poses=False)


def beyond(off: Array, covariance: Array) -> bool:
    """Whether a difference, (3,), is beyond what is close and stated."""
    sigmas = np.sqrt([np.trace(covariance[:2, :2]), covariance[2, 2]])
    size = np.array([np.hypot(off[0], off[1]), abs(off[2])])
    return bool((size > CLOSE + SIGMAS * sigmas).any())


def wrong(one: Match, outcome: LaserOutcome, logged: Array) -> bool:
    """Whether an accepted match is wrong, (3,) being the log's pose of it."""
    if not beyond(wrapped(logged - one.pose), one.covariance):
        return False
    sweeps = outcome.inputs.by_stop
    reference, moving = sweeps[one.reference], sweeps[one.moving]
    peer = plicp(reference.sweep.points, moving.sweep.points, logged)
    ours, theirs = (_in_common(reference, moving, pose) for pose in (one.pose, logged))
    return ours < theirs or beyond(wrapped(peer - one.pose), one.covariance)


def _in_common(reference: Prepared, moving: Prepared, pose: Array) -> float:
    """Share of the points of both scans that lie within `CLOSE` of a point of the other."""
    there = reference.tree.query(transform(pose, moving.sweep.points))[0]
    back = moving.tree.query(transform(inverse(pose), reference.sweep.points))[0]
    return float((np.append(there, back) < CLOSE[0]).mean())


def show(lines: Lines, starts: Sequence[int], *, drift: bool) -> None:
    """One line for each spacing, and one for all accepted matches."""
    records = read_carmen(FOLDER / "fr079.log.gz")
    with gzip.open(FOLDER / "fr079.log.gz", "rt", encoding="ascii") as file:
        log = [line for line in file.read().splitlines() if line.startswith("ROBOTLASER1")]
    times = np.array([record.scan.time for record in records])
    logged = np.array([record.odometry for record in records])
    odometry = drifting(logged) if drift else logged
    laser = compose(logged, np.broadcast_to(OFFSET, logged.shape))
    accepted = far = bad = 0
    for step, share in ASKED.items():
        placed = total = 0
        for start in starts:
            row = start + step * np.arange(STOPS)
            if row[-1] >= len(log):
                continue
            with tempfile.TemporaryDirectory() as name:
                written(Path(name), log, times, odometry, row)
                outcome = solved(Path(name))
            total += STOPS
            placed += sum(len(one.stops) for one in outcome.solutions.values())
            for one in outcome.matchings["scanmatch"].accepted:
                first, second = row[int(one.reference) - 1], row[int(one.moving) - 1]
                truth = between(laser[first], laser[second])
                accepted += 1
                far += beyond(wrapped(truth - one.pose), one.covariance)
                bad += wrong(one, outcome, truth)
        lines.share(f"stops placed, {step} scans apart", placed, total, share)
    what = f"accepted and wrong, of {accepted}"
    lines.show(what, f"{bad}", "0", met=bad == 0)
    print(f"  {far - bad} more are further from the log's poses; scans and PLICP side with them")


if __name__ == "__main__":
    chosen = arguments(__doc__, 5, slices=7, drift=0)
    if not FOLDER.is_dir():
        raise SystemExit(f"no real scans at {FOLDER}; set GTVAL_REAL_DATA")
    starts = chosen.seed + np.linspace(0, 1215, chosen.slices).astype(int)
    show(Lines(), starts.tolist(), drift=bool(chosen.drift))
