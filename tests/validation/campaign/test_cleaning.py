"""What is kept of earlier runs is removed, and nothing else."""

import pytest
from click.testing import CliRunner

from validation.campaign.cleaning import kept_files
from validation.cli import main
from validation.errors import GtvalError


@pytest.fixture
def campaign(tmp_path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "vision_images.jsonl").write_text("x" * 1000)
    (tmp_path / "results").mkdir()
    return tmp_path


def test_what_is_kept_is_removed_and_the_results_stay(campaign):
    tried = CliRunner().invoke(main, ["clean", str(campaign), "--dry-run"])
    assert "would be removed" in tried.output
    assert (campaign / "kept").is_dir()
    assert CliRunner().invoke(main, ["clean", str(campaign)]).exit_code == 0
    assert not (campaign / "kept").exists()
    assert (campaign / "results").is_dir()
    assert CliRunner().invoke(main, ["clean", str(campaign)]).exit_code == 0  # nothing to remove


def test_a_folder_with_something_else_is_left_alone(campaign):
    (campaign / "kept" / "thesis.doc").write_text("years of work")
    done = CliRunner().invoke(main, ["clean", str(campaign)])
    assert done.exit_code != 0
    assert "thesis.doc is not of gtval's making" in done.output
    assert len(list((campaign / "kept").iterdir())) == 2


def test_a_folder_of_campaigns_stands_for_them(tmp_path_factory):
    hall = tmp_path_factory.mktemp("hall")
    for name in ("day_1", "day_2"):
        (hall / name / "kept").mkdir(parents=True)
        (hall / name / "campaign.toml").write_text('name = "x"\n')
        (hall / name / "kept" / ".report_figures.jsonl.4711").write_text("cut")
    assert CliRunner().invoke(main, ["clean", str(hall)]).exit_code == 0
    assert not list(hall.glob("*/kept"))


def test_a_link_is_not_followed(campaign, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "a.jsonl").write_text("{}")
    folder = tmp_path_factory.mktemp("other")
    (folder / "kept").symlink_to(elsewhere)
    with pytest.raises(GtvalError, match="no folder of kept pieces"):
        kept_files(folder)
    assert (elsewhere / "a.jsonl").exists()
    with pytest.raises(GtvalError, match="no such folder"):
        kept_files(campaign / "nowhere")
