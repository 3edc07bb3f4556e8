"""What all validation poses, or all GT poses, are off together.

Poses of one survey hang on the same marks and the same rig, and a table may state so by a joint
covariance. Such a shared error looks exactly like a wrong frame or a wrong mount of the system
under test. Fits weigh the poses one by one; here their parameters get the uncertainty that the
shared errors add, so that a survey's own error is not taken for a fault of the system.
"""

import numpy as np
from scipy import special

from validation.explain.fitting.fit import Fit, known_part
from validation.explain.fitting.noise import regular
from validation.poses.angles import Array
from validation.poses.shared_errors import SharedErrors


def shared_covariance(fit: Fit, covariance: Array, between: SharedErrors | None) -> Array:
    """(k, k) what the shared errors add to the covariance of a fit's parameters.

    Parameters
    ----------
    fit : Fit
        Of one version of the pairs.
    covariance : (k, k) array
        Of its parameters if all poses were independent; infinite where undetermined.
    between : SharedErrors or None
        What the errors of different poses have in common.

    Notes
    -----
    The parameters are a linear function H of the errors, H = C J^T W with the slopes J and the
    weights W of the fit, so the added covariance is H S H^T for errors of covariance S.
    """
    k = len(fit.model.fitted)
    if between is None or k == 0:
        return np.zeros((k, k))
    n = fit.residuals.shape[1]
    slopes = np.broadcast_to(fit.corrected.by_parameters, (1, n, 3, k))[0]
    root = np.sqrt(fit.weights[0][:, [0, 0, 1]])
    precision = root[:, :, None] * np.linalg.inv(regular(fit.covariances[0])) * root[:, None, :]
    own = known_part(covariance)
    gain = np.einsum("kl,nil,nij->knj", own, slopes, precision, optimize=True)
    added = between.seen_by(gain)
    known = np.isfinite(np.diagonal(covariance))
    if np.linalg.eigvalsh((own + added)[known][:, known]).min(initial=1.0) >= 0:
        return np.asarray(added)
    # Errors that cancel make parameters better known, but never better than exactly.
    values, vectors = np.linalg.eigh(added)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def dropped_p_value(full: Fit, simple: Fit, covariance: Array) -> float:
    """Chance of so large values of what the simpler explanation leaves out, if it were true.

    Parameters
    ----------
    full, simple : Fit
        The simpler one is contained in the full one.
    covariance : (k, k) array
        Of the full one's parameters, shared errors included.
    """
    kept = set(simple.model.parameters)
    rows = [i for i, name in enumerate(full.model.parameters) if name not in kept]
    block = covariance[np.ix_(rows, rows)]
    if not rows or not np.isfinite(block).all():
        return 1.0
    values = full.parameters[0, rows]
    return float(special.chdtrc(len(rows), values @ np.linalg.solve(regular(block), values)))
