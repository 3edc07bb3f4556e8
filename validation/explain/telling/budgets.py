"""Uncertainty budgets in which frame, mount and clock are told apart, by the fit of all three."""

import numpy as np

from validation.explain.analysis import SystemExplanation
from validation.explain.fitting.models import PARTS
from validation.explain.fitting.selection import Candidate, Selection
from validation.poses.angles import Array
from validation.poses.pose_table import PLANAR
from validation.statistics.standards.budget import Budget, Contribution, budget
from validation.statistics.standards.summary import ERRORS, noise_lines

LINES = {"frame": ("frame", "slip"), "mount": ("mount",), "clock": ("time",)}
"""Parts of the chain in each line; where the surveyed reference slips, the frame does."""
GOOD = 0.5
"""Weight above which a cell counts: it is more likely good than not."""


def system_budgets(one: SystemExplanation, confidence: float = 0.95) -> tuple[Budget, ...]:
    """Of x, y and theta of the error of one pose, once frame, mount and clock are taken out.

    Parameters
    ----------
    one : SystemExplanation
        With the fit of frame and mount, and of the time where the robot moves.
    confidence : float
        Of the expanded uncertainties.

    Returns
    -------
    tuple of Budget
        Empty where the poses do not determine both, or errors depend on their neighbours.

    Notes
    -----
    Variances of the fitted parameters, carried to the poses by the fit's derivatives and averaged
    over them. Estimates of frame and mount are correlated: what they make together is exact, and
    is shared among the lines in proportion to what each would make alone.
    """
    if one.selection is None or one.selection.dependent:
        return ()
    chosen = _widest(one.selection)
    if chosen is None:
        return ()
    fit, pairs = chosen.fit, one.selection.pairs
    freedom = float(max(fit.observations - len(fit.model.fitted), 1))
    grown = fit.observations / freedom if fit.estimated else 1.0
    covariance = grown * fit.covariance[0]
    slopes = np.broadcast_to(
        fit.corrected.by_parameters, (1, len(pairs), 3, len(fit.model.fitted))
    )[0]
    shared = np.einsum("nij,jk,nik->i", slopes, covariance, slopes) / len(pairs)
    alone = {name: _alone(slopes, covariance, fit.model.fitted, name) for name in LINES}
    total = np.sum(list(alone.values()), axis=0)
    survey = np.diagonal(pairs.validation_covariances, axis1=1, axis2=2)
    found = []
    for column, component in enumerate(PLANAR):
        cells = fit.weights[0, : len(pairs), column // 2] > GOOD
        squares = float(np.square(fit.residuals[0, cells, column]).sum())
        # Each component bears a third of the fitted numbers.
        left = max(float(cells.sum()) - len(fit.model.parameters) / 3, 1.0)
        known = survey[:, column] if pairs.stated else np.full(len(pairs), np.nan)
        lines, missing = noise_lines(known, squares / left, left)
        systematic = [
            Contribution(
                name,
                float(np.sqrt(shared[column] * part[column] / total[column])),
                freedom,
                "A",
                ERRORS,
            )
            for name, part in alone.items()
            if part[column] > 0
        ]
        every = [*lines[:-1], *systematic, lines[-1]]
        found.append(budget(component.name, component.unit, every, confidence, missing))
    return tuple(found)


def _widest(selection: Selection) -> Candidate | None:
    """The fit of frame and mount, and time where it can be told; None where that is not known."""
    for name in ("frame_mount_time", "frame_mount"):
        for one in selection.candidates:
            if one.name == name and one.observability.complete:
                return one
    return None


def _alone(slopes: Array, covariance: Array, fitted: tuple[str, ...], line: str) -> Array:
    """(3,) variance of x, y and theta by the parameters of one line, on average over the poses."""
    names = {name for part in LINES[line] for name in PARTS[part]}
    rows = [i for i, name in enumerate(fitted) if name in names]
    if not rows:
        return np.zeros(3)
    own = slopes[:, :, rows]
    block = covariance[np.ix_(rows, rows)]
    return np.asarray(np.einsum("nij,jk,nik->i", own, block, own) / len(own))
