"""What people decided about the images of a campaign, as its steps take it."""

from collections.abc import Iterator
from pathlib import Path

from validation.campaign.folder import Campaign
from vision_gt.images.decisions import Decided, decided, image_decisions
from vision_gt.images.files import CampaignImages, campaign_images
from vision_gt.settings import VisionSettings


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


def told_of_decisions(folder: Path, found: Decided) -> Iterator[tuple[str, str]]:
    """Images that are left out, and decisions about images that there are not."""
    for image, one in found.left_out.items():
        if (folder / image).is_file():
            yield image, f"left out as decided {one.told}".rstrip()
    for image in {**found.left_out, **found.corners}:
        if not (folder / image).is_file():
            yield image, "there is no such image, and something was decided about it"
