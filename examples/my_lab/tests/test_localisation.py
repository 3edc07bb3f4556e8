"""A robot's localisation against the true poses of its stops, in a clean room and a bad one."""

import pytest
from my_lab.localisation import localise

import gtval


def errors_of(room):
    """What gtval makes of the poses that the robot believes."""
    poses = localise(room.scans, room.odometry[0], room.guesses, room.walls)
    truth = gtval.pose_table("truth", room.poses, ids=room.stops)
    return gtval.compare(truth, gtval.pose_table("robot", poses, ids=room.stops)).comparison


@pytest.mark.parametrize("gtval_scans", [{"stops": 10}], indirect=True)
def test_the_robot_knows_where_it_is_to_5_mm(gtval_scans):
    assert errors_of(gtval_scans).distances.max() < 0.005


@pytest.mark.parametrize("gtval_scans", [{"stops": 10, "faults": ["boxes", "lost"]}], indirect=True)
def test_moved_boxes_and_lost_beams_cost_it_no_more_than_2_cm(gtval_scans):
    assert errors_of(gtval_scans).distances.max() < 0.02
