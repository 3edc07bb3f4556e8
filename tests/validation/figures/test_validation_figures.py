"""Figures show the numbers that they are given."""

import numpy as np
import pytest
from small_campaigns import three_stops

from validation.figures.errors import arrow_scale, error_against_heading, error_map, error_strips
from validation.poses.pose_table import SPATIAL, Component, PoseTable
from validation.statistics.comparison import compare
from validation.statistics.evaluation import evaluate


@pytest.mark.parametrize(
    ("distance", "extent", "scale"),
    [(0.08, 7.0, 10), (0.2, 7.0, 5), (0.001, 7.0, 1000), (0.0, 7.0, 1), (3.0, 7.0, 1)],
)
def test_arrows_are_enlarged_by_a_round_factor(distance, extent, scale):
    assert arrow_scale(np.full(5, distance), extent) == scale


def test_arrows_lead_from_the_validation_pose_towards_the_gt_pose():
    comparison = compare(three_stops("survey"), three_stops("rig", shift=0.02))
    figure = error_map(comparison, walls=[[(0, 0), (5, 0)]], landmarks={"W1": (5.0, 5.0)})
    [axes] = figure.axes
    assert axes.get_title() == "rig: from validation to GT, enlarged 20 times"
    quiver = next(artist for artist in axes.collections if hasattr(artist, "U"))
    assert np.column_stack([quiver.U, quiver.V]) == pytest.approx(np.full((3, 2), 0.4))
    assert {text.get_text() for text in axes.texts} == {"W1", "1", "2", "3"}


def test_the_factor_of_three_is_used_too():
    assert arrow_scale(np.full(5, 0.03), 0.7) == 3


def test_errors_are_drawn_over_the_heading():
    comparison = compare(three_stops("survey"), three_stops("rig", shift=0.02))
    panels = error_against_heading(comparison).axes
    assert [axes.get_ylabel() for axes in panels] == [
        "x error [m]",
        "y error [m]",
        "theta error [rad]",
    ]
    heading = panels[0].lines[1].get_xdata()
    assert heading == pytest.approx(np.degrees([0.1, 1.6, -3.1]))


def test_poses_in_space_have_a_map_and_a_heading():
    poses = np.random.default_rng(0).uniform(-1, 1, (4, 6))
    ids = ("1", "2", "3", "4")
    comparison = compare(
        PoseTable("survey", ids, poses, components=SPATIAL),
        PoseTable("rig", ids, poses + 0.01, components=SPATIAL),
    )
    assert len(error_against_heading(comparison).axes) == 6
    assert error_map(comparison).axes[0].get_xlabel() == "x [m], GTV frame"


def test_without_heading_there_is_nothing_to_draw():
    depth = (Component("z", "length", "z"),)
    table = PoseTable("survey", ("1",), [[1.0]], components=depth)
    with pytest.raises(ValueError, match="no heading"):
        error_against_heading(compare(table, table))


def test_every_error_is_a_point_and_a_missing_interval_is_not_drawn():
    one = three_stops("survey").select(["1"])
    evaluations = [
        evaluate(three_stops("survey"), three_stops("rig", poses=np.ones((3, 3)))),
        evaluate(one, three_stops("other", shift=0.1)),
    ]
    panels = error_strips(evaluations).axes
    # Zero line; points, interval and mean of the first; points and mean of the second.
    assert [len(axes.lines) for axes in panels] == [6, 6, 6]
