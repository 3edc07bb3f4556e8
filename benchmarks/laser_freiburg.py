"""Real scans of building 079, Freiburg, against relative poses checked by hand.

The 136 relations that have both scans in the log, joined by time stamps to 0.1 ms, are matched from
the logged poses as guess, as logged and corrected for the motion of the robot during a scan, beside
kiss-icp, small_gicp and PLICP, which see the same scans from the same guesses; then the whole log
becomes a trajectory, from the logged odometry and from one that drifts. How
well the relations themselves can be trusted shows in their own loops. Needs the folder laser/fr079
(environment variable GTVAL_REAL_DATA); prints nothing but that where it is missing.
"""

import os
import resource
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from laser_lines import Lines, arguments
from laser_matching import small_gicp
from trials.plicp import plicp
from trials.scan_pairs import ScanPair

from laser_gt.driving.drive import solve_log
from laser_gt.driving.log import DriveInputs
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.logs.carmen import read_carmen
from laser_gt.logs.motion import MirrorTiming, undistorted_records
from laser_gt.logs.records import ScanRecord
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.kiss import register
from laser_gt.matching.verdicts import Match
from laser_gt.placing.graph import Edge
from laser_gt.placing.guesses import GENEROUS, guess_scatter
from laser_gt.placing.mounts import MountEstimate, mount_of
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose, inverse, wrapped
from laser_gt.scans.scan import sweep
from validation.poses.angles import Array, wrap
from validation.poses.factored import Factored

DATA = Path(os.environ.get("GTVAL_REAL_DATA", Path(__file__).parents[2] / "shared" / "real"))
FOLDER = DATA / "laser" / "fr079"
OFFSET = np.array([-0.04, 0.0, 0.0])
"""The laser in the robot frame, as the data set states it."""
TIMING = MirrorTiming(1 / 75, 2)
JOINED = 1e-4
"""Seconds by which the stamps of a relation may differ from those of the scans: they are written to
microseconds; a millisecond joins scans that are not the relation's."""
WORKERS = 2
RELATION_SIGMAS = (0.02, 0.02, 0.005)


class Relations:
    """The relations with both scans in the log, and what is compared with them."""

    def __init__(self, rows: Array, records: list[ScanRecord]) -> None:
        times = np.array([record.scan.time for record in records])
        nearest = np.abs(times - rows[:, :2, None]).argmin(-1)
        both = (np.abs(times[nearest] - rows[:, :2]) < JOINED).all(-1)
        self.pairs = nearest[both]
        self.poses = rows[both][:, [2, 3, 7]]
        laser = np.array([record.laser_odometry for record in records])
        self.guesses = between(laser[self.pairs[:, 0]], laser[self.pairs[:, 1]])

    def differences(self, laser_poses: Array, offset: Array) -> Array:
        """(n, 3) matches, moved to the robot frame by the laser's offset, less the relations."""
        robot = compose(compose(offset, laser_poses), inverse(offset))
        difference = robot - self.poses
        difference[:, 2] = wrap(difference[:, 2])
        return difference

    def prepared(self, records: list[ScanRecord]) -> dict[int, Prepared]:
        """The scans that the relations name."""
        return {i: Prepared(sweep(records[i].scan, str(i))) for i in np.unique(self.pairs).tolist()}


def guess_settings(found: list[Match]) -> MatchSettings:
    """What the accepted matches say of the guesses: nothing of the relations is used."""
    scatter = guess_scatter(found)
    assert scatter is not None, "hardly any match was accepted"
    length, angle = GENEROUS * scatter
    return MatchSettings(guess_length=float(length), guess_angle=float(angle))


