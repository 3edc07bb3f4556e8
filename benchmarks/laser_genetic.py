"""Clean rooms of 12 to 26 stops by both engines: what scan matching places, genetic places too.

Each seed is a room of its own with odometry and a survey; all surveyed stops place the laser
frame, so that the largest group of stops counts. Stops that scan matching places and the genetic
aligner does not are named; the errors of both are shown against the truth, and so is the
document's fitness of right matches and of the best wrong pose of the same pair.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from laser_campaigns import Campaign
from laser_lines import Lines, arguments

from data_samples.rooms.campaign_files import write_campaign
from data_samples.rooms.laser_campaign import LaserSimulation, laser_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from laser_gt.campaign.solve import solve_campaign
from laser_gt.placing.engines import Engine
from validation.campaign.folder import load_campaign
from validation.poses.pose_table import from_csv
from validation.solving import solve_validation
from validation.systems import installed_systems

FEWEST, MOST = 12, 26
ENGINES: tuple[Engine, Engine] = ("scanmatch", "genetic")


def solved(seed: int) -> Campaign:
    """A clean room of a number of stops that the seed draws, solved by both engines."""
    rng = np.random.default_rng(seed)
    room = make_room(RoomSettings(stops=int(rng.integers(FEWEST, MOST + 1))), rng)
    survey = simulate_survey(room, SimulationSettings(systems=()), rng)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(folder, survey, seed, laser_files(room, LaserSimulation(), rng))
        campaign = solve_validation(load_campaign(folder), installed_systems())
        outcome = solve_campaign(campaign, engines=ENGINES)
        truth = from_csv(folder / "truth" / "poses.csv")
    return Campaign(outcome, truth.ids, truth.poses)


def of_room(seed: int, total: dict[str, list[np.ndarray]]) -> tuple[int, list[float], list[float]]:
    """A room on a line; stops that only scan matching places, fitness of right and wrong poses."""
    room = solved(seed)
    placed = {engine: room.outcome.solutions[engine] for engine in ENGINES}
    missing = sorted(set(placed["scanmatch"].stops) - set(placed["genetic"].stops))
    parts = [f"seed {seed}: {len(room.truth)} stops"]
    for engine, one in placed.items():
        errors = room.errors(one.stops, one.placement.poses)
        errors = errors - errors.mean(0)  # a mean is the error of the survey
        total[engine].append(errors)
        matches = f"{len(one.matching.accepted)} of {len(one.matching.matches)} matches"
        parts.append(f"{engine} {len(one.stops)} by {matches}")
    print(*parts, f"lost: {' '.join(missing) or 'none'}", sep=", ", flush=True)
    accepted = placed["genetic"].matching.accepted
    wrong = [one.rival_fitness for one in accepted if np.isfinite(one.rival_fitness)]
    return len(missing), [one.fitness for one in accepted], wrong


if __name__ == "__main__":
    chosen = arguments(__doc__, 14_000, rooms=40)
    lines = Lines()
    total: dict[str, list[np.ndarray]] = {engine: [] for engine in ENGINES}
    seeds = range(chosen.seed, chosen.seed + chosen.rooms)
    lost, right, wrong = zip(*(of_room(seed, total) for seed in seeds), strict=True)
    lines.at_most("stops that only scan matching places", sum(lost), 0, "")
    for engine, errors in total.items():
        spread = np.concatenate(errors).std(0)
        lines.at_most(f"{engine}: deviation of x or y in a room", spread[:2].max() * 1e3, 5, "mm")
        lines.at_most(f"{engine}: deviation of theta in a room", spread[2] * 1e3, 2, "mrad")
    good, bad = np.concatenate(right), np.concatenate(wrong)
    print(f"fitness of {len(good)} right matches: median {np.median(good):.3f} m^2")
    print(
        f"of the best wrong pose of {len(bad)} of them: median {np.median(bad):.3f} m^2, "
        f"{np.median(bad) / np.median(good):.0f} times (AD2.3: about 40)"
    )
    print(f"wrong ones below the worst right one: {np.mean(bad < good.max()):.0%}")
    sys.exit(bool(lines.missed))
