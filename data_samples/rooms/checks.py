"""What a survey team measures beside the survey: known lengths, two walls, a known motion."""

import numpy as np

from data_samples.faults.room_faults import decimals, rounded
from data_samples.rooms.rooms import Room
from data_samples.rooms.simulate import SimulatedCampaign
from survey.readings.instrument import reading_sigma
from validation.campaign.folder import Instrument
from validation.poses.angles import Array
from validation.text_files.csv_text import csv_text

LENGTHS = np.linspace(0.5, 12.0, 24)
"""Known lengths in metres: to beyond the room's diagonal, as many as a person reads in a quarter of
an hour."""
ALONG = 6
"""Places along the short walls at which their distance is measured."""
MOTION_SIGMAS = (0.001, 0.001, 0.002)
"""How well the motion between two stops is known: x, y (metres), theta (radians). A judgement:
laid off with a steel tape and a square."""


def check_files(made: SimulatedCampaign, rng: np.random.Generator) -> dict[str, str]:
    """Texts of files by their paths; that under 'campaign.toml' is to be added to its end.

    Parameters
    ----------
    made : SimulatedCampaign
        The survey; its instrument reads the lengths and the walls, too.
    rng : numpy.random.Generator
        Source of all chance.

    Notes
    -----
    The known lengths are read on a bench, with the instrument's own noise; the walls by hand.
    """
    instrument = made.settings.instrument
    position, between = _walls(made.room)
    bench = instrument.model_copy(update={"setup_sigma": 0.0})  # nobody aims at a mark there
    shown = _read(LENGTHS, bench, rng)
    distance = _read(between, instrument, rng)
    return {
        "survey/known_lengths.csv": csv_text(
            ("true", "reading"),
            zip((f"{one:.4f}" for one in LENGTHS), _texts(shown, instrument), strict=True),
        ),
        "survey/walls.csv": csv_text(
            ("wall_a", "wall_b", "position", "distance"),
            [
                ("south", "north", f"{at:.2f}", text)
                for at, text in zip(position, _texts(distance, instrument), strict=True)
            ],
        ),
        "campaign.toml": _motion(made.room, rng),
    }


def _read(true: Array, instrument: Instrument, rng: np.random.Generator) -> Array:
    """What the instrument shows for true lengths."""
    unrounded = instrument.model_copy(update={"resolution": 0.0})
    noisy = true + reading_sigma(unrounded, true) * rng.standard_normal(len(true))
    return rounded((noisy - instrument.offset) / instrument.scale, instrument)


def _texts(shown: Array, instrument: Instrument) -> list[str]:
    """Readings as they are written down."""
    return [f"{one:.{decimals(instrument)}f}" for one in shown]


def _walls(room: Room) -> tuple[Array, Array]:
    """Places along the first wall, and the distances there to the wall opposite."""
    first, second, third, fourth = room.outline
    length = np.hypot(*(second - first))
    along = (second - first) / length
    across = np.array([-along[1], along[0]])
    position = np.round(np.linspace(0.1, 0.9, ALONG) * length, 2)
    ends = np.array([[corner @ along - first @ along, corner @ across - first @ across]
                     for corner in (fourth, third)])  # fmt: skip
    return position, np.interp(position, ends[:, 0], ends[:, 1])


def _motion(room: Room, rng: np.random.Generator) -> str:
    """The motion from the first stop to the second, in the GTV frame."""
    if len(room.stops) < 2:
        return ""
    step = room.stops[1] - room.stops[0] + MOTION_SIGMAS * rng.standard_normal(3)
    names = room.stop_names
    return (
        f'\n[[survey.motions]]\nstart = "{names[0]}"\nend = "{names[1]}"\n'
        f"dx = {step[0]:.4f}\ndy = {step[1]:.4f}\ndtheta = {step[2]:.5f}\n"
        f"sigmas = {list(MOTION_SIGMAS)}\n"
    )
