import numpy as np
import pytest

from data_samples.rooms.sight import outline_segments, sees

WALL = np.array([[[0.0, -1.0], [0.0, 1.0]]])


@pytest.mark.parametrize(
    ("start", "end", "free"),
    [
        ((-1, 0), (1, 0), False),
        ((-1, 0), (-0.1, 0), True),
        ((-1, 2), (1, 2), True),
        ((-1, 0), (0, 0), True),  # a mark on the wall is seen from inside
        ((0, 0), (1, 0), True),
        ((0, -1), (0, 1), True),  # along the wall itself
        ((-1, 1), (1, 1), False),  # the end of a wall blocks
    ],
)
def test_a_wall_blocks_what_is_behind_it(start, end, free):
    assert sees(np.array(start, float), np.array(end, float), WALL) == free
    assert sees(np.array(end, float), np.array(start, float), WALL) == free


def test_nothing_blocks_where_nothing_stands():
    assert sees(np.zeros((3, 2)), np.ones((3, 2)), np.empty((0, 2, 2))).all()


def test_pairs_are_broadcast():
    starts, ends = np.zeros((4, 1, 2)), np.ones((5, 2))
    assert sees(starts, ends, WALL).shape == (4, 5)


def test_an_outline_is_closed():
    sides = outline_segments(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert np.array_equal(sides[:, 1], np.roll(sides[:, 0], -1, axis=0))


def chord(start, end, corners):
    """Length of a line inside a convex outline, by clipping at one side after the other."""
    enters, leaves = 0.0, 1.0
    centre = corners.mean(0)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inwards = np.array([a[1] - b[1], b[0] - a[0]])
        inwards = inwards * np.sign(inwards @ (centre - a))
        at_start, slope = inwards @ (start - a), inwards @ (end - start)
        if slope == 0:
            if at_start < 0:
                return 0.0
        elif slope > 0:
            enters = max(enters, -at_start / slope)
        else:
            leaves = min(leaves, -at_start / slope)
    return max(0.0, leaves - enters) * np.hypot(*(end - start))


def test_sight_agrees_with_clipping_at_convex_obstacles():
    rng = np.random.default_rng(5)
    corners = rng.uniform(0, 10, (6, 1, 2)) + np.array([[0, 0], [1, 0.2], [0.8, 1.1], [-0.1, 0.9]])
    lines = rng.uniform(-1, 12, (800, 2, 2))
    outside = np.array([[chord(p, p + 1e-9, box) == 0 for box in corners] for p in lines[:, 0]])
    lines = lines[outside.all(1)]
    free = np.array([all(chord(a, b, box) == 0 for box in corners) for a, b in lines])
    assert 0.1 < free.mean() < 0.9
    assert np.array_equal(sees(lines[:, 0], lines[:, 1], outline_segments(corners)), free)
