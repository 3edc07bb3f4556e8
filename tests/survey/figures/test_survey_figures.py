"""Figures: right places and sizes, equal axes, names, and the same bytes every time."""

import numpy as np
import pytest
from matplotlib.patches import Ellipse
from matplotlib.text import Annotation

from survey.estimation.geometry import ellipse_axes
from survey.figures.maps import Places, Room, ellipse_scale, hand_against_validation, survey_map
from survey.figures.residuals import residual_figure
from survey.figures.studies import (
    convergence_map,
    instrument_figure,
    planning_map,
)
from survey.studies.convergence import NOT_CONVERGED, Convergence, regions
from survey.studies.instrument_check import check_instrument
from validation.campaign.folder import Instrument
from validation.errors import GtvalError
from validation.figures.writing import figure_bytes, write_figure

ROOM = Room(vframe=[("O", (0.0, 0.0)), ("X", (2.5, 0.0)), ("Y", (0.0, 2.5)), ("XY", (2.5, 2.5))])
WORLD = Places(
    ("1", "2", "3"),
    np.array([[-3.0, 0.0], [5.0, 1.0], [0.0, 6.0]]),
    np.tile(np.diag([4e-6, 1e-6]), (3, 1, 1)),
)
FRAMES = Places(
    ("a", "b"),
    np.array([[1.0, 1.0, 0.3], [2.0, 3.0, -2.0]]),
    np.stack([np.diag([1e-6, 4e-6, 1e-5]), np.full((3, 3), np.nan)]),
)


def names(axes):
    return {text.get_text() for text in axes.texts if isinstance(text, Annotation)} - {""}


def test_the_ellipse_of_a_turned_covariance():
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, -s], [s, c]])
    long, short, direction = ellipse_axes(turn @ np.diag([9e-6, 1e-6]) @ turn.T)
    assert (long, short) == pytest.approx((0.003, 0.001))
    assert np.tan(direction) == pytest.approx(np.tan(0.4))


def test_the_map_names_all_and_draws_ellipses_in_the_stated_scale():
    figure = survey_map(ROOM, WORLD, FRAMES)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1
    assert names(axes) == {"1", "2", "3", "a", "b", "O", "X", "Y", "XY"}
    assert "[m]" in axes.get_xlabel()
    scale = ellipse_scale([WORLD, FRAMES])
    assert f"enlarged {scale} times" in axes.get_title()
    ellipses = [patch for patch in axes.patches if isinstance(patch, Ellipse)]
    # Pose b has no stated covariance, hence no ellipse.
    assert len(ellipses) == 4
    # Full width of 3 sigma on both sides
    assert max(e.width for e in ellipses) == pytest.approx(2 * 3 * 0.002 * scale)


def test_the_scale_is_one_of_a_few_and_makes_ellipses_visible():
    scale = ellipse_scale([WORLD])
    assert scale in {m * 10**p for m in (1, 2, 3, 5) for p in range(5)}
    assert 8 / 60 < 3 * 0.002 * scale < 8 / 20
    assert ellipse_scale([]) == 1


def test_maps_of_nothing_are_drawn_too():
    none = Places((), np.empty((0, 3)), np.empty((0, 3, 3)))
    assert survey_map(Room(), frames=none).axes
    assert survey_map(ROOM).axes


def test_hand_measurements_are_enlarged_as_stated():
    hand = Places(FRAMES.names, FRAMES.states + np.array([0.1, -0.05, 0.1]), FRAMES.covariances)
    figure = hand_against_validation(hand, FRAMES, ROOM)
    assert "enlarged" in figure.axes[0].get_title()
    assert {"a", "b"} <= names(figure.axes[0])


def test_suspect_readings_are_marked_and_named():
    rng = np.random.default_rng(0)
    w = rng.uniform(-2, 2, 40)
    w[3], w[4] = 5.0, np.nan
    labels = [f"O to {i}" for i in range(40)]
    figure = residual_figure(np.linspace(1, 9, 40), w, labels)
    assert names(figure.axes[0]) == {"O to 3"}
    counted = sum(patch.get_height() for patch in figure.axes[1].patches)
    assert counted == 39


def test_residuals_that_nothing_checks_are_said_to_be_none():
    figure = residual_figure(np.array([1.0]), np.array([np.nan]), ["O to 1"])
    assert "no reading is checked" in figure.axes[1].texts[0].get_text()


def explored():
    rng = np.random.default_rng(0)
    starts = rng.uniform(-3, 3, (300, 3))
    outcome = np.zeros(300, dtype=np.int8)
    outcome[np.hypot(*starts[:, :2].T) > 2.5] = NOT_CONVERGED
    found = regions(np.zeros(3), starts, outcome > 0, 5.0)
    return Convergence(np.zeros(3), 1.0, starts, outcome, (), found, 5.0, 20)


def test_the_convergence_map_counts_all_starts():
    found = explored()
    failures = int((found.outcome == NOT_CONVERGED).sum())
    figure = convergence_map(found, "pose 7")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert f"leads to the solution ({300 - failures})" in labels
    assert f"does not converge ({failures})" in labels
    assert any(label.startswith("no failure within") for label in labels)


def test_every_figure_can_be_written_and_gives_the_same_bytes_twice(tmp_path):
    length = np.array([1.0, 2.0, 5.0])
    check = check_instrument(length, length + 0.001, Instrument())

    def figures():
        return {
            "instrument": instrument_figure(length, length + 0.001, check, Instrument()),
            "map": survey_map(ROOM, WORLD, FRAMES),
            "plan": planning_map(ROOM, WORLD, FRAMES, [("1", np.zeros(2), np.ones(2))]),
            "convergence": convergence_map(explored(), "pose 7"),
        }

    for name, figure in figures().items():
        again = figures()[name]
        for suffix in (".png", ".svg"):
            first = figure_bytes(figure, suffix, name)
            assert first == figure_bytes(again, suffix, name), name
    write_figure(tmp_path / "new" / "map.png", survey_map(ROOM))
    assert (tmp_path / "new" / "map.png").read_bytes().startswith(b"\x89PNG")


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(GtvalError, match=r"\.png or \.svg"):
        write_figure(tmp_path / "map.pdf", survey_map(ROOM))
    assert list(tmp_path.iterdir()) == []
