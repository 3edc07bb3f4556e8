"""Is the measuring origin right? A hand laser against known lengths.

AD2.3, "Hand-laser distance measuring device", says that the device's origin was checked and that
its output was compared on a similar distance, and prints no number. Here readings over known
lengths give offset, scale and noise, each with its uncertainty;
`survey.studies.instrument_verdict` says what may be claimed from them.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, ndtr, ndtri, stdtr, stdtrit

from survey.readings.instrument import reading_sigma, tolerance_at
from survey.studies.instrument_misfit import Misfit, find_misfit
from validation.campaign.folder import Instrument
from validation.poses.angles import Array

CONFIDENCE = 0.95
"""Of intervals and tests: usual."""


@dataclass(frozen=True)
class Correction:
    """What to enter under [instrument]: a reading d stands for ``offset + scale * d``.

    ``covariance`` (2, 2) is of (offset, scale): square metres, metres, none.
    """

    offset: float
    scale: float
    covariance: Array


@dataclass(frozen=True)
class InstrumentCheck:
    """Errors of an instrument over known lengths.

    Parameters
    ----------
    readings : int
        How many.
    shortest, longest : float
        Known lengths covered, metres.
    offset, scale_error : float
        A reading is too long by ``offset + scale_error * length``, metres and metres per metre.
        Without lengths that differ by more than the noise the scale error is NaN, and the offset
        is the error there.
    covariance : (2, 2) array
        Of (offset, scale_error); NaN where not observable.
    p_offset, p_scale : float
        Two-sided chance of an estimate at least as far from 0.
    p_joint : float
        The same of both together.
    noise : float
        Standard deviation of the readings about the fit, metres; NaN without any redundancy.
    noise_interval : (float, float)
        Its confidence interval.
    expected_noise : float
        Root mean square of the standard deviations expected, metres.
    p_noise : float
        Chance of a noise at least as large if the expected one holds; NaN without redundancy.
    degrees_of_freedom : int
        Readings less what was estimated.
    largest_error : float
        Limit of the systematic error over the lengths covered, at the confidence, metres.
    tolerance : float
        What the maker allows at the length where that limit comes nearest to it, metres.
    correction : Correction
        To remove what is significant; offset 0 and scale 1 where nothing is.
    shared_rounding : float
        Standard deviation of the rounding that all readings of one length share, metres; 0 where
        no length was read twice, or the readings scatter by more than the last digit.
    misfit : Misfit
        What an offset, a scale and noise do not explain. The numbers are then those of the rows
        that are not bad, and of no use where it is something else than bad rows.
    """

    readings: int
    shortest: float
    longest: float
    offset: float
    scale_error: float
    covariance: Array
    p_offset: float
    p_scale: float
    p_joint: float
    noise: float
    noise_interval: tuple[float, float]
    expected_noise: float
    p_noise: float
    degrees_of_freedom: int
    largest_error: float
    tolerance: float
    correction: Correction
    shared_rounding: float = 0.0
    misfit: Misfit = field(default_factory=Misfit)


@dataclass(frozen=True)
class _Fit:
    """Weighted least squares of the errors by a constant and, maybe, the length."""

    parameters: Array
    covariance: Array
    chi_squared: float
    degrees_of_freedom: int

    @property
    def quantile(self) -> float:
        """Half width of a two-sided interval in standard deviations."""
        level = (1 + CONFIDENCE) / 2
        return float(
            stdtrit(self.degrees_of_freedom, level) if self.degrees_of_freedom else ndtri(level)
        )

    def p_value(self, which: int) -> float:
        """Two-sided t test of one parameter; normal without redundancy."""
        ratio = abs(self.parameters[which]) / np.sqrt(self.covariance[which, which])
        dof = self.degrees_of_freedom
        return float(2 * (stdtr(dof, -ratio) if dof else ndtr(-ratio)))

    def p_joint(self) -> float:
        """F test of all parameters; chi-squared without redundancy."""
        size = float(self.parameters @ np.linalg.solve(self.covariance, self.parameters))
        k, dof = len(self.parameters), self.degrees_of_freedom
        return float(fdtrc(k, dof, size / k) if dof else chdtrc(k, size))


def check_instrument(
    length: Array, reading: Array, instrument: Instrument, sigma: Array | None = None
) -> InstrumentCheck:
    """Offset, scale and noise of an instrument, and whether they keep its specification.

    Parameters
    ----------
    length : (n,) array
        Known lengths, metres; known far better than the instrument reads.
    reading : (n,) array
        What it read, metres.
    instrument : Instrument
        The specification. What a person adds in the field (``setup_sigma``) and corrections
        already entered do not belong to it and are left out.
    sigma : (n,) array, optional
        Standard deviation of each reading, metres; by default half the stated tolerance and the
        rounding.

    Raises
    ------
    ValueError
        If there is no reading, or a number is not finite.

    Notes
    -----
    The error ``reading - length`` is fitted by ``offset + scale_error * length``: regressing on
    the known lengths, which carry no noise, is what keeps the scale free of bias. The tests use
    the noise seen (Student, F), but never less than the rounding leaves; without redundancy they
    use the expected one (normal, chi-squared). Readings of one length that hardly scatter are all
    rounded the same way: that part does not average out, and is counted once a length.
    """
    length, reading = np.asarray(length, dtype=float), np.asarray(reading, dtype=float)
    if length.size == 0 or not np.isfinite(np.concatenate([length, reading])).all():
        raise ValueError("at least one reading and finite numbers are needed")
    bare = instrument.model_copy(update={"setup_sigma": 0.0})
    expected = reading_sigma(bare, length) if sigma is None else np.asarray(sigma, dtype=float)
    both = bool(np.ptp(length) > expected.max())
    error = reading - length
    misfit = find_misfit(length, error, expected, with_scale=both)
    good = np.setdiff1d(np.arange(len(length)), misfit.bad_rows)
    length, error, expected = length[good], error[good], expected[good]
    both = bool(np.ptp(length) > expected.max())
    rounding = _Rounding.of(length, error, instrument.resolution)
    fit = _fit(length, error, expected, rounding, with_scale=both)
    typical = float(np.sqrt((expected**2).mean()))
    largest, tolerance = _nearest_to_tolerance(fit, length, bare)
    check = InstrumentCheck(
        readings=len(length),
        shortest=float(length.min()),
        longest=float(length.max()),
        offset=float(fit.parameters[0]),
        scale_error=float(fit.parameters[1]) if both else np.nan,
        covariance=fit.covariance if both else np.diag([fit.covariance[0, 0], np.nan]),
        p_offset=fit.p_value(0),
        p_scale=fit.p_value(1) if both else np.nan,
        p_joint=fit.p_joint(),
        noise=typical * _ratio(fit.chi_squared, fit.degrees_of_freedom),
        noise_interval=_noise_interval(fit, typical),
        expected_noise=typical,
        p_noise=float(chdtrc(fit.degrees_of_freedom, fit.chi_squared))
        if fit.degrees_of_freedom
        else np.nan,
        degrees_of_freedom=fit.degrees_of_freedom,
        largest_error=largest,
        tolerance=tolerance,
        correction=Correction(0.0, 1.0, np.zeros((2, 2))),
        shared_rounding=rounding.shared,
        misfit=misfit,
    )
    scale_matters = both and check.p_scale < 1 - CONFIDENCE
    if check.p_joint < 1 - CONFIDENCE:
        kept = fit if scale_matters else _fit(length, error, expected, rounding, with_scale=False)
        return replace(check, correction=_correction(kept))
    return check


@dataclass(frozen=True)
class _Rounding:
    """Standard deviations of rounding, metres: of one reading, and shared by those of a length."""

    single: float
    shared: float

    @classmethod
    def of(cls, length: Array, error: Array, resolution: float) -> Self:
        """What is shared, by how much the readings of one length scatter.

        Notes
        -----
        A value anywhere between two steps q, read with normal noise s and rounded, is off by
        sum_k (-1)^k q / (pi k) exp(-2 (pi k s / q)^2) sin(2 pi k x / q) in the mean: of variance
        q^2 / 12 without noise, and none soon after s exceeds q / 2. The least noise that the
        scatter allows (95 %) is taken.
        """
        single = resolution / np.sqrt(12)
        places, group = np.unique(length, return_inverse=True)
        spare = len(length) - len(places)
        if spare == 0 or resolution == 0:
            return cls(single, 0.0)
        means = np.bincount(group, error) / np.bincount(group)
        seen = float(((error - means[group]) ** 2).sum()) / chdtri(spare, 1 - CONFIDENCE)
        noise = max(seen - single**2, 0.0)
        k = np.arange(1, 200)
        terms = np.exp(-4 * (np.pi * k / resolution) ** 2 * noise) / (2 * (np.pi * k) ** 2)
        return cls(single, float(resolution * np.sqrt(terms.sum())))


def _fit(
    length: Array, error: Array, sigma: Array, rounding: _Rounding, *, with_scale: bool
) -> _Fit:
    """The fit, with the covariance scaled by the noise seen, and what is shared added."""
    columns = [np.ones_like(length), length] if with_scale else [np.ones_like(length)]
    design = np.stack(columns, axis=-1) / sigma[:, None]
    q, r = np.linalg.qr(design)
    parameters = np.linalg.solve(r, q.T @ (error / sigma))
    inverse = np.linalg.inv(r)
    rest = error / sigma - design @ parameters
    dof = len(length) - len(columns)
    chi_squared = float(rest @ rest)
    least = float((rounding.single**2 / sigma**2).mean())
    factor = max(chi_squared / dof, least) if dof else 1.0
    # What one length adds to the parameters, with the rounding of all its readings as one.
    places, group = np.unique(length, return_inverse=True)
    gain = inverse @ q.T / sigma
    by_length = np.stack([np.bincount(group, row, len(places)) for row in gain])
    shared = rounding.shared**2 * by_length @ by_length.T
    return _Fit(parameters, factor * inverse @ inverse.T + shared, chi_squared, dof)


def _ratio(chi_squared: float, dof: float) -> float:
    return float(np.sqrt(chi_squared / dof)) if dof else np.nan


def _noise_interval(fit: _Fit, typical: float) -> tuple[float, float]:
    """Chi-squared interval of the noise, metres."""
    dof = fit.degrees_of_freedom
    if dof == 0:
        return np.nan, np.nan
    low = float(chdtri(dof, (1 - CONFIDENCE) / 2))
    high = float(chdtri(dof, (1 + CONFIDENCE) / 2))
    return typical * _ratio(fit.chi_squared, low), typical * _ratio(fit.chi_squared, high)


def _nearest_to_tolerance(fit: _Fit, length: Array, instrument: Instrument) -> tuple[float, float]:
    """Limit of the systematic error where it comes nearest to, or goes furthest over, tolerance.

    The limit is convex in the length and the tolerance made of two straight pieces, so the ends
    and the kink are all that need a look.
    """
    ends = np.array([length.min(), length.max()])
    kink = np.clip(instrument.tolerance_up_to, ends[0], ends[1])
    at = np.append(ends, kink)
    design = np.stack([np.ones_like(at), at], axis=-1)[:, : len(fit.parameters)]
    spread = np.sqrt(np.einsum("ni,ij,nj->n", design, fit.covariance, design))
    limit = np.abs(design @ fit.parameters) + fit.quantile * spread
    allowed = tolerance_at(instrument, at)
    worst = int((limit - allowed).argmax())
    return float(limit[worst]), float(allowed[worst])


def _correction(fit: _Fit) -> Correction:
    """The inverse of the fitted error: reading = a + (1 + b) length, solved for the length."""
    a = float(fit.parameters[0])
    b = float(fit.parameters[1]) if len(fit.parameters) == 2 else 0.0
    covariance = np.zeros((2, 2))
    k = len(fit.parameters)
    covariance[:k, :k] = fit.covariance
    slope = np.array([[-1 / (1 + b), a / (1 + b) ** 2], [0.0, -1 / (1 + b) ** 2]])
    return Correction(-a / (1 + b), 1 / (1 + b), slope @ covariance @ slope.T)
