"""Straight roads and standing records on fresh seeds: accepted and right, or refused, and why.

Roads whose headings span 1 to 20 degrees, level and with slopes, and records that stand, with all
that may be stated of offsets and distances. Sizes of errors are of the whole: offsets and
distances together, and a pose. Numbers on the command line: first seed, seeds a road.
"""

import sys
from collections import Counter
from itertools import product

import numpy as np
from trials.straight_roads import KNOWLEDGE, ROADS, knowledge_of, prior_of, road_of, sizes, solved

from rtk_gt.campaign.solve import prepare
from rtk_gt.settings import RtkSettings
from validation.errors import GtvalError

REASONS = (
    "does not determine",
    "is open by",
    "steps allow",
    "upside down",
    "contradict",
    "no triangle",
)


def reason_of(error: GtvalError) -> str:
    """What a refusal says, in short."""
    said = str(error)
    return next((one for one in REASONS if one in said), said[:60])


def main() -> None:
    first, count = (int(n) for n in (sys.argv[1:] + ["100", "5"][len(sys.argv) - 1 :])[:2])
    accepted, refused, errors = Counter(), Counter(), []
    for seed in range(first, first + count):
        roads = [(kind, road_of(seed, **kind)) for kind in ROADS]
        ready = [(kind, road, prepare(road.steps, RtkSettings())) for kind, road in roads]
        for (kind, road, made), what in product(ready, KNOWLEDGE):
            prior = prior_of(*knowledge_of(road, what, seed))
            try:
                worst = max(sizes(road, *solved(road.steps, prior, ready=made)))
            except GtvalError as error:
                refused[what, reason_of(error)] += 1
                continue
            accepted[what] += 1
            errors.append(worst)
            if worst > 3:
                print(f"  beyond 3 sigmas: {kind}, {what} stated, seed {seed}: {worst:.1f}")
        print(f"seed {seed}: {len(errors)} accepted so far", flush=True)
    beyond = np.array(errors)
    total = len(ROADS) * len(KNOWLEDGE) * count
    print(f"\n{total} records, {len(errors)} accepted, {total - len(errors)} refused")
    for what in KNOWLEDGE:
        said = "; ".join(f"{n} {why}" for (w, why), n in sorted(refused.items()) if w == what)
        print(f"  {what:14} stated: {accepted[what]:4} accepted; refused: {said or 'none'}")
    print(
        f"beyond 3 sigmas: {(beyond > 3).sum()} ({100 * np.mean(beyond > 3):.2f} %, asked 1), "
        f"beyond 5: {(beyond > 5).sum()}"
    )


if __name__ == "__main__":
    main()
