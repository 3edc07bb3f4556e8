"""How often `gtval explain` is right, on simulated campaigns whose causes are known.

Prints one line a case: the figure, its 95 % interval, and what is asked. What is asked is asked of
300 campaigns a case (--seeds 300, hours); other seeds by --offset.
Three questions: ``choice`` (right explanation, and NEES of its parameters), ``clean`` (systematic
errors and wrong poses invented), ``wrong`` (a wrong pose of 5 cm or 3 degrees named with the right
source). A peer beside the last: the best that any rule could do that knew the noise and the true
errors of all other poses, at the same chance of a false alarm over the table.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/validation/explain"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/validation/explain/fitting"))

from four_sources import NAMES, WRONG_ANGLE, WRONG_LENGTH, Case, campaign
from test_explain_selection import TRUE, chosen_and_nees

from validation.explain.analysis import SystemExplanation, explain
from validation.explain.sources.verdicts import CELLS, Verdict

CASES = (
    Case("noise estimated"),
    Case("noise stated", stated=True),
    Case("a third of the poses missing", missing=0.3),
    Case("lasers half in common", common=0.5),
    Case("a round", path="loop"),
    Case("a straight path", path="straight", stated=True),
    Case("all with 5 mm", noise=(0.005,) * 4),
    Case("40 stops", stops=40),
)


def rate(hits: int, n: int) -> str:
    """'0.970 (0.944 to 0.986)' by Clopper and Pearson."""
    interval = stats.binomtest(hits, n).proportion_ci(0.95)
    return f"{hits / n:.3f} ({interval.low:.3f} to {interval.high:.3f})"


def choice(seeds: range) -> None:
    """Right explanation and NEES, by cause."""
    print("right explanation, asked >= 0.95; NEES per parameter, with the interval asked")
    for noise in (1.0, 0.5, 2.0):
        for stated in (True, False):
            for kind, (true, _) in TRUE.items():
                found = [chosen_and_nees(kind, seed, stated, noise=noise) for seed in seeds]
                right, k, n = sum(ok for ok, *_ in found), len(true), len(found)
                line = f"  {kind:16} noise x {noise:<4} {'stated' if stated else 'estimated':10}"
                line += f" {rate(right, n)}"
                if k:
                    expected = 1.0 if stated else 73 / 71
                    nees = np.mean([value for _, value, _ in found]) / k / expected
                    low, high = stats.chi2.ppf([0.025, 0.975], k * n) / (k * n)
                    line += f"  NEES {nees:.3f} ({low:.3f} to {high:.3f})"
                print(line, flush=True)


def named(verdicts: Sequence[Verdict], stop: str, source: int, cell: int) -> bool:
    """Whether the one wrong cell is laid at the one right door."""
    wanted = (stop, CELLS[cell], (NAMES[source],))
    return any((one.stop, one.cell, one.blamed) == wanted for one in verdicts)


def invented(one: SystemExplanation, true: set[str]) -> bool:
    """Whether each explanation that is not ruled out holds a part that is not there."""
    assert one.selection is not None
    offered = [one.selection.chosen.model, *(rival.model for rival in one.selection.rivals)]
    parts = [{"mount" if part == "turn" else part for part in model.parts} for model in offered]
    return all(part - true for part in parts)


def clean(seeds: range) -> None:
    """What is invented in campaigns without a wrong pose."""
    print("invented causes and false alarms; asked <= 0.05 each, suspects <= 1 a table")
    for case in CASES:
        extra = alarms = suspects = 0
        for seed in seeds:
            survey, systems, _ = campaign(case, [1, seed])
            found = explain(survey, systems, case.question)
            true = [{"frame"}, {"mount"}, {"frame", "mount"}]
            extra += any(invented(*pair) for pair in zip(found.systems, true, strict=True))
            alarms += bool(found.arbitration.verdicts)
            suspects += len(found.arbitration.suspects)
        n = len(seeds)
        print(
            f"  {case.name:28} causes {rate(extra, n)}  alarms {rate(alarms, n)}"
            f"  suspects {suspects / n:.2f}",
            flush=True,
        )


def best_possible(case: Case, source: int, cell: int) -> float:
    """Chance to name the wrong cell if noise and all else were known, Bonferroni at 5 %."""
    noise = np.array(case.noise if cell == 0 else case.angle_noise)
    others = 1 / (1 / np.delete(noise, source) ** 2).sum()
    size = WRONG_LENGTH if cell == 0 else WRONG_ANGLE
    limit = stats.chi2.isf(0.05 / (8 * case.stops), 2 - cell)
    return float(stats.ncx2.sf(limit, 2 - cell, size**2 / (noise[source] ** 2 + others)))


def wrong(seeds: range) -> None:
    """One wrong pose in each source and cell in turn."""
    print("wrong pose named with the right source, asked >= 0.95; known: Bonferroni, noise known")
    for case in CASES:
        everything = []
        for source in range(4):
            for cell in range(2):
                hits = seconds = 0
                for seed in seeds:
                    survey, systems, stop = campaign(case, [2, seed], wrong=(source, cell))
                    found = explain(survey, systems, case.question).arbitration
                    hit = named(found.verdicts, stop, source, cell)
                    hits += hit
                    seconds += hit or named(found.suspects, stop, source, cell)
                everything.append(hits)
                n = len(seeds)
                size = 1000 * (case.noise if cell == 0 else case.angle_noise)[source]
                print(
                    f"  {case.name:28} {NAMES[source]:10} {CELLS[cell]:9} noise {size:4.1f}"
                    f"  {rate(hits, n)}  with suspects {seconds / n:.3f}"
                    f"  known {best_possible(case, source, cell):.3f}",
                    flush=True,
                )
        print(f"  {case.name:28} all sources and cells: {rate(sum(everything), 8 * len(seeds))}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=10, help="campaigns of each case")
    parser.add_argument("--offset", type=int, default=0, help="first seed")
    parser.add_argument("--only", choices=("choice", "clean", "wrong"))
    asked = parser.parse_args()
    seeds = range(asked.offset, asked.offset + asked.seeds)
    for one in (choice, clean, wrong):
        if asked.only in {None, one.__name__}:
            one(seeds)


if __name__ == "__main__":
    main()
