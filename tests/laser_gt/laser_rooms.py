"""Scan pairs and small campaigns for the tests of laser GT."""

import os
from pathlib import Path

import numpy as np

from data_samples.rooms.laser_campaign import LaserSimulation, laser_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.scan_pairs import ScanPair, draw_pair
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from laser_gt.scans.evidence import Prepared
from validation.poses.angles import wrap

REAL = Path(os.environ.get("GTVAL_REAL_DATA", Path(__file__).parents[3] / "shared" / "real"))
FR079 = REAL / "laser" / "fr079"


def prepared(pair: ScanPair):
    return Prepared(pair.reference), Prepared(pair.moving)


def pair_of(seed, kind="room", scanner=None, **settings):
    rng = np.random.default_rng(seed)
    more = {} if scanner is None else {"scanner": scanner}
    return draw_pair(rng, kind, **more, **settings)


def error(pose, truth):
    difference = np.asarray(pose) - truth
    return float(np.hypot(*difference[:2])), float(abs(wrap(difference[2])))


def write_campaign(folder, seed=1, stops=6, **laser):
    from data_samples.rooms.campaign_files import write_campaign as write

    rng = np.random.default_rng(seed)
    room = make_room(RoomSettings(stops=stops, world_points=8), rng)
    simulated = simulate_survey(room, SimulationSettings(systems=()), rng)
    write(folder, simulated, seed, laser_files(room, LaserSimulation(**laser), rng))
    return room
