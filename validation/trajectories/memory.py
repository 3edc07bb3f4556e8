"""How correlated the errors of a trajectory's poses at stops are."""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.fft import dct

from validation.poses.angles import Array

MOST_FREQUENCIES, FEWEST_FREQUENCIES = 400, 30
"""Of a stop's spectrum, and of all stops together. Two numbers are fitted to them: thirty tell the
long-run variance to a factor of about two."""
CORRELATED_GAIN = 6.0
"""By which correlated noise must fit better than white noise, in twice the logarithm of the
likelihood: two more numbers reach it in one of twenty campaigns with white noise."""
LONGEST_MEMORY = 0.5
"""Of the length of a stop: the longest correlation that its poses can show. An error that lasts
longer is the same all through the stop; what slow motion within it looks like, with half the size
of the noise, would otherwise be taken for errors of a thousand times the variance."""
_MEMORIES = 1 - np.geomspace(1.0, 0.002, 30)
_WHITE_SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95)
"""Correlation of neighbours, up to 500 poses long, and the share of white noise that are tried."""


def inflation_of(groups: Sequence[Array]) -> Array:
    """(m,) long-run variance of the poses of a stop over their variance, of all stops together.

    The spectra of all stops, each in units of its variance, are fitted by one of a first-order
    autoregression with white noise, by Whittle's likelihood; its value at frequency zero is the
    long-run variance (Whittle 1953; the cosines are those of Mueller and Watson 2008).
    """
    power, frequency = [np.empty((0, groups[0].shape[1]))], [np.empty(0)]
    for values in groups:
        n = len(values)
        spectrum = dct(values - values.mean(0), axis=0, norm="ortho")[1 : MOST_FREQUENCIES + 1] ** 2
        power.append(spectrum / np.maximum(values.var(0), 1e-30))
        frequency.append(np.pi * np.arange(1, len(spectrum) + 1) / n)
    powers, omega = np.vstack(power), np.concatenate(frequency)
    if len(omega) < FEWEST_FREQUENCIES:
        return np.full(powers.shape[1], np.nan)
    white_alone = len(omega) * np.log(np.maximum(powers.mean(0), 1e-30))
    best, found = white_alone - CORRELATED_GAIN, np.ones(powers.shape[1])
    longest = LONGEST_MEMORY * float(np.median([len(values) for values in groups]))
    memories = _MEMORIES[np.exp(-1 / max(longest, 1e-9)) >= _MEMORIES]
    for memory, white in itertools.product(memories, _WHITE_SHARES):
        coloured = (1 - memory**2) / (1 - 2 * memory * np.cos(omega) + memory**2)
        shape = (1 - white) * coloured + white
        scale = (powers / shape[:, None]).mean(0)
        misfit = np.log(shape).sum() + len(omega) * np.log(np.maximum(scale, 1e-30))
        at_zero = scale * ((1 - white) * (1 + memory) / (1 - memory) + white)
        found = np.where(misfit < best, at_zero, found)
        best = np.minimum(best, misfit)
    return np.maximum(found, 1.0)
