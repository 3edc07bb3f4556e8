"""A solver of one's own against the true places of a synthetic room."""

import numpy as np
import pytest
from my_lab.solver import world_points

NEEDED = ("start", "end", "distance", "sigma", "vframe", "vframe_sigma")
LIMIT = 18.4
"""Chi-squared with 2 degrees of freedom is above it once in 10,000 times."""


def solved(room):
    return world_points(**{name: room.survey[name] for name in NEEDED})


def test_every_world_point_is_where_it_is_and_as_sure_as_it_says(gtval_survey):
    found = solved(gtval_survey)
    assert set(found) == set(gtval_survey.world_points)
    for name, (point, covariance, misfit) in found.items():
        off = point - gtval_survey.world_points[name]
        assert off @ np.linalg.solve(covariance, off) < LIMIT
        assert misfit < LIMIT  # 4 readings, 2 unknowns


@pytest.mark.parametrize("gtval_survey", [{"stops": 1, "blunders": 4}], indirect=True)
def test_a_wrong_reading_shows_in_the_misfit_of_its_point(gtval_survey):
    found = solved(gtval_survey)
    spoilt = {gtval_survey.survey["end"][row] for row in gtval_survey.wrong_readings}
    spoilt_from_vframe = {
        gtval_survey.survey["end"][row]
        for row in gtval_survey.wrong_readings
        if gtval_survey.survey["start"][row] in gtval_survey.survey["vframe"]
    }
    doubtful = {name for name, (_, _, misfit) in found.items() if misfit > LIMIT}
    assert spoilt_from_vframe <= doubtful | set(gtval_survey.survey["vframe"])
    assert doubtful <= spoilt
