"""Campaigns of a survey and three systems, each with its own fault, for the arbitration."""

from dataclasses import dataclass

import numpy as np
from explain_campaigns import FRAME, MOUNT, matrix, pose, random_stops

from validation.explain.analysis import Question, explain
from validation.poses.pose_table import PoseTable

NAMES = ("survey", "vision", "genetic", "scanmatch")
WRONG_LENGTH = 0.05
WRONG_ANGLE = np.radians(3.0)


@dataclass(frozen=True)
class Case:
    """One kind of campaign.

    ``noise`` of the coordinate (metres) and ``angle_noise`` (radians) of each source; ``stated``
    whether the tables give covariances; ``path`` 'room', 'loop' (headings along a round) or
    'straight'; ``missing`` the share of poses that each system lacks; ``common`` the part of the
    two laser systems' variance that they share, as they look with one sensor.
    """

    name: str
    noise: tuple[float, ...] = (0.005, 0.006, 0.006, 0.010)
    angle_noise: tuple[float, ...] = (0.005, 0.006, 0.006, 0.006)
    stated: bool = False
    path: str = "room"
    missing: float = 0.0
    common: float = 0.0
    stops: int = 26

    @property
    def question(self) -> Question:
        """What is known beside the tables."""
        return Question(sensors={"laser": NAMES[2:]} if self.common else {})


def stops_of(case, rng):
    """True poses (n, 3)."""
    n = case.stops
    if case.path == "room":
        return random_stops(rng, n)
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False) + rng.uniform(-0.1, 0.1, n)
    if case.path == "loop":
        around = np.column_stack([0.5 + 2.5 * np.cos(turn), 1.5 + 3 * np.sin(turn)])
        return np.column_stack([around, np.angle(np.exp(1j * (turn + np.pi / 2)))])
    along = np.linspace(-2, 6, n)
    return np.column_stack([along, 0.3 + 0.05 * rng.normal(size=n), 0.05 * rng.normal(size=n)])


def errors_of(case, rng):
    """(4, n, 3) random errors of the sources."""
    size = np.column_stack([case.noise, case.noise, case.angle_noise])[:, None]
    drawn = rng.normal(size=(4, case.stops, 3))
    shared = rng.normal(size=(case.stops, 3))
    for source in (2, 3):
        drawn[source] = np.sqrt(case.common) * shared + np.sqrt(1 - case.common) * drawn[source]
    return size * drawn


def campaign(case, seed, *, wrong=None):
    """Validation and GT tables.

    Parameters
    ----------
    case : Case
        Which kind.
    seed : sequence of int or int
        Of everything drawn.
    wrong : (source, cell), optional
        Numbers of the source and the cell (0 position, 1 heading) that one stop has wrong.

    Returns
    -------
    survey : PoseTable
        Validation poses.
    systems : list of PoseTable
        Vision with a wrong frame, genetic with a wrong mount, scanmatch with both.
    stop : str
        The wrong one, at which all sources are; empty if none.
    """
    rng = np.random.default_rng(seed)
    truth = stops_of(case, rng)
    errors = errors_of(case, rng)
    frame, mount = np.linalg.inv(matrix(FRAME)), matrix(MOUNT)
    spoiled = [truth, pose(frame @ matrix(truth)), pose(matrix(truth) @ mount)]
    spoiled.append(pose(frame @ matrix(truth) @ mount))
    poses = np.stack(spoiled) + errors
    there = rng.uniform(size=poses.shape[:2]) >= case.missing
    there[0] = True
    name = ""
    if wrong is not None:
        source, cell = wrong
        stop = int(rng.integers(case.stops))
        there[:, stop] = True
        name = str(stop + 1)
        if cell == 0:
            way = rng.uniform(-np.pi, np.pi)
            poses[source, stop, :2] += WRONG_LENGTH * np.array([np.cos(way), np.sin(way)])
        else:
            poses[source, stop, 2] += WRONG_ANGLE * rng.choice([-1, 1])
    ids = np.array([str(i + 1) for i in range(case.stops)])
    tables = []
    for source in range(4):
        rows = there[source]
        size = np.array([case.noise[source]] * 2 + [case.angle_noise[source]])
        given = np.tile(np.diag(size**2), (rows.sum(), 1, 1)) if case.stated else np.empty(0)
        tables.append(PoseTable(NAMES[source], tuple(ids[rows]), poses[source, rows], given))
    return tables[0], tables[1:], name


def verdicts_of(case, seed, *, wrong=None):
    """The arbitration of one campaign, and the wrong stop."""
    survey, systems, stop = campaign(case, seed, wrong=wrong)
    return explain(survey, systems, case.question).arbitration, stop
