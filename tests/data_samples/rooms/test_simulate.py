import dataclasses
from functools import cache

import numpy as np
from scipy import stats

from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import ExampleSystem, SimulationSettings, simulate_survey
from survey.readings.instrument import reading_sigma
from validation.campaign.folder import Instrument

RARE = 1e-4  # a correct simulation fails a two-sided bound once in 5,000 choices of the seeds
SMALL = RoomSettings(stops=6, world_points=8)


def simulated(seed=0, room=SMALL, **changes):
    rng = np.random.default_rng(seed)
    settings = dataclasses.replace(SimulationSettings(), **changes)
    return simulate_survey(make_room(room, rng), settings, rng)


@cache
def many():
    return [simulated(seed) for seed in range(60)]


def true_places(campaign):
    """Every named point, where it really is."""
    places = dict(zip(campaign.room.world_names, campaign.room.world_points, strict=True))
    places |= dict(zip(campaign.room.vframe.points, campaign.truth.vframe_points, strict=True))
    for stop, marks in zip(campaign.room.stop_names, campaign.truth.marks, strict=True):
        named = zip(campaign.robot_frame.points, marks, strict=True)
        places |= {f"{stop}/{point}": place for point, place in named}
    return places


def true_lengths(campaign):
    places, readings = true_places(campaign), campaign.readings
    start = np.array([places[name] for name in readings.start])
    end = np.array([places[name] for name in readings.end])
    return np.hypot(*(start - end).T)


def reading_errors(campaigns):
    """Errors of all readings over the standard deviations that the readings state."""
    return np.concatenate(
        [(c.readings.distance - true_lengths(c)) / c.readings.sigma for c in campaigns]
    )


def assert_standard_normal(values):
    """Variance about zero within the chi-square bounds, and the 95 % share within binomial ones."""
    values = np.ravel(values)
    n = values.size
    low, high = stats.chi2.ppf([RARE, 1 - RARE], n)
    assert low < (values**2).sum() < high
    low, high = stats.binom.ppf([RARE, 1 - RARE], n, 0.95)
    assert low <= (np.abs(values) < stats.norm.ppf(0.975)).sum() <= high
    assert abs(values.mean()) * np.sqrt(n) < stats.norm.ppf(1 - RARE)


def test_all_pairs_are_read_where_nothing_is_in_the_way():
    campaign = simulated(room=RoomSettings(heaters=0))
    assert len(campaign.readings) == 6 + 16 * 4 + 26 * 48
    assert campaign.readings.poses == [str(number) for number in range(1, 27)]


def test_nearly_all_pairs_are_read_in_the_room_as_it_is():
    read = [len(simulated(seed, RoomSettings()).readings) for seed in range(20)]
    assert np.mean(read) > 0.97 * (6 + 16 * 4 + 26 * 48)


def test_readings_err_as_the_instrument_states():
    assert_standard_normal(reading_errors(many()))


def test_an_offset_and_a_scale_are_undone_by_the_correction():
    laser = Instrument(offset=0.05, scale=1.002, setup_sigma=0.002)
    campaigns = [simulated(seed, instrument=laser) for seed in range(20)]
    # The standard deviation is stated for the corrected distance; a scale of 1.002 changes it
    # by less than the chi-square bound can see.
    assert_standard_normal(reading_errors(campaigns))
    shown_errors = np.concatenate([c.shown - true_lengths(c) for c in campaigns])
    assert abs(shown_errors.mean() + 0.05) < 0.02


def test_readings_are_shown_to_the_millimetre():
    shown = np.concatenate([campaign.shown for campaign in many()])
    assert np.abs(shown * 1000 - np.round(shown * 1000)).max() < 1e-9


def test_vframe_marks_scatter_about_their_nominal_places_as_stated():
    nominal = np.array(list(many()[0].room.vframe.points.values()))
    sigma = many()[0].room.vframe.sigma
    assert_standard_normal([(c.truth.vframe_points - nominal) / sigma for c in many()])


def test_the_rig_scatters_about_its_nominal_shape_as_stated():
    frame = many()[0].robot_frame
    nominal = np.array(list(frame.points.values()))
    assert_standard_normal([(c.truth.rig_points - nominal) / frame.shape_sigma for c in many()])


def test_measured_sides_scatter_about_the_true_rig_as_stated():
    errors = []
    for campaign in many():
        frame = campaign.robot_frame
        places = dict(zip(frame.points, campaign.truth.rig_points, strict=True))
        assert set(frame.sides) == {"O-X", "O-Y", "X-Y"}
        for side, length in frame.sides.items():
            a, b = side.split("-")
            errors.append((length - np.hypot(*(places[a] - places[b]))) / frame.sides_sigma)
    assert_standard_normal(errors)


