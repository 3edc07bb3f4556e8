"""What a report of a camera network printed: read, and shown where there are no images."""

import re
from contextlib import suppress

from validation.campaign.folder import Campaign
from validation.campaign.stored import stored_tables
from validation.errors import GtvalError
from validation.poses.pose_table import PoseTable
from validation.published.systems import published_table
from validation.results import VALIDATION_SYSTEM, Finding, Section, Size, SystemResult
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
from vision_gt.campaign.printed_table import check_tables, table_result
from vision_gt.images.files import counting
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
    table = table_result(campaign, settings.printed, validation_of(campaign))
    seen = printed_detections(campaign, settings)
    if seen is None or not seen.images:
        return table
    whole = rates(seen, "all")["all"]
    stops = rates(seen, "pose")
    some = sum(rate.recognised > 0 for rate in stops.values())
    low, high = whole.interval
    size = Size("share of images with a marker", whole.share, "", low, high, 0.95)
    text = (
        f"As printed, a marker was recognised in {whole.recognised} of {whole.images} images "
        f"({100 * whole.share:.0f} %, {100 * low:.0f} to {100 * high:.0f} %) and at {some} of "
        f"{len(stops)} stops."
    )
    return SystemResult(
        findings=[
            Finding("note", text, "vision", "success_rate", (size,)),
            *_not_used(campaign, seen),
            *table.findings,
        ],
        sections=[
            Section("Vision: marker detection", detection_blocks(None, seen)),
            *table.sections,
        ],
        files={"vision_success.csv": success_csv(None, seen), **table.files},
        facts={"detection": detection_facts(None, seen), **table.facts},
        overview=[*(rate_table(by, None, seen) for by in ("camera", "marker")), *table.overview],
    )


def validation_of(campaign: Campaign) -> PoseTable | None:
    """The validation poses: those solved before, or those of an earlier run; None without."""
    known = campaign.solved.get(VALIDATION_SYSTEM)
    if known is not None:
        return known.tables[0] if known.tables else None
    with suppress(GtvalError):
        stored = stored_tables(campaign).tables
        return next((one for one in stored if one.system == VALIDATION_SYSTEM), None)
    return None


def printed_table_alone(campaign: Campaign) -> SystemResult | None:
    """What was printed of a table where there are no images of one; None where there are.

    Raises
    ------
    GtvalError
        If a file is bad, or there are no validation poses to compare with.
    """
    settings = campaign.section("vision", VisionSettings)
    images = campaign.folder / settings.images / "table"
    if images.exists() or not (settings.printed.table_board or settings.printed.table_marker):
        return None
    validation = validation_of(campaign)
    if validation is None:
        check_tables(campaign, settings.printed)  # a bad cell is said before the next step
        raise GtvalError(f"{campaign.results}: no poses_survey.csv; `gtval run` makes it")
    return table_result(campaign, settings.printed, validation)


def _not_used(campaign: Campaign, seen: SeenMarkers) -> list[Finding]:
    """Cameras that recognised a marker at a stop, and are not among those its pose is said from."""
    entry = next((one for one in campaign.settings.published if one.system == "vision"), None)
    if entry is None or entry.stops or not (campaign.folder / entry.file).exists():
        return []
    poses = published_table(campaign.folder, entry)
    named = dict(zip(poses.ids, poses.sources, strict=True))
    odd = []
    for stop in sorted({stop for _, stop in seen.images}, key=counting):
        found = [camera for (camera, at), ids in seen.images.items() if at == stop and ids]
        said = re.findall(r"[^\s+]+", named.get(stop, "").removeprefix("camera "))
        if sorted(found) != sorted(said):
            odd.append(
                f"at pose {stop} a marker was recognised by {_cameras(found)}, the table of poses "
                f"names {_cameras(said)}"
            )
    if not odd:
        return []
    text = f"The two printed tables differ: {'; '.join(odd)}."
    return [Finding("note", text, "vision", "recognised_not_used")]


def _cameras(names: list[str]) -> str:
    """Names of cameras in words."""
    if not names:
        return "no camera"
    return f"camera{'s' if len(names) > 1 else ''} {' and '.join(names)}"
