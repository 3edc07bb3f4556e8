"""Findings as scripts read them: sizes with unit and interval, and ids that are counted."""

import json
import re

import numpy as np

from validation.explain.analysis import explain
from validation.explain.telling.words import findings
from validation.poses.pose_table import PoseTable
from validation.results import MOST_LISTED
from validation.statistics.conclusions import conclusions
from validation.statistics.evaluation import evaluate

UNITS = {"", "m", "rad", "s", "ppm", "m/s", "rad/s", "s/s"}
"""Of measured sizes; others are of things that are counted."""
LIST = re.compile(rf"(?:[\w-]+, ){{{MOST_LISTED + 5},}}")


def test_findings_of_the_published_campaign_say_how_large(ad23_run):
    folder, _ = ad23_run
    found = json.loads((folder / "results/run.json").read_text())["findings"]
    assert len(found) > 50
    for one in found:
        assert one["code"], one
        assert one["subject"], one
        assert one["text"].startswith(one["sentence"]), one
        assert not LIST.search(one["text"]), one
        for size in one["sizes"]:
            assert size["of"], one
            assert size["unit"] in UNITS or float(size["value"]).is_integer(), one
            if size["low"] is not None and size["value"] is not None:
                assert size["low"] <= size["value"] <= size["high"], one
                assert size["confidence"] is None or 0.5 < size["confidence"] < 1, one
    assert sum(bool(one["sizes"]) for one in found) > 0.7 * len(found)


def test_thousands_of_missing_ids_are_counted():
    rng = np.random.default_rng(4)
    ids = [f"stop{k}" for k in range(3000)]
    true = np.c_[rng.uniform(-5, 5, (3000, 2)), rng.uniform(-3, 3, 3000)]
    some = np.sort(rng.choice(3000, 60, replace=False))
    tables = []
    for name, rows, more in (("rig", some, 2000), ("second", some[::2], 0)):
        poses = np.vstack([true[rows] + rng.normal(0, 0.01, (len(rows), 3)), true[:more]])
        extra = [f"other{k}" for k in range(more)]
        tables.append(PoseTable(name, (*(ids[row] for row in rows), *extra), poses))
    survey = PoseTable("survey", tuple(ids), true)
    found = [one for table in tables for one in conclusions(evaluate(survey, table))]
    found += findings(explain(survey, tables))
    assert {one.code for one in found} >= {"coverage", "two_sources"}
    for one in found:
        assert len(one.text) < 1200, one
        assert not LIST.search(one.text), one
    (rig,) = (one for one in found if (one.code, one.subject) == ("coverage", "rig"))
    assert [(size.value, size.unit) for size in rig.sizes] == [(2940, "poses")]
    assert "and 2930 more" in rig.text
