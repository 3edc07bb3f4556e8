"""Errors between who made the poses."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats
from small_campaigns import AD23

from validation.cli import main
from validation.poses.pose_table import PoseTable, from_csv, to_csv
from validation.statistics.by_source import (
    makers_of,
    source_differences,
    source_findings,
    source_section,
)
from validation.statistics.evaluation import evaluate


def evaluation(errors, sources):
    n = len(errors)
    ids = tuple(map(str, range(n)))
    poses = np.random.default_rng(3).uniform(-3, 3, (n, 3))
    survey = PoseTable("survey", ids, poses)
    return evaluate(survey, PoseTable("rig", ids, poses - errors, sources=sources))


def mixed(n, seed):
    """Cameras 1 to 4, in an order that is no order."""
    return tuple(f"camera {i}" for i in np.random.default_rng(seed).permutation(np.arange(n) % 4))


def test_makers_are_read_from_sources():
    sources = ["camera 4+1", "match, camera 2, day 2023-05-04", "12 matches", ""]
    assert makers_of(sources, "camera") == ["4+1", "2", "", ""]
    assert makers_of(sources, "day") == ["", "2023-05-04", "", ""]


def test_columns_of_a_table_say_who_made_a_pose(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text("pose,x,y,theta,camera,observer,source\n1,0,0,0,2,Ann,board\n2,1,0,0,,,\n")
    table = from_csv(path)
    assert table.sources == ("board, camera 2, observer Ann", "")
    path.write_text(to_csv(table))
    assert from_csv(path).sources == table.sources


def test_equal_cameras_are_told_apart_as_rarely_as_stated():
    shown = hints = 0
    for seed in range(200):
        errors = np.random.default_rng(seed).standard_t(3, size=(24, 3)) * 0.01
        found = source_differences(evaluation(errors, mixed(24, seed)), seed)
        shown += any(one.family_p < 0.05 for one in found)
        hints += any(one.looked_p < 0.05 for one in found if one.component.name == "y")
    # 5 % are stated; of 200, fewer than 2 or more than 20 come once in 1000 times.
    assert 2 <= shown <= 20
    assert 2 <= hints <= 20


def test_a_camera_that_is_off_is_named_with_its_size():
    errors = np.random.default_rng(1).normal(size=(24, 3)) * 0.01
    sources = mixed(24, 1)
    errors[np.array(sources) == "camera 3", 1] += 0.05
    found = source_differences(evaluation(errors, sources))
    y = next(one for one in found if one.component.name == "y")
    assert y.verdict == "shown"
    assert ("3",) in y.split
    assert max(y.split_means) - min(y.split_means) == pytest.approx(0.05, abs=4 * 0.0047)
    assert y.means["3"][1] == 6
    [finding] = source_findings(found)
    assert finding.code == "differs_by_source"
    assert "in 3" in finding.text
    assert source_section(found).folded


def test_without_two_makers_nothing_is_said():
    errors = np.random.default_rng(1).normal(size=(6, 3))
    assert source_differences(evaluation(errors, ("camera 1",) * 6)) == []
    one_each = tuple(f"camera {i}" for i in range(6))
    assert source_differences(evaluation(errors, one_each)) == []


def test_many_poses_are_compared_quickly_and_steadily():
    errors = np.random.default_rng(1).normal(size=(5000, 3)) * 0.01
    sources = mixed(5000, 2)
    first, again = (source_differences(evaluation(errors, sources)) for _ in range(2))
    assert [one.p_value for one in first] == [one.p_value for one in again]
    # By the distribution of the ratio of variances, which is exact here.
    groups = [errors[np.array(sources) == f"camera {i}", 0] for i in range(4)]
    assert first[0].p_value == pytest.approx(stats.f_oneway(*groups).pvalue, abs=0.05)


def test_the_cameras_of_ad23_are_a_hint_and_no_finding():
    tables = [AD23 / "survey/published_poses.csv", AD23 / "vision/published_poses.csv"]
    done = CliRunner().invoke(main, ["compare", *map(str, tables), "--json"])
    told = json.loads(done.stdout)
    [y] = [one for one in told["comparisons"][0]["by_source"] if one["component"] == "y"]
    assert {frozenset(side) for side in y["split"]} == {frozenset("12"), frozenset("34")}
    assert sorted(round(1000 * mean) for mean in y["split_means"]) == [-3, 79]
    assert y["split_p"] < 0.02
    assert 0.05 < y["p_value"] < 0.1
    assert y["family_p"] > 0.1
    assert y["verdict"] == "hint"
    assert [one["severity"] for one in told["findings"] if one["code"] == "source_hint"] == ["note"]
