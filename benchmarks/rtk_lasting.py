"""Errors of receivers that last: what is found of them, and what covariances say under them.

Drives of a vehicle that the program does not know (`trials.lasting_errors`): jumps of all
receivers, restarts of the base station of two, false fixes of one, clean hours; then offsets and
poses with slow errors against the truth, and clocks that are off. The same errors in drives of a
rougher kind (`trials.rough_drives`), and clean hours of these. Numbers on the command line: first
seed, drives a condition, and what is run ("jumps", "alone", "hours", "slow", "clocks", "rough",
"rough_hours" or "all").
"""

import sys
import time
from dataclasses import replace

import numpy as np
from trials import rough_drives
from trials.lasting_errors import ETA, Errors, Made, made_drive
from trials.rough_drives import Put, rough_drive, spoilt_by

from rtk_gt.lasting.errors import errors_of_one
from rtk_gt.lasting.lasting_error import LastingError
from rtk_gt.lasting.settled import settle
from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.offsets.memory import error_model
from rtk_gt.path.antennas import antenna_positions
from rtk_gt.path.clocks import right_clocks
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array
from validation.poses.pose_table import SPATIAL, pose_difference

RATES = {
    "5 Hz": (0.2, 0.2, 0.2),
    "1 and 5 Hz": (1.0, 0.2, 0.2),
    "1 Hz": (1.0, 1.0, 1.0),
}
NOISE = {
    "white 3 mm": Errors(0.003),
    "white 6 mm": Errors(0.006),
    "slow 10 mm, 30 s": Errors(0.003, 0.010, 30.0),
    "slow 5 mm, 60 s alone": Errors(0.0, 0.005, 60.0),
}
SLOW = {
    "white 4 mm": (Errors(0.004), 600.0),
    "3 mm, 30 s alone": (Errors(0.0, 0.003, 30.0), 300.0),
    "10 mm, 30 s alone": (Errors(0.0, 0.010, 30.0), 300.0),
    "3 mm, 30 s with white": (Errors(0.004, 0.003, 30.0), 300.0),
    "10 mm, 60 s with white": (Errors(0.004, 0.010, 60.0), 600.0),
    "5 mm, 120 s alone": (Errors(0.0, 0.005, 120.0), 1200.0),
    "10 mm, 120 s with white": (Errors(0.004, 0.010, 120.0), 1200.0),
}
ROUGH_NOISE = {
    "white 4 mm": Errors(0.004),
    "slow 10 mm, 30 s": Errors(0.003, 0.010, 30.0),
    "slow 5 mm, 60 s": Errors(0.003, 0.005, 60.0),
    "slow 7 mm, 120 s": Errors(0.004, 0.007, 120.0),
}
ROUGH_RATES = ((0.2, 0.2, 0.2), (1.0, 0.2, 0.2), (1.0, 0.2, 0.1))
KINDS = ("false fix 8 cm level", "false fix 15 cm up", "restart 5 cm", "all 10 cm")


def spoilt(made: Made, kind: str, generator: np.random.Generator) -> tuple[Made, LastingError]:
    """The drive with an error of a kind in it, and that error."""
    times = made.steps.times
    first = int(generator.uniform(0.2, 0.7) * len(times))
    length = round(generator.uniform(5, 60) / float(np.median(np.diff(times))))
    angle = generator.uniform(0, 2 * np.pi)
    direction = generator.standard_normal(3)
    direction /= np.linalg.norm(direction)
    size, who = {
        KINDS[0]: (0.08 * np.array([np.cos(angle), np.sin(angle), 0.0]), [generator.integers(3)]),
        KINDS[1]: (np.array([0.0, 0.0, 0.15 * generator.choice([-1, 1])]), [generator.integers(3)]),
        KINDS[2]: (0.05 * direction, [1, 2]),
        KINDS[3]: (0.10 * direction, [0, 1, 2]),
    }[kind]
    last = len(times) if kind in KINDS[2:] else min(first + length, len(times) - 60)
    rows = np.arange(first, last)
    end = float(times[last]) if last < len(times) else np.inf
    error = LastingError(
        tuple(int(k) for k in who), float(times[first]), end, size, np.eye(3), 0.0, len(rows), 0.2
    )
    return made.jumped(list(error.receivers), rows, size), error


def same_time(found: LastingError, true: LastingError, slack: float) -> bool:
    """Whether it begins and ends when it does."""
    begins = abs(found.start - true.start) <= slack
    return begins and (found.end == true.end or abs(found.end - true.end) <= slack)


