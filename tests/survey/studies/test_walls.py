import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binom

from survey.studies.walls import compare_walls, wall_findings
from validation.cli import main

SIGMA = 0.001


def test_the_document_s_walls_are_not_parallel():
    # AD2.3: "more than 2cm of difference between 2 points 3m away each other".
    pair = compare_walls("a", "b", np.array([0.0, 3.0]), np.array([6.0, 6.02]), np.full(2, SIGMA))
    assert pair.angle == pytest.approx(np.arctan(0.02 / 3))
    assert pair.sigma == pytest.approx(SIGMA * np.sqrt(2) / 3, rel=1e-4)
    assert pair.p_value < 1e-40
    assert np.isnan(pair.p_straight)
    assert [f.code for f in wall_findings(pair)] == ["not_parallel"]


def test_turning_the_positions_round_turns_the_sign():
    one = compare_walls("a", "b", np.array([0.0, 3.0]), np.array([6.0, 6.02]), np.full(2, SIGMA))
    two = compare_walls("a", "b", np.array([3.0, 0.0]), np.array([6.0, 6.02]), np.full(2, SIGMA))
    assert two.angle == pytest.approx(-one.angle)
    assert two.sigma == pytest.approx(one.sigma)


@pytest.mark.parametrize("position", [[1.0], [1.0, 1.0, 1.0]])
def test_one_position_shows_no_angle(position):
    n = len(position)
    pair = compare_walls("a", "b", np.array(position), np.full(n, 6.0), np.full(n, SIGMA))
    assert np.isnan(pair.angle)
    assert [f.code for f in wall_findings(pair)] == ["one_position"]


def test_no_reading_is_an_error():
    with pytest.raises(ValueError, match="no reading"):
        compare_walls("a", "b", np.empty(0), np.empty(0), np.empty(0))


def test_rates_are_as_stated():
    rng = np.random.default_rng(11)
    position, trials, slope = np.array([0.0, 1.0, 2.5, 4.0]), 2000, 0.004
    hits = np.zeros(3)
    for _ in range(trials):
        noise = rng.normal(0, SIGMA, (2, 4))
        tilted = compare_walls(
            "a", "b", position, 5 + slope * position + noise[0], np.full(4, SIGMA)
        )
        level = compare_walls("a", "b", position, 5 + noise[1], np.full(4, SIGMA))
        low, high = tilted.interval()
        hits += [
            not low <= np.arctan(slope) <= high,
            level.p_value < 0.05,
            level.p_straight < 0.05,
        ]
    low, high = binom.ppf([5e-5, 1 - 5e-5], trials, 0.05)
    assert ((low <= hits) & (hits <= high)).all()


def test_a_bent_wall_is_called_bent():
    position = np.array([0.0, 1.0, 2.0, 3.0])
    distance = 5 + 0.01 * np.abs(position - 1.5)
    pair = compare_walls("a", "b", position, distance, np.full(4, SIGMA))
    assert "not_straight" in [f.code for f in wall_findings(pair)]


STATED = ["--tolerance", "0.0015"]
HEADER = "wall_a,wall_b,position,distance\n"


def test_the_command_compares_every_pair(tmp_path):
    path = tmp_path / "walls.csv"
    path.write_text(HEADER + "s,n,0,6.000\ns,n,3,6.021\nw,e,0,9.000\nw,e,4,9.000\n")
    done = CliRunner().invoke(main, ["walls-check", str(path), *STATED])
    assert done.exit_code == 0, done.output
    assert "Not parallel" in done.output
    assert "No angle seen" in done.output
    result = json.loads(
        CliRunner().invoke(main, ["walls-check", str(path), *STATED, "--json"]).output
    )
    assert [pair["wall_a"] for pair in result["walls"]] == ["s", "w"]


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("s,s,0,6", "the two walls are the same"),
        ("n,s,0,6", "the other way round"),
        ("s,n,x,6", "not a number"),
        ("s,n,0,60", "out of range"),
        (",n,0,6", "empty"),
    ],
)
def test_bad_rows_are_named(tmp_path, row, said):
    path = tmp_path / "walls.csv"
    path.write_text(f"{HEADER}s,n,0,6.000\n{row}\n")
    done = CliRunner().invoke(main, ["walls-check", str(path), *STATED])
    assert done.exit_code == 2
    assert "line 3" in done.output
    assert said in done.output
