"""The published campaign, explained."""

import pytest

from validation.campaign.stored import read_tables
from validation.explain.analysis import Question, explain


@pytest.fixture(scope="session")
def ad23_tables(ad23_folder):
    """Validation poses, and the GT systems by name, as printed."""
    names = {
        "vision": "vision/published_poses.csv",
        "laser_genetic": "laser/published_genetic.csv",
        "laser_scanmatch": "laser/published_scanmatch.csv",
    }
    survey = read_tables([ad23_folder / "survey/published_poses.csv"], ["survey"]).tables[0]
    return survey, {
        name: read_tables([ad23_folder / file], [name]).tables[0] for name, file in names.items()
    }


@pytest.fixture(scope="session")
def ad23(ad23_tables):
    survey, systems = ad23_tables
    question = Question(
        references={"laser_genetic": "6"},
        sensors={"laser": ("laser_genetic", "laser_scanmatch")},
    )
    return explain(survey, list(systems.values()), question)
