"""Every row of the tables of docs/ad23.md is what the program says now."""

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from validation.campaign.folder import load_campaign
from validation.campaign.stored import read_tables
from validation.explain.analysis import explain
from validation.explain.loading import campaign_question
from validation.explain.settings import ExplainSettings
from validation.explain.telling.words import findings
from validation.published.systems import published_tables

PAGE = Path(__file__).parents[4] / "docs" / "ad23.md"
NAMES = {
    "survey": "survey",
    "genetic laser": "laser_genetic",
    "scan matching": "laser_scanmatch",
    "vision": "vision",
    "hand": "hand",
}


@pytest.fixture(scope="module")
def page():
    return PAGE.read_text().replace("−", "-")


@pytest.fixture(scope="module")
def explained():
    """With the campaign's own [explain] table, as `gtval explain gtval-demo` does it."""
    campaign = load_campaign(Path(str(files("data_samples") / "ad23")))
    systems = published_tables(campaign)
    settings = campaign.section("explain", ExplainSettings)
    question = campaign_question(campaign, settings, [table.system for table in systems])
    survey = read_tables([campaign.folder / "survey/published_poses.csv"], ["survey"]).tables[0]
    return explain(survey, systems, question)


def rows(page, after):
    """Cells of the first table after a text."""
    lines = page[page.index(after) :].split("\n")
    start = next(i for i, line in enumerate(lines) if line.startswith("| ---") or "---|" in line)
    found = []
    for line in lines[start + 1 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip().replace("*", "") for cell in line.strip("|").split("|")])
    return found


def test_the_flagged_poses(page, explained):
    told = {}
    for pose, cell, size, who, sure in rows(page, "| pose | what"):
        told[pose, cell] = (float(size.split()[0]), NAMES[who], re.match(r"\w+", sure)[0])
    found = {
        (v.stop, v.cell): (round(v.size, 3), *v.blamed, v.certainty)
        for v in explained.arbitration.verdicts
    }
    assert told == found


def test_the_suspects(page, explained):
    text = page[page.index("to be looked at again") :][:400]
    for one in explained.arbitration.suspects:
        assert f"{one.cell} of pose {one.stop}" in text
        assert f"{one.size:.3f}" in text


def test_the_noise_of_the_sources(page, explained):
    variances = explained.arbitration.variances
    intervals = 1000 * variances.intervals()
    for name, *cells in rows(page, "| source | coordinate"):
        row = variances.names.index(NAMES[name])
        for kind, cell in enumerate(cells):
            assert cell.split(" m")[0] == "{:.0f} to {:.0f}".format(*intervals[row, kind])


def test_the_explanations_of_the_genetic_laser(page, explained):
    selection = explained.system("laser_genetic").selection
    least = min(one.criterion for one in selection.candidates)
    best = max(one.loo.score for one in selection.candidates)
    order = ["none", "scale", "frame", "frame_scale", "mount", "reference_mount", "frame_mount"]
    order += ["reference_mount_scale", "frame_mount_scale"]
    order += ["drift", "growing_drift", "frame_drift", "mount_drift", "frame_mount_drift"]
    told = rows(page, "| explanation | parameters")
    assert len(told) == len(order) == len(selection.candidates)
    for name, (_, count, bic, score, left_out) in zip(order, told, strict=True):
        one = selection.candidate(name)
        assert int(count) == len(one.model.parameters)
        assert float(bic) == pytest.approx(one.criterion - least, abs=0.51)
        assert float(score) == pytest.approx(one.loo.score - best, abs=0.51)
        assert float(left_out.split()[0]) == pytest.approx(1000 * one.loo.typical_length, abs=0.51)


def test_before_and_after(page, explained):
    settled = explained.system("laser_genetic").settled
    columns = [
        settled.spread(settled.before, everything=True),
        settled.spread(settled.after, everything=True),
        settled.spread(settled.before),
        settled.spread(settled.after),
        settled.noise,
    ]
    expected = 1000 * np.array(columns).T
    told = rows(page, "| | all poses but 6, before")
    for (_, *cells), values in zip(told, expected, strict=True):
        for cell, value in zip(cells, values, strict=True):
            digits = len(cell.split()[0].partition(".")[2])
            assert cell.split()[0] == f"{value:.{digits}f}"


def test_both_lasers(page, explained):
    [one] = explained.agreements
    differences = 1000 * one.differences()[0]
    for (_, value, ends), expected in zip(
        rows(page, "| | scan matching minus genetic"), differences, strict=True
    ):
        numbers = [float(n) for n in re.findall(r"[-+]?\d+\.\d", f"{value} {ends}")]
        assert numbers == pytest.approx(expected, abs=0.051)


def test_the_parameters_in_the_text(page, explained):
    told = {(f.subject, f.code): f.text for f in findings(explained)}
    genetic = told["laser_genetic", "systematic_error"]
    assert "mount x -89.3 mm (-92.8 to -85.7)" in genetic
    assert "x -89 mm (-93 to -86), y -50 mm (-53 to -46), heading +3.5 mrad (+0.2 to +6.7)" in (
        " ".join(page.split())
    )
    scan = explained.system("laser_scanmatch")
    assert scan.reference.possible == ("1",)
    low_high = [(p.low, p.high) for p in scan.settled.parameters() if p.name == "mount_x"]
    assert f"({1000 * low_high[0][0]:.0f} to {1000 * low_high[0][1]:.0f})" in page
    x, y, _ = explained.system("vision").selection.taken_out.fit.parameters[0]
    assert f"x {1000 * x:+.0f} mm and y {1000 * y:+.0f} mm" in " ".join(page.split())
    assert f"about {100 * explained.arbitration.rate:.2g} %" in page
