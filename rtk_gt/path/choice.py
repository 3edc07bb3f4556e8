"""Which of several solutions is the vehicle's: the one whose nose points where it drives."""

from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.minima import Minima
from rtk_gt.path.antennas import Antennas, Places
from rtk_gt.path.motion_check import forward_share
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.fixes import Ints
from rtk_gt.receivers.steps import Steps, receiver_pairs
from validation.errors import GtvalError

AHEAD = 0.5
"""Share of the way that goes along the nose, above which it points ahead: 60 degrees. A vehicle
that drives forward has some 0.99, the solutions that are turned by half -0.99."""
LARGEST_HEADING = np.radians(10.0)
"""Standard deviation of a heading above which it is open: an error of 20 degrees bends an arm by
6 % of its length, and what is wrong is no longer along one line."""
_POSES = 2000
"""Poses that suffice to see where the nose points."""


@dataclass(frozen=True)
class Choice:
    """The solution taken, and what was not.

    Parameters
    ----------
    offsets : Offsets
        The vehicle's.
    antennas : Antennas
        Their positions on the vehicle.
    left : tuple of Offsets
        As good as far as the distances go, but with the nose against the motion.
    """

    offsets: Offsets
    antennas: Antennas
    left: tuple[Offsets, ...] = ()


def choose(minima: Minima, steps: Steps, places: Places, max_gap: float) -> Choice:
    """The solution whose nose points where the vehicle drives, if there are several.

    Parameters
    ----------
    minima : Minima
        What the steps allow.
    steps : Steps
        As recorded.
    places : Places
        What is stated of the antennas.
    max_gap : float
        Poses farther apart in time show no motion, in seconds.

    Raises
    ------
    GtvalError
        If more than one solution remains, or none.
    """
    solutions = (minima.best, *minima.others)
    if len(solutions) == 1:
        return Choice(minima.best, places.antennas(minima.best.distances))
    found: list[tuple[Offsets, Antennas, VehiclePath]] = []
    for offsets in solutions:
        try:
            antennas = places.antennas(offsets.distances)
            found.append((offsets, antennas, _short_path(steps, offsets, antennas)))
        except GtvalError:  # no triangle, or upside down: not this vehicle
            continue
    shares = [forward_share(path, max_gap) for _, _, path in found]
    ahead = [row for row, share in enumerate(shares) if share is not None and share > AHEAD]
    if len(found) == 1:
        ahead = [0]
    if len(ahead) == 1:
        offsets, antennas, _ = found[ahead[0]]
        return Choice(offsets, antennas, tuple(o for o, _, _ in found if o is not offsets))
    raise GtvalError(_ambiguous([path for _, _, path in found], shares))


def check_order(minima: Minima, steps: Steps, places: Places, max_gap: float) -> None:
    """Raise if two receivers are exchanged: the antennas then go round the other way.

    Parameters
    ----------
    minima, steps, places, max_gap
        As in `choose`.

    Raises
    ------
    GtvalError
        Naming the two, where the motion tells which.
    """
    if minima.mirrored is not None:
        raise GtvalError(_exchanged(minima.mirrored, steps, places, max_gap))


def _exchanged(offsets: Offsets, steps: Steps, places: Places, max_gap: float) -> str:
    """Which two of the first three receivers are exchanged, as far as the motion tells."""
    text = "the vehicle comes out upside down: the antennas go round the other way than listed. "
    names = offsets.receivers
    likely = []
    for i, j in receiver_pairs(3):
        order = np.arange(len(names))
        order[[i, j]] = j, i
        turned, wanted = _reordered(steps, order), _offsets_in_order(offsets, order)
        try:
            antennas = places.antennas(wanted.distances)
            share = forward_share(_short_path(turned, wanted, antennas), max_gap)
        except GtvalError:
            continue
        if share is not None and share > 0.9:  # a judgement: 25 degrees, other pairs make 60
            likely.append((share, names[i], names[j]))
    if likely:
        _, one, other = max(likely)
        text += f"The files of {one} and {other} are exchanged: with them the other way round the "
        text += "nose points where the vehicle drives"
    else:
        text += f"Are two of {', '.join(names)} exchanged? {places.order}"
    return text


def _reordered(steps: Steps, order: Ints) -> Steps:
    return replace(steps, positions=steps.positions[:, order], kinds=steps.kinds[:, order])


def _offsets_in_order(offsets: Offsets, order: Ints) -> Offsets:
    """The offsets and distances of receivers in another order; covariances stay as they were."""
    values = offsets.offsets.values[order]
    rows = {pair: row for row, pair in enumerate(receiver_pairs(len(order)))}
    places = [
        rows[min(order[i], order[j]), max(order[i], order[j])]
        for i, j in receiver_pairs(len(order))
    ]
    return replace(
        offsets,
        offsets=replace(offsets.offsets, values=values - values[0]),
        distances=offsets.distances[places],
    )


def check_attitude(path: VehiclePath) -> None:
    """Raise if the heading is as good as unknown.

    Raises
    ------
    GtvalError
        Saying how large the error may be, and what to state.
    """
    sigma = float(np.sqrt(np.median(path.systematic_covariances[:, 3, 3])))
    if sigma > LARGEST_HEADING:
        raise GtvalError(
            f"the heading of the vehicle is open by {np.degrees(sigma):.0f} degrees (one standard "
            f"deviation, the most is {np.degrees(LARGEST_HEADING):.0f}): the vehicle turned too "
            "little to tell the offsets across it. State [rtk.known_offsets] from a longer drive "
            "with turns; `gtval rtk coverage` works without. If it did turn: a clock that is off "
            "by tenths of a second looks like another vehicle at one speed; set the receivers' "
            "clocks by the satellites' time, or drive at several speeds"
        )


def _short_path(steps: Steps, offsets: Offsets, antennas: Antennas) -> VehiclePath:
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    # Neighbours, not every n-th step: motion is seen between poses that are near in time.
    begin = max((len(rows) - _POSES) // 2, 0)
    return vehicle_path(steps.select(rows[begin : begin + _POSES]), offsets, antennas)


def _ambiguous(paths: list[VehiclePath], shares: list[float | None]) -> str:
    headings = ", ".join(f"{np.degrees(path.poses[0, 3]):.0f}" for path in paths[:4])
    more = f" and {len(paths) - 4} more" if len(paths) > 4 else ""
    moves = any(share is not None for share in shares)
    why = (
        "in none of them, or in several, the nose points where the vehicle drives"
        if moves
        else "the vehicle does not drive, so that nothing says where its nose points"
    )
    return (
        f"the steps allow {len(paths)} solutions (first headings {headings} degrees{more}), and "
        f"{why}. A straight or standing record does not tell them apart; state "
        "[rtk.known_offsets] from a longer drive with turns"
    )
