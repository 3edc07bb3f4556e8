"""A delay of a moving robot, from poses that lie apart."""

import numpy as np

from validation.explain.analysis import Question, explain
from validation.poses.pose_table import PoseTable


def test_a_delay_along_a_winding_way_is_named_with_its_size():
    """The robot turns between stops that are a second apart: straight steps would miss it."""
    held = []
    for seed in range(10):
        rng = np.random.default_rng([77, seed])
        ticks = np.arange(-1, 22, 0.01)
        turning = 0.5 * np.sin(rng.uniform(0.3, 0.9) * ticks + rng.uniform(0, 6))
        heading = np.cumsum(turning) * 0.01
        x, y = (np.cumsum(0.5 * one(heading)) * 0.01 for one in (np.cos, np.sin))
        stamps, delay = np.arange(20.0), rng.uniform(0.15, 0.4)
        ids = tuple(map(str, range(20)))
        tables = [
            PoseTable(
                name,
                ids,
                np.column_stack([np.interp(at, ticks, one) for one in (x, y, heading)])
                + rng.normal(0, 0.003, (20, 3)),
                np.zeros(0),
            )
            for name, at in (("survey", stamps), ("late", stamps - delay))
        ]
        times = dict(zip(ids, stamps, strict=True))
        one = explain(tables[0], tables[1:], Question(times=times)).systems[0]
        assert one.name == "time"
        told = one.settled.parameters()[0]
        held.append(told.low < delay < told.high)
    # Of ten intervals of 95 %, fewer than seven hold by chance once in a thousand.
    assert sum(held) >= 7
