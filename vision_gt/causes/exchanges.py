"""Things that were taken for each other: cameras, their files, images of stops."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from validation.poses.angles import Array, wrap
from vision_gt.causes.effects import Effect
from vision_gt.causes.evidence import BAR, CALIBRATION, Seen, kind_of_board
from vision_gt.causes.linear import Gain, Linear
from vision_gt.optics.transforms import planar_pose
from vision_gt.patterns.board_views import BoardView

_SAME = 0.1, 0.1
"""Metres and radians within which two cameras see the robot in one place. A judgement: single
cameras are good to centimetres, and stops lie farther apart."""


@dataclass(frozen=True)
class Exchanged(Effect):
    """Things that were taken for each other.

    Parameters
    ----------
    pair : (str, str)
        Two cameras, whose files ('camera_files_exchanged'), images of their calibration
        ('calibrations_exchanged') or images of the stops ('cameras_exchanged') are exchanged; or
        two stops of the camera ``subject``, whose images are ('images_exchanged'). Empty for the
        ids of the bar's two boards ('bar_exchanged').
    """

    pair: tuple[str, str] = ("", "")

    @property
    def prior(self) -> Array:
        """(0,): there are no numbers."""
        return np.zeros(0)

    @property
    def lenses(self) -> bool:
        """Whether two cameras have each other's lens."""
        return self.kind in {"camera_files_exchanged", "calibrations_exchanged"}

    def like(self, other: Effect) -> bool:
        """Whether both are of one pair, of whatever camera."""
        pair = other.pair if isinstance(other, Exchanged) else None
        return self.kind == other.kind and self.pair == pair

    def gain(self, linear: Linear) -> Gain:
        """Nothing to first order: it is no small change."""
        del linear
        return Gain(np.zeros((0, 0)), np.zeros(0))

    def reread(self, seen: Seen) -> Seen:
        """What was seen and stated, read the other way."""
        a, b = self.pair
        other = {a: b, b: a}
        if self.kind == "bar_exchanged":
            return replace(seen, boards=tuple(_other_board(view) for view in seen.boards))
        if self.lenses:
            lenses = {camera.name: camera for camera in seen.cameras}
            cameras = [replace(lenses[other.get(n, n)], name=n) for n in seen.names]
            boards = tuple(
                replace(view, camera=other.get(view.camera, view.camera))
                if self.kind == "calibrations_exchanged" and kind_of_board(view) == CALIBRATION
                else view
                for view in seen.boards
            )
            return replace(seen, cameras=tuple(cameras), boards=boards)
        if self.kind == "cameras_exchanged":
            stops = {
                stop: [replace(one, camera=other.get(one.camera, one.camera)) for one in sightings]
                for stop, sightings in seen.stops.items()
            }
            spoilt = {stop for stop, s in seen.stops.items() if any(o.camera in other for o in s)}
        else:
            found = {s: [o for o in seen.stops[s] if o.camera == self.subject] for s in other}
            stops = {
                stop: [*(o for o in s if o.camera != self.subject), *found.get(other[stop], [])]
                if stop in other
                else list(s)
                for stop, s in seen.stops.items()
            }
            spoilt = set(other)
        known = {key: T for key, T in seen.T_gtv_robot.items() if key[1] not in spoilt}
        return replace(seen, stops=stops, T_gtv_robot=known)


def _other_board(view: BoardView) -> BoardView:
    """A view of the bar's first board as one of its second, and the other way round."""
    return replace(view, part=1 - view.part) if kind_of_board(view) == BAR else view


def lenses_exchanged(seen: Seen) -> Iterator[Exchanged]:
    """Cameras whose files, or whose images of the calibration, may be exchanged."""
    shown = {view.camera for view in seen.boards if kind_of_board(view) == CALIBRATION}
    for kind, names in (
        ("camera_files_exchanged", seen.from_files),
        ("calibrations_exchanged", [name for name in seen.names if name in shown]),
    ):
        pairs = list(combinations(names, 2))
        for pair in pairs:
            yield Exchanged(kind, pair=pair, places=len(pairs))


def bar_exchanged(seen: Seen) -> Iterator[Exchanged]:
    """The two boards of the bar, where both were seen."""
    if {view.part for view in seen.boards if kind_of_board(view) == BAR} == {0, 1}:
        yield Exchanged("bar_exchanged")


def exchanges(seen: Seen) -> Iterator[Exchanged]:
    """Cameras whose lenses or images may be exchanged, and images of stops that may."""
    yield from lenses_exchanged(seen)
    seeing = {one.camera for sightings in seen.stops.values() for one in sightings}
    pairs = list(combinations([name for name in seen.names if name in seeing], 2))
    for pair in pairs:
        yield Exchanged("cameras_exchanged", pair=pair, places=len(pairs))
    yield from _stops_exchanged(seen)


def _stops_exchanged(seen: Seen) -> Iterator[Exchanged]:
    """Two stops of one camera; another camera sees the robot at one where this sees the other."""
    states = {key: planar_pose(T) for key, T in seen.T_gtv_robot.items()}
    order = {stop: i for i, stop in enumerate(seen.stops)}
    found: dict[tuple[str, frozenset[str]], Exchanged] = {}
    for (camera, stop), own in states.items():
        others = [state for (c, s), state in states.items() if s == stop and c != camera]
        if not others or any(_near(own, one) for one in others):
            continue
        for (c, s), state in states.items():
            if c == camera and s != stop and any(_near(state, one) for one in others):
                pair = (stop, s) if order[stop] < order[s] else (s, stop)
                one = Exchanged("images_exchanged", camera, pair=pair)
                found[camera, frozenset(pair)] = one
    n = max(len(states), 2)
    for one in found.values():
        yield replace(one, places=n * (n - 1) // 2)


def _near(a: Array, b: Array) -> bool:
    """Whether two poses x, y, theta are one, as far as single cameras tell."""
    length, angle = _SAME
    return bool(np.hypot(*(a - b)[:2]) < length and abs(float(wrap(a[2] - b[2]))) < angle)
