"""JSON that any reader takes."""

import json
from datetime import date
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from validation.campaign.folder import Comparison
from validation.results import Figure, Finding
from validation.text_files.json_text import as_json, json_text


class Colour(StrEnum):
    RED = "red"


class Pair(NamedTuple):
    low: float
    high: float


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (None, None),
        (True, True),
        (3, 3),
        (0.5, 0.5),
        (float("nan"), None),
        (float("-inf"), None),
        ("é", "é"),
        (np.float64(0.25), 0.25),
        (np.float64("nan"), None),
        (np.int64(7), 7),
        (np.bool_(False), False),
        (np.array([[1.0, np.nan]]), [[1.0, None]]),
        ((1, "a"), [1, "a"]),
        ({"b", "a"}, ["a", "b"]),
        ({1: Path("a/b")}, {"1": "a/b"}),
        (Colour.RED, "red"),
        (Pair(1.0, 2.0), {"low": 1.0, "high": 2.0}),
        (date(2008, 8, 6), "2008-08-06"),
        (iter([1, 2]), [1, 2]),
        (
            Finding("note", "X. Y."),
            {
                "severity": "note",
                "text": "X. Y.",
                "subject": "",
                "code": "",
                "sizes": [],
                "sentence": "X.",
            },
        ),
        (
            Figure("f", "c", "a", print),
            {"name": "f", "caption": "c", "alternative": "a", "folded": False},
        ),
        (1j, "1j"),
    ],
)
def test_every_kind_of_value_has_a_plain_form(value, plain):
    assert as_json(value) == plain


def test_settings_are_dumped_by_name():
    assert as_json(Comparison())["confidence"] == 0.95


def test_the_text_is_json_without_nan():
    text = json_text({"a": [float("nan"), 1.5]})
    assert json.loads(text) == {"a": [None, 1.5]}
    assert text.endswith("}\n")
