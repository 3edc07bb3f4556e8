"""How often `gtval compare` and `gtval explain` judge rightly where errors are not independent.

Prints one line a kind of campaign. Questions: ``clean`` (causes invented, flags, and the rate that
is told of them, by noise), ``intervals`` (of means and of a frame: missed, withheld; how often the
report says that neighbours depend on each other), ``causes`` (each named rightly), ``gross`` (a
wrong pose blamed on the right one of four sources), ``copies`` (noticed; nobody innocent called
wrong for sure). 600 campaigns a kind take hours; other seeds by --offset, other noises by --noises.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/validation/explain"))

from judged_campaigns import Kind, campaign, copied, times_of

from validation.errors import GtvalError
from validation.explain.analysis import Explanation, Question, explain
from validation.statistics.evaluation import evaluate

FRAME = np.array([0.05, -0.04, 0.02])
NAMED = {
    "mount": {"mount"},
    "lever": {"mount"},
    "scale": {"scale"},
    "turned_frame": {"frame"},
    "mirror": {"mirrored_y"},
    "exchanged": {"exchanged_axes"},
    "millimetres": {"millimetres"},
    "degrees": {"degrees"},
    "motion": {"direction_of_motion"},
    "drift": {"drift"},
    "growing": {"drift"},
    "time": {"time"},
}
"""What each cause of the simulation is to be called."""


def rate(hits: int, n: int) -> str:
    """'0.970 (0.944 to 0.986)' by Clopper and Pearson."""
    interval = stats.binomtest(hits, n).proportion_ci(0.95)
    return f"{hits / n:.3f} ({interval.low:.3f} to {interval.high:.3f})"


def explained(kind: Kind, seed: int) -> Explanation:
    """One campaign, explained."""
    survey, systems, _ = campaign(kind, seed)
    return explain(survey, systems, Question(times=times_of(kind)))


def kinds_of(noises: Sequence[str], stops: Sequence[int]) -> list[Kind]:
    """Clean campaigns in a room and along a drive."""
    return [
        Kind(noise=noise, n=n, path=path)
        for noise in noises
        for n in stops
        for path in ("room", "drive")
    ]


def clean(seeds: range, noises: Sequence[str], stops: Sequence[int]) -> None:
    """What is invented where nothing is wrong."""
    for kind in kinds_of(noises, stops):
        names: Counter[str] = Counter()
        flags, told, dependent = 0, 0.0, 0
        for seed in seeds:
            found = explained(kind, seed)
            names[found.systems[0].name] += 1
            flags += bool(found.arbitration.verdicts)
            told += found.arbitration.rate / len(seeds)
            one = found.systems[0].selection
            dependent += one is not None and one.dependent
        extra = len(seeds) - names["none"] - names["drift"]
        print(f"  {kind.name:32} invented {rate(extra, len(seeds))} drift {names['drift']}"
              f"  flags {rate(flags, len(seeds))} told {told:.3f}"
              f"  called dependent {rate(dependent, len(seeds))}", flush=True)  # fmt: skip


def intervals(seeds: range, noises: Sequence[str], stops: Sequence[int]) -> None:
    """Campaigns with an interval that misses the truth, or without one; neighbours told."""
    for kind in kinds_of(noises, stops):
        count, told = np.zeros((2, 3), dtype=int), 0
        for seed in seeds:
            survey, systems, _ = campaign(kind, seed)
            made = evaluate(survey, systems[0])
            ends = np.array([[one.ci_low, one.ci_high] for one in made.statistics])
            count[0] += _missed(ends, np.zeros(3))
            told += bool(made.neighbours is not None and made.neighbours.dependent)
            one = explained(replace(kind, cause="frame"), seed).systems[0]
            assert one.settled is not None
            if "frame" in one.settled.fit.model.parts:
                values = one.settled.parameters()[:3]
                count[1] += _missed(np.array([[p.low, p.high] for p in values]), FRAME)
        n = len(seeds)
        for what, (any_of, all_of, withheld) in zip(("mean", "frame"), count, strict=True):
            print(f"  {kind.name:32} {what:5} missed by any of three {rate(any_of, n)} by each"
                  f" {all_of / 3 / n:.3f} withheld {rate(withheld, n)} neighbours told"
                  f" {told / n:.3f}", flush=True)  # fmt: skip


def _missed(ends: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Whether any interval misses, how many do, and whether one is withheld."""
    given = np.isfinite(ends).all(1)
    out = given & ((truth < ends[:, 0]) | (truth > ends[:, 1]))
    return np.array([out.any(), out.sum(), not given.all()], dtype=int)


