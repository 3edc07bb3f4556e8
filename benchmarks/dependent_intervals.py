"""Intervals of a mean and an rms where neighbours share errors, beside Student and Newey-West.

Of every setting: share of the 95 % intervals printed that hold the truth, share withheld, and share
that says the record may be short. 10 values a second.

    python benchmarks/dependent_intervals.py [--seeds N]
"""

import argparse
from collections.abc import Iterator

import numpy as np
from scipy import special
from scipy.signal import lfilter

from validation.statistics.dependence import mean_of_series, rms_of_series

STEP = 0.1
LENGTHS = (200, 1000, 4000, 20_000)
TIMES = (0.1, 1.0, 5.0, 30.0)
KINDS = ("ar1", "ar1+white", "oscillating", "skewed")


def errors(kind: str, n: int, time: float, seeds: int, rng: np.random.Generator) -> np.ndarray:
    """(seeds, n) errors of mean zero with a correlation time in seconds."""
    memory = np.exp(-STEP / time)
    before = int(10 * time / STEP) + 50
    drawn = rng.standard_normal((seeds, n + before))
    if kind == "oscillating":
        turn = 2 * np.pi * STEP / max(2 * time, 0.6)
        return lfilter([1], [1, -2 * memory * np.cos(turn), memory**2], drawn)[:, before:]
    slow = lfilter([np.sqrt(1 - memory**2)], [1, -memory], drawn)[:, before:]
    if kind == "ar1+white":
        return slow + rng.standard_normal((seeds, n))
    if kind == "skewed":  # log-normal, skewness 2.3
        return np.exp(0.6 * slow) - np.exp(0.18)
    return slow


def settings() -> Iterator[tuple[str, int, float]]:
    return ((kind, n, time) for kind in KINDS for n in LENGTHS for time in TIMES)


def newey_west(values: np.ndarray) -> float:
    """Half-width by Bartlett weights over 4 (n / 100)^(2/9) lags."""
    n = len(values)
    away = values - values.mean()
    lags = int(4 * (n / 100) ** (2 / 9))
    total = away @ away / n
    for lag in range(1, lags + 1):
        total += 2 * (1 - lag / (lags + 1)) * (away[lag:] @ away[:-lag]) / n
    return 1.96 * np.sqrt(total / n)


def measured(values: np.ndarray) -> dict[str, float]:
    """Shares over the seeds of one setting."""
    means = [mean_of_series(row) for row in values]
    given = np.array([not np.isnan(one.low) for one in means])
    holds = np.array([one.low <= 0 <= one.high for one in means])
    short = np.array([one.short for one in means])
    n, std = values.shape[1], values.std(1, ddof=1)
    centre = np.abs(values.mean(1))
    student = special.stdtrit(n - 1, 0.975) * std / np.sqrt(n)
    truth = np.sqrt(np.square(values).mean())
    rms = [rms_of_series(row) for row in values]
    rms_given = np.array([not np.isnan(one.low) for one in rms])
    rms_holds = np.array([one.low <= truth <= one.high for one in rms])
    half = np.array([one.half_width for one in means])
    return {
        "holds": holds[given].mean() if given.any() else np.nan,
        "withheld": 1 - given.mean(),
        "short": (short | ~given).mean(),
        "width": np.nanmedian(half) / (1.96 * values.mean(1).std()) if given.any() else np.nan,
        "rms": rms_holds[rms_given].mean() if rms_given.any() else np.nan,
        "student": (centre < student).mean(),
        "newey_west": np.mean([c < newey_west(row) for c, row in zip(centre, values, strict=True)]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=400)
    seeds = parser.parse_args().seeds
    rng = np.random.default_rng(20_260)
    print(f"95 % intervals over {seeds} seeds; width over that of a known spread")
    print(
        f"{'errors':12} {'n':>6} {'time':>6} {'records':>8} {'holds':>7} {'withheld':>9} "
        f"{'told short':>11} {'width':>6} {'rms':>6} {'Student':>8} {'Newey-West':>11}"
    )
    for kind, n, time in settings():
        one = measured(errors(kind, n, time, seeds, rng))
        print(
            f"{kind:12} {n:6d} {time:5.1f}s {n * STEP / time:8.1f} {one['holds']:7.3f} "
            f"{one['withheld']:9.3f} {one['short']:11.3f} {one['width']:6.2f} {one['rms']:6.3f} "
            f"{one['student']:8.3f} {one['newey_west']:11.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
