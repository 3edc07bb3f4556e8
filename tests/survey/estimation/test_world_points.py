import csv

import numpy as np
import pytest
from scipy.stats import chi2
from surveys import AD23, ad23, case

from survey.estimation.vframe import estimate_vframe
from survey.estimation.world_points import locate_world_points, place_at
from survey.published.as_published import world_point_filter
from survey.readings.readings import Readings
from validation.campaign.folder import Vframe


def printed():
    with (AD23 / "survey" / "published_world_points.csv").open() as stream:
        return {
            r["world_point"]: np.array([float(r["x"]), float(r["y"])])
            for r in csv.DictReader(stream)
        }


def to_points(p, vframe, names=None):
    names = list(vframe.points) if names is None else names
    places = np.array([vframe.points[n] for n in names]).reshape(-1, 2)
    return Readings(("P",) * len(names), tuple(names), np.linalg.norm(places - p, axis=1), 0.002)


def locate(readings, vframe):
    return locate_world_points(["P"], readings, estimate_vframe(vframe, readings))


def test_fifteen_of_sixteen_printed_points_follow_within_a_tenth_of_a_millimetre():
    world = ad23().solution.world
    off = {p.name: np.abs(p.position - printed()[p.name]).max() for p in world.points}
    assert len(off) == 16
    assert max(off, key=off.get) == "15"
    assert max(v for name, v in off.items() if name != "15") < 1e-4
    assert printed()["15"] - dict(zip(world.names, world.positions, strict=True))[
        "15"
    ] == pytest.approx([-0.0031, -0.0021], abs=5e-5)


def test_the_documents_listing_gives_the_same_points():
    outcome = ad23()
    vframe = outcome.campaign.settings.vframe
    for point in outcome.solution.world.points:
        own = outcome.inputs.file.used.touching([point.name], list(vframe.points))
        literal = world_point_filter(
            list(own.distance), [vframe.points[n] for n in own.end], point.position + 0.3
        )
        # Order of the readings and sigma model move the last 0.1 mm.
        assert literal.x == pytest.approx(point.position, abs=1.5e-4)


def test_every_rejected_solution_costs_far_more_than_the_chosen_one():
    for point in ad23().solution.world.points:
        assert point.rejected is not None
        assert point.rejected.cost > point.cost + 1000


@pytest.mark.parametrize("count", [0, 1])
def test_a_point_seen_from_fewer_than_two_places_is_not_located(count):
    vframe = Vframe()
    world = locate(to_points(np.array([4.0, 1.0]), vframe, list(vframe.points)[:count]), vframe)
    assert not world.points
    assert "three" in world.missing[0].reason


def test_two_readings_leave_two_places():
    vframe = Vframe()
    p = np.array([4.0, 1.0])
    world = locate(to_points(p, vframe, ["O", "X"]), vframe)
    assert not world.points
    assert "two places" in world.missing[0].reason
    assert sorted(world.missing[0].candidates[:, 1]) == pytest.approx([-1.0, 1.0], abs=1e-6)


def test_vframe_points_on_a_line_leave_a_mirror_image():
    vframe = Vframe(points={"A": (0, 0), "B": (1, 0), "C": (2, 0.0), "D": (0.0, 2.0)})
    world = locate(to_points(np.array([1.0, 3.0]), vframe, ["A", "B", "C"]), vframe)
    assert not world.points
    assert "nearly on a line" in world.missing[0].reason
    assert sorted(world.missing[0].candidates[:, 1]) == pytest.approx([-3.0, 3.0], abs=1e-6)


def test_two_readings_to_one_point_do_not_count_as_two_places():
    vframe = Vframe()
    readings = Readings(("P", "P", "P"), ("O", "O", "X"), [4.0, 4.001, 2.5], 0.002)
    assert not locate(readings, vframe).points


def test_joint_covariance_is_that_of_repeated_surveys():
    vframe, sigma = Vframe(), 0.003
    nominal = np.array(list(vframe.points.values()))
    truth = np.array([[4.0, 1.0], [-2.0, 5.0]])
    rng = np.random.default_rng(3)
    found = []
    for _ in range(500):
        marks = nominal + vframe.sigma * rng.standard_normal(nominal.shape)
        d = np.linalg.norm(marks[None] - truth[:, None], axis=2) + sigma * rng.standard_normal(
            (2, 4)
        )
        readings = Readings(("P",) * 4 + ("Q",) * 4, tuple(vframe.points) * 2, d.ravel(), sigma)
        world = locate_world_points(["P", "Q"], readings, estimate_vframe(vframe, readings))
        found.append(world.positions.ravel() - truth.ravel())
    sample = np.cov(np.array(found).T)
    scale = np.sqrt(np.outer(np.diag(sample), np.diag(sample)))
    # A correlation of 500 samples scatters by 1 / sqrt(500), a variance by sqrt(2 / 500).
    assert np.abs((sample - world.covariance) / scale).max() < 4 * np.sqrt(2 / 500)
    assert np.abs(world.covariance[:2, 2:]).max() > 0.1 * world.covariance[0, 0]


def test_world_points_of_simulated_rooms_are_as_good_as_stated():
    total = count = 0
    for seed in range(12):
        errors, covariances = case(seed).world_errors()
        total += errors[0] @ np.linalg.solve(covariances[0], errors[0])
        count += 1
    low, high = chi2.ppf([0.0005, 0.9995], 2 * count)
    assert low < total < high


def test_a_place_on_the_line_of_its_points_is_not_located_where_they_are_all_it_has():
    frame = Vframe(points={"A": (0.0, 0.0), "B": (2.0, 0.0), "C": (4.0, 0.0), "D": (0.0, 2.0)})
    world = locate(to_points(np.array([6.0, 0.0]), frame, ["A", "B", "C"]), frame)
    assert not world.points
    assert "measure it from a point off that line" in world.missing[0].reason


def test_a_point_in_line_with_the_frame_has_a_place_whose_distance_from_the_line_is_open():
    vframe = Vframe()
    frame = estimate_vframe(vframe, Readings((), (), np.empty(0), 0.001))
    own = Readings(("1", "1"), ("O", "X"), [6.0, 3.5], 0.001)
    point = place_at("1", np.array([6.0, 0.0]), own, frame)
    assert np.sqrt(point.covariance[0, 0]) < 0.01
    assert np.sqrt(point.covariance[1, 1]) == pytest.approx(100.0, rel=1e-6)
