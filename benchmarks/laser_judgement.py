"""The judgement on pairs of which a third or more have no right answer, and corridors.

Two series. Rooms of the samples: too little overlap, corridors as far as the scanner sees, all
furniture moved; two thirds are good pairs, half with 722 beams all around, half with 361 over half
a turn, 1 cm range noise. And places of a generator of its own: halls at any angle, columns, panes,
people, shared errors of the ranges. No match that is used, accepted or imprecise, may be wrong by
more than 20 mm or 10 mrad beyond three of its standard deviations, and hardly a good one be held
up. Along a corridor the stated standard deviation must be near the true one, for good and for poor
guesses.
"""

from collections import Counter
from collections.abc import Callable

import numpy as np
from laser_lines import Lines, arguments
from trials.other_pairs import GOOD, other_pair
from trials.scan_pairs import ScanPair, corridor_pair, mixed_pair

from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.verdicts import Match
from laser_gt.scans.evidence import Prepared
from validation.poses.angles import Array, wrap

FAR_OFF = (0.02, 0.01)
LIMITS = MatchSettings(guess_length=0.06, guess_angle=0.06)
GUESSES = ((0.02, 0.01), (0.1, 0.05), (1.0, 0.1))
"""Standard deviations of good, usual and poor guesses: metres, radians."""


def wrong(found: Match, truth: Array) -> bool:
    """Whether a match is further off than allowed and than its covariance says."""
    off = found.pose - truth
    length, angle = float(np.hypot(*off[:2])), float(abs(wrap(off[2])))
    towards = off[:2] / max(length, 1e-12)
    sigma = float(np.sqrt(towards @ found.covariance[:2, :2] @ towards))
    far = length > FAR_OFF[0] + 3 * sigma or angle > FAR_OFF[1] + 3 * found.sigma_angle
    return bool(far)


def judge(
    lines: Lines,
    name: str,
    draw: Callable[[int, int], ScanPair],
    good: tuple[str, ...],
    seeds: range,
) -> None:
    """Verdicts by kind, wrong ones that are used, and good ones held up."""
    verdicts: dict[str, Counter[str]] = {}
    told: list[str] = []
    for number, seed in enumerate(seeds):
        pair = draw(number, seed)
        found = match(Prepared(pair.reference), Prepared(pair.moving), pair.guess, LIMITS)
        verdicts.setdefault(pair.kind, Counter())[found.verdict] += 1
        if found.used and wrong(found, pair.truth):
            off = found.pose - pair.truth
            told.append(f"seed {seed} ({pair.kind}, {found.verdict}): {np.round(off, 3)}")
    for kind, counts in verdicts.items():
        print(f"  {kind}: " + ", ".join(f"{n} {v}" for v, n in sorted(counts.items())))
    lines.show(f"{name}: used and wrong, of {len(seeds)}", str(len(told)), "0", met=not told)
    for one in told:
        print(f"  {one}")
    total = sum(verdicts[kind].total() for kind in good)
    held = sum(verdicts[kind][one] for kind in good for one in ("may be wrong", "refuted"))
    figure = f"{held} of {total} ({held / total:.1%})"
    lines.show(f"{name}: good ones held up", figure, "<= 5 %", met=held <= 0.05 * total)


def corridors(lines: Lines, seeds: range) -> None:
    """Stated against true standard deviation along corridors without features, and verdicts."""
    accepted = 0
    for length, angle in GUESSES:
        errors, stated = [], []
        for seed in seeds:
            pair, along = corridor_pair(seed)
            off = np.random.default_rng([5, seed]).normal(0, 1, 3) * [length, length, angle]
            settings = MatchSettings(guess_length=length, guess_angle=angle)
            both = Prepared(pair.reference), Prepared(pair.moving)
            found = match(*both, pair.truth + off, settings)
            errors.append(float(along @ (found.pose - pair.truth)[:2]))
            stated.append(float(np.sqrt(along @ found.covariance[:2, :2] @ along)))
            accepted += found.verdict == "accepted"
        true = float(np.sqrt(np.mean(np.square(errors))))
        ratio = float(np.sqrt(np.mean(np.square(stated)))) / true
        what = f"stated over true along {len(seeds)} corridors, guess {length} m"
        met = 1 / 1.5 < ratio < 1.5
        lines.show(what, f"{ratio:.2f} ({true * 1e3:.0f} mm)", "0.67 to 1.5", met=met)
    lines.show("corridors accepted", str(accepted), "0", met=accepted == 0)


if __name__ == "__main__":
    chosen = arguments(__doc__, 800_000, pairs=1000, others=600, corridors=60)
    lines = Lines()
    first = chosen.seed
    judge(lines, "rooms", mixed_pair, ("room",), range(first, first + chosen.pairs))
    judge(lines, "other places", other_pair, GOOD, range(first, first + chosen.others))
    corridors(lines, range(first, first + chosen.corridors))
