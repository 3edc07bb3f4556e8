"""Motion before any pose is seen: white noise on acceleration, in time that does not tick.

The state is a pose and its rates. Over a time T the rates keep, but for noise of the covariance
q [[T^3/3, T^2/2], [T^2/2, T]] in each freedom, q being the strength in m^2/s^3 or rad^2/s^3.
Source: Barfoot, State Estimation for Robotics, chapters 3.4 and 11.
"""

import numpy as np

from validation.poses.angles import Array


def information(steps: Array, strengths: Array) -> Array:
    """(n, 2m, 2m) inverse covariances of the noise over steps.

    Parameters
    ----------
    steps : (n,) array
        Seconds.
    strengths : (m,) array
        Of each freedom.
    """
    m = len(strengths)
    found = np.zeros((len(steps), 2 * m, 2 * m))
    k = np.arange(m)
    found[:, k, k] = 12 / (steps[:, None] ** 3 * strengths)
    found[:, k, m + k] = found[:, m + k, k] = -6 / (steps[:, None] ** 2 * strengths)
    found[:, m + k, m + k] = 4 / (steps[:, None] * strengths)
    return found


def log_determinants(steps: Array, strengths: Array) -> float:
    """Sum of the logarithms of the determinants of the noise over steps (n,)."""
    m = len(strengths)
    return float(2 * len(steps) * np.log(strengths).sum() + m * np.log(steps**4 / 12).sum())


def in_between(steps: Array, shares: Array) -> tuple[Array, Array, Array]:
    """How a state between two states depends on them.

    Parameters
    ----------
    steps : (n,) array
        Seconds between the two states.
    shares : (n,) array
        0 at the first, 1 at the second.

    Returns
    -------
    first, second : (n, 2, 2) arrays
        Weights of pose and rate of the two: Hermite's cubic.
    free : (n,) array
        Variance of the pose that is left, of a prior of strength 1.
    """
    T, s = steps, shares
    second = np.empty((len(T), 2, 2))
    second[:, 0, 0], second[:, 0, 1] = 3 * s**2 - 2 * s**3, T * (s**3 - s**2)
    second[:, 1, 0], second[:, 1, 1] = 6 * (s - s**2) / T, 3 * s**2 - 2 * s
    first = np.empty((len(T), 2, 2))
    first[:, 0, 0], first[:, 0, 1] = 1 - second[:, 0, 0], T * (s - 2 * s**2 + s**3)
    first[:, 1, 0], first[:, 1, 1] = -second[:, 1, 0], 1 - 4 * s + 3 * s**2
    return first, second, T**3 * (s * (1 - s)) ** 3 / 3
