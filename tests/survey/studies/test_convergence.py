import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binom, kstest
from surveys import case

from survey.estimation.distance_fit import DistanceFit, place_fit
from survey.estimation.geometry import rotate
from survey.estimation.iterated_ekf import iterated_ekf
from survey.studies.convergence import (
    NOT_CONVERGED,
    REACHES_OTHER,
    REACHES_SOLUTION,
    explore_convergence,
    random_starts,
    regions,
    smallest_region,
)
from survey.studies.convergence_problems import unknowns_of
from validation.cli import main
from validation.poses.angles import wrap

SQUARE = np.array([[0.0, 0.0], [2.5, 0.0], [0.0, 2.5], [2.5, 2.5]])
LINE = np.array([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0], [4.0, 0.0]])
RIG = np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.4]])
RING = 5 * np.stack([np.cos(np.arange(16) * 0.4), np.sin(np.arange(16) * 0.4)], axis=-1)


def point_problem(place, known=SQUARE, noise=0.0):
    distance = np.linalg.norm(known - place, axis=-1) + noise
    sigma = np.full(len(distance), 0.003)
    return place_fit(known, np.full(len(known), 0.002), distance, sigma)


def pose_problem(state, seed=0, noise=0.003):
    known, body = np.repeat(RING, 3, axis=0), np.tile(RIG, (16, 1))
    distance = np.linalg.norm(known - state[:2] - rotate(state[2], body), axis=-1)
    distance += np.random.default_rng(seed).normal(0, noise, 48)
    sigmas = np.full(48, 0.003), np.full(48, 0.002)
    return DistanceFit(known, body, distance, *sigmas, 0.001)


def single_model(problem):
    many = problem.equations

    def evaluate(state):
        h, H, variance = many(state[None])
        return h[0], H[0], np.diag(variance[0])

    return evaluate


@pytest.mark.parametrize(
    ("problem", "solution"),
    [
        (point_problem(np.array([4.0, 3.0]), noise=np.array([2, -3, 1, 2]) * 1e-3), [4.0, 3.0]),
        (point_problem(np.array([1.0, 2.0]), LINE), [1.0, 2.0]),
        (pose_problem(np.array([0.5, -0.4, 2.0])), [0.5, -0.4, 2.0]),
    ],
)
def test_a_batch_ends_where_single_filters_end(problem, solution):
    starts = random_starts(np.array(solution), 8.0, 60, np.random.default_rng(3))
    ended = problem.ends(starts)
    model = single_model(problem)
    for i, start in enumerate(starts):
        one = iterated_ekf(model, start, problem.prior_sigma)
        assert one.converged == ended.converged[i]
        if one.converged:
            off = one.state - ended.state[i]
            off[2:] = wrap(off[2:])
            assert np.abs(off).max() < 1e-8
            assert one.passes == ended.passes[i]
            assert one.cost == pytest.approx(ended.cost[i], rel=1e-6, abs=1e-9)


def test_no_start_is_lost_when_there_are_more_than_fit_the_working_set():
    problem = pose_problem(np.array([0.5, -0.4, 2.0]))
    starts = random_starts(np.array([0.5, -0.4, 2.0]), 1.0, 1500, np.random.default_rng(3))
    starts[:, 2] = 2.0
    together = problem.ends(starts)
    in_parts = [problem.ends(part) for part in np.array_split(starts, 7)]
    assert together.converged.all()
    # The order of sums differs between array sizes: rounding, not more.
    assert together.state == pytest.approx(np.concatenate([p.state for p in in_parts]), abs=1e-12)


def test_a_mirror_solution_is_found_with_its_place_and_cost():
    # Known points on the x axis: (1, 2) and (1, -2) fit equally well, and each half plane leads
    # to its own, the filter being symmetric about the axis.
    problem = point_problem(np.array([1.0, 2.0]), LINE)
    found = explore_convergence(
        problem, np.array([1.0, 2.0]), np.random.default_rng(1), starts=2000, radius=4.0
    )
    settled = found.outcome != NOT_CONVERGED
    above = found.starts[:, 1] > 0
    assert ((found.outcome == REACHES_SOLUTION) == above)[settled].all()
    assert ((found.outcome == REACHES_OTHER) == ~above)[settled].all()
    assert found.others[0].state == pytest.approx([1.0, -2.0], abs=1e-6)
    assert found.others[0].cost == pytest.approx(found.cost, abs=1e-9)
    # The nearest failure is just beyond the axis, two metres away.
    assert 1.5 < found.regions[0].radius <= 2.0


def test_a_better_place_elsewhere_is_told():
    # Readings of (1, -2) with one point slightly off the line; started at the worse mirror image.
    known = LINE.copy()
    known[3, 1] = 0.05
    problem = point_problem(np.array([1.0, -2.0]), known)
    found = explore_convergence(
        problem, np.array([1.0, 2.0]), np.random.default_rng(1), starts=500, radius=6.0
    )
    assert found.better_elsewhere is not None
    assert found.better_elsewhere.state == pytest.approx([1.0, -2.0], abs=1e-3)


