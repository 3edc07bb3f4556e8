"""The judgement on pairs of which a third have no right answer, and corridors.

Too little overlap, corridors as far as the scanner sees, all furniture moved; two thirds are good
pairs, half with 722 beams all around, half with 361 over half a turn, 1 cm range noise. No
accepted match may be wrong by more than 20 mm or 10 mrad, and hardly a good one be held up.
Along a corridor the stated standard deviation must be near the true one.
"""

from collections import Counter

import numpy as np
from laser_lines import Lines, arguments
from trials.scan_pairs import CORRIDOR_GUESS, KINDS, corridor_pair, mixed_pair

from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.scans.evidence import Prepared
from validation.poses.angles import wrap

FAR_OFF = (0.02, 0.01)
LIMITS = MatchSettings(guess_length=0.06, guess_angle=0.06)


def judge(lines: Lines, seeds: range) -> None:
    """Verdicts by kind, accepted wrong ones, and good ones held up."""
    verdicts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    wrong: list[str] = []
    worst = 0.0
    for number, seed in enumerate(seeds):
        pair = mixed_pair(number, seed)
        kind = pair.kind
        found = match(Prepared(pair.reference), Prepared(pair.moving), pair.guess, LIMITS)
        length = float(np.hypot(*(found.pose - pair.truth)[:2]))
        angle = float(abs(wrap(found.pose[2] - pair.truth[2])))
        verdicts[kind][found.verdict] += 1
        if found.verdict == "accepted":
            worst = max(worst, length)
            if length > FAR_OFF[0] or angle > FAR_OFF[1]:
                wrong.append(f"seed {seed} ({kind}): {length * 1e3:.0f} mm, {angle * 1e3:.0f} mrad")
    for kind, counts in verdicts.items():
        print(f"  {kind}: " + ", ".join(f"{n} {v}" for v, n in sorted(counts.items())))
    what = f"accepted and wrong, of {len(seeds)} (worst {worst * 1e3:.1f} mm)"
    lines.show(what, str(len(wrong)), "0", met=not wrong)
    for one in wrong:
        print(f"  {one}")
    good = verdicts["room"]
    held_up = good.total() - good["accepted"]
    figure = f"{held_up} of {good.total()} ({held_up / good.total():.1%})"
    lines.show("good ones not accepted", figure, "<= 5 %", met=held_up <= 0.05 * good.total())


def corridors(lines: Lines, seeds: range) -> None:
    """Stated against true standard deviation along corridors without features, and verdicts."""
    errors, stated, accepted = [], [], 0
    for seed in seeds:
        pair, along = corridor_pair(seed)
        settings = MatchSettings(guess_length=CORRIDOR_GUESS[0], guess_angle=CORRIDOR_GUESS[1])
        found = match(Prepared(pair.reference), Prepared(pair.moving), pair.guess, settings)
        errors.append(float(along @ (found.pose - pair.truth)[:2]))
        stated.append(float(np.sqrt(along @ found.covariance[:2, :2] @ along)))
        accepted += found.verdict == "accepted"
    true = float(np.sqrt(np.mean(np.square(errors))))
    ratio = float(np.sqrt(np.mean(np.square(stated)))) / true
    what = f"stated over true deviation along {len(seeds)} corridors"
    lines.show(what, f"{ratio:.2f} ({true * 1e3:.0f} mm)", "0.5 to 2", met=0.5 < ratio < 2)
    lines.show("corridors accepted", str(accepted), "0", met=accepted == 0)


if __name__ == "__main__":
    chosen = arguments(__doc__, 800_000, pairs=1000, corridors=60)
    lines = Lines()
    judge(lines, range(chosen.seed, chosen.seed + chosen.pairs))
    corridors(lines, range(chosen.seed, chosen.seed + chosen.corridors))
