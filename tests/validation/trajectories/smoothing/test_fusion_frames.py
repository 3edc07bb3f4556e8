"""Sources in two frames are told, and errors that last are not taken for a frame."""

from dataclasses import replace

import numpy as np
import pytest
from fusion_drives import drive

from validation.poses.trajectory import Trajectory
from validation.trajectories.smoothing.frames import frame_findings
from validation.trajectories.smoothing.fusion import fuse
from validation.trajectories.smoothing.gathering import stamped
from validation.trajectories.smoothing.source import Source


def told(sources):
    epoch = sources[0].trajectory.epoch
    return frame_findings(sources, [stamped(one, epoch, smooth=True) for one in sources])


def moved(source, shift, turn):
    own = source.trajectory
    c, s = np.cos(turn), np.sin(turn)
    poses = own.poses.copy()
    poses[:, :2] = poses[:, :2] @ np.array([[c, s], [-s, c]]) + shift
    poses[:, 2] += turn
    return replace(source, trajectory=replace(own, poses=poses))


@pytest.mark.parametrize("level", [3])
@pytest.mark.parametrize(("shift", "turn"), [((1.0, -2.0), 0.0), ((0.5, 0.3), 1.5)])
def test_two_frames_are_told_with_their_turn_and_shift(level, shift, turn):
    sources = drive(3, level, seconds=60.0).sources
    (finding,) = told([sources[0], sources[1], moved(sources[2], shift, turn)])
    assert (finding.subject, finding.code) == ("camera_3", "sources_apart")
    assert finding.severity == "error"
    assert f"turned by {np.degrees(turn):.0f}"[:-1] in finding.text


def one_frame(seed, level):
    """Nothing is told of sources in one frame, nor where delays are wrong by 0.2 s."""
    made = drive(seed, level, seconds=60.0)
    sources = [one for one in made.sources if len(one.trajectory) > 2]
    late = [replace(one, delay_s=one.delay_s + 0.2 * k) for k, one in enumerate(sources)]
    return told(sources) == told(late) == []


@pytest.mark.parametrize("level", [2])
def test_one_frame_is_not_told_whatever_the_noise(level):
    assert one_frame(40, level)


@pytest.mark.full
@pytest.mark.parametrize("level", range(4))
def test_one_frame_is_not_told_in_many_drives(level):
    assert all(one_frame(41 + seed, level) for seed in range(10))


def test_errors_that_last_are_a_frame_only_beyond_what_is_stated():
    times = np.arange(0.0, 40.0, 0.1)
    rng = np.random.default_rng(5)
    truth = np.column_stack([np.cos(times / 9), np.sin(times / 7), times / 30])
    slow = 0.02 * np.column_stack([np.sin(times / 20), np.cos(times / 25), 0 * times])

    def source(name, off, sigma):
        poses = truth + off + rng.normal(0, 0.002, truth.shape)
        covariances = np.broadcast_to(sigma**2 * np.eye(3), (len(times), 3, 3))
        return Source(Trajectory(name, times, poses, "plane", covariances))

    first, constant = source("a", 0 * truth, 0.02), np.array([0.05, 0.03, 0.0])
    assert told([first, source("b", slow, 0.02)]) == []
    assert told([first, source("b", constant, 0.02)]) == []
    (finding,) = told([source("a", 0 * truth, 0.005), source("b", constant, 0.005)])
    assert finding.severity == "warning"
    fused = fuse([first, source("b", np.array([2.0, 0.0, 0.0]), 0.02)])
    assert [one.code for one in fused.findings if one.severity == "error"] == ["sources_apart"]
