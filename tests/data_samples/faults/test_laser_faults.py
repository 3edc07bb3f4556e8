import numpy as np
import pytest
from click.testing import CliRunner

from data_samples.rooms.laser_campaign import (
    FAULTS,
    LaserSimulation,
    laser_files,
    room_panels,
    with_faults,
)
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.scanners import Scanner, take_scan
from validation.cli import main

ROOM = make_room(RoomSettings(stops=3, world_points=8), np.random.default_rng(2))


def _scans(simulation):
    return laser_files(ROOM, simulation, np.random.default_rng(5))["laser/scans.csv"]


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_changes_the_scans(fault):
    assert _scans(with_faults([fault])) != _scans(LaserSimulation())


def test_without_faults_the_scans_are_the_usual_ones():
    assert _scans(with_faults([])) == _scans(LaserSimulation())
    with pytest.raises(ValueError, match="no such fault: fog"):
        with_faults(["fog"])


def test_behind_a_window_the_scanner_sees_the_next_building():
    exact = Scanner(720, 2 * np.pi, sigma=1e-12, resolution=0.0)
    centre = np.append(ROOM.outline.mean(0), 0.0)
    bare, glazed = (
        take_scan(room_panels(ROOM, glass=glass), exact, centre, np.random.default_rng(1))
        for glass in (0.0, 2.0)
    )
    farther = glazed.ranges > bare.ranges + 1e-6
    assert farther.any()
    # two metres behind the wall, whatever the incidence, and never nearer than the wall
    assert (glazed.ranges[farther] - bare.ranges[farther] >= 2.0 - 1e-9).all()
    assert np.allclose(glazed.ranges[~farther], bare.ranges[~farther])


def test_the_command_offers_the_faults_that_there_are(tmp_path):
    shown = CliRunner().invoke(main, ["simulate", "--help"]).output
    assert all(fault in shown for fault in FAULTS)
    arguments = ["simulate", str(tmp_path / "room"), "--stops", "3", "--laser"]
    for fault in FAULTS:
        arguments += ["--laser-fault", fault]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "room" / "laser" / "scans.csv").stat().st_size > 10_000