def median_with_interval(lengths: Array) -> tuple[float, float, float]:
    """Median in millimetres, and 95 % interval of it by drawing the pairs again."""
    rng = np.random.default_rng(0)
    drawn = np.median(rng.choice(lengths, (2000, len(lengths))), axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(np.median(lengths) * 1e3), float(low * 1e3), float(high * 1e3)


def show_matches(lines: Lines, name: str, relations: Relations, found: list[Match]) -> None:
    """Median difference, bias with and without the offset, verdicts, and the offset found."""
    poses = np.array([one.pose for one in found])
    difference = relations.differences(poses, OFFSET)
    length = np.hypot(*difference[:, :2].T)
    median, low, high = median_with_interval(length)
    lines.at_most(f"{name}: median difference of {len(found)}", median, 26, "mm")
    print(f"  drawn again {low:.1f} to {high:.1f} mm; by verdict:")
    for verdict in ("accepted", "imprecise", "may be wrong", "refuted"):
        chosen = np.array([one.verdict == verdict for one in found])
        if chosen.any():
            median, largest = np.median(length[chosen]) * 1e3, length[chosen].max() * 1e3
            turned = np.median(np.abs(difference[chosen, 2])) * 1e3
            print(f"    {verdict}: {chosen.sum()}, median {median:.1f} mm, {turned:.1f} mrad, "
                  f"largest {largest:.0f} mm")  # fmt: skip
    bias = np.median(difference[:, :2], axis=0) * 1e3
    without = np.median(relations.differences(poses, np.zeros(3))[:, :2], axis=0) * 1e3
    gone = bool(
        (np.abs(bias) < 1.2533 * 1e3 * difference[:, :2].std(0) / np.sqrt(len(found))).all()
    )
    lines.show(f"{name}: bias with the offset", f"({bias[0]:+.1f}, {bias[1]:+.1f}) mm",
               "within its deviation", met=gone)  # fmt: skip
    print(f"  without the offset ({without[0]:+.1f}, {without[1]:+.1f}) mm")
    kept = [i for i, one in enumerate(found) if one.verdict != "refuted"]
    estimate = mount_from(relations.poses[kept], [found[i] for i in kept])
    near = np.abs(estimate.mount[:2] - OFFSET[:2]) < 2.5 * estimate.sigmas[:2]
    figure = f"{estimate.mount[0]:.4f}, {estimate.mount[1]:+.4f} +- {estimate.sigmas[0]:.4f} m"
    lines.show(f"{name}: offset found", figure, "-0.04, 0 m", met=bool(near.all()))


def mount_from(motions: Array, matches: Sequence[Match]) -> MountEstimate:
    """The mount from motions of the robot and their matches, each motion with stops of its own."""
    n = len(motions)
    poses, own = np.zeros((n, 2, 3)), np.zeros((n, 2, 3, 3))
    poses[:, 1] = motions
    own[:, 0], own[:, 1] = np.eye(3) * 1e-12, np.diag(RELATION_SIGMAS) ** 2
    edges = [Edge(2 * i, 2 * i + 1, one.pose, one.covariance) for i, one in enumerate(matches)]
    return mount_of(poses.reshape(-1, 3), Factored.alone(own.reshape(-1, 3, 3)), edges, np.zeros(3))


def show_loops(rows: Array) -> None:
    """How far loops of the relations are from closing: nobody can agree with them better."""
    known = {(a, b): pose for a, b, pose in zip(*rows.T[:2], rows[:, [2, 3, 7]], strict=True)}
    known |= {(b, a): inverse(pose) for (a, b), pose in list(known.items())}
    neighbours: dict[float, list[float]] = defaultdict(list)
    for a, b in known:
        neighbours[a].append(b)
    open_by = []
    for (a, b), pose in known.items():
        if b - a < 10:
            continue  # start from relations that close a loop
        for c in neighbours[b]:
            for d in neighbours[a]:
                if abs(c - b) < 10 and abs(d - a) < 10 and (c, d) in known:
                    way = compose(compose(pose, known[b, c]), compose(known[c, d], known[d, a]))
                    open_by.append(np.hypot(*way[:2]))
    median = float(np.median(open_by)) * 1e3
    print(f"  loops of four relations: {len(open_by)}, open by {median:.0f} mm in the median; "
          f"if all four share it, each is off by {median / 2:.0f} mm")  # fmt: skip


def peers_of(relations: Relations, scans: dict[int, Prepared]) -> dict[str, Array]:
    """(n,) differences in metres of the peers' matches from the same guesses."""

    def by_kiss(reference: Prepared, moving: Prepared, guess: Array) -> Array:
        return register(reference, moving, guess, 0.3)

    def by_gicp(reference: Prepared, moving: Prepared, guess: Array) -> Array:
        return small_gicp(ScanPair(reference.sweep, moving.sweep, guess, guess, "real"))

    def by_plicp(reference: Prepared, moving: Prepared, guess: Array) -> Array:
        return plicp(reference.sweep.points, moving.sweep.points, guess)

    methods: dict[str, Callable[[Prepared, Prepared, Array], Array]] = {
        "kiss-icp": by_kiss,
        "small_gicp": by_gicp,
        "PLICP": by_plicp,
    }
    lengths = {}
    for name, method in methods.items():
        try:
            poses = [
                method(scans[i], scans[j], guess)
                for (i, j), guess in zip(relations.pairs.tolist(), relations.guesses, strict=True)
            ]
        except ImportError:
            print(f"  {name}: not installed (pip install 'gtval[bench]')")
            continue
        lengths[name] = np.hypot(*relations.differences(np.array(poses), OFFSET)[:, :2].T)
    return lengths


def quantiles(lengths: Array) -> tuple[float, float]:
    """Median and 90 % quantile in millimetres."""
    return float(np.median(lengths) * 1e3), float(np.quantile(lengths, 0.9) * 1e3)


def compare(lines: Lines, name: str, ours: Array, peers: dict[str, Array]) -> None:
    """Median and 90 % quantile, ours not above those of PLICP and small_gicp."""
    median, high = quantiles(ours)
    print(f"  {name}, ours: median {median:.1f} mm, 90 % below {high:.1f} mm")
    for peer, lengths in peers.items():
        other, other_high = quantiles(lengths)
        print(f"  {name}, {peer}: median {other:.1f} mm, 90 % below {other_high:.1f} mm")
        if peer != "kiss-icp":
            lines.at_most(f"{name}: median beside {peer}", median, round(other, 2), "mm")
            lines.at_most(f"{name}: 90 % beside {peer}", high, round(other_high, 2), "mm")


def drifting(odometry: Array) -> Array:
    """Odometry with scales that are 2 % wrong, a bias to the left, and slip."""
    rng = np.random.default_rng(0)
    steps = between(odometry[:-1], odometry[1:]) * [1.02, 1.02, 1.02]
    way = np.hypot(*steps[:, :2].T)
    steps[:, 2] += 0.01 * way + 0.02 * np.sqrt(way) * rng.normal(size=len(steps))
    steps[:, 0] += 0.03 * np.sqrt(way) * rng.normal(size=len(steps))
    poses = [odometry[0]]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def show_drive(lines: Lines, name: str, records: list[ScanRecord], rows: Array, odo: Array) -> None:
    """The whole log as a trajectory: time, memory, share placed, relations."""
    times = np.array([record.scan.time for record in records])
    inputs = DriveInputs(
        {"front": [record.scan for record in records]},
        {"front": Sensor(OFFSET, TIMING)},
        np.array([0.002, 0.002, 0.002]),
        Odometer(times, odo),
    )
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    found = solve_log(inputs, WORKERS, lambda _what, _share: None)
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    own, others = (
        after.ru_utime - before.ru_utime for after, before in zip(both, used, strict=True)
    )
    # What the processes share is done at once, the rest one after the other.
    lines.at_most(f"{name}: seconds on two cores", own + others / WORKERS, 70, "s")
    memory = both[0].ru_maxrss / 1e3 + WORKERS * both[1].ru_maxrss / 1e3
    lines.at_most(f"{name}: memory of all processes", memory, 1000, "MB")
    lines.share(f"{name}: scans placed", int(found.matched.sum()), len(records), 0.95)
    poses = found.trajectory.poses
    relations = Relations(rows, records)
    first, second = relations.pairs.T
    off = wrapped(between(poses[first], poses[second]) - relations.poses)
    median, high = quantiles(np.hypot(*off[:, :2].T))
    lines.at_most(f"{name}: median of the relations", median, 30, "mm")
    print(f"  90 % below {high:.1f} mm; {found.loops} loops, {found.switched_off} switched off")


if __name__ == "__main__":
    arguments(__doc__, 0)
    if not FOLDER.is_dir():
        raise SystemExit(f"no real scans at {FOLDER}; set GTVAL_REAL_DATA")
    rows = np.loadtxt(FOLDER / "fr079.relations")
    records = read_carmen(FOLDER / "fr079.log.gz")
    relations = Relations(rows, records)
    show_loops(rows)
    corrected = undistorted_records(records, {"front": TIMING}, {"front": OFFSET})
    lines = Lines()
    # Before the matches, whose memory would count: what a process has used at most is known only.
    logged = np.array([record.odometry for record in records])
    show_drive(lines, "drive", records, rows, logged)
    show_drive(lines, "drive, odometry that drifts", records, rows, drifting(logged))
    guess = np.hypot(*relations.differences(relations.guesses, OFFSET)[:, :2].T)
    print(f"  the guess itself: median {np.median(guess) * 1e3:.1f} mm")
    for name, log in (("as logged", records), ("corrected for motion", corrected)):
        scans = relations.prepared(log)
        peers = peers_of(relations, scans)
        settings = MatchSettings()
        for step in ("rough guess", "guess as the accepted say"):
            found = [
                match(scans[i], scans[j], guess, settings)
                for (i, j), guess in zip(relations.pairs.tolist(), relations.guesses, strict=True)
            ]
            print(f"guess good to {settings.guess_length:.3f} m, {settings.guess_angle:.3f} rad:")
            show_matches(lines, f"{name}, {step}", relations, found)
            poses = np.array([one.pose for one in found])
            ours = np.hypot(*relations.differences(poses, OFFSET)[:, :2].T)
            compare(lines, f"{name}, {step}", ours, peers)
            settings = guess_settings(found)
