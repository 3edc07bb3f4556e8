from dataclasses import replace

import numpy as np
import pytest
from surveys import simulated

from data_samples.rooms.campaign_files import write_campaign
from survey.campaign.findings import survey_findings
from survey.campaign.solve import solve_campaign
from survey.estimation.solve import solve_survey
from survey.readings.readings import Readings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError


def test_names_that_are_no_point_of_the_survey_are_refused_all_at_once():
    room, made = simulated(5, 2)
    names = {"7": "seven", "1/O": "1/Q", "XY": "Z"}
    readings = replace(
        made.readings,
        start=tuple(names.get(name, name) for name in made.readings.start),
        end=tuple(names.get(name, name) for name in made.readings.end),
    )
    with pytest.raises(GtvalError) as caught:
        solve_survey(room.vframe, made.robot_frame, readings, room.world_names)
    ends = (*readings.start, *readings.end)
    for name in names.values():
        assert f"'{name}' ({ends.count(name)})" in str(caught.value)
    assert "'X'" not in str(caught.value)


def test_every_reading_is_either_used_or_given_back_as_left_out():
    room, made = simulated(5, 2)
    lonely = Readings(("O", "9/O"), ("far", "1"), np.array([3.0, 4.0]), np.array([1e-3, 1e-3]))
    both = Readings(
        (*made.readings.start, *lonely.start),
        (*made.readings.end, *lonely.end),
        np.append(made.readings.distance, lonely.distance),
        np.append(made.readings.sigma, lonely.sigma),
    )
    solution = solve_survey(room.vframe, made.robot_frame, both, (*room.world_names, "far"))
    assert solution.left_out.start == lonely.start
    assert solution.left_out.end == lonely.end
    assert len(solution.used) == len(made.readings)
    assert [point.name for point in solution.world.missing] == ["far"]
    assert [pose.pose for pose in solution.not_posed] == ["9"]


def test_a_campaign_says_which_readings_are_not_used(tmp_path):
    _, made = simulated(5, 2)
    write_campaign(tmp_path, made, 5)
    with (tmp_path / "survey" / "readings.csv").open("a") as file:
        file.write("2024-03-05T09:00:00,9/O,1,4.000,A\n")
    findings = survey_findings(solve_campaign(load_campaign(tmp_path)))
    (told,) = [one for one in findings if one.code == "readings-left-out"]
    assert told.text.startswith("1 reading(s) are not used")
    assert told.text.endswith(": 9/O–1.")
