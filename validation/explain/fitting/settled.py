"""The chosen explanation without the flagged cells: parameters, intervals, degrees of freedom."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.explain.fitting.fit import LEAST_P, Fit, covariance_of, fit, known_part
from validation.explain.fitting.models import UNITS, correct
from validation.explain.fitting.noise import DIMENSIONS, Mask, masked_precision, precision, regular
from validation.explain.fitting.pairs import Pairs
from validation.explain.fitting.serial import Serial, serial
from validation.explain.fitting.shared import shared_covariance
from validation.poses.angles import Array, wrap
from validation.poses.factored import Factored
from validation.poses.shared_errors import SharedErrors
from validation.statistics.consistency import joint_square, square_of_factored
from validation.statistics.hypotheses import Parameter

WAY = 1 / 3
"""Of the difference between velocities by all poses and by every other one: what the former may be
off by. Of an error of the third power of the step it would be a seventh, but robots turn sharply.
Errors of a time offset of 30 standard deviations spread by 0.9 to 1.2 of what is stated (40 drives
a kind along meanders, loops and random curves of 20 and 60 poses); by up to 1.8 without it."""
_KIND = np.array([0, 0, 1])
"""The cell, position or heading, of x, y and theta."""


@dataclass(frozen=True)
class Settled:
    """An ordinary weighted least-squares fit to the cells that were not flagged.

    Parameters
    ----------
    pairs : Pairs
        What was fitted to.
    fit : Fit
        Its covariances use the noise level corrected for the degrees of freedom.
    cells : (n, 2) array of bool
        Positions and headings used.
    used_freedom : (2,) array
        Degrees of freedom that the fit took from positions and headings.
    dof : (2,) array
        Degrees of freedom left in each.
    serial : Serial, optional
        What the parameters are worth where errors depend on their neighbours.
    """

    pairs: Pairs
    fit: Fit
    cells: Mask
    used_freedom: Array
    dof: Array
    serial: Serial | None = None

    @property
    def values(self) -> Array:
        """(k,) systematic parameters."""
        return self.fit.parameters[0, : len(self.fit.model.parameters)]

    @property
    def covariance(self) -> Array:
        """(k, k) covariance of the systematic parameters."""
        k = len(self.fit.model.parameters)
        return self.full_covariance[:k, :k]

    @property
    def full_covariance(self) -> Array:
        """Covariance of all that was fitted, with what poses are off together."""
        own = covariance_of(self.fit.information)[0]
        if self.serial is not None:
            known = np.isfinite(np.diagonal(own))
            own = np.where(known[:, None] & known, self.serial.covariance, own)
        own = own + shared_covariance(self.fit, own, self.pairs.between)
        off = self._off_by_the_way()
        return np.asarray(own + off[:, None] * off)

    def _off_by_the_way(self) -> Array:
        """(k,) what parameters may be off by, as the way between poses is not known."""
        fitted, motion = self.fit.model.fitted, self.pairs.motion
        if "time" not in fitted or motion is None:
            return np.zeros(len(fitted))
        slopes, used = _pieces(self.fit, self.cells)
        own = known_part(covariance_of(self.fit.information)[0])
        missed = self.fit.parameters[0, fitted.index("time")] * motion.doubts * WAY
        return np.asarray(own @ np.einsum("nik,nij,nj->k", slopes, used, missed))

    @property
    def before(self) -> Array:
        """(n, 3) errors as they came."""
        return self.pairs.errors

    @property
    def after(self) -> Array:
        """(n, 3) errors of the corrected poses; the slip is not a fault and not corrected here.

        See `corrected_poses`.
        """
        left = self.pairs.validation - self.corrected_poses(self.pairs.gt)
        left[:, 2] = wrap(left[:, 2])
        return left

    def corrected_poses(self, poses: Array, rows: npt.ArrayLike | None = None) -> Array:
        """GT poses (n, 3) with the explanation taken out, the slip of the reference included.

        ``rows`` says which of the pairs they are, where a velocity or a place in the order counts;
        all of them by default. Poses are read in the convention of the validation beforehand.

        The slip is the survey's error, but it went into every GT pose through the reference; the
        other stops together know it better than the reference pose itself.
        """
        pairs = self.pairs
        some = slice(None) if rows is None else np.asarray(rows)
        moving = None if pairs.motion is None else pairs.motion.select(some)
        places = pairs.places[some] if self.fit.model.drifts else None
        tied, values = pairs.reference_pose, self.fit.parameters[0]
        made = correct(self.fit.model, values, poses, tied, moving, places)
        result = np.array(np.broadcast_to(made.poses, poses.shape))
        result[:, 2] = wrap(result[:, 2])
        return result

    def corrected_covariances(self) -> Array:
        """(n, 3, 3) of the corrected poses: GT noise where stated, and of the parameters."""
        made = self.fit.corrected
        slopes = np.broadcast_to(made.by_parameters, (1, *self.before.shape, self._k))[0]
        by = np.broadcast_to(made.by_pose, (1, *self.before.shape, 3))[0]
        finite = known_part(self.full_covariance)
        own = by @ self.pairs.gt_covariances @ np.swapaxes(by, -1, -2)
        if self.pairs.contradicted:
            own = own * by_level(self.fit.scale[0])
        return regular(own + np.einsum("nik,kl,njl->nij", slopes, finite, slopes))

    @property
    def _k(self) -> int:
        return len(self.fit.model.fitted)

    def parameters(self, confidence: float = 0.95) -> tuple[Parameter, ...]:
        """All fitted parameters with intervals by Student's t (normal where noise is stated).

        Where errors depend on their neighbours, by the mixture over their memories; NaN where
        that is withheld.
        """
        covariance = self.full_covariance
        every = self._freedoms()
        rows = []
        for column, name in enumerate(self.fit.model.fitted):
            value, dof = float(self.fit.parameters[0, column]), float(every[column])
            sigma = float(np.sqrt(covariance[column, column]))
            if self.fit.estimated:
                quantile = float(special.stdtrit(dof, (1 + confidence) / 2))
                p = 2 * float(special.stdtr(dof, -abs(value) / sigma))
            else:
                quantile = float(special.ndtri((1 + confidence) / 2))
                p = 2 * float(special.ndtr(-abs(value) / sigma))
            if self.serial is not None and np.isfinite(sigma):
                spread = self.serial.spread(column)
                widest = spread.quantile((1 + confidence) / 2) / sigma
                quantile = np.nan if self.serial.withheld else max(quantile, widest)
                p = max(p, 2 * spread.below(-abs(value)))
            low, high = value - quantile * sigma, value + quantile * sigma
            rows.append(Parameter(name, UNITS[name], value, sigma, low, high, max(p, LEAST_P)))
        return tuple(rows)

    def _freedoms(self) -> Array:
        """(k,) degrees of freedom of each parameter's variance, one or more.

        It is a sum of what the noise of positions gives and that of headings, whose levels are
        estimated apart: Satterthwaite (1946), "An approximate distribution of estimates of variance
        components".
        """
        slopes, used = _pieces(self.fit, self.cells)
        own = known_part(covariance_of(self.fit.information)[0])
        by_heading = own @ slopes[:, 2].T * np.sqrt(used[:, 2, 2])
        whole = np.maximum(np.diagonal(own), 1e-300)
        share = np.clip((by_heading**2).sum(1) / whole, 0.0, 1.0)
        of, left = np.stack([1 - share, share]), np.maximum(self.dof, 1.0)[:, None]
        return np.asarray(np.maximum(1 / (of**2 / left).sum(0), 1.0))

    def spread(self, errors: Array, *, everything: bool = False) -> Array:
        """(3,) standard deviation of x, y and theta about their mean.

        Parameters
        ----------
        errors : (n, 3) array
            As they came, or corrected.
        everything : bool
            Over all poses; else over the cells used.

        Notes
        -----
        Sample standard deviation, n - 1. `noise` is the one that counts all fitted parameters.
        """
        used = np.ones_like(self.cells) if everything else self.cells
        return np.array([_deviation(errors[used[:, _KIND[c]], c], c == 2) for c in range(3)])

    def mean(self, errors: Array, *, everything: bool = False) -> Array:
        """(3,) means of x, y and theta, over the cells used or over all."""
        used = np.ones_like(self.cells) if everything else self.cells
        picked = [errors[used[:, _KIND[c]], c] for c in range(3)]
        return np.array([float(one.mean()) if len(one) else np.nan for one in picked])

    @property
    def noise(self) -> Array:
        """(3,) root mean square of what is left in x, y, theta, for the degrees of freedom left.

        The freedom that the fit took from the positions is shared by x and y.
        """
        left = self.fit.residuals[0]
        result = []
        for c in range(3):
            used = self.cells[:, _KIND[c]]
            share = self.used_freedom[_KIND[c]] / (2 if c < 2 else 1)
            dof = used.sum() - share
            total = float((left[used, c] ** 2).sum())
            result.append(np.sqrt(total / dof) if dof > 0 else np.nan)
        return np.array(result)

    @cached_property
    def misfit(self) -> Array:
        """(2, 3) noise of positions and headings over the stated one, with a 99 % interval.

        NaN where the noise is not stated or no freedom is left. Where poses share errors, by all
        of a kind together, what could be fitted left out.
        """
        result = np.full((2, 3), np.nan)
        if not self.pairs.stated:
            return result
        if self.pairs.between is not None:
            return self._joint_misfit(self.pairs.between)
        level = self.fit.scale[0]  # 1 unless it was estimated
        residuals, known = self.fit.residuals[0], precision(self.fit.covariances[0])
        position = residuals[:, :2]
        squares = np.stack(
            [
                np.einsum("ni,nij,nj->n", position, known.position, position),
                residuals[:, 2] ** 2 * known.heading,
            ],
            -1,
        )
        for kind in range(2):
            dof, total = float(self.dof[kind]), float(squares[self.cells[:, kind], kind].sum())
            if dof >= 1:
                bounds = special.chdtri(dof, np.array([0.005, 0.995]))
                result[kind] = level[kind] * np.sqrt(total / np.array([dof, *bounds]))
        return result

    def _joint_misfit(self, between: SharedErrors) -> Array:
        """The misfit with the stated covariance of all poses together."""
        n, k = len(self.cells), self._k
        slopes = np.broadcast_to(self.fit.corrected.by_parameters, (1, n, 3, k))[0]
        result = np.full((2, 3), np.nan)
        for kind in range(2):
            rows, of = np.flatnonzero(self.cells[:, kind]), np.flatnonzero(kind == _KIND)
            if not rows.size:
                continue
            parts = np.ix_(rows, of)
            blocks = self.fit.covariances[0][np.ix_(rows, of, of)]
            shared = between.select(rows)
            total, freedom = _square_of(
                self.fit.residuals[0][parts], blocks, shared.only(of), slopes[parts]
            )
            if freedom:
                bounds = special.chdtri(freedom, np.array([0.005, 0.995]))
                result[kind] = np.sqrt(total / np.array([freedom, *bounds]))
        return result

    @property
    def explained(self) -> Array:
        """(3,) part of the mean square of x, y and theta that the explanation takes away."""
        first = np.array(
            [
                np.mean(self.before[self.cells[:, _KIND[c]], c] ** 2)
                if self.cells[:, _KIND[c]].any()
                else np.nan
                for c in range(3)
            ]
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(1 - self.noise**2 / first)


def _square_of(
    errors: Array, covariances: Array, shared: SharedErrors, slopes: Array
) -> tuple[float, int]:
    """Normalised square of errors (n, k) beside what is fitted, and its freedom."""
    n, k = errors.shape
    if shared.whole is None:
        rows, signs = shared.factor, shared.signs
        own = covariances - (rows * signs) @ np.swapaxes(rows, 1, 2)
        if shared.net is not None:
            own = own - shared.net.blocks
        found = square_of_factored(errors, Factored(own, rows, signs, shared.net), slopes)
        if found is not None:
            return found
    whole = shared.matrix()
    whole[np.arange(n), :, np.arange(n)] = covariances
    flat = slopes.reshape(n * k, -1)
    return joint_square(errors.ravel(), whole.reshape(n * k, n * k), flat)


def _deviation(values: Array, angle: bool) -> float:
    """Sample standard deviation, of angles about their mean direction."""
    if len(values) < 2:
        return float("nan")
    if angle:
        middle = np.angle(np.exp(1j * values).mean())
        values = wrap(values - middle)
    return float(values.std(ddof=1))


def by_level(level: Array) -> Array:
    """(3, 3) factors on covariances for those (2,) on standard deviations of both kinds."""
    size = level[_KIND]
    return np.asarray(size[:, None] * size)


def settle(pairs: Pairs, robust: Fit, cells: Mask, *, dependent: bool = False) -> Settled:
    """The robust fit's explanation fitted again to the cells not flagged.

    Parameters
    ----------
    pairs : Pairs
        The n pairs.
    robust : Fit
        Where to start from.
    cells : (n, 2) array of bool
        Positions and headings to use.
    dependent : bool
        Whether errors depend on their neighbours.
    """
    cells = np.asarray(cells, dtype=bool)
    estimated = robust.estimated
    plain = fit(
        pairs, robust.model, cells=cells, start=robust, iterations=20, estimate_scale=estimated
    )
    taken = _freedom(plain, cells)
    count = cells.sum(0) * DIMENSIONS
    dof = np.maximum(count - taken, 0.0)
    if estimated:
        factor = np.sqrt(np.where(dof > 0, count / np.maximum(dof, 1e-9), 1.0))
        size = np.concatenate([factor[[0, 0]], factor[[1]]])
        # The slip's row has the same noise level; both shrink together.
        plain = replace(
            plain,
            scale=plain.scale * factor,
            covariances=plain.covariances * (size[:, None] * size[None, :]),
            information=_rescaled(plain, cells, size, pairs),
        )
    worth = serial(pairs, plain, cells) if dependent else None
    return Settled(pairs, plain, cells, taken, dof, worth)


def _pieces(plain: Fit, cells: Mask) -> tuple[Array, Array]:
    """Derivatives (n, 3, k) and the precision (n, 3, 3) with which each pose entered."""
    k = plain.parameters.shape[1]
    slopes = np.broadcast_to(plain.corrected.by_parameters, (1, len(cells), 3, k))[0]
    return slopes, masked_precision(precision(plain.covariances[0]), cells)


def _freedom(plain: Fit, cells: Mask) -> Array:
    """(2,) traces of the hat matrix over positions and headings."""
    if not plain.parameters.shape[1]:
        return np.zeros(2)
    slopes, used = _pieces(plain, cells)
    finite = known_part(covariance_of(plain.information)[0])
    hat = np.einsum("nik,kl,njl,nji->ni", slopes, finite, slopes, used)
    return np.array([hat[:, :2].sum(), hat[:, 2].sum()])


def _rescaled(plain: Fit, cells: Mask, size: Array, pairs: Pairs) -> Array:
    """(1, k, k) information with the noise level corrected."""
    slopes, used = _pieces(plain, cells)
    without_slip = np.einsum("nik,nij,njl->kl", slopes, used, slopes)
    slip = plain.information[0] - without_slip
    shrunk = used / (size[:, None] * size[None, :])
    again = np.einsum("nik,nij,njl->kl", slopes, shrunk, slopes)
    if pairs.reference_pose is not None and plain.model.slip:
        each = np.concatenate([np.ones(plain.parameters.shape[1] - 3), size])
        slip = slip / (each[:, None] * each[None, :])
    return np.asarray((again + slip)[None])
