"""Known lengths, walls and a known motion are measured as well as they say."""

import csv
import io
import tomllib

import numpy as np
from scipy.stats import chi2

from data_samples.rooms.checks import MOTION_SIGMAS, check_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from survey.readings.instrument import reading_sigma

ROOMS = 60


def made(seed):
    rng = np.random.default_rng(seed)
    room = make_room(RoomSettings(stops=3, world_points=4), rng)
    survey = simulate_survey(room, SimulationSettings(), rng)
    return survey, check_files(survey, rng)


def columns(text, *names):
    rows = list(csv.DictReader(io.StringIO(text)))
    return [np.array([float(row[name]) for row in rows]) for name in names]


def inside(squared, count):
    """Whether a sum of squared standard errors is what chance makes of it, 1 in 10,000 aside."""
    low, high = chi2.ppf([0.5e-4, 1 - 0.5e-4], count)
    return low < squared < high


def test_lengths_and_walls_are_read_by_the_instrument_of_the_campaign():
    lengths, walls, slopes = [], [], []
    for seed in range(ROOMS):
        survey, files = made(seed)
        instrument = survey.settings.instrument
        true, shown = columns(files["survey/known_lengths.csv"], "true", "reading")
        bench = instrument.model_copy(update={"setup_sigma": 0.0})
        lengths.append((shown - true) / reading_sigma(bench, true))
        at, distance = columns(files["survey/walls.csv"], "position", "distance")
        room = survey.room.settings
        true = room.length - room.skew * room.width / 2 + room.skew * at
        walls.append((distance - true) / reading_sigma(instrument, true))
        slopes.append(np.polyfit(at, distance, 1)[0])
    assert inside((np.array(lengths) ** 2).sum(), np.size(lengths))
    assert inside((np.array(walls) ** 2).sum(), np.size(walls))
    assert abs(np.mean(slopes) - 0.02 / 3) < 4 * np.std(slopes) / np.sqrt(ROOMS)


def test_the_motion_is_the_true_one_to_its_sigmas():
    errors = []
    for seed in range(ROOMS):
        survey, files = made(seed)
        (motion,) = tomllib.loads(files["campaign.toml"])["survey"]["motions"]
        true = survey.room.stops[1] - survey.room.stops[0]
        stated = np.array([motion["dx"], motion["dy"], motion["dtheta"]])
        assert (motion["start"], motion["end"]) == ("1", "2")
        assert motion["sigmas"] == list(MOTION_SIGMAS)
        errors.append((stated - true) / MOTION_SIGMAS)
    assert inside((np.array(errors) ** 2).sum(), np.size(errors))


def test_a_room_with_one_stop_has_no_motion():
    rng = np.random.default_rng(1)
    room = make_room(RoomSettings(stops=1, world_points=4), rng)
    assert check_files(simulate_survey(room, SimulationSettings(), rng), rng)["campaign.toml"] == ""
