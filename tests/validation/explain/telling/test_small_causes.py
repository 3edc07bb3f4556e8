"""A small constant cause is told with what else it may be: an error that lasts."""

import numpy as np
import pytest
from explain_campaigns import random_stops, table

from validation.explain.analysis import explain
from validation.explain.telling.words import findings

WOULD = "would look the same"


@pytest.mark.parametrize(("millimetres", "n", "told"), [(5, 20, True), (30, 20, False)])
def test_a_frame_below_the_noise_of_poses_may_be_an_error_that_lasts(millimetres, n, told):
    rng = np.random.default_rng(5)
    truth = random_stops(rng, n)
    poses = truth + rng.normal(size=truth.shape) * [0.003, 0.003, 0.002]
    moved = np.array([millimetres / 1000, 0, 0])
    explanation = explain(table("survey", truth), [table("rig", poses + moved)])
    (cause,) = [one for one in findings(explanation) if one.code == "systematic_error"]
    assert (WOULD in cause.text) == told