def causes(seeds: range, noises: Sequence[str], stops: Sequence[int]) -> None:
    """Each cause by its name."""
    for cause, wanted in NAMED.items():
        moving = cause in {"motion", "drift", "growing", "time"}
        for noise in noises:
            for n in stops:
                kind = Kind(noise=noise, cause=cause, n=n, path="drive" if moving else "room")
                names: Counter[str] = Counter()
                for seed in seeds:
                    try:
                        names[explained(kind, seed).systems[0].name] += 1
                    except GtvalError as error:
                        names["degrees" if "degrees" in str(error) else "refused"] += 1
                right = sum(names[name] for name in wanted)
                others = dict((names - Counter(dict.fromkeys(wanted, len(seeds)))).most_common(3))
                print(f"  {kind.name:40} {rate(right, len(seeds))} {others}", flush=True)


def gross(seeds: range, _: Sequence[str], stops: Sequence[int]) -> None:
    """A wrong pose of the first of three systems beside a survey."""
    for n in stops:
        for size in (8.0, 10.0, 15.0):
            kind = Kind(n=n, systems=3, survey=0.6, gross=size)
            right = innocent = 0
            for seed in seeds:
                survey, systems, stop = campaign(kind, seed)
                for one in explain(survey, systems).arbitration.verdicts:
                    own = (one.stop, one.cell, one.blamed) == (stop, "position", ("rig",))
                    right += own
                    innocent += not own and one.certainty == "sure"
            print(f"  {kind.name} {size:g} sigma: right {rate(right, len(seeds))}"
                  f" innocent called sure {innocent / len(seeds):.3f}", flush=True)  # fmt: skip


def copies(seeds: range, _: Sequence[str], stops: Sequence[int]) -> None:
    """Copies of a wrong table: noticed, and nobody innocent blamed."""
    for n in stops:
        for near in (0.0, 0.05):
            for others in (0, 1):
                noticed = innocent = 0
                for seed in seeds:
                    survey, systems, guilty = copied(n, seed, near=near, others=others)
                    found = explain(survey, systems).arbitration
                    noticed += any({"rig", "copy"} <= set(one.names) for one in found.copies)
                    innocent += any(
                        one.certainty == "sure" and not set(one.blamed) <= guilty
                        for one in found.verdicts
                    )
                print(f"  copies n={n} near={near} others={others} noticed"
                      f" {rate(noticed, len(seeds))} innocent called sure"
                      f" {rate(innocent, len(seeds))}", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=10, help="campaigns of each kind")
    parser.add_argument("--offset", type=int, default=0, help="first seed")
    parser.add_argument("--noises", default="gauss,ar0.5,ar0.8,ar0.95,t3")
    parser.add_argument("--stops", default="20,60")
    parser.add_argument("--only", choices=("clean", "intervals", "causes", "gross", "copies"))
    asked = parser.parse_args()
    seeds = range(asked.offset, asked.offset + asked.seeds)
    stops = [int(one) for one in asked.stops.split(",")]
    for one in (clean, intervals, causes, gross, copies):
        if asked.only in {None, one.__name__}:
            print(one.__name__)
            one(seeds, asked.noises.split(","), stops)


if __name__ == "__main__":
    main()
