"""The chain of transforms against homogeneous matrices, and its derivatives against differences."""

import numpy as np
import pytest
from explain_campaigns import matrix, pose, random_stops

from validation.explain.fitting.models import Motion, candidates, correct
from validation.poses.angles import wrap

RNG = np.random.default_rng(1)
STOPS = random_stops(RNG, 12)
REFERENCE = np.array([0.7, -1.1, 2.2])
MOTION = Motion(
    RNG.normal(size=(12, 3)),
    RNG.normal(size=(12, 3)),
    RNG.normal(size=(12, 2, 3)),
    np.full((12, 2), 0.6),
    np.zeros((12, 3)),
)
MODELS = {
    model.name: model
    for reference in (True, False)
    for model in candidates(reference=reference, moving=True)
} | {f"{m.name}*": m for m in candidates(reference=True, moving=True)}


def by_matrices(model, values, stops):
    """The same corrections, written as the docstring has them."""
    at = dict(zip(model.fitted, values, strict=True))

    def part(name):
        return matrix([at.get(f"{name}_{axis}", 0.0) for axis in ("x", "y", "theta")])

    late = at.get("time", 0.0)
    jerk = MOTION.jerks[:, int(late > 0)]
    powers = late ** np.arange(1, 4) / np.array([1, 2, 6])
    moved = stops + np.tensordot(powers, [MOTION.velocities, MOTION.accelerations, jerk], 1)
    pivot = REFERENCE[:2]
    moved[:, :2] = pivot + (1 + at.get("scale", 0.0)) * (moved[:, :2] - pivot)
    done = matrix(moved) @ np.linalg.inv(part("mount"))
    p = matrix(REFERENCE)
    if model.through_reference and "mount" in model.parts:
        done = p @ part("mount") @ np.linalg.inv(p) @ done
    if model.slip:
        there, back = np.eye(3), np.eye(3)
        there[:2, 2], back[:2, 2] = pivot, -pivot
        done = there @ part("slip") @ back @ done
    return pose(part("frame") @ done)


@pytest.mark.parametrize("name", MODELS)
def test_the_chain_is_the_product_of_matrices(name):
    model = MODELS[name]
    values = RNG.normal(size=len(model.fitted)) * 0.2
    made = correct(model, values, STOPS, REFERENCE, MOTION)
    difference = np.broadcast_to(made.poses, STOPS.shape) - by_matrices(model, values, STOPS)
    difference[:, 2] = wrap(difference[:, 2])
    assert np.abs(difference).max() < 1e-12


@pytest.mark.parametrize("name", MODELS)
def test_derivatives_are_those_of_the_chain(name):
    model, h = MODELS[name], 1e-6
    values = RNG.normal(size=len(model.fitted)) * 0.2
    made = correct(model, values, STOPS, REFERENCE, MOTION)
    for column, step in enumerate(h * np.eye(len(values))):
        up, down = (
            correct(model, values + sign * step, STOPS, REFERENCE, MOTION).poses for sign in (1, -1)
        )
        assert np.allclose((up - down) / (2 * h), made.by_parameters[..., column], atol=1e-8)
    for column, step in enumerate(h * np.eye(3)):
        up, down = (
            correct(model, values, STOPS + sign * step, REFERENCE, MOTION).poses for sign in (1, -1)
        )
        assert np.allclose((up - down) / (2 * h), made.by_pose[..., column], atol=1e-8)


def test_a_batch_of_parameters_is_the_same_as_each_alone():
    model = MODELS["frame_mount"]
    values = RNG.normal(size=(4, 6)) * 0.2
    together = correct(model, values, STOPS, REFERENCE)
    for row, one in enumerate(values):
        assert np.allclose(together.poses[row], correct(model, one, STOPS, REFERENCE).poses)


def test_without_parameters_nothing_changes():
    model = candidates(reference=False, moving=False)[0]
    assert np.array_equal(
        np.broadcast_to(correct(model, np.zeros(0), STOPS).poses, STOPS.shape), STOPS
    )


@pytest.mark.parametrize("time", [-2.0, -0.61, 0.61, 3.0])
def test_beyond_the_next_pose_the_velocity_stays(time):
    way, rate = MOTION.later(np.array([[[time]]]))
    edge, at_edge = MOTION.later(np.array([[[0.6 * np.sign(time)]]]))
    assert np.allclose(rate, at_edge)
    assert np.allclose(way, edge + rate * (time - 0.6 * np.sign(time)))
