"""Cameras whose frames in a drive are those of another camera."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vision_gt.driving.stream import Stream
from vision_gt.images.markers import MarkerView

Views = Sequence[Sequence[MarkerView]]
MANY_OFF = 0.5
"""Share of a camera's poses with the robot off the floor, from which on its place, or its lens, is
not that of the frames. Of a camera that is where it was a few are, by markers that are wrong."""
TRIED = 40
"""Frames that are tried with another camera: they tell a share of a half to a twelfth."""


@dataclass(frozen=True)
class Exchange:
    """Two cameras, each of which has the frames of the other.

    Parameters
    ----------
    cameras : (str, str)
        Their names.
    tried : (int, int)
        Frames of each with the robot off the floor that were tried with the other's place and lens.
    agree : (int, int)
        How many of them have it on the floor then.
    """

    cameras: tuple[str, str]
    tried: tuple[int, int]
    agree: tuple[int, int]


def off_the_floor(stream: Stream) -> tuple[int, int]:
    """Frames with the robot off the floor, and all with a pose."""
    off = stream.count("off the floor")
    return off, off + stream.count("spurious") + int(stream.posed.sum())


def many_off(stream: Stream) -> bool:
    """Whether most poses of a camera have the robot off the floor."""
    off, posed = off_the_floor(stream)
    return off > MANY_OFF * posed


def exchanges(
    streams: Sequence[Stream],
    seen: Mapping[str, Views],
    pose: Callable[[str, Views], Stream],
) -> tuple[Exchange, ...]:
    """Pairs of cameras that have the robot on the floor with the other's frames only.

    Parameters
    ----------
    streams : sequence of Stream
        As they are stated.
    seen : mapping of str to sequence
        The markers of each frame, by camera.
    pose : callable
        The stream of a camera that saw some frames.

    Notes
    -----
    A wrong place puts the robot beside the floor by centimetres and decimetres. On it with most
    frames of both cameras is no chance. Of two cameras of one height that look down as much, each
    has the robot on the floor with the other's frames too: then nothing is told here.
    """
    odd = [one for one in streams if many_off(one)]
    found = []
    for one, other in itertools.combinations(odd, 2):
        tried, agree = [], []
        for own, lent in ((one, other.camera), (other, one.camera)):
            rows = np.flatnonzero([said == "off the floor" for said in own.verdicts])
            rows = rows[np.linspace(0, len(rows) - 1, min(TRIED, len(rows))).astype(int)]
            again = pose(lent, [seen[own.camera][row] for row in rows])
            tried.append(len(rows))
            agree.append(int(again.kept.sum()))
        if all(a > (1 - MANY_OFF) * n for a, n in zip(agree, tried, strict=True)):
            names = (one.camera, other.camera)
            found.append(Exchange(names, (tried[0], tried[1]), (agree[0], agree[1])))
    return tuple(found)
