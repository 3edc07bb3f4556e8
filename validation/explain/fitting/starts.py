"""Where fits start: from zero, from a closed form where errors are large, from a smaller model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from validation.explain.fitting.fit import Fit, fit
from validation.explain.fitting.models import ErrorModel
from validation.explain.fitting.pairs import Pairs
from validation.poses.angles import Array

LARGE_TURN, LARGE_SHIFT = 0.3, 0.1
"""Typical errors of headings (radians), and of positions as a part of the room, from which on fits
start from a closed form as well. From zero, 60 simulated frames with turns up to 0.5 rad were all
found; with half a turn one in two."""
Plane = npt.NDArray[np.complex128]
"""Positions as complex numbers."""
_ROUNDS = 10
LOWER = 1e-6
"""A log likelihood that is lower than a smaller model's by more than this is not the greatest."""


def fit_all(pairs: Pairs, models: Sequence[ErrorModel], fitted: Sequence[Fit] = ()) -> list[Fit]:
    """Each model fitted, so that none is worse than one that it contains.

    Parameters
    ----------
    pairs : Pairs
        What to fit to.
    models : sequence of ErrorModel
        The simplest first.
    fitted : sequence of Fit
        Of simpler models, made before.
    """
    large = _large(pairs)
    made = list(fitted)
    for model in models:
        found = fit(pairs, model)
        if large:
            found = _better(found, fit(pairs, model, begin=closed_form(pairs, model)))
        for one in made:
            if one.model.nested_in(model) and _likelihood(one) > _likelihood(found) + LOWER:
                found = _better(found, fit(pairs, model, begin=_within(one, model)))
                if _likelihood(one) > _likelihood(found) + LOWER:  # stopped at a bound
                    same = replace(one, model=model, parameters=_within(one, model)[None])
                    found = fit(pairs, model, start=same, iterations=0)
        made.append(found)
    return made[len(fitted) :]


def _likelihood(one: Fit) -> float:
    return float(one.log_likelihood[0])


def _better(a: Fit, b: Fit) -> Fit:
    return b if _likelihood(b) > _likelihood(a) else a


def _within(small: Fit, model: ErrorModel) -> Array:
    """The parameters of a smaller model in those of a larger one."""
    known = dict(zip(small.model.fitted, small.parameters[0], strict=True))
    return np.array([known.get(name, 0.0) for name in model.fitted])


def _large(pairs: Pairs) -> bool:
    """Whether errors are so large that a fit from zero may end elsewhere."""
    errors = pairs.errors
    room = np.linalg.norm(pairs.validation[:, :2] - np.median(pairs.validation[:, :2], 0), axis=1)
    shift = float(np.median(np.linalg.norm(errors[:, :2], axis=1)))
    turn = float(np.median(np.abs(errors[:, 2])))
    return turn > LARGE_TURN or shift > LARGE_SHIFT * float(np.median(room))


def closed_form(pairs: Pairs, model: ErrorModel) -> Array:
    """(k,) parameters from linear least squares that gross errors hardly move.

    Notes
    -----
    With complex positions z of the validation and g of the GT, ``z = a g + f - m e^(i theta)``
    where theta is the validation's heading: linear in the frame ``a``, ``f`` and the arm ``m``.
    """
    z, g = (one[:, 0] + 1j * one[:, 1] for one in (pairs.validation, pairs.gt))
    heading, ahead = pairs.validation[:, 2], np.exp(1j * pairs.validation[:, 2])
    frame, mount = "frame" in model.parts, "mount" in model.parts
    moved = frame or "shift" in model.parts
    found: dict[str, float] = {}
    columns = [np.ones_like(z)] if moved else []
    columns += [-ahead] if mount else []
    turn = 1 + 0j
    if frame:
        first = _solved(z, [g, *columns])
        turn = first[0] / abs(first[0]) if abs(first[0]) > 1e-9 else turn
        if np.linalg.matrix_rank(np.column_stack([g, *columns]), tol=1e-6) <= len(columns):
            turn = 1 + 0j
        if not mount:
            both = np.exp(1j * (heading - pairs.gt[:, 2]))
            turn = turn if abs(np.angle(turn)) else both.mean() / max(abs(both.mean()), 1e-9)
    rest = _solved(z - turn * g, columns) if columns else np.zeros(0, dtype=complex)
    if moved:
        found.update(frame_x=rest[0].real, frame_y=rest[0].imag, frame_theta=np.angle(turn))
    if mount:
        found.update(mount_x=rest[-1].real, mount_y=rest[-1].imag)
    if mount or "turn" in model.parts:
        off = np.exp(1j * (pairs.gt[:, 2] - heading)) * turn
        found["mount_theta"] = float(np.angle(np.median(off.real) + 1j * np.median(off.imag)))
    return np.array([found.get(name, 0.0) for name in model.fitted], dtype=float)


def _solved(target: Plane, columns: Sequence[Plane]) -> Plane:
    """Complex coefficients, reweighted."""
    design, weights = np.column_stack(columns), np.ones(len(target))
    for _ in range(_ROUNDS):
        root = np.sqrt(weights)
        found = np.linalg.lstsq(design * root[:, None], target * root, rcond=1e-9)[0]
        sizes = np.abs(target - design @ found)
        weights = 1 / (1 + (sizes / max(2 * float(np.median(sizes)), 1e-12)) ** 2)
    return np.asarray(found)