def test_starts_fill_the_disc_and_the_circle():
    centre = np.array([1.0, -2.0, 0.3])
    starts = random_starts(centre, 3.0, 4000, np.random.default_rng(2))
    away = np.linalg.norm(starts[:, :2] - centre[:2], axis=1)
    direction = np.arctan2(*(starts[:, :2] - centre[:2]).T[::-1])
    assert away.max() <= 3.0
    assert kstest(away / 3, "uniform").pvalue > 1e-3
    assert kstest(direction / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3
    assert kstest(wrap(starts[:, 2] - 0.3) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


def ring_of_starts(distances, heading=0.0):
    return np.stack([distances, 0 * distances, np.full(len(distances), heading)], axis=-1)


def test_the_radius_is_the_largest_tested_without_failure():
    distances = np.linspace(0.01, 5.0, 500)
    failed = np.isclose(distances, 1.03)
    found = regions(np.zeros(3), ring_of_starts(distances), failed, 5.0)
    assert found[0].radius == pytest.approx(1.0)
    assert found[0].starts == 100
    # (1 - p)^n = 0.05, near the rule of three
    assert (1 - found[0].failures_below) ** 100 == pytest.approx(0.05)
    assert not found[0].limited_by_test


def test_failures_with_a_large_heading_error_do_not_count_for_small_ones():
    near, far = ring_of_starts(np.linspace(0.01, 5, 500)), ring_of_starts(np.array([0.5]), 1.2)
    failed = np.append(np.zeros(500, dtype=bool), True)
    found = regions(np.zeros(3), np.concatenate([near, far]), failed, 5.0)
    by_limit = {round(np.degrees(one.heading_limit)): one for one in found}
    assert by_limit[60].radius == 5.0
    assert by_limit[60].limited_by_test
    assert by_limit[90].radius == pytest.approx(0.4)
    assert by_limit[180].radius == pytest.approx(0.4)


def test_a_failure_at_the_centre_leaves_no_region():
    found = regions(np.zeros(2), np.array([[0.01, 0.0], [1.0, 0.0]]), np.array([True, False]), 5.0)
    assert found[0].radius == 0
    assert found[0].failures_below == 1


def test_the_claimed_share_of_failures_holds_as_often_as_stated():
    # 0.2 % of all starts fail. A claim is wrong where it is below that.
    rng = np.random.default_rng(9)
    trials, wrong = 1000, 0
    for _ in range(trials):
        away = 5 * rng.random(2500)
        failed = rng.random(2500) < 0.002
        found = regions(np.zeros(2), np.stack([away, 0 * away], axis=-1), failed, 5.0)
        wrong += found[0].failures_below < 0.002
    # The bound falls below 0.2 % from 1497 starts on. Radii go in steps of about 50 starts, so
    # the first to hold as many holds 1497 to about 1550: without failure in 0.998^n of all cases,
    # 4.5 % to 5 %.
    assert binom.ppf(5e-5, trials, 0.045) <= wrong <= binom.ppf(1 - 5e-5, trials, 0.05)


def test_starting_nowhere_near_is_an_error():
    with pytest.raises(ValueError, match="does not converge"):
        explore_convergence(
            point_problem(np.array([1.0, 2.0])),
            np.array([1e9, 1e9]),
            np.random.default_rng(0),
            starts=1,
            passes=1,
        )


def test_half_a_metre_and_a_rough_heading_are_near_enough_as_the_document_says():
    # AD2.3: "all of the initializations in a radius of about half-meter about the used one, turns
    # into the same final solution"
    solved = case(1)
    unknowns = unknowns_of(solved.solution, solved.simulated.readings, solved.simulated.robot_frame)
    assert {one.kind for one in unknowns} == {"world point", "pose"}
    rng = np.random.default_rng(4)
    found = [
        explore_convergence(one.problem, one.solution, rng, starts=600, radius=0.5)
        for one in unknowns
    ]
    region = smallest_region(found, np.pi / 3)
    assert region.radius == 0.5
    assert region.limited_by_test


def test_the_command_gives_radii_and_maps(tmp_path):
    folder, maps = tmp_path / "campaign", tmp_path / "maps"
    done = CliRunner().invoke(
        main, ["simulate", str(folder), "--stops", "2", "--world-points", "5", "--seed", "4"]
    )
    assert done.exit_code == 0, done.output
    command = ["convergence", str(folder), "--starts", "200", "--radius", "2"]
    done = CliRunner().invoke(main, [*command, "--json", "--figures", str(maps)])
    assert done.exit_code == 0, done.output
    unknowns = json.loads(done.output)["unknowns"]
    assert [one["kind"] for one in unknowns] == ["world point"] * 5 + ["pose"] * 2
    for one in unknowns:
        assert one["to_solution"] + one["elsewhere"] + one["nowhere"] == 200
    assert len(list(maps.glob("*.png"))) == 7
    again = CliRunner().invoke(main, [*command, "--json"])
    assert json.loads(again.output)["unknowns"] == unknowns
    table = CliRunner().invoke(main, command)
    assert "radius [m]" in table.output


def test_without_readings_there_is_nothing_to_start(tmp_path):
    (tmp_path / "survey").mkdir()
    (tmp_path / "campaign.toml").write_text('name = "poses only"\n')
    (tmp_path / "survey/published_poses.csv").write_text("pose,x,y,theta\n1,0,0,0\n")
    done = CliRunner().invoke(main, ["convergence", str(tmp_path)])
    assert done.exit_code == 2
    assert "without readings" in done.output


@pytest.mark.parametrize("radius", ["0", "-1", "nan", "inf"])
def test_a_radius_that_is_none_is_refused(tmp_path, radius):
    done = CliRunner().invoke(main, ["convergence", str(tmp_path), "--radius", radius])
    assert done.exit_code == 2
    assert "Traceback" not in done.output
