"""What a report says of a ground truth that is biased, and of one that is not."""

import json

import pytest
from my_lab.report import verdict

import gtval


@pytest.mark.parametrize("gtval_survey", [{"bias": (0.1, 0.0, 0.0)}], indirect=True)
def test_a_bias_of_10_cm_is_told(gtval_survey):
    told = verdict(gtval_survey.truth, gtval_survey.example)
    assert told.startswith("Do not use example_gt")


def test_a_rig_without_a_bias_can_be_used(gtval_survey):
    assert verdict(gtval_survey.truth, gtval_survey.example) == "example_gt can be used."


@pytest.mark.parametrize("gtval_room", [{"stops": 6, "bias": (0.1, 0.0, 0.0)}], indirect=True)
def test_the_whole_report_names_the_bias(gtval_room):
    gtval.write_run(gtval.run_campaign(gtval_room.folder))
    page = (gtval_room.folder / "report" / "report.html").read_text(encoding="utf-8")
    record = json.loads((gtval_room.folder / "results" / "run.json").read_text(encoding="utf-8"))
    told = [
        (one["subject"], one["severity"]) for one in record["findings"] if one["code"] == "bias"
    ]
    assert ("example_gt", "warning") in told
    assert "example_gt" in page
