"""One unknown place or pose from distances, its readings taken as independent.

This is quick, many first guesses at once, and errs towards larger sigmas. What readings share
is in the models of `world_points` and `robot_frames`, which refine what is found here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from survey.estimation.iterated_ekf import PASSES, Estimates, iterated_ekf_batch
from survey.estimation.measurement import independent_variance, linearise
from validation.poses.angles import Array, wrap

Rows = npt.NDArray[np.intp] | npt.NDArray[np.bool_]
PLACE_PRIOR_SIGMA = np.array([100.0, 100.0])
"""Standard deviations from which each pass starts, metres: sigma[0] of the document."""
POSE_PRIOR_SIGMA = np.array([1000.0, 1000.0, 100.0])
"""The same for poses: metres, metres, radians."""
SAME = 0.01
"""Solutions nearer than this, in metres, are one minimum reached twice. A judgement: the filter
ends within 1e-9 m of a minimum, and two different minima are decimetres apart."""
_SAME_HEADING = 0.02
"""The same for headings, radians."""


@dataclass(frozen=True)
class DistanceFit:
    """The m readings of one unknown place (x, y), or pose (x, y, theta), with n unknowns.

    Parameters
    ----------
    known : (m, 2) array
        Known point of each reading, metres, Vframe.
    body : (m, 2) array or None
        Rig point of each reading, metres, robot frame; None for a place, which has no heading.
    distance, sigma : (m,) array
        Readings and their standard deviations, metres.
    known_sigma : (m,) array
        Root mean square standard deviation of the coordinates of the known points, metres.
    body_sigma : float
        The same for the marks.
    """

    known: Array
    body: Array | None
    distance: Array
    sigma: Array
    known_sigma: Array
    body_sigma: float

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def unknowns(self) -> int:
        """2 for a place, 3 for a pose."""
        return 2 if self.body is None else 3

    @property
    def prior_sigma(self) -> Array:
        """(n,) standard deviations from which each pass starts."""
        return PLACE_PRIOR_SIGMA if self.body is None else POSE_PRIOR_SIGMA

    def select(self, rows: Rows) -> Self:
        """The given readings."""
        return replace(
            self,
            known=self.known[rows],
            body=None if self.body is None else self.body[rows],
            distance=self.distance[rows],
            sigma=self.sigma[rows],
            known_sigma=self.known_sigma[rows],
        )

    def equations(self, states: Array) -> tuple[Array, Array, Array]:
        """The equations h (..., m), H (..., m, n) and the variances of h at states (..., n)."""
        body = np.zeros_like(self.known) if self.body is None else self.body
        at = linearise(with_heading(states), self.known, body, self.distance)
        variance = independent_variance(at, self.sigma, self.known_sigma, self.body_sigma)
        return at.h, at.H[..., : self.unknowns], variance

    def costs(self, states: Array) -> Array:
        """Chi-squared (b,) of each of the states (b, n)."""
        h, _, variance = self.equations(states)
        return np.asarray((h**2 / variance).sum(-1))

    def ends(self, starts: Array, passes: int = PASSES) -> Estimates:
        """Where the filter ends from starts (b, n), headings brought to (-pi, pi]."""
        ended = iterated_ekf_batch(
            lambda states, _: self.equations(states), starts, self.prior_sigma, passes
        )
        ended.state[:, 2:] = wrap(ended.state[:, 2:])
        return ended

    def solutions(self, starts: Array) -> tuple[Array, Array]:
        """Different states at which the filter rests, and their costs, the best first.

        Parameters
        ----------
        starts : (b, n) array
            First guesses.

        Returns
        -------
        states : (k, n) array
            Metres and radians, Vframe.
        costs : (k,) array
            Chi-squared of each.
        """
        ended = self.ends(starts)
        return _different(ended.state, ended.cost, ended.converged)


def solutions_of_many(
    fits: Sequence[DistanceFit], starts: Sequence[Array]
) -> list[tuple[Array, Array]]:
    """`DistanceFit.solutions` of each of many fits from its own starts (b, n), quicker.

    Those with as many readings as others are iterated with them.
    """
    alike: dict[int, list[int]] = {}
    for i, fit in enumerate(fits):
        alike.setdefault(len(fit), []).append(i)
    found: dict[int, tuple[Array, Array]] = {}
    for same in alike.values():
        together = [fits[i] for i in same]
        owner = np.repeat(np.arange(len(same)), [len(starts[i]) for i in same])
        known = np.array([fit.known for fit in together])
        body = np.array([np.zeros_like(f.known) if f.body is None else f.body for f in together])
        distance = np.array([fit.distance for fit in together])
        sigma = np.array([fit.sigma for fit in together])
        known_sigma = np.array([fit.known_sigma for fit in together])
        body_sigma = np.array([[fit.body_sigma] for fit in together])
        n = together[0].unknowns

        def model(
            states: Array,
            rows: npt.NDArray[np.intp],
            owner: npt.NDArray[np.intp] = owner,
            arrays: tuple[Array, ...] = (known, body, distance, sigma, known_sigma, body_sigma),
            n: int = n,
        ) -> tuple[Array, Array, Array]:
            own = owner[rows]
            known, body, distance, sigma, known_sigma, body_sigma = (a[own] for a in arrays)
            at = linearise(with_heading(states), known, body, distance)
            return at.h, at.H[..., :n], independent_variance(at, sigma, known_sigma, body_sigma)

        ended = iterated_ekf_batch(
            model, np.concatenate([starts[i] for i in same]), together[0].prior_sigma
        )
        ended.state[:, 2:] = wrap(ended.state[:, 2:])
        for k, i in enumerate(same):
            rows = owner == k
            found[i] = _different(ended.state[rows], ended.cost[rows], ended.converged[rows])
    return [found[i] for i in range(len(fits))]


def _different(state: Array, cost: Array, converged: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Of the ends of many starts those that are different, with their costs, the best first."""
    usable = converged & np.isfinite(cost)
    kept: list[int] = []
    for i in np.flatnonzero(usable)[np.argsort(cost[usable])]:
        off = state[kept] - state[i]
        near = np.linalg.norm(off[:, :2], axis=1) <= SAME
        near &= (np.abs(wrap(off[:, 2:])) <= _SAME_HEADING).all(1)
        if not near.any():
            kept.append(int(i))
    return state[kept], cost[kept]


def place_fit(known: Array, known_sigma: Array, distance: Array, sigma: Array) -> DistanceFit:
    """The readings of a place; the arguments are those of `DistanceFit`."""
    return DistanceFit(known, None, distance, sigma, known_sigma, 0.0)


def with_heading(states: Array) -> Array:
    """States (..., 3); a place, whose heading nothing depends on, gets 0."""
    missing = 3 - states.shape[-1]
    return np.concatenate([states, np.zeros((*states.shape[:-1], missing))], axis=-1)


def coordinate_sigma(covariance: Array) -> Array:
    """(k,) root mean square standard deviation of the coordinates of k points.

    Parameters
    ----------
    covariance : (2 k, 2 k) array
        Of x and y of each in turn, square metres.
    """
    return np.asarray(np.sqrt(np.diagonal(covariance).reshape(-1, 2).mean(1)))
