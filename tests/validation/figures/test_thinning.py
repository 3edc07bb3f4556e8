"""Long series on a screen: nothing that can be seen is lost."""

from itertools import pairwise

import numpy as np
import pytest

from validation.figures.thinning import rows_shown


@pytest.mark.parametrize("count", [1, 50, 10_007, 72_000])
def test_no_peak_is_lost_and_few_rows_are_left(count):
    values = np.random.default_rng(2).standard_normal((count, 3))
    rows = rows_shown(values, places=100)
    assert (np.diff(rows) > 0).all()
    assert (rows[0], rows[-1]) == (0, count - 1)
    assert len(rows) <= min(count, 8 * 100)
    edges = np.linspace(0, count, 101).astype(int)
    for first, last in pairwise(edges):
        inside = rows[(rows >= first) & (rows < last)]
        if last > first:
            assert (values[inside].max(0) == values[first:last].max(0)).all()
            assert (values[inside].min(0) == values[first:last].min(0)).all()


def test_a_short_series_stays_as_it_is():
    assert (rows_shown(np.zeros(3000)) == np.arange(3000)).all()
