"""Straight roads and standing records made in code: what little they determine is known."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import special
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import ANTENNAS
from rtk_gt.campaign.solve import Prepared, offsets_of, prepare
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.path.antennas import Places
from rtk_gt.path.choice import Choice, check_attitude
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.steps import Steps
from rtk_gt.settings import RtkSettings
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame
from validation.poses.pose_table import SPATIAL, pose_difference

SITE = LocalFrame.from_degrees(45.5, 9.16, 177.0)
NAMES = ("rear", "front_left", "front_right")
KNOWLEDGE = ("none", "distances", "two distances", "offsets", "one offset", "both")


STANDING = {"moving": False}
SHORT = {"seconds": 120.0, "interval": 1.0, "sigma": 0.0064}
ROADS = [
    *({"degrees": d, "slope": s} for s in (0.0, 1.0, 3.0) for d in (1, 2, 5, 10, 20)),
    *({"degrees": d, **SHORT} for d in (2, 10, 20)),
    STANDING,
    {**STANDING, "bases": False},
    {**STANDING, **SHORT},
]
"""Headings that span 1 to 20 degrees, level and with slopes; short records; standing ones."""


class Road(NamedTuple):
    """Steps as recorded, and the truth: offsets (3, 3), distances (3,), poses (t, 6)."""

    steps: Steps
    offsets: Array
    distances: Array
    poses: Array


def road_of(
    seed: int,
    *,
    degrees: float = 2.0,
    moving: bool = True,
    sigma: float = 0.004,
    seconds: float = 300.0,
    interval: float = 0.2,
    slope: float = 1.0,
    bases: bool = True,
    eta: float = 1.75,
    slow: float = 0.0,
    memory: float = 30.0,
) -> Road:
    """A road whose headings span ``degrees``, at 8 m/s; or the vehicle stands.

    The slope changes by ``slope`` degrees along the road. With ``bases`` each receiver has its
    own base station and an offset of metres, without it offsets are 0. Errors of the receivers are
    white, with slow ones of sigma ``slow`` beside them.
    """
    generator = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, interval)
    s = t / seconds
    phases = generator.uniform(0, 2 * np.pi, 3)
    bend = np.sin(2 * np.pi * s + phases[0]) + 0.3 * np.sin(6 * np.pi * s + phases[1])
    bend = np.radians(degrees) * (bend - bend.min()) / np.ptp(bend)
    yaw = generator.uniform(-np.pi, np.pi) + bend * moving
    tilt = np.radians(slope) * moving
    pitch = (
        tilt * np.sin(4 * np.pi * s + phases[2]) / 2 + np.radians(slope) * generator.normal() / 2
    )
    roll = tilt / 2 * np.sin(10 * np.pi * s + phases[1]) / 2
    speed = 8.0 * moving
    ahead = np.column_stack(
        [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)]
    )
    place = np.cumsum(ahead * speed * interval, axis=0)
    R = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])).as_matrix()
    offsets = np.vstack([np.zeros(3), generator.normal(size=(2, 3)) * bases * [3, 3, 1]])
    positions = place[:, None] + np.einsum("tij,rj->tri", R, ANTENNAS) - offsets
    errors = generator.standard_normal(positions.shape) * sigma
    if slow:
        kept = np.exp(-interval / memory)
        new = generator.standard_normal(positions.shape) * slow
        new[1:] *= np.sqrt(1 - kept**2)
        errors += lfilter([1.0], [1.0, -kept], new, axis=0)
    positions = positions + errors * [1, 1, eta]
    distances = [np.linalg.norm(ANTENNAS[i] - ANTENNAS[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    poses = np.column_stack([place, yaw, pitch, roll])
    steps = Steps(NAMES, 1.7e9 + t, positions, np.full((len(t), 3), 4), SITE)
    return Road(steps, offsets, np.array(distances), poses)


def knowledge_of(
    road: Road, what: str, seed: int, offset_sigma: float = 0.005, distance_sigma: float = 0.01
) -> tuple[Array | None, Array | None]:
    """Offsets and distances with their sigmas as one would state them; NaN where not stated."""
    generator = np.random.default_rng([seed, 7])
    offsets = road.offsets + generator.normal(size=(3, 3)) * offset_sigma
    offsets[0] = 0
    distances = road.distances + generator.normal(size=3) * distance_sigma
    if what not in ("offsets", "one offset", "both"):
        offsets = None
    elif what == "one offset":
        offsets[2] = np.nan
    if what not in ("distances", "two distances", "both"):
        distances = None
    elif what == "two distances":
        distances[2] = np.nan
    return offsets, distances


def prior_of(
    offsets: Array | None,
    distances: Array | None,
    offset_sigma: float = 0.005,
    distance_sigma: float = 0.01,
) -> OffsetPrior:
    """What `knowledge_of` gives, with the heights of the antennas."""
    known = {"heights": ANTENNAS[:, 2]}
    if offsets is not None:
        known |= {"offsets": offsets, "offset_sigmas": np.full((3, 3), offset_sigma)}
    if distances is not None:
        known |= {"distances": distances, "distance_sigmas": np.full(3, distance_sigma)}
    return OffsetPrior(**known)


def solved(
    steps: Steps,
    prior: OffsetPrior,
    settings: RtkSettings | None = None,
    ready: Prepared | None = None,
) -> tuple[Choice, VehiclePath]:
    """Choice and path of the whole chain; a GtvalError where it refuses.

    What `prepare` makes of the steps is the same whatever is stated, and may be given.
    """
    settings = settings or RtkSettings()
    ready = ready or prepare(steps, settings)
    steps = ready.steps
    chosen, _, model = offsets_of(ready, prior, settings, Places(ANTENNAS[:, 2]))
    rows = np.flatnonzero(steps.complete)[chosen.offsets.weights > 0]
    path = vehicle_path(
        steps.select(rows), chosen.offsets, chosen.antennas, jumps=ready.jumps, model=model
    )
    check_attitude(path)
    return chosen, path


def sizes(road: Road, chosen: Choice, path: VehiclePath) -> list[float]:
    """Errors in standard deviations of the whole: offsets and distances, and the middle pose."""
    found = chosen.offsets
    off = (found.offsets.values - road.offsets)[1:].ravel()
    off = np.concatenate([off, found.distances - road.distances])
    middle = len(path) // 2
    row = int(np.searchsorted(road.steps.times, path.times[middle] - 1e-3))
    error = pose_difference(path.poses[[middle]], road.poses[[row]], SPATIAL)[0]
    squares = (
        (off @ np.linalg.pinv(found.covariance, rcond=1e-12, hermitian=True) @ off, 9),
        (error @ np.linalg.solve(path.covariances[middle], error), 6),
    )
    return [float(-special.ndtri(max(special.chdtrc(dof, at), 1e-300) / 2)) for at, dof in squares]


HEAD = """name = "Road"
[rtk]
origin = { latitude = 45.5, longitude = 9.16, height = 177.0 }
eta = 1.75
"""


def write_road(folder: Path, steps: Steps, known: str = "", names: tuple[str, ...] = NAMES) -> None:
    """Steps as a campaign: a CSV file for each receiver, 0.1 mm on the last digit."""
    (folder / "rtk").mkdir(parents=True)
    toml = HEAD
    for column, name in enumerate(names):
        places = SITE.to_geodetic(steps.positions[:, column])
        lines = ["time,latitude,longitude,height,fix"]
        lines += [
            f"{time:.3f},{np.degrees(north):.11f},{np.degrees(east):.11f},{height:.4f},4"
            for time, (north, east, height) in zip(steps.times, places, strict=True)
        ]
        (folder / "rtk" / f"{name}.csv").write_text("\n".join(lines) + "\n")
        toml += f'[[rtk.receivers]]\nname = "{name}"\nfile = "rtk/{name}.csv"\n'
        toml += f"height = {ANTENNAS[NAMES.index(name), 2]}\n"
    (folder / "campaign.toml").write_text(toml + known)
