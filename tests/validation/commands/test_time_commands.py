"""gtval compare with trajectories, as typed."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from moving_robot import drive, seen

from validation.cli import main


def gtval(*arguments: object):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def write(path, one, late=0.0):
    rows = np.column_stack([one.times + late, one.poses])
    np.savetxt(path, rows, delimiter=",", header="time,x,y,theta", comments="", fmt="%.9f")
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A reference and a source whose stamps are 80 ms late."""
    folder, path = tmp_path_factory.mktemp("recorded"), drive(120.0)
    reference = write(folder / "reference.csv", seen(path, 50.0, 0.002))
    return reference, write(folder / "camera.csv", seen(path, 10.0, 0.002, 3, start=3.0), 0.08)


def test_trajectories_are_compared_and_the_limit_is_answered(recorded):
    told = json.loads(gtval("compare", *recorded, "--json", "--limit", 0.2).stdout)
    [(name, one)] = told["systems"].items()
    assert name == "camera"
    assert one["verdict"] == one["limit"]["verdict"] == "yes"
    assert one["aligned"] == {"parts": [], "freedoms": 0}
    shown = gtval("compare", *recorded).stdout
    assert "Errors in time (reference minus source)" in shown
    assert "Is 'camera' good enough for 5 cm?" in shown
    assert "Worst stretches of camera" in gtval("compare", *recorded, "--all").stdout


def test_a_delay_is_taken_away_where_that_is_asked_for(recorded):
    before = json.loads(gtval("compare", *recorded, "--json").stdout)["systems"]["camera"]
    done = gtval("compare", *recorded, "--align", "frame+time", "--json")
    after = json.loads(done.stdout)["systems"]["camera"]
    assert after["aligned"]["delay_s"]["value"] == pytest.approx(-0.08, abs=0.002)
    assert after["rms_position_m"] < 0.006 < before["rms_position_m"]
    assert after["aligned"]["freedoms"] == 4


def test_a_delay_that_the_motion_does_not_tell_is_not_taken(tmp_path):
    t = np.arange(0, 60, 0.1)
    line = np.column_stack([t, 0.5 * t, 0 * t, 0 * t])
    noise = np.random.default_rng(1).normal(0, 0.003, (2, len(t), 4)) * [0, 1, 1, 1]
    files = []
    for name, rows in (("one", line + noise[0]), ("two", line + noise[1])):
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, rows, delimiter=",", header="time,x,y,theta", comments="", fmt="%.9f")
        files.append(path)
    refused = gtval("compare", *files, "--align", "frame+time")
    assert refused.exit_code == 2
    assert "the delay of 'two'" in refused.stderr
    assert "gtval sync" in refused.stderr


def test_what_does_not_go_together_is_refused(recorded):
    assert "'frames' cannot be aligned" in gtval("compare", *recorded, "--align", "frames").stderr
    twice = gtval("compare", recorded[0], recorded[1], recorded[1])
    assert "two sources are named camera" in twice.stderr
    assert "tables of stops" in gtval("compare", *recorded, "--normal-interval").stderr
