"""A hand-laser survey of a synthetic room, with the truth it was made from.

Everything is drawn from the distributions that the campaign states, so that an honest estimator
must be right as often as it says; the extras (blunders, typing errors, tilted beams, ...) break
that on purpose, are off by default, and are recorded in the truth.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from data_samples.faults.room_faults import Fault, draw_faults, rounded
from data_samples.rooms.rooms import Room
from data_samples.rooms.sight import sees
from survey.readings.instrument import corrected, reading_sigma
from survey.readings.readings import Readings
from validation.campaign.folder import Instrument, RobotFrame
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable

Indices = npt.NDArray[np.intp]

HAND_LASER = Instrument(
    model="simulated laser distance meter", tolerance_per_metre=0.000175, setup_sigma=0.002
)
"""+-1.5 mm to 30 m and +-5 mm at 50 m as in AD2.3, and 2 mm for the person."""

RIG = RobotFrame(marking_sigma=0.0005, shape_sigma=0.0002, sides_sigma=0.0003)
"""The L of AD2.3, machined to 0.2 mm, its sides measured; marks with a thin pen, to 0.5 mm.

What the rig is off turns every validation heading by the same angle: 1 mm on an arm of 0.6 m
would be 1.7 mrad, more than the ground truths to be judged are off.
"""


@dataclass(frozen=True)
class ExampleSystem:
    """A ground-truth system to compare with the survey.

    Parameters
    ----------
    system : str
        Its name.
    sigmas : (float, float, float)
        Standard deviations of x, y (metres) and theta (radians).
    bias : (float, float, float)
        Added to every pose; the stated covariance does not cover it.
    """

    system: str = "example_gt"
    sigmas: tuple[float, float, float] = (0.02, 0.02, 0.01)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SimulationSettings:
    """Instrument, robot frame and what goes wrong.

    Parameters
    ----------
    instrument : Instrument
        As campaign.toml will state it.
    robot_frame : RobotFrame
        The same; its ``sides`` are measured in the simulation.
    systems : tuple of ExampleSystem
        Ground truths to compare with.
    missing : float
        Share of the readings that were not taken, 0 to 1.
    blunders : int
        Readings that are off by ``blunder_size`` metres, up or down.
    typos : int
        Readings typed with two neighbouring digits exchanged.
    mirror_trap : bool
        The labels X and Y of the Vframe points are exchanged in the file, and nothing says so.
    hand_points : int
        World points whose coordinates were also measured roughly, with ``hand_sigma`` metres.
    guess_sigmas : (float, float, float), optional
        Standard deviations of initial guesses: x, y (metres), theta (radians); there are no
        guesses where not given.
    spot_height : float
        The laser spot is off by up to this height, metres, up or down: a longer distance.
    tail_freedom : float, optional
        Degrees of freedom (more than 2) of Student's t noise of the same standard deviation;
        normal noise where not given.
    """

    instrument: Instrument = HAND_LASER
    robot_frame: RobotFrame = RIG
    systems: tuple[ExampleSystem, ...] = ()
    missing: float = 0.0
    blunders: int = 0
    blunder_size: float = 0.1
    typos: int = 0
    mirror_trap: bool = False
    hand_points: int = 0
    hand_sigma: float = 0.1
    guess_sigmas: tuple[float, float, float] | None = None
    spot_height: float = 0.0
    tail_freedom: float | None = None


@dataclass(frozen=True)
class SurveyTruth:
    """What was drawn and no estimator may know, in the GTV frame.

    Parameters
    ----------
    vframe_points : (v, 2) array
        Where the marks of the Vframe really are, in the order of the campaign's points.
    rig_points : (r, 2) array
        True shape of the robot frame's rig, in its own frame.
    marks : (s, r, 2) array
        Marks on the floor at each stop.
    poses : PoseTable
        True poses of the stops, of system 'truth'.
    faults : tuple of Fault
        In the order of their rows.
    """

    vframe_points: Array
    rig_points: Array
    marks: Array
    poses: PoseTable
    faults: tuple[Fault, ...]


@dataclass(frozen=True)
class SimulatedCampaign:
    """All that a campaign folder would hold, in memory.

    Parameters
    ----------
    room : Room
        Where it took place.
    settings : SimulationSettings
        What it was made from.
    robot_frame : RobotFrame
        The settings' one with its sides as measured.
    shown : (n,) array
        What the instrument showed, metres, typing errors included.
    readings : Readings
        The same, corrected and with the standard deviations that the instrument states.
    initial_guesses : PoseTable or None
        Rough poses.
    hand_points : dict of str to (float, float)
        World points measured roughly.
    systems : tuple of PoseTable
        Poses of the example ground truths.
    truth : SurveyTruth
        For judging estimates, not for making them.
    """

    room: Room
    settings: SimulationSettings
    robot_frame: RobotFrame
    shown: Array
    readings: Readings
    initial_guesses: PoseTable | None
    hand_points: dict[str, tuple[float, float]]
    systems: tuple[PoseTable, ...]
    truth: SurveyTruth


def simulate_survey(
    room: Room, settings: SimulationSettings, rng: np.random.Generator
) -> SimulatedCampaign:
    """A survey of a room: marks drawn, distances read, truth kept.

    Parameters
    ----------
    room : Room
        The truth of the room.
    settings : SimulationSettings
        Instrument, robot frame, extras.
    rng : numpy.random.Generator
        Source of all that is drawn.

    Notes
    -----
    Marks of the Vframe and points of the rig are normal about their nominal places with the
    campaign's ``vframe.sigma`` and ``robot_frame.shape_sigma`` for each coordinate; marks on the
    floor are normal about the rig's points with ``marking_sigma``; sides of the rig are measured
    with ``sides_sigma``. A reading is normal about the distance of the two marks, then rounded to
    the instrument's resolution; pairs that do not see each other or lie out of range are not
    read. All Vframe points are measured against each other.
    """
    nominal = np.array(list(room.vframe.points.values()))
    vframe = nominal + room.vframe.sigma * rng.standard_normal(nominal.shape)
    rig, robot_frame = _rig(settings.robot_frame, rng)
    marks = _marks(room.stops, rig, settings.robot_frame.marking_sigma, rng)
    names, places = _points(room, settings.robot_frame, vframe, marks)
    start, end = _pairs(room, len(rig))
    taken = _can_be_read(room, settings, places[start], places[end], rng)
    start, end = start[taken], end[taken]
    length = np.hypot(*(places[start] - places[end]).T)
    shown, faults = _shown(length, settings, rng)
    return SimulatedCampaign(
        room=room,
        settings=settings,
        robot_frame=robot_frame,
        shown=shown,
        readings=_as_readings([names[i] for i in start], [names[i] for i in end], shown, settings),
        initial_guesses=None
        if settings.guess_sigmas is None
        else _noisy_poses(room, "hand", settings.guess_sigmas, rng),
        hand_points=_hand_points(room, settings, rng),
        systems=tuple(
            _noisy_poses(room, example.system, example.sigmas, rng, example.bias)
            for example in settings.systems
        ),
        truth=SurveyTruth(
            vframe, rig, marks, PoseTable("truth", room.stop_names, room.stops), faults
        ),
    )


def _rig(frame: RobotFrame, rng: np.random.Generator) -> tuple[Array, RobotFrame]:
    """True points of the rig (r, 2), and the frame with its sides as measured."""
    nominal = np.array(list(frame.points.values()))
    rig = nominal + frame.shape_sigma * rng.standard_normal(nominal.shape)
    named = dict(zip(frame.points, rig, strict=True))
    sides = {
        f"{a}-{b}": round(float(np.hypot(*(named[a] - named[b])) + error), 5)
        for (a, b), error in zip(
            combinations(named, 2),
            frame.sides_sigma * rng.standard_normal(len(named) * (len(named) - 1) // 2),
            strict=True,
        )
    }
    return rig, frame.model_copy(update={"sides": sides})


def _marks(poses: Array, rig: Array, sigma: float, rng: np.random.Generator) -> Array:
    """(s, r, 2) marks of a rig (r, 2) at poses (s, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    rotation = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    exact = poses[:, None, :2] + np.einsum("sij,rj->sri", rotation, rig)
    return np.asarray(exact + sigma * rng.standard_normal(exact.shape))


def _points(room: Room, frame: RobotFrame, vframe: Array, marks: Array) -> tuple[list[str], Array]:
    """Names and true places of all points: Vframe, world, then robot points stop by stop."""
    names = [*room.vframe.points, *room.world_names]
    names += [f"{stop}/{point}" for stop in room.stop_names for point in frame.points]
    return names, np.concatenate([vframe, room.world_points, marks.reshape(-1, 2)])


def _pairs(room: Room, rig_points: int) -> tuple[Indices, Indices]:
    """Point numbers of all readings that are wanted: Vframe, then world, then robot points."""
    v, w = len(room.vframe.points), len(room.world_names)
    robot = v + w + np.arange(len(room.stop_names) * rig_points)
    world = v + np.arange(w)
    mutual = np.triu_indices(v, 1)
    start = [mutual[0], np.tile(np.arange(v), w), np.repeat(robot, w)]
    end = [mutual[1], np.repeat(world, v), np.tile(world, len(robot))]
    return np.concatenate(start), np.concatenate(end)


def _can_be_read(
    room: Room,
    settings: SimulationSettings,
    start: Array,
    end: Array,
    rng: np.random.Generator,
) -> npt.NDArray[np.bool_]:
    """Which pairs of places (n, 2) see each other, lie in range and were not left out."""
    length = np.hypot(*(start - end).T)
    in_range = (length >= settings.instrument.range_min) & (length <= settings.instrument.range_max)
    kept = rng.uniform(size=len(length)) >= settings.missing
    return np.asarray(sees(start, end, room.segments) & in_range & kept)


def _shown(
    length: Array, settings: SimulationSettings, rng: np.random.Generator
) -> tuple[Array, tuple[Fault, ...]]:
    """What the instrument shows for distances (n,), and which of it is wrong."""
    instrument = settings.instrument
    if settings.spot_height:
        length = np.hypot(length, settings.spot_height * rng.uniform(-1, 1, len(length)))
    unrounded = instrument.model_copy(update={"resolution": 0.0})
    noise = reading_sigma(unrounded, length) * _unit_noise(settings.tail_freedom, len(length), rng)
    shown = rounded((length + noise - instrument.offset) / instrument.scale, instrument)
    faults = draw_faults(
        shown,
        instrument,
        rng,
        blunders=settings.blunders,
        blunder_size=settings.blunder_size,
        typos=settings.typos,
    )
    for fault in faults:
        shown[fault.row] = rounded(shown[fault.row] + fault.size, instrument)
    return shown, faults


def _unit_noise(freedom: float | None, n: int, rng: np.random.Generator) -> Array:
    """(n,) numbers of mean 0 and variance 1: normal, or Student's t with heavier tails."""
    if freedom is None:
        return rng.standard_normal(n)
    return np.asarray(rng.standard_t(freedom, n) * np.sqrt((freedom - 2) / freedom))


def _as_readings(
    start: list[str], end: list[str], shown: Array, settings: SimulationSettings
) -> Readings:
    """Readings with the labels that stand in the file."""
    label = {"X": "Y", "Y": "X"} if settings.mirror_trap else {}
    return Readings(
        start=tuple(label.get(name, name) for name in start),
        end=tuple(label.get(name, name) for name in end),
        distance=corrected(settings.instrument, shown),
        sigma=reading_sigma(settings.instrument, shown),
    )


def _hand_points(
    room: Room, settings: SimulationSettings, rng: np.random.Generator
) -> dict[str, tuple[float, float]]:
    """World points spread along the walls, measured roughly."""
    n, count = len(room.world_names), min(settings.hand_points, len(room.world_names))
    chosen = np.arange(count) * n // max(count, 1)
    rough = room.world_points[chosen] + settings.hand_sigma * rng.standard_normal((count, 2))
    return {
        room.world_names[number]: (round(float(x), 2), round(float(y), 2))
        for number, (x, y) in zip(chosen, rough, strict=True)
    }


def _noisy_poses(
    room: Room,
    system: str,
    sigmas: tuple[float, float, float],
    rng: np.random.Generator,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> PoseTable:
    """Poses of all stops, normal about the true ones plus a bias, with their covariances."""
    n = len(room.stop_names)
    poses = room.stops + np.array(bias) + np.array(sigmas) * rng.standard_normal((n, 3))
    poses[:, 2] = wrap(poses[:, 2])
    covariances = np.broadcast_to(np.diag(np.square(sigmas)), (n, 3, 3))
    return PoseTable(system, room.stop_names, poses, covariances)
