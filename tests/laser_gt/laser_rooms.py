"""Scan pairs and small campaigns for the tests of laser GT."""

import os
from pathlib import Path

import numpy as np
from trials.scan_pairs import ScanPair, draw_pair

from data_samples.rooms.laser_campaign import LaserSimulation, laser_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from laser_gt.campaign.solve import solve_campaign
from laser_gt.placing.graph import Edge
from laser_gt.scans.evidence import Prepared
from validation.campaign.folder import load_campaign
from validation.poses.angles import wrap
from validation.poses.factored import Factored
from validation.solving import solve_validation
from validation.systems import installed_systems

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


def solved(folder, engines=("scanmatch",), **choices):
    """What laser GT makes of a campaign folder, the survey solved first."""
    campaign = solve_validation(load_campaign(folder), installed_systems())
    return solve_campaign(campaign, engines=engines, **choices)


def of_motions(robot, covariances, laser, laser_covariances):
    """Motions as a graph: each from a stop of its own at the origin to another.

    Gives poses, their covariance and edges as `laser_gt.placing.mounts.mount_of` takes them.
    """
    n = len(robot)
    poses, own = np.zeros((n, 2, 3)), np.zeros((n, 2, 3, 3))
    poses[:, 1] = robot
    own[:, 0], own[:, 1] = np.eye(3) * 1e-12, covariances
    edges = [
        Edge(2 * i, 2 * i + 1, pose, covariance)
        for i, (pose, covariance) in enumerate(zip(laser, laser_covariances, strict=True))
    ]
    return poses.reshape(-1, 3), Factored.alone(own.reshape(-1, 3, 3)), edges


def write_campaign(folder, seed=1, stops=6, **laser):
    from data_samples.rooms.campaign_files import write_campaign as write

    rng = np.random.default_rng(seed)
    room = make_room(RoomSettings(stops=stops, world_points=8), rng)
    simulated = simulate_survey(room, SimulationSettings(systems=()), rng)
    write(folder, simulated, seed, laser_files(room, LaserSimulation(**laser), rng))
    return room
