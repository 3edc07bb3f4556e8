"""`gtval explain` of trajectories."""

import json

import numpy as np
from click.testing import CliRunner
from trials.drives_in_time import Drive, simulate

from validation.cli import main


def write(folder, trajectory):
    path = folder / f"{trajectory.system}.csv"
    rows = np.column_stack([trajectory.times + 1_700_000_000, trajectory.poses])
    np.savetxt(path, rows, delimiter=",", header="time,x,y,theta", comments="", fmt="%.9f")
    return str(path)


def test_trajectories_are_explained(tmp_path):
    pair = simulate(Drive(seconds=80.0), 3, {"delay": -0.15})
    files = [write(tmp_path, one) for one in pair]
    done = CliRunner().invoke(main, ["explain", *files, "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    one = told["systems"]["source"]
    assert one["explanation"] == "delay"
    (delay,) = one["parameters"]
    assert delay["name"] == "delay"
    assert abs(delay["value"] + 0.15) < 4 * delay["sigma"]
    assert told["findings"][0]["code"] == "systematic_error"


def test_options_of_stops_are_refused(tmp_path):
    files = [write(tmp_path, one) for one in simulate(Drive(seconds=10.0), 3)]
    done = CliRunner().invoke(main, ["explain", *files, "--figures"])
    assert done.exit_code == 2
    assert "take no options but" in done.output