def jumps(first: int, drives: int) -> None:
    print(f"Errors that begin with a jump, {drives} drives of ten minutes a condition:")
    print(
        "found within two fixes of their time, with the right receivers; clean drives with an alarm"
    )
    for rate, every in RATES.items():
        for noise, errors in NOISE.items():
            begin, alarms = time.perf_counter(), 0
            told = {kind: [0, 0] for kind in KINDS}
            for seed in range(first, first + drives):
                made = made_drive(seed, errors, every=every)
                alarms += bool(settle(made.steps)[1])
                generator = np.random.default_rng([seed, 5])
                for kind in KINDS:
                    bad, true = spoilt(made, kind, generator)
                    near = [
                        one for one in settle(bad.steps)[1]
                        if same_time(one, true, 2.01 * max(one.spacing, 0.2))
                    ]  # fmt: skip
                    told[kind][0] += bool(near)
                    told[kind][1] += any(
                        true.receivers in (one.receivers, *one.alike) for one in near
                    )
            said = ", ".join(f"{kind} {a} ({b})" for kind, (a, b) in told.items())
            seconds = time.perf_counter() - begin
            print(f"  {rate:10} {noise:22} alarms {alarms}; {said}; {seconds:.0f} s", flush=True)


def alone(first: int, drives: int) -> None:
    """The same of the second receiver by itself, at 5 Hz."""
    print(f"\nOne receiver: errors found at their time, of {drives} drives of ten minutes, alarms")
    for noise, errors in NOISE.items():
        alarms, told = 0, dict.fromkeys((KINDS[0], KINDS[1], KINDS[3]), 0)
        for seed in range(first, first + drives):
            made = made_drive(seed, errors)
            alarms += bool(errors_of_one(_second(made))[0])
            generator = np.random.default_rng([seed, 5])
            for kind in told:
                true = LastingError((0,), 0.0, 0.0, np.zeros(3), np.eye(3), 0.0, 0, 0.2)
                while 1 not in true.receivers:
                    bad, true = spoilt(made, kind, generator)
                found = errors_of_one(_second(bad))[0]
                told[kind] += any(same_time(one, true, 0.41) for one in found)
        said = ", ".join(f"{kind} {count}" for kind, count in told.items())
        print(f"  {noise:22} alarms {alarms}; {said}", flush=True)


def _second(made: Made) -> Steps:
    steps = made.steps
    return replace(
        steps,
        receivers=steps.receivers[1:2],
        positions=steps.positions[:, 1:2],
        kinds=steps.kinds[:, 1:2],
    )


def hours(first: int, drives: int) -> None:
    print(f"\nClean hours at 5 Hz with an alarm, of {drives} a condition")
    for noise, errors in NOISE.items():
        alarms = 0
        for seed in range(first, first + drives):
            alarms += bool(settle(made_drive(seed, errors, seconds=3600.0).steps)[1])
        print(f"  {noise:22} {alarms}", flush=True)


def rough(first: int, drives: int) -> None:
    print(f"\nRough drives of ten minutes at 5, 1 + 5 and 1 + 5 + 10 Hz, {drives} of each kind of")
    print(
        "error: found within two fixes with its receivers, and squared errors of the sizes over 3"
    )
    counts: dict[tuple[str, str], list[float]] = {}
    alarms = 0
    for n in range(drives):
        rates, name, errors = _rough_kind(first + n)
        made = rough_drive(first + n, errors, every=rates)
        alarms += bool(settle(made.steps)[1])
        for kind in rough_drives.KINDS:
            bad, put = spoilt_by(made, first + n, kind)
            scores = [_squares(one, put) for one in settle(bad.steps)[1] if _is(one, put, bad)]
            told = counts.setdefault((kind, "white" if errors.slow == 0 else "slow"), [0, 0, 0.0])
            told[0] += 1
            told[1] += bool(scores)
            told[2] += scores[0] if scores else 0.0
            if not scores:
                where = f"{put.start - made.steps.times[0]:.1f} s, {rates}, {name}"
                print(
                    f"    missed: drive {first + n}, {kind} {put.size} of {put.receivers}, {where}"
                )
    print(f"  clean drives with an alarm: {alarms} of {drives}")
    for (kind, noise), (count, found, squares) in sorted(counts.items()):
        mean = squares / max(found, 1) / 3
        print(f"  {kind:14} {noise:6} {found:.0f} of {count:.0f}, squares {mean:.2f}", flush=True)