def test_marks_on_the_floor_scatter_about_the_rig_at_the_true_pose_as_stated():
    errors = []
    for campaign in many():
        for (x, y, theta), marks in zip(campaign.room.stops, campaign.truth.marks, strict=True):
            turn = np.exp(1j * theta)
            rig = campaign.truth.rig_points @ [1, 1j] * turn + (x + 1j * y)
            gap = marks @ [1, 1j] - rig
            errors.append(np.concatenate([gap.real, gap.imag]))
    assert_standard_normal(np.array(errors) / campaign.robot_frame.marking_sigma)


def test_an_example_system_errs_as_its_covariances_state_about_its_bias():
    bias = np.array([0.03, -0.01, 0.02])
    errors = []
    for seed in range(60):
        campaign = simulated(seed, systems=(ExampleSystem(bias=tuple(bias)),))
        table = campaign.systems[0]
        gap = (table.poses - campaign.truth.poses.poses - bias) @ np.diag([1, 1, 1])
        gap[:, 2] = np.angle(np.exp(1j * gap[:, 2]))
        errors.append(gap / np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2)))
    assert_standard_normal(errors)


def test_initial_guesses_scatter_as_asked():
    errors = []
    for seed in range(60):
        campaign = simulated(seed, guess_sigmas=(0.1, 0.05, 0.2))
        gap = campaign.initial_guesses.poses - campaign.room.stops
        gap[:, 2] = np.angle(np.exp(1j * gap[:, 2]))
        errors.append(gap / campaign.settings.guess_sigmas)
    assert_standard_normal(errors)


def test_there_are_no_initial_guesses_unless_asked_for():
    assert simulated().initial_guesses is None


def test_hand_points_are_rough_places_of_world_points_far_apart():
    campaign = simulated(hand_points=2)
    assert list(campaign.hand_points) == ["1", "5"]
    true = dict(zip(campaign.room.world_names, campaign.room.world_points, strict=True))
    for name, place in campaign.hand_points.items():
        assert np.hypot(*(np.array(place) - true[name])) < 6 * campaign.settings.hand_sigma


def test_the_mirror_trap_exchanges_labels_and_nothing_else():
    honest, trap = simulated(), simulated(mirror_trap=True)
    assert np.array_equal(honest.shown, trap.shown)
    exchanged = {"X": "Y", "Y": "X"}
    assert trap.readings.start == tuple(exchanged.get(n, n) for n in honest.readings.start)
    assert trap.readings.end == tuple(exchanged.get(n, n) for n in honest.readings.end)
    assert trap.readings.start != honest.readings.start


def test_faults_are_recorded_and_are_all_that_differs():
    honest, faulty = simulated(), simulated(blunders=3, blunder_size=0.25, typos=2)
    change = np.round(faulty.shown - honest.shown, 6)
    assert len(faulty.truth.faults) == 5
    recorded = np.zeros(len(change))
    for fault in faulty.truth.faults:
        recorded[fault.row] = fault.size
    assert np.array_equal(change, np.round(recorded, 6))
    assert not honest.truth.faults


def test_missing_readings_are_as_many_as_asked():
    full, thinned = (
        simulated(room=RoomSettings(heaters=0), missing=share) for share in (0.0, 0.25)
    )
    low, high = stats.binom.ppf([RARE, 1 - RARE], len(full.readings), 0.75)
    assert low <= len(thinned.readings) <= high


def test_a_tilted_beam_reads_longer():
    laser = Instrument(tolerance=1e-9, resolution=0.0)
    level = simulated(instrument=laser)
    tilted = simulated(instrument=laser, spot_height=0.02)
    length = true_lengths(level)
    longest = np.hypot(length, 0.02)
    longer = tilted.shown - true_lengths(tilted)
    assert (longer > -1e-6).all()
    assert (tilted.shown < longest + 1e-6).all()
    assert longer.max() > 1e-5


def test_heavier_tails_have_the_same_variance_and_more_outliers():
    campaigns = [simulated(seed, tail_freedom=5.0) for seed in range(60)]
    errors = reading_errors(campaigns)
    n = errors.size
    # Student's t with 5 degrees of freedom has kurtosis 9, so the variance of the squares is 8.
    assert abs((errors**2).mean() - 1) < stats.norm.ppf(1 - RARE) * np.sqrt(8 / n)
    expected = 2 * stats.norm.sf(4)
    assert (np.abs(errors) > 4).mean() > 10 * expected


def test_readings_out_of_range_are_not_taken():
    short = Instrument(range_max=4.0)
    campaign = simulated(instrument=short)
    assert len(campaign.readings) < len(simulated().readings)
    assert true_lengths(campaign).max() <= 4.0


def test_the_same_seed_gives_the_same_survey_and_another_another():
    a, b, c = simulated(3), simulated(3), simulated(4)
    assert np.array_equal(a.shown, b.shown)
    assert a.robot_frame == b.robot_frame
    assert np.array_equal(a.truth.marks, b.truth.marks)
    assert not np.array_equal(a.truth.marks, c.truth.marks)


def test_the_stated_sigma_is_the_instruments():
    campaign = simulated()
    expected = reading_sigma(campaign.settings.instrument, campaign.shown)
    assert np.array_equal(campaign.readings.sigma, expected)
