"""What a report of a camera network printed: read, and shown where there are no images."""

from validation.campaign.folder import Campaign
from validation.results import Finding, Section, SystemResult
from validation.text_files.csv_tables import Column, read_csv
from vision_gt.campaign.detections import (
    SeenMarkers,
    detection_blocks,
    detection_facts,
    rate_table,
    rates,
    success_csv,
)
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.settings import VisionSettings


def seen_in(outcome: VisionOutcome) -> SeenMarkers:
    """What the images of the robot show."""
    images = {key: found.numbers for key, found in outcome.detections.items()}
    return SeenMarkers(outcome.layout.layout.numbers, images)


def printed_detections(campaign: Campaign, settings: VisionSettings) -> SeenMarkers | None:
    """The table of recognised markers that [vision.printed] names; None where it names none.

    Raises
    ------
    InputError
        Naming every bad place of the file.
    """
    if not settings.printed.detections:
        return None
    path = campaign.folder / settings.printed.detections
    table = read_csv(path, [Column("camera"), Column("pose"), Column("markers", blank=True)])
    table.flag_duplicates(["camera", "pose"])
    for row, cell in enumerate(table.text["markers"]):
        if not all(part.isdigit() for part in cell.split()):
            table.flag(row, "markers", "expected ids of markers, separated by spaces")
    table.raise_problems()
    found = [tuple(int(part) for part in cell.split()) for cell in table.text["markers"]]
    keys = zip(table.text["camera"], table.text["pose"], strict=True)
    stated = {*settings.printed.markers, *(int(number) for number in settings.markers.sides)}
    numbers = sorted(stated | {number for ids in found for number in ids})
    return SeenMarkers(tuple(numbers), dict(zip(keys, found, strict=True)))


def printed_result(campaign: Campaign, settings: VisionSettings) -> SystemResult:
    """What is told of a camera network of which there are printed tables and no images."""
    seen = printed_detections(campaign, settings)
    if seen is None or not seen.images:
        return SystemResult()
    whole = rates(seen, "all")["all"]
    stops = rates(seen, "pose")
    some = sum(rate.recognised > 0 for rate in stops.values())
    low, high = whole.interval
    text = (
        f"As printed, a marker was recognised in {whole.recognised} of {whole.images} images "
        f"({100 * whole.share:.0f} %, {100 * low:.0f} to {100 * high:.0f} %) and at {some} of "
        f"{len(stops)} stops."
    )
    return SystemResult(
        findings=[Finding("note", text, "vision", "success_rate")],
        sections=[Section("Vision: marker detection", detection_blocks(None, seen))],
        files={"vision_success.csv": success_csv(None, seen)},
        facts={"detection": detection_facts(None, seen)},
        overview=[rate_table(by, None, seen) for by in ("camera", "marker")],
    )