def _rough_kind(seed: int) -> tuple[tuple[float, ...], str, Errors]:
    """Rates and errors of a rough drive: all twelve in twelve drives."""
    name = list(ROUGH_NOISE)[seed % len(ROUGH_NOISE)]
    return ROUGH_RATES[seed // len(ROUGH_NOISE) % len(ROUGH_RATES)], name, ROUGH_NOISE[name]


def _is(one: LastingError, put: Put, made: Made) -> bool:
    """Whether an error that was found is the one that was put in: within two fixes of its own."""
    own = made.steps.times[(made.steps.kinds[:, put.receivers] == 4).any(1)]

    def apart(time: float, other: float) -> int:
        return abs(int(np.searchsorted(own, time - 1e-6)) - int(np.searchsorted(own, other - 1e-6)))

    near = apart(one.start, put.start) <= 2 and apart(one.end, put.end) <= 2
    return near and one.stays == np.isinf(put.end) and put.receivers in (one.receivers, *one.alike)


def _squares(one: LastingError, put: Put) -> float:
    off = one.size - put.size
    return float(off @ np.linalg.solve(one.covariance, off))


def rough_hours(first: int, drives: int) -> None:
    print(f"\nRough clean hours with an alarm, of {drives}")
    alarms = 0
    for n in range(drives):
        rates, name, errors = _rough_kind(first + n)
        found = settle(rough_drive(first + n, errors, seconds=3600.0, every=rates).steps)[1]
        alarms += bool(found)
        for one in found:
            print(f"    drive {first + n}, {rates}, {name}: {one.receivers} {one.size}", flush=True)
    print(f"  {alarms}", flush=True)


def solved(made: Made) -> tuple[Offsets, VehiclePath, Array]:
    """Offsets, path, and the true poses of the path."""
    quick = estimate_offsets(made.steps, eta=ETA, bent="never")
    model = error_model(made.steps, quick)
    offsets = estimate_offsets(made.steps, eta=ETA, model=model)
    antennas = antenna_positions(offsets.distances, made.antennas[:, 2])
    rows = np.flatnonzero(made.steps.complete)[offsets.weights > 0]
    path = vehicle_path(made.steps.select(rows), offsets, antennas, model=model)
    return offsets, path, made.poses[rows]


def slow(first: int, drives: int) -> None:
    print(f"\nSlow errors of each receiver, {drives} drives of ten memories a condition")
    print(f"  {'':26} {'z of the offsets, rms':>22} {'NEES of a pose / 6':>20}")
    for name, (errors, seconds) in SLOW.items():
        scores, squares = [], []
        for seed in range(first, first + drives):
            made = made_drive(seed, errors, seconds=seconds, every=(0.5, 0.5, 0.5))
            offsets, path, true = solved(made)
            off = (offsets.offsets.values - made.offsets)[1:]
            scores.append(off / offsets.offset_sigmas[1:])
            error = pose_difference(path.poses, true, SPATIAL)
            whole = np.einsum("ni,nij,nj->n", error, np.linalg.inv(path.covariances), error)
            squares.append(whole.mean() / 6)
        rms = np.sqrt(np.mean(np.square(scores)))
        print(f"  {name:26} {rms:22.2f} {np.mean(squares):20.2f}", flush=True)


def clocks(first: int, drives: int) -> None:
    print(f"\nClocks that are off by 0.2 to 1 s, {drives} drives, one of them clean in four")
    told, worst = 0, 0.0
    for seed in range(first, first + drives):
        generator = np.random.default_rng([seed, 9])
        off = 0.05 * generator.integers(4, 21, 2) * generator.choice([-1, 1], 2)
        off = off * (seed % 4 > 0)
        made = made_drive(seed, NOISE["white 3 mm"], seconds=300, delays=(0.0, *off))
        _, found = right_clocks(made.steps, ETA)
        late = np.zeros(3) if found is None else found.late
        error = np.abs(late[1:] + off).max()
        told += error < 0.01
        worst = max(worst, error if error < 0.01 else 0.0)
    print(f"  right to 10 ms: {told} of {drives}; greatest error of these {1000 * worst:.1f} ms")


def main() -> None:
    given = sys.argv[1:]
    first, drives = (int(n) for n in (given + ["1000", "40"][len(given) :])[:2])
    what = given[2] if len(given) > 2 else "all"
    runs = {"jumps": jumps, "alone": alone, "hours": hours, "slow": slow, "clocks": clocks,
            "rough": rough, "rough_hours": rough_hours}  # fmt: skip
    for name, run in runs.items():
        if what in (name, "all"):
            run(first, drives)


if __name__ == "__main__":
    main()
