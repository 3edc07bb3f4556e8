"""Who surveyed a stop, and when, stands in the source of its pose."""

import numpy as np

from survey.campaign.outcome import with_makers
from survey.readings.readings import Readings
from validation.poses.pose_table import PoseTable


def test_one_observer_and_one_day_are_named_and_several_are_not():
    readings = Readings(
        start=("O", "1", "1", "2", "2"),
        end=("1", "5/O", "5/X", "6/O", "6/X"),
        distance=np.ones(5),
        sigma=np.ones(5),
        time=("", "2023-05-04T10:00", "2023-05-04 11:00", "2023-05-04T12:00", "2023-05-05T09:00"),
        observer=("Cy", "Ann", "Ann", "Ann", "Bo"),
    )
    table = PoseTable("survey", ("5", "6", "7"), np.zeros((3, 3)), sources=("joint",) * 3)
    found = with_makers(table, readings).sources
    assert found == ("joint, observer Ann, day 2023-05-04", "joint", "joint")
