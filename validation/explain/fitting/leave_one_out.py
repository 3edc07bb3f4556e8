"""How well an explanation predicts a pose that it was not fitted to."""

from dataclasses import dataclass

import numpy as np

from validation.explain.fitting.fit import SMALLEST_SCALE, Fit, covariance_of, known_part
from validation.explain.fitting.noise import Precision, precision, weigh
from validation.poses.angles import Array

ALONE = 1e-10
"""A parameter of which one pose holds all information but this part is determined by that pose
alone: sums over n poses are good to some n times 2e-16."""


@dataclass(frozen=True)
class LeaveOneOut:
    """Predictions of each pose from the others.

    Parameters
    ----------
    residuals : (n, 3) array
        Validation minus predicted pose, metres and radians.
    covariances : (n, 3, 3) array
        Of these residuals: noise and what the parameters do not know.
    log_densities : (n,) array
        Of the prediction.
    """

    residuals: Array
    covariances: Array
    log_densities: Array

    @property
    def score(self) -> float:
        """Sum of the log densities: the higher, the better it predicts."""
        return float(self.log_densities.sum())

    @property
    def typical_length(self) -> float:
        """Median length of the position error of a prediction, in metres."""
        return float(np.median(np.hypot(self.residuals[:, 0], self.residuals[:, 1])))

    @property
    def typical_angle(self) -> float:
        """Median size of the heading error of a prediction, in radians."""
        return float(np.median(np.abs(self.residuals[:, 2])))


def leave_one_out(fit: Fit) -> LeaveOneOut:
    """Each pose predicted from the rest, by one exact step from the fit to all.

    Parameters
    ----------
    fit : Fit
        A single fit (B = 1).

    Notes
    -----
    With the weights kept, taking pose i out of a linear least-squares problem changes the
    parameters by -(N - J'WJ)^-1 J'W r, in closed form (Cook and Weisberg, Residuals and Influence
    in Regression, 1982, section 3.4). The noise level is taken without pose i as well, and
    corrected for the parameters fitted. The score is Vehtari, Gelman and Gabry (2017),
    "Practical Bayesian model evaluation ...", equation 4, with the plug-in density.
    """
    residuals, noise = fit.residuals[0], fit.covariances[0]
    slopes = fit.corrected.by_parameters
    slopes = np.broadcast_to(slopes, (1, *residuals.shape, fit.parameters.shape[1]))[0]
    known = precision(noise)
    used = weigh(residuals, known).precision  # with which each pose entered the fit
    weighted = np.einsum("nij,njk->nik", used, slopes)
    whole = fit.information[0]
    information = whole - np.einsum("nik,nil->nkl", slopes, weighted)
    # What is left of a parameter that one pose alone determines is the rounding of its digits.
    left = np.diagonal(information, axis1=-2, axis2=-1) > ALONE * np.diagonal(whole)
    information = np.where(left[:, :, None] & left[:, None, :], information, 0.0)
    # An undetermined parameter does not move, and its pose cannot be predicted well.
    finite = known_part(covariance_of(information))
    step = np.einsum("nkl,nl->nk", finite, np.einsum("nil,ni->nl", weighted, residuals))
    predicted = residuals + np.einsum("nik,nk->ni", slopes, step)
    spread = slopes @ finite @ np.swapaxes(slopes, -1, -2)
    others = noise * _scale_without(fit, known)
    total = others + spread
    found = weigh(predicted, precision(total))
    return LeaveOneOut(predicted, total, found.log_density)


def _scale_without(fit: Fit, known: Precision) -> Array:
    """(n, 3, 3) factors on the noise: without the pose itself, and for the parameters fitted."""
    n = len(fit.residuals[0])
    if not fit.estimated:
        return np.ones((n, 3, 3))
    residuals = fit.residuals[0]
    position = residuals[:, :2]
    own = np.stack(
        [
            np.einsum("ni,nij,nj->n", position, known.position, position) / 2,
            residuals[:, 2] ** 2 * known.heading,
        ],
        -1,
    )
    own = fit.weights[0] * own
    total = own.sum(0)
    factor = np.maximum(total - own, 0.25 * total) / (n - 1)
    factor = factor * fit.observations / max(fit.observations - fit.parameters.shape[1], 1)
    factor = np.maximum(factor, np.square(SMALLEST_SCALE / fit.scale[0]))
    size = np.sqrt(factor[:, [0, 0, 1]])
    return np.asarray(size[:, :, None] * size[:, None, :])
