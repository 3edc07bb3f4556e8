"""Causes of errors in time on simulated drives, against their truth.

False alarms where there is no cause, for noise with correlation times of 0.1 to 10 s; how often
each cause is found, alone and with the right name; how often 95 % intervals hold the truth; what
is said where two causes cannot be told apart. Numbers on the command line: first seed, drives a
condition.
"""

import sys
import time
from dataclasses import replace

import numpy as np
from trials.drives_in_time import Drive, simulate

from validation.trajectories.causes.explanation import TimeExplanation, time_causes

ROUGH = Drive(outliers=0.02, flips=0.01, lost=0.05, tails=4.0)
"""The noise that the estimator does not know of."""
TIMES = (0.1, 0.3, 1.0, 3.0, 10.0)


def draw(cause: str, rng: np.random.Generator) -> dict[str, float]:
    """A cause of a size that matters to a ground truth of 5 mm."""
    sign = rng.choice([-1.0, 1.0], 3)
    shift, turn = rng.uniform(0.01, 0.05, 2), rng.uniform(0.005, 0.03)
    return {
        "none": {},
        "frame": {
            "frame_x": sign[0] * shift[0],
            "frame_y": sign[1] * shift[1],
            "frame_theta": sign[2] * turn,
        },
        "mount": {
            "mount_x": sign[0] * shift[0],
            "mount_y": sign[1] * shift[1],
            "mount_theta": sign[2] * turn,
        },
        "turn": {"mount_theta": sign[0] * turn},
        "scale": {"scale": sign[0] * rng.uniform(0.003, 0.02)},
        "delay": {"delay": sign[0] * rng.uniform(0.02, 0.3)},
        "clock_drift": {"clock_drift": sign[0] * rng.uniform(1e-4, 3e-4)},
        "pose_drift": {
            "pose_drift_x": sign[0] * rng.uniform(1e-4, 3e-4),
            "pose_drift_y": sign[1] * rng.uniform(1e-4, 3e-4),
            "pose_drift_theta": sign[2] * rng.uniform(5e-5, 1e-4),
        },
    }[cause]


def holds(found: TimeExplanation, truth: dict[str, float]) -> list[bool]:
    """Of the parameters found, whether their intervals hold the truth."""
    return [one.low <= truth.get(one.name, 0.0) <= one.high for one in found.parameters]


def false_alarms(first: int, drives: int) -> None:
    print(f"no cause, {drives} drives each: share in which one is claimed (5 % expected at most)")
    for name, drive in (("white and first order", Drive()), ("heavy tails, outliers", ROUGH)):
        for tau in TIMES:
            setting = replace(drive, correlation_time=tau)
            names = [
                time_causes(*simulate(setting, seed)).name for seed in range(first, first + drives)
            ]
            claimed = [one for one in names if one != "none"]
            share = 100 * len(claimed) / drives
            print(f"  {name:24} {tau:5.1f} s {share:5.1f} %  {' '.join(claimed)}", flush=True)


def detection(first: int, drives: int) -> None:
    print(f"one or two causes, {drives} drives each")
    sets = ("frame", "mount", "turn", "scale", "delay", "clock_drift", "pose_drift")
    sets = (*sets, "frame delay", "mount delay", "scale delay", "frame mount", "frame mount delay")
    for drive in (Drive(), ROUGH):
        for wanted in sets:
            exact, within, inside, told, seconds = 0, 0, 0, 0, 0.0
            for seed in range(first, first + drives):
                rng = np.random.default_rng(seed + 10**6)
                truth = {k: v for one in wanted.split() for k, v in draw(one, rng).items()}
                pair = simulate(drive, seed, truth)
                begin = time.perf_counter()
                found = time_causes(*pair)
                seconds += time.perf_counter() - begin
                names = {one.name for one in found.causes}
                exact += names == set(wanted.split())
                within += set(wanted.split()) <= names
                if names == set(wanted.split()):
                    good = holds(found, truth)
                    inside, told = inside + sum(good), told + len(good)
            print(
                f"  {wanted:18} exactly {100 * exact / drives:5.1f} %, found "
                f"{100 * within / drives:5.1f} %, intervals hold {inside}/{told} "
                f"({100 * inside / max(told, 1):.1f} %), {seconds / drives:.2f} s",
                flush=True,
            )


def coverage(first: int, drives: int) -> None:
    print(f"frame and delay, {drives} drives each: 95 % intervals that hold the truth")
    for tau in TIMES:
        inside, told = 0, 0
        for seed in range(first, first + drives):
            rng = np.random.default_rng(seed + 10**6)
            truth = draw("frame", rng) | draw("delay", rng)
            found = time_causes(*simulate(Drive(correlation_time=tau), seed, truth))
            good = holds(found, truth)
            inside, told = inside + sum(good), told + len(good)
        print(f"  {tau:5.1f} s  {inside}/{told} ({100 * inside / max(told, 1):.1f} %)", flush=True)


def not_told(first: int, drives: int) -> None:
    print(f"drives that do not tell, a delay of 0.1 s, {drives} each: chosen, and as well")
    for way in ("straight", "circle", "still", "one_heading"):
        said: dict[str, int] = {}
        for seed in range(first, first + drives):
            found = time_causes(*simulate(Drive(way=way), seed, {"delay": -0.1}))
            rivals = "".join(f" or {'+'.join(one)}" for one in sorted(found.rivals))
            key = f"{found.name}{rivals}; unseen {' '.join(found.unseen) or '-'}"
            said[key] = said.get(key, 0) + 1
        for key, count in sorted(said.items(), key=lambda one: -one[1]):
            print(f"  {way:12} {count:4} {key}", flush=True)


if __name__ == "__main__":
    FIRST, DRIVES = (int(one) for one in [*sys.argv[1:], "1", "40"][:2])
    not_told(FIRST, max(DRIVES // 8, 1))
    false_alarms(FIRST, DRIVES)
    coverage(FIRST, DRIVES)
    detection(FIRST, max(DRIVES // 2, 1))
