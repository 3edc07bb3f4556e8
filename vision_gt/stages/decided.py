"""What people decided about the images of a campaign, as its steps take it."""

from collections.abc import Iterator
from pathlib import Path

from validation.campaign.folder import Campaign
from validation.results import Finding, Size
from vision_gt.images.decisions import Decided, decided, image_decisions
from vision_gt.images.files import CampaignImages, campaign_images
from vision_gt.settings import VisionSettings

MOST = 10
"""Images that are named in a finding."""


def decisions_path(campaign: Campaign, settings: VisionSettings) -> Path:
    """The file of all decisions."""
    return campaign.folder / settings.decisions


def decided_about(campaign: Campaign, settings: VisionSettings) -> Decided:
    """The decisions that count.

    Raises
    ------
    InputError
        If their file is bad.
    """
    return decided(image_decisions(decisions_path(campaign, settings)))


def images_in_use(campaign: Campaign, settings: VisionSettings) -> CampaignImages:
    """The images of a campaign but those left out.

    Raises
    ------
    InputError
        If the file of decisions is bad, or the name of an image.
    """
    left_out = decided_about(campaign, settings).paths(campaign.folder)
    return campaign_images(campaign.folder / settings.images, left_out)


def strange_decisions(folder: Path, found: Decided) -> Iterator[tuple[str, str]]:
    """Decisions about images that there are not."""
    for image in {**found.left_out, **found.corners}:
        if not (folder / image).is_file():
            yield image, "there is no such image, and something was decided about it"


def left_out_findings(campaign: Campaign, settings: VisionSettings) -> Iterator[Finding]:
    """What people decided not to use, if there is any."""
    found = decided_about(campaign, settings).left_out
    there = [f"{image} ({one.told or 'no reason'})" for image, one in found.items()]
    if there:
        more = f"; and {len(there) - MOST} more" if len(there) > MOST else ""
        text = (
            f"{len(there)} image{'s are' if len(there) > 1 else ' is'} left out as people decided: "
            f"{'; '.join(there[:MOST])}{more}. `gtval vision decide`, or the page, takes one back."
        )
        size = (Size("images left out", len(there), "images"),)
        yield Finding("note", text, "vision", "images_left_out", size)
