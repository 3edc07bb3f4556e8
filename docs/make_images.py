"""The pictures of the documentation, drawn by gtval itself: run `make images` after a change."""

from pathlib import Path

from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.figures.errors import error_map
from validation.poses.pose_table import from_csv
from validation.published.systems import published_tables
from validation.statistics.comparison import compare
from validation.text_files.csv_tables import Column, read_csv

DOCS = Path(__file__).parent
CAMPAIGN = DOCS.parent / "data_samples" / "ad23"


def main() -> None:
    """Write docs/images/errors_vision.png."""
    campaign = load_campaign(CAMPAIGN, frozenset({"survey"}))
    files = campaign.section("survey", SurveySettings)
    marks = read_csv(
        CAMPAIGN / files.published_world_points,
        [Column("world_point"), Column("x", "number"), Column("y", "number")],
    )
    places = zip(marks.numbers["x"], marks.numbers["y"], strict=True)
    landmarks = dict(zip(marks.text["world_point"], places, strict=True))
    validation = from_csv(CAMPAIGN / files.published_poses, "survey")
    vision = next(table for table in published_tables(campaign) if table.system == "vision")
    figure = error_map(compare(validation, vision), landmarks=landmarks)
    (DOCS / "images").mkdir(exist_ok=True)
    figure.savefig(DOCS / "images" / "errors_vision.png", dpi=110)


if __name__ == "__main__":
    main()
