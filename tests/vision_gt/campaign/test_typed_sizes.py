"""Sizes that were typed in millimetres are refused where they are read."""

import pytest
from click.testing import CliRunner
from pydantic import ValidationError

from validation.cli import main
from vision_gt.settings import VisionSettings

BOARD = {"columns": 10, "rows": 6, "square": 0.1}


@pytest.mark.parametrize(
    "table",
    [
        {"markers": {"family": "4X4_50", "sides": {"3": 160.0}}},
        {"board": {**BOARD, "square": 100.0}},
        {"board": {**BOARD, "family": "4X4_50", "marker": 75.0}},
        {"bar": {"second_on_first": {"translation": (1500.0, 0.0, 0.0)}}},
        {"plan": {"marker_side": 156.0}},
    ],
)
def test_millimetres_are_asked_about(table):
    with pytest.raises(ValidationError, match="typed in millimetres"):
        VisionSettings.model_validate(table)


def test_of_options_too(tmp_path):
    board = ["--columns", "10", "--rows", "6", "--square", "100"]
    told = CliRunner().invoke(main, ["vision", "calibrate", str(tmp_path), *board])
    assert told.exit_code == 2
    assert "typed in millimetres? Then it is 0.1" in told.output
