"""Whether two tables differ by a convention: a mirrored axis, exchanged axes, a unit, a heading.

Such a difference is no small error of a frame or a mount, and no number of theirs makes it good. It
is looked for first, from the shapes of both tables, and taken out before anything is fitted.

Covariances may be in another unit than their positions: who writes millimetres as metres seldom
thinks of them. Read as they stand they are a million times too small or too large, and each small
thing is then a cause, or nothing is.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from validation.explain.fitting.angle_unit import CERTAIN, chance_of_agreement
from validation.poses.angles import Array, wrap
from validation.statistics.units import PER_METRE, unit_of_ratio

Plane = npt.NDArray[np.complex128]
"""Positions as complex numbers."""
FEWEST = 5
"""Poses from which on a convention is looked for: a plane map and an arm take six of their ten
coordinates."""
BETTER = 3.0
"""Times by which the typical residual of a shape must fall. A judgement: by chance that of two maps
with equally many parameters differs by less than a half."""
SURE = float(np.log(1e6))
"""Log of the odds that are asked for, as for degrees taken for radians (`angle_unit.CERTAIN`)."""
ALIGNED = 0.12
"""Radians within which an axis is named. Frames are set up by hand to a few degrees; between two
axes lie ninety."""
_ROUNDS = 12
"""Of reweighting; residuals of 200 simulated tables with wrong poses settled within ten."""


@dataclass(frozen=True)
class Convention:
    """How a table is to be read.

    Parameters
    ----------
    name : str
        'mirrored_y', 'exchanged_axes', 'millimetres', 'clockwise', 'direction_of_motion', ...;
        joined by '+' where there are several; empty if there is none.
    words : str
        What is different, for a sentence.
    shrink : float
        Metres in one of the table's units.
    mirror : complex
        Factor after the positions were mirrored at x; 0 where they are not.
    sign, turn : float
        A heading is to be read as ``sign`` times itself, plus ``turn``.
    radians : float
        Radians in one of the table's units of angle.
    """

    name: str = ""
    words: str = ""
    shrink: float = 1.0
    mirror: complex = 0j
    sign: float = 1.0
    turn: float = 0.0
    radians: float = 1.0

    @property
    def headings_lost(self) -> bool:
        """Whether headings are not those of the robot, and nobody knows what these were."""
        return ALONG in self.name

    def read(self, poses: Array) -> Array:
        """Poses (n, 3) in the convention of the other table."""
        if not self.name:
            return poses
        z: Plane = np.asarray(self.shrink * (poses[:, 0] + 1j * poses[:, 1]), dtype=complex)
        if self.mirror:
            z = np.asarray(self.mirror * np.conj(z), dtype=complex)
        theta = self.sign * poses[:, 2] * self.radians + self.turn
        return np.column_stack([z.real, z.imag, wrap(theta)])

    def read_covariances(self, covariances: Array) -> Array:
        """Covariances (n, 3, 3) in the convention of the other table."""
        if not self.name:
            return covariances
        m = self.mirror
        part = [[m.real, m.imag], [m.imag, -m.real]] if m else np.eye(2)
        change = np.zeros((3, 3))
        change[:2, :2] = self.shrink * np.array(part)
        change[2, 2] = self.sign * self.radians
        made = np.asarray(change @ covariances @ change.T)
        if self.headings_lost:
            made[:, 2, 2] += np.pi**2 / 3  # of a heading that may be any
        return made


ALONG = "direction_of_motion"
"""Name of headings that are the direction of motion."""
NONE = Convention()


def convention_of(validation: Array, gt: Array) -> Convention:
    """How a GT table is to be read, so that it fits the validation poses.

    Parameters
    ----------
    validation, gt : (n, 3) array
        Poses at the same stops, in the order in which they were visited.
    """
    if len(gt) < FEWEST:
        return NONE
    names, words = [], []
    shrink, mirror, shape = _positions(validation, gt)
    unit = unit_of_ratio(1 / shrink)
    if unit:
        names.append(unit)
        words.append(f"positions in {unit} instead of metres")
    sign, turn, radians, heading = _headings(validation[:, 2], gt[:, 2], mirrored=bool(mirror))
    if mirror:
        names.append(shape)
        words.append(SHAPES[shape] + ("" if sign < 0 else ", in positions but not in headings"))
    if heading:
        names.append(heading)
        words.append(HEADINGS[heading])
    found = Convention("", "", shrink, mirror, sign, turn, radians)
    if not heading and along_the_path(validation, gt, found):
        names.append(ALONG)
        words.append("headings that are the direction of motion and not those of the robot")
    return Convention("+".join(names), " and ".join(words), shrink, mirror, sign, turn, radians)


SHAPES = {
    "mirrored_y": "a mirrored y axis",
    "mirrored_x": "a mirrored x axis",
    "exchanged_axes": "exchanged axes (x for y)",
    "mirrored": "mirrored axes",
}
HEADINGS = {
    "clockwise": "headings that count clockwise",
    "degrees": "headings in degrees instead of radians",
}


def plane_fit(target: Plane, columns: Plane) -> tuple[float, Plane]:
    """Median residual of a complex least-squares fit that gross errors hardly move."""
    weights = np.ones(len(target))
    for _ in range(_ROUNDS):
        root = np.sqrt(weights)
        found = _solved(columns * root[:, None], target * root)
        sizes = np.abs(target - columns @ found)
        typical = max(float(np.median(sizes)), 1e-12)
        weights = 1 / (1 + (sizes / (2 * typical)) ** 2)
    return typical, np.asarray(found)


def _solved(columns: Plane, target: Plane) -> Plane:
    """Least squares: by the normal equations where these lose less than four digits of sixteen."""
    size = np.linalg.norm(columns, axis=0)
    if (size > 0).all():
        scaled = columns / size
        normal = scaled.conj().T @ scaled
        if np.linalg.cond(normal) < WELL_POSED:
            return np.asarray(np.linalg.solve(normal, scaled.conj().T @ target) / size)
    return np.asarray(np.linalg.lstsq(columns, target, rcond=1e-9)[0])


WELL_POSED = 1e4
"""Condition of normal equations, columns of length one, up to which they are solved: an error of
1e-16 grows to 1e-12, far below any median residual that is compared."""


def _positions(validation: Array, gt: Array) -> tuple[float, complex, str]:
    """Metres in a unit of the GT, the factor of its mirror image (0 if none), and its name."""
    z, w = (one[:, 0] + 1j * one[:, 1] for one in (validation, gt))
    n, ones = len(z), np.ones(len(z))
    arms = [np.exp(1j * validation[:, 2])] if n > FEWEST + 2 else []
    straight, found = plane_fit(w, np.column_stack([z, ones, *arms]))
    # A mirrored sensor sees its own arm mirrored, too.
    turned, image = plane_fit(w, np.column_stack([np.conj(z), ones, *map(np.conj, arms)]))
    freedom = 2 * n - 4 - 2 * len(arms)
    is_image = turned * BETTER < straight and freedom * np.log(straight / turned) > SURE
    factor, left = (image[0], turned) if is_image else (found[0], straight)
    spread = float(np.abs(z - z.mean()).std() + np.abs(z - z.mean()).mean())
    size = float(abs(factor))
    # The scale is known where the stops lie apart by far more than the residuals.
    known = size * spread > 10 * left / np.sqrt(n)
    unit = unit_of_ratio(size) if known else ""
    shrink = 1 / PER_METRE[unit] if unit else 1.0
    if not is_image or not known:
        return shrink, 0j, ""
    angle = float(np.angle(factor))
    quarter = round(angle / (np.pi / 2))
    if abs(angle - quarter * np.pi / 2) > ALIGNED:
        return shrink, 1 + 0j, "mirrored"
    name = {0: "mirrored_y", 2: "mirrored_x", -2: "mirrored_x"}.get(quarter, "exchanged_axes")
    # w = f conj(z) is undone by z = conj(w / f) = f conj(w) for |f| = 1.
    return shrink, complex(np.round(np.exp(0.5j * np.pi * quarter))), name


def _headings(validation: Array, gt: Array, *, mirrored: bool) -> tuple[float, float, float, str]:
    """Sign, turn and radians by which headings are to be read, and a name if that is one."""
    n = len(gt)
    same, as_image = _apart(validation - gt), _apart(validation + gt)
    in_degrees = _apart(validation - np.radians(gt))
    if in_degrees * 5 < min(same, as_image) and chance_of_agreement(n, in_degrees) < CERTAIN:
        return 1.0, 0.0, np.pi / 180, "degrees"
    if as_image * BETTER > same or (n - 1) * np.log(same / max(as_image, 1e-9)) < SURE:
        return 1.0, 0.0, 1.0, ""
    turn = float(np.angle(np.exp(1j * (validation + gt)).mean()))
    quarter = round(turn / (np.pi / 2))
    turn = quarter * np.pi / 2 if abs(turn - quarter * np.pi / 2) < ALIGNED else 0.0
    return -1.0, turn, 1.0, "" if mirrored else "clockwise"


def _apart(difference: Array) -> float:
    """Median distance of angles from their middle direction."""
    turned = np.exp(1j * difference)
    middle = turned.mean()
    for _ in range(3):
        off = wrap(np.angle(turned / middle)) if abs(middle) > 1e-9 else np.angle(turned)
        weights = 1 / (1 + (off / max(float(np.median(np.abs(off))), 1e-6)) ** 2)
        middle = (weights * turned).sum()
    return max(float(np.median(np.abs(off))), 1e-9)


def along_the_path(validation: Array, gt: Array, reading: Convention) -> bool:
    """Whether the headings of the GT are the direction of its own motion, not the robot's.

    They must fit the way from pose to pose far better than the validation's headings, which must
    themselves not be that direction.
    """
    read = replace(reading, name="read").read(gt)
    for rows, own_way, way in zip(_ROWS, _ways(read), _ways(validation), strict=True):
        if len(own_way) < FEWEST:
            return False
        own = _apart(read[rows, 2] - own_way)
        robot = _apart(read[rows, 2] - validation[rows, 2])
        other = min(robot, _apart(validation[rows, 2] - way))
        if own * BETTER < other and (len(way) - 1) * np.log(other / own) > SURE:
            return True
    return False


_ROWS = (slice(0, -1), slice(1, None), slice(1, -1))
"""Poses that have a way to the next, from the last, and between both."""


def _ways(poses: Array) -> tuple[Array, Array, Array]:
    """Directions of motion to the next pose, from the last, and between both."""
    steps = np.diff(poses[:, 0] + 1j * poses[:, 1])
    return np.angle(steps), np.angle(steps), np.angle(steps[1:] + steps[:-1])


FEWEST_COVARIANCES = 8
"""Poses from which on it is looked for: the fit takes six of their sixteen coordinates."""
RAYLEIGH = float(np.sqrt(2 * np.log(2)))
"""Median length of a plane error over the standard deviation of a coordinate."""
FITS = 2.0
"""Times by which what is left may differ from what is stated in the unit that is told. A judgement:
standard deviations ten times too large, as cautious people state, are then not taken for square
centimetres, beside a survey that is half as noisy as the system."""
OFF = 50.0
"""Times by which both tables together must be wrong as they stand, where positions are in metres:
another unit makes a hundred of one of them, beside another that is as noisy 71. With 10, standard
deviations of a survey that were 15 times too large were taken for square centimetres in 41 of 47
campaigns; what is not taken for a unit is still found to be of another size (`fitting.level`)."""
UNITS = ("millimetres", "centimetres")


@dataclass(frozen=True)
class CovarianceUnit:
    """How the covariances of two tables are to be read.

    Parameters
    ----------
    words : str
        What is wrong, for a sentence; empty if nothing is.
    validation, gt : float
        Factors on the standard deviations of positions.
    ratio : float
        What is left of the positions over what is stated, as the covariances stand.
    """

    words: str = ""
    validation: float = 1.0
    gt: float = 1.0
    ratio: float = float("nan")

    def read(self, covariances: Array, factor: float) -> Array:
        """Covariances (..., 3, 3) with the standard deviations of positions times a factor."""
        size = np.array([factor, factor, 1.0])
        return np.asarray(covariances * size[:, None] * size)


AS_STATED = CovarianceUnit()


def covariance_unit(
    validation: Array, gt: Array, ours: Array, theirs: Array, shrink: float
) -> CovarianceUnit:
    """The unit of the covariances, where chi-squared leaves no doubt.

    Parameters
    ----------
    validation, gt : (n, 3) array
        Poses, both in metres.
    ours, theirs : (n, 3, 3) array
        Their covariances; those of the GT read in the unit of its positions.
    shrink : float
        Metres in one of the units in which the GT table has its positions.

    Notes
    -----
    Sum of the squares of what a frame, a scale and a mount leave of the positions, by its median,
    so that wrong poses do not count; its density under each unit. Another unit is told where it is
    a million times as likely and what is left is then as large as stated, within `FITS`.
    """
    n = len(gt)
    if n < FEWEST_COVARIANCES:
        return AS_STATED
    z, w = (one[:, 0] + 1j * one[:, 1] for one in (validation, gt))
    typical, _ = plane_fit(z, np.column_stack([w, np.ones(n), np.exp(1j * gt[:, 2])]))
    spread = typical / RAYLEIGH * np.sqrt(2 * n / (2 * n - 6))
    own, other = (
        float(np.trace(c[:, :2, :2], axis1=1, axis2=2).mean()) / 2 for c in (ours, theirs)
    )
    if not own + other > 0:
        return AS_STATED

    def cost(first: float, second: float) -> tuple[float, float]:
        sigma = np.sqrt(first**2 * own + second**2 * other)
        ratio = float(spread / sigma)
        return 2 * n * (ratio**2 / 2 + float(np.log(sigma))), ratio

    now, ratio = cost(1.0, 1.0)
    if shrink == 1 and 1 / OFF < ratio < OFF:
        return AS_STATED
    tried = []
    if shrink != 1:
        unit = "square metres, and its positions are not in metres"
        tried.append((f"this system's covariances are in {unit}", 1.0, 1 / shrink))
    for unit in UNITS if shrink == 1 else ():
        f, said = 1 / PER_METRE[unit], f"in square {unit}, and the positions in metres"
        tried += [
            (f"this system's covariances are {said}", 1.0, f),
            (f"the validation's covariances are {said}", f, 1.0),
            (f"the covariances of both tables are {said}", f, f),
        ]
    told = [(cost(first, second), words, first, second) for words, first, second in tried]
    fits = [one for one in told if now - one[0][0] > SURE and 1 / FITS < one[0][1] < FITS]
    # Where one table alone explains it, nothing says that the other is wrong as well.
    fits = [one for one in fits if 1.0 in one[2:]] or fits
    if not fits:
        return AS_STATED
    _, words, first, second = min(fits)
    return CovarianceUnit(words, first, second, ratio)
