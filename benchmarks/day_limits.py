"""Limits of control charts, by the share of days without change that exceed them.

    python benchmarks/day_limits.py [--series 50000] [--days 60] [--seed 1]

Each limit is the quantile, on that day, of the series in which nothing was noticed before. The
table of validation/statistics/control/limits.py was made with --series 1000000, in an hour of one
processor; figures of fewer series scatter about it.
"""

import argparse

import numpy as np

from validation.statistics.control.changes import evidence
from validation.statistics.control.limits import FIRST, LIMITS, NUMBERS, RATES

CHUNK = 20_000
"""Series at a time: 100 megabytes."""


def all_evidence(series: int, days: int, seed: int) -> np.ndarray:
    """(series, days + 1) evidence on each day; NaN on days too few to tell."""
    rng = np.random.default_rng(seed)
    found = np.full((series, days + 1), np.nan, dtype=np.float32)
    for start in range(0, series, CHUNK):
        drawn = rng.standard_normal((min(CHUNK, series - start), days))
        for number in range(FIRST, days + 1):
            one = evidence(drawn[:, :number], np.ones(number))
            found[start : start + len(drawn), number] = one
    return found


def limits_of(found: np.ndarray, rate: float) -> np.ndarray:
    """(days + 1,) the limit of each day; NaN on days too few to tell."""
    left = np.ones(len(found), dtype=bool)
    limits = np.full(found.shape[1], np.nan)
    for number in range(FIRST, found.shape[1]):
        one = found[:, number]
        limits[number] = np.quantile(one[left], 1 - rate, method="higher")
        left &= one <= limits[number]
    return limits


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--series", type=int, default=50_000)
    parser.add_argument("--days", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    found = all_evidence(options.series, options.days, options.seed)
    # Limits change slowly: those of neighbouring days are averaged.
    around = {
        number: range(max(FIRST, number * 9 // 10), number * 11 // 10 + 1) for number in NUMBERS
    }
    for rate, known in zip(RATES, LIMITS, strict=True):
        if rate * options.series < 25:
            continue  # too few beyond the limit
        limits = limits_of(found, rate)
        said = []
        for number, one in zip(NUMBERS, known, strict=True):
            near = [day for day in around[number] if day <= options.days]
            if near:
                said.append(f"{number}: {limits[near].mean():.3f} ({one:.3f})")
        print(f"rate {rate:g}, limits by the number of days (in the table): {', '.join(said)}")


if __name__ == "__main__":
    main()
