"""The frame on the floor: its four points from poles and diagonals, and whether it is square."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from math import erfc

import numpy as np

from survey.readings.readings import Readings
from validation.campaign.folder import Vframe
from validation.poses.angles import Array


@dataclass(frozen=True)
class FrameCheck:
    """A test of one property of the frame.

    Parameters
    ----------
    name : str
        What is tested, in words.
    measured, expected : float
        Metres or radians.
    sigma : float
        Standard deviation of their difference if the stated sigmas hold.
    p_value : float
        Two-sided chance of a difference at least as large.
    unit : str
        'm' or 'rad'.
    rests_on : frozenset of str
        The measured lengths that it is computed from, such as 'X–Y'.
    """

    name: str
    measured: float
    expected: float
    sigma: float
    p_value: float
    unit: str = "m"
    rests_on: frozenset[str] = frozenset()


@dataclass(frozen=True)
class VframeEstimate:
    """Coordinates of the Vframe points before the joint adjustment.

    Parameters
    ----------
    names : tuple of str, length n
        Their names.
    points : (n, 2) array
        Metres, in the Vframe.
    covariance : (2 n, 2 n) array
        Of x and y of each in turn, square metres.
    checks : tuple of FrameCheck
        Lengths, right angles, equal diagonals.
    """

    names: tuple[str, ...]
    points: Array
    covariance: Array
    checks: tuple[FrameCheck, ...] = ()

    @property
    def tests(self) -> tuple[FrameCheck, ...]:
        """One check for each set of readings: what rests on the same readings is one test."""
        return tuple({check.rests_on: check for check in reversed(self.checks)}.values())[::-1]


def estimate_vframe(vframe: Vframe, readings: Readings) -> VframeEstimate:
    """The frame's nominal points, how well they are marked, and the tests of its shape.

    Parameters
    ----------
    vframe : Vframe
        Nominal points and the standard deviation of marking each coordinate.
    readings : Readings
        All readings; those between two Vframe points are tested.

    Notes
    -----
    AD2.3, "Definition of the validation frame". The nominal frame is the GTV frame; marks stand
    off it by ``sigma`` in each coordinate. Poles and diagonals are tested here; they improve the
    points only in the joint adjustment, so that trilateration rests on the same coordinates as
    in the document.
    """
    names = tuple(vframe.points)
    nominal = np.array([vframe.points[name] for name in names], dtype=float)
    inner = readings.touching(names, names)
    checks = (
        *_length_checks(vframe, inner),
        *_right_angle_checks(vframe, inner),
        *_diagonal_checks(vframe, inner),
    )
    return VframeEstimate(names, nominal, np.eye(nominal.size) * vframe.sigma**2, checks)


def _mean_distances(inner: Readings) -> Mapping[frozenset[str], tuple[float, float]]:
    """Weighted mean and its standard deviation for each pair that was measured."""
    pairs: dict[frozenset[str], list[int]] = {}
    for row, ends in enumerate(zip(inner.start, inner.end, strict=True)):
        pairs.setdefault(frozenset(ends), []).append(row)
    means = {}
    for pair, rows in pairs.items():
        weight = 1 / np.square(inner.sigma[rows])
        mean = float((weight * inner.distance[rows]).sum() / weight.sum())
        means[pair] = mean, float(1 / np.sqrt(weight.sum()))
    return means


def _length_checks(vframe: Vframe, inner: Readings) -> list[FrameCheck]:
    """Each measured length against its nominal one."""
    checks = []
    for pair, (measured, sigma) in _mean_distances(inner).items():
        a, b = (n for n in vframe.points if n in pair)
        expected = float(np.linalg.norm(np.subtract(vframe.points[a], vframe.points[b])))
        total = float(np.sqrt(sigma**2 + 2 * vframe.sigma**2))
        checks.append(_check(f"length {a}–{b}", measured, expected, total, [(a, b)]))
    return checks


def _right_angle_checks(vframe: Vframe, inner: Readings) -> list[FrameCheck]:
    """Angle at each corner that is nominally right, from the diagonal across it.

    A side that was not measured enters with its nominal length and the marking sigma.
    """
    lengths = _mean_distances(inner)
    checks = []
    for corner in vframe.points:
        others = [name for name in vframe.points if name != corner]
        for a, b in combinations(others, 2):
            u = np.subtract(vframe.points[a], vframe.points[corner])
            v = np.subtract(vframe.points[b], vframe.points[corner])
            across = lengths.get(frozenset((a, b)))
            if across is None or abs(u @ v) > 1e-9:
                continue
            mark = np.sqrt(2) * vframe.sigma
            p, sp = lengths.get(frozenset((corner, a)), (float(np.linalg.norm(u)), mark))
            q, sq = lengths.get(frozenset((corner, b)), (float(np.linalg.norm(v)), mark))
            cosine = (p**2 + q**2 - across[0] ** 2) / (2 * p * q)
            slope = np.array([1 / q - cosine / p, 1 / p - cosine / q, -across[0] / (p * q)])
            of_readings = float(np.linalg.norm(slope * [sp, sq, across[1]]))
            of_marks = vframe.sigma * np.sqrt(2 / p**2 + 2 / q**2)
            # Lengths that make no triangle are an angle of 0 or pi: wrong by as much as can be.
            angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
            sigma = float(np.hypot(of_readings, of_marks))
            checks.append(
                _check(
                    f"right angle at {corner} ({a}–{corner}–{b})",
                    angle,
                    np.pi / 2,
                    sigma,
                    [
                        pair
                        for pair in ((a, b), (corner, a), (corner, b))
                        if frozenset(pair) in lengths
                    ],
                    "rad",
                )
            )
    return checks


def _diagonal_checks(vframe: Vframe, inner: Readings) -> list[FrameCheck]:
    """The two diagonals of a nominal rectangle against one another."""
    lengths = _mean_distances(inner)
    checks = []
    for (a, b), (c, d) in combinations(combinations(vframe.points, 2), 2):
        if {a, b} & {c, d} or not _are_diagonals(vframe, (a, b), (c, d)):
            continue
        first, second = lengths.get(frozenset((a, b))), lengths.get(frozenset((c, d)))
        if first is None or second is None:
            continue
        sigma = float(np.sqrt(first[1] ** 2 + second[1] ** 2 + 4 * vframe.sigma**2))
        name, pairs = f"equal diagonals {a}–{b} and {c}–{d}", [(a, b), (c, d)]
        checks.append(_check(name, first[0], second[0], sigma, pairs))
    return checks


def _are_diagonals(vframe: Vframe, one: tuple[str, str], two: tuple[str, str]) -> bool:
    """Whether two pairs are the diagonals of a rectangle: same middle, same length."""
    a, b, c, d = (np.array(vframe.points[name]) for name in (*one, *two))
    same_middle = np.allclose(a + b, c + d, atol=1e-9)
    same_length = np.isclose(np.linalg.norm(a - b), np.linalg.norm(c - d), atol=1e-9)
    return bool(same_middle and same_length)


def _check(
    name: str,
    measured: float,
    expected: float,
    sigma: float,
    pairs: Iterable[tuple[str, str]],
    unit: str = "m",
) -> FrameCheck:
    p_value = float(erfc(abs(measured - expected) / sigma / np.sqrt(2)))
    rests_on = frozenset("–".join(sorted(pair)) for pair in pairs)
    return FrameCheck(name, measured, expected, sigma, p_value, unit, rests_on)
