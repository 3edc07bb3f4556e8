"""Drives filmed by cameras whose places, lenses and markers are a little off what is known."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform
from vision_scenes import camera, seen_robot

from data_samples.motion.path import drive, through
from data_samples.motion.sensors import odometry
from data_samples.rooms.cameras import looking, robot_layout
from validation.poses.angles import wrap
from validation.poses.trajectory import Clock, Trajectory
from vision_gt.driving.stream import camera_stream
from vision_gt.network.adjustment import Network
from vision_gt.optics.transforms import perturbed, planar_transform
from vision_gt.robot.robot_pose import Floor

PLACE, AIM, LENS = 0.001, 0.0003, 0.3
"""Standard deviations of a camera's place (m), its direction (rad) and focal lengths (pixels)."""
MARKER, LEAN = 0.0005, 0.001
"""Of a marker's place on the robot: metres, radians."""
EYES = ((-0.5, -0.5), (8.5, -0.5), (8.5, 6.5), (-0.5, 6.5))
AIMS = ((2.5, 2.0), (5.5, 2.0), (5.5, 4.0), (2.5, 4.0))
MIDDLE = np.array([[3.2, 2.4, 0.0], [4.8, 2.4, 2.0], [4.8, 3.6, -2.0], [3.2, 3.6, 1.0]])
FLOOR = Floor(0.001, 0.001)
FARTHEST = 7.0


@dataclass(frozen=True)
class Filmed:
    """What is true, and what the estimator is given."""

    path: object
    delays: dict
    streams: list
    odometry: Trajectory
    spurious: dict

    def errors(self, trajectory, delay=0.0, least=0.0):
        """Errors (n, 3) of a trajectory, and which of its times are within the drive."""
        times = trajectory.times + delay
        inside = (times >= least) & (times <= self.path.times[-1] - least)
        off = trajectory.poses - self.path.at(times)
        off[:, 2] = wrap(off[:, 2])
        return off, inside


def leap(solved):
    """Largest ratio of the standard deviations of two neighbouring poses of a fused drive.

    Of poses 60 ms apart at most, while the same cameras see the robot: have kept frames within
    0.15 s, one and a half periods, on the common time.
    """
    told = solved.trajectory
    near = []
    for stream in solved.streams:
        clock = solved.clocks.get(stream.camera)
        if clock is None or not stream.kept.any():
            continue
        at = stream.times[stream.kept] + clock.delay_s + stream.epoch - told.epoch
        near.append(np.abs(told.times[:, None] - at).min(1) < 0.15)
    near = np.array(near)
    alike = (near[:, 1:] == near[:, :-1]).all(0) & near.any(0)[1:] & (np.diff(told.times) < 0.06)
    alike &= solved.supported[1:] & solved.supported[:-1]
    sigmas = np.sqrt(np.diagonal(told.covariances, axis1=1, axis2=2))
    steps = np.abs(np.diff(np.log(sigmas), axis=0))[alike]
    return float(np.exp(steps.max()))


def true_and_known(rng, cameras):
    """The network as it is, as (place, lens) a camera, and as it is known."""
    sigmas = np.concatenate([np.full(3, PLACE), np.full(3, AIM), [LENS, LENS], np.full(7, 1e-9)])
    true = [looking(np.array([*EYES[i], 2.6]), np.array([*AIMS[i], 0.0])) for i in range(cameras)]
    off = sigmas * rng.standard_normal((cameras, 15))
    known = Network(
        tuple(
            replace(camera(str(i + 1)), parameters=camera().parameters + off[i, 6:])
            for i in range(cameras)
        ),
        RigidTransform.concatenate([perturbed(T, o[:6]) for T, o in zip(true, off, strict=True)]),
        np.kron(np.eye(cameras), np.diag(sigmas**2)),
        RigidTransform.identity(),
        np.zeros((6, 6)),
        0.1,
    )
    drawn = robot_layout()
    spread = np.tile(np.concatenate([np.full(3, MARKER), np.full(3, LEAN)]), len(drawn.numbers))
    moved = (spread * rng.standard_normal(spread.shape)).reshape(-1, 6)
    layout = replace(
        drawn,
        T_robot_marker=perturbed(drawn.T_robot_marker, moved),
        covariance=np.diag(spread**2),
    )
    return true, known, drawn, layout


def filmed(seed, seconds, *, cameras=4, rate=10.0, noise=0.2, wrong=0.03, middle=False):
    """A drive with late and lost frames, some of which show wrong markers.

    In the middle of the room all cameras see the robot.
    """
    jitter = 0.003
    rng = np.random.default_rng(seed)
    true, network, layout, known_layout = true_and_known(rng, cameras)
    path = through(MIDDLE, seconds, rng) if middle else drive(seconds, rng)
    streams, delays, spurious = [], {}, {}
    for i, T in enumerate(true):
        name, delay = str(i + 1), -float(rng.uniform(0, 0.34))
        times = np.arange(rng.uniform(0, 1 / rate), seconds - 0.1, 1 / rate)
        times = times[rng.random(len(times)) > 0.02]
        stamps = times - delay + jitter * (rng.gamma(4.0, 0.5, len(times)) - 2)
        stamps = np.maximum.accumulate(stamps + 1e-9 * np.arange(len(stamps)))
        bad = rng.random(len(times)) < wrong
        seen = []
        for time, spoilt in zip(times, bad, strict=True):
            robot = planar_transform(path.at(np.array([time]))[0])
            far = np.linalg.norm(T.translation - robot.translation) > FARTHEST
            views = () if far else seen_robot(T, robot, noise, rng, layout=layout).views
            if spoilt and len(views) > 1:
                a, b, *rest = views
                views = (replace(a, number=b.number),)  # one marker, taken for another
                if rng.random() < 0.5:  # two of them taken for each other
                    views = (*views, replace(b, number=a.number), *rest)
            seen.append(views)
        floor, clock = FLOOR, Clock("receipt")
        streams.append(camera_stream(name, stamps, seen, network, known_layout, floor, clock=clock))
        delays[name] = delay
        spurious[name] = bad & (np.array([len(v) for v in seen]) > 1)
    wheels = odometry(path, rng)
    return Filmed(
        path, delays, streams, Trajectory("odometry", wheels.stamps, wheels.poses), spurious
    )
