"""The evidence on one system: its errors against what they may depend on, before and after."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from validation.explain.analysis import SystemExplanation
from validation.poses.angles import Array, wrap
from validation.results import Figure, Table
from validation.statistics.evaluation import Evaluation
from validation.statistics.neighbours import Told, neighbours_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

FEWEST = 3
"""Stops below which nothing is drawn."""


def evidence_figure(
    evaluation: Evaluation,
    explained: SystemExplanation | None = None,
    times: Mapping[str, float] | None = None,
) -> Figure | None:
    """Sizes of the errors over order, time, heading, speed, distance, source; their distribution.

    Parameters
    ----------
    evaluation : Evaluation
        The errors.
    explained : SystemExplanation, optional
        For the errors after the explanation is taken out, and the stop that is the reference.
    times : mapping of str to float, optional
        Seconds of the stops.
    """
    if len(evaluation.comparison) < FEWEST:
        return None
    return Figure(
        f"evidence_{evaluation.system}",
        "Sizes of the errors, as they came and with the explanation taken out, over what they may "
        "depend on; the share below each size; and each error over that of the stop before.",
        f"Scatter plots of the errors of {evaluation.system}. The numbers are in the table of its "
        "poses.",
        partial(_draw, evaluation, explained, times or {}),
    )


def _draw(
    evaluation: Evaluation, explained: SystemExplanation | None, times: Mapping[str, float]
) -> "MatplotlibFigure":
    from validation.figures.summary import Evidence, evidence  # noqa: PLC0415  (half a second that text does without)

    one = evaluation.comparison
    columns = [k for k, component in enumerate(one.components) if component.kind == "length"]
    columns = columns or list(range(len(one.components)))
    after = _after(evaluation, explained)
    told = Evidence(
        f"m{one.components[columns[0]].unit}",
        np.linalg.norm(one.errors[:, columns], axis=1),
        None if after is None else np.linalg.norm(after[:, columns], axis=1),
        _axes(evaluation, explained, times),
        one.gt.sources,
    )
    return evidence(f"{evaluation.system}: sizes of the errors", told)


def _after(evaluation: Evaluation, explained: SystemExplanation | None) -> Array | None:
    """(n, k) errors with the explanation taken out, NaN where unknown; None where there is none."""
    settled = explained.settled if explained is not None else None
    if settled is None or not settled.fit.model.parts:
        return None
    left = dict(zip(settled.pairs.ids, settled.after, strict=True))
    unknown = np.full(settled.after.shape[1], np.nan)
    return np.array([left.get(name, unknown) for name in evaluation.comparison.ids])


def _axes(
    evaluation: Evaluation, explained: SystemExplanation | None, times: Mapping[str, float]
) -> dict[str, Array]:
    """What errors are drawn against, by its name."""
    one = evaluation.comparison
    n, names = len(one), [component.name for component in one.components]
    found = {"order of the stops": np.arange(1.0, n + 1)}
    lengths = [k for k, component in enumerate(one.components) if component.kind == "length"]
    places = one.validation.poses[:, lengths]
    if all(name in times for name in one.ids):
        seconds = np.array([times[name] for name in one.ids])
        found["time [s]"] = seconds - seconds.min()
        if lengths and (np.diff(seconds) > 0).all():
            speeds = np.linalg.norm(np.gradient(places, seconds, axis=0), axis=1)
            found["speed [m/s]"] = speeds
    heading = next((names.index(name) for name in ("theta", "yaw") if name in names), None)
    if heading is not None:
        found["heading [degrees]"] = np.degrees(wrap(one.validation.poses[:, heading]))
    if lengths:
        selection = explained.selection if explained is not None else None
        tied = selection.pairs.reference if selection is not None else None
        if tied in one.ids:
            found[f"distance from reference {tied} [m]"] = np.linalg.norm(
                places - places[one.ids.index(tied)], axis=1
            )
        else:
            found["distance from the origin [m]"] = np.linalg.norm(places, axis=1)
    return found


def dependence_table(
    evaluation: Evaluation, explained: SystemExplanation | None = None
) -> Table | None:
    """Whether errors depend on those of their neighbours, before and after the explanation.

    Parameters
    ----------
    evaluation : Evaluation
        With what was found of its errors as they came; None is returned where nothing was.
    explained : SystemExplanation, optional
        For the errors after the explanation is taken out.
    """
    if evaluation.neighbours is None:
        return None
    rows = _rows("as it came", evaluation.neighbours)
    after = _after(evaluation, explained)
    if after is not None:
        weighed = next(iter(evaluation.neighbours.kinds.values()))[0]
        kinds = {name: at for name, (_, at) in evaluation.neighbours.kinds.items()}
        known = np.isfinite(after).all(axis=1)
        left = neighbours_of(weighed.steps[known], after[known] - after[known].mean(axis=0), kinds)
        rows += [] if left is None else _rows("explanation out", left)
    return Table(
        f"{evaluation.system}: do errors depend on those of their neighbours?",
        ["errors", "of", "correlation of neighbours", "lasts [poses]", "log odds", "so they do"],
        rows,
        ["", "", ".2f", ".1f", ".1f", ""],
        "In the order of the stops. Log odds: of errors that last against errors without memory, "
        "both Gaussian, positions and headings together. Where they do, intervals are widened.",
    )


def _rows(what: str, told: Told) -> list[list[str | int | float | None]]:
    answer = "yes" if told.dependent else "not shown"
    return [
        [what, name, one.neighbours, one.length, told.gain, answer]
        for name, (one, _) in told.kinds.items()
    ]
