"""The pictures of ad23.md, drawn by gtval itself: run `make images` after a change."""

from pathlib import Path

from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.explain.analysis import explain
from validation.explain.loading import campaign_question
from validation.explain.settings import ExplainSettings
from validation.explain.telling.figures import (
    arrows_before_after,
    error_with_curve,
    residual_ellipses,
    source_matrix,
)
from validation.poses.pose_table import from_csv
from validation.published.systems import published_tables

DOCS = Path(__file__).parent
CAMPAIGN = DOCS.parent / "data_samples" / "ad23"


def main() -> None:
    """Write docs/images/explain_*.png."""
    campaign = load_campaign(CAMPAIGN, frozenset({"survey"}))
    files = campaign.section("survey", SurveySettings)
    validation = from_csv(CAMPAIGN / files.published_poses, "survey")
    systems = published_tables(campaign)
    settings = campaign.section("explain", ExplainSettings)
    question = campaign_question(campaign, settings, [table.system for table in systems])
    explanation = explain(validation, systems, question)
    drawn = {
        "explain_sources": source_matrix(explanation),
        "explain_ellipses": residual_ellipses(explanation),
        "explain_arrows_laser_genetic": arrows_before_after(explanation.system("laser_genetic")),
    }
    for one in explanation.systems:
        drawn[f"explain_heading_{one.system}"] = error_with_curve(one)
    (DOCS / "images").mkdir(exist_ok=True)
    for name, figure in drawn.items():
        figure.savefig(DOCS / "images" / f"{name}.png", dpi=90)


if __name__ == "__main__":
    main()
