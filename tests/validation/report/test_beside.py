"""The published way of a system stands beside its own, and is no witness of its own."""

import numpy as np
import pytest

from validation.campaign.folder import load_campaign
from validation.poses.pose_table import PoseTable, to_csv
from validation.report.beside import beside_section, beside_tables
from validation.report.document import build_document
from validation.run import run_campaign
from validation.statistics.evaluation import evaluate

N = 12
RNG = np.random.default_rng(5)
TRUE = np.column_stack([RNG.uniform(-3, 3, (N, 2)), RNG.uniform(-3, 3, N)])
NAMES = tuple(str(i) for i in range(N))


def table(system, sigma, ids=NAMES):
    noise = np.random.default_rng(len(system)).normal(0, sigma, TRUE.shape)
    return PoseTable(system, ids, (TRUE + noise)[: len(ids)])


def test_each_stop_that_both_have_is_shown_with_its_difference():
    own, published = table("cam", 0.001), table("cam_as_published", 0.05, NAMES[:-1])
    (shown,) = beside_tables([own, published, table("other", 0.1)])
    assert [row[0] for row in shown.rows] == list(NAMES[:-1])
    assert shown.rows[3][4] == pytest.approx(1e3 * (published.poses[3, 0] - own.poses[3, 0]))
    assert "no pose of 11" in shown.note


def test_without_a_published_way_there_is_no_chapter():
    assert beside_section([table("cam", 0.1)], []) is None
    assert beside_section([table("cam_as_published", 0.1)], []) is None


def test_both_ways_are_judged_at_the_same_stops():
    validation = PoseTable("survey", NAMES, TRUE)
    tables = [table("cam", 0.001), table("cam_as_published", 0.05, NAMES[:-1])]
    section = beside_section(tables, [evaluate(validation, one) for one in tables])
    assert section is not None
    row = section.blocks[0].rows[0]
    errors = [one.poses[: N - 1, 0] - TRUE[: N - 1, 0] for one in tables]
    assert row[2] == N - 1
    assert row[3:5] == pytest.approx([1e3 * np.sqrt(np.mean(e**2)) for e in errors])


def test_the_published_way_is_in_the_report_and_not_in_the_explanation(tmp_path):
    (tmp_path / "survey").mkdir()
    (tmp_path / "survey" / "published_poses.csv").write_text(
        to_csv(PoseTable("survey", NAMES, TRUE))
    )
    toml = 'name = "both ways"\n'
    for system, sigma in (("cam", 0.002), ("cam_as_published", 0.02), ("other", 0.01)):
        (tmp_path / f"{system}.csv").write_text(to_csv(table(system, sigma)))
        toml += f'[[published]]\nsystem = "{system}"\nfile = "{system}.csv"\n'
    (tmp_path / "campaign.toml").write_text(toml)
    run = run_campaign(load_campaign(tmp_path))
    titles = [section.title for section in build_document(run).sections]
    assert "The published way beside gtval's" in titles
    assert "System cam_as_published" in titles
    assert "Where the errors of cam come from" in titles
    assert not any("cam_as_published come" in title for title in titles)
