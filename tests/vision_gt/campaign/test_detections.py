"""How often markers are recognised, and the printed table of AD2.3 beside it."""

import csv

import numpy as np
import pytest
from scipy.stats import norm

from data_samples.demo import copy_demo
from validation.campaign.folder import load_campaign
from validation.errors import InputError
from vision_gt.campaign.detections import (
    Rate,
    SeenMarkers,
    detection_facts,
    image_table,
    rate_table,
    rates,
    success_csv,
)
from vision_gt.settings import VisionSettings
from vision_gt.system import SYSTEM

OWN = SeenMarkers(
    (3, 6),
    {("1", "2"): (3, 6), ("1", "10"): (), ("2", "10"): (6,), ("2", "9"): (6,)},
)


@pytest.fixture
def demo(tmp_path):
    copy_demo(tmp_path / "demo")
    return load_campaign(tmp_path / "demo")


def test_images_stops_and_markers_are_counted_over_all_images():
    assert rates(OWN, "camera") == {"1": Rate(2, 1), "2": Rate(2, 2)}
    assert list(rates(OWN, "pose")) == ["2", "9", "10"]
    assert rates(OWN, "pose")["10"] == Rate(2, 1)
    assert rates(OWN, "marker") == {"3": Rate(4, 1), "6": Rate(4, 3)}
    assert rates(OWN, "all") == {"all": Rate(4, 3)}


@pytest.mark.parametrize(("images", "recognised"), [(40, 23), (6, 5), (10, 0), (3, 3)])
def test_the_interval_holds_all_shares_that_a_score_test_does_not_reject(images, recognised):
    """Wilson's interval: the shares p with |found - p| <= 1.96 sqrt(p (1 - p) / n)."""
    low, high = Rate(images, recognised).interval
    z = norm.ppf(0.975)
    for share in {low, high} - {0.0, 1.0}:
        off = abs(recognised / images - share)
        assert off == pytest.approx(z * np.sqrt(share * (1 - share) / images), abs=1e-9)


def test_the_printed_table_of_ad23_is_told_in_numbers(demo):
    """23 of 40 images and 20 of 26 stops, counted here from the file by other means."""
    result = SYSTEM.solve(demo, lambda *_: None)
    with (demo.folder / "vision" / "marker_detections.csv").open() as file:
        rows = list(csv.DictReader(file))
    seen = [row for row in rows if row["markers"]]
    assert (len(rows), len(seen), len({row["pose"] for row in seen})) == (40, 23, 20)
    printed = result.facts["detection"]["printed"]
    assert printed["all"]["all"]["recognised"] == 23
    assert sum(one["recognised"] > 0 for one in printed["pose"].values()) == 20
    assert printed["marker"]["89"] == {"images": 40, "recognised": 0, "share": 0.0}
    assert "23 of 40 images (57 %, 42 to 71 %) and at 20 of 26 stops" in result.findings[0].text
    assert result.tables == ()
    for section in result.sections:
        for block in section.blocks:
            if hasattr(block, "draw"):
                block.draw()


def test_own_and_printed_rates_stand_beside_each_other():
    printed = SeenMarkers((3, 6, 14), {("1", "2"): (14,), ("4", "1"): ()})
    table = rate_table("camera", OWN, printed)
    assert [row[0] for row in table.rows] == ["1", "2", "4", "all"]
    assert table.rows[0][1:3] == [2, 1]
    assert table.rows[0][6:8] == [1, 1]
    assert table.rows[2][1:6] == [None] * 5
    assert image_table(OWN, printed).rows[0] == ["1", "2", 2, "3 6", 1, "14"]
    assert detection_facts(OWN, printed)["printed"]["all"]["all"]["images"] == 2
    lines = success_csv(OWN, printed).splitlines()
    assert sum(line.startswith("printed,") for line in lines) == 2 + 2 + 3 + 1


def test_a_bad_printed_table_is_refused_with_its_places(demo):
    path = demo.folder / "vision" / "marker_detections.csv"
    path.write_text("camera,pose,markers\n1,3,6 x\n1,4,\n1,3,6\n")
    with pytest.raises(InputError) as caught:
        SYSTEM.solve(demo, lambda *_: None)
    assert {(p.line, p.field) for p in caught.value.problems} >= {(2, "markers")}
    assert len(caught.value.problems) == 2
    path.unlink()
    with pytest.raises(InputError):
        SYSTEM.solve(demo, lambda *_: None)


def test_a_campaign_without_images_and_printed_table_holds_no_data(demo):
    toml = demo.toml.read_text()
    demo.toml.write_text(toml[: toml.index("# What the document prints of its cameras")])
    assert not SYSTEM.has_data(load_campaign(demo.folder))
    assert demo.section("vision", VisionSettings).printed.detections
