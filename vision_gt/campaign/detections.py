"""How often markers are recognised: by camera, stop and marker, with the printed rate beside it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy import special

from validation.results import Figure, Table, Text
from validation.text_files.csv_text import csv_text
from vision_gt.images.files import counting

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

By = Literal["camera", "pose", "marker", "all"]
GROUPS: tuple[By, ...] = ("camera", "pose", "marker")
Image = tuple[str, str]
"""Camera and stop."""
PRINTED_ALONE = "As printed; the images themselves are not in the campaign."


@dataclass(frozen=True)
class SeenMarkers:
    """Which markers were recognised in every image of the robot.

    Parameters
    ----------
    numbers : tuple of int
        All markers that there are.
    images : mapping of (str, str) to tuple of int
        By camera and stop: ids of those recognised, none where nothing was.
    """

    numbers: tuple[int, ...]
    images: Mapping[Image, tuple[int, ...]]


@dataclass(frozen=True)
class Rate:
    """A share of images.

    Parameters
    ----------
    images : int
        Looked at.
    recognised : int
        Of them, those that show a marker (of a row of markers: that marker).
    """

    images: int
    recognised: int

    @property
    def share(self) -> float:
        """Of the images."""
        return self.recognised / self.images

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share, as if images were drawn at random.

        Notes
        -----
        Wilson (1927), "Probable inference, the law of succession, and statistical inference".
        """
        p, n, z = self.share, self.images, float(special.ndtri(0.975))
        middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
        half = z / (1 + z**2 / n) * float(np.sqrt(p * (1 - p) / n + (z / (2 * n)) ** 2))
        low = middle - half if self.recognised else 0.0
        return low, middle + half if self.recognised < n else 1.0


def rates(seen: SeenMarkers, by: By) -> dict[str, Rate]:
    """Success rates of each camera, stop or marker, or of everything.

    Parameters
    ----------
    seen : SeenMarkers
        Of every image.
    by : {"camera", "pose", "marker", "all"}
        What a row is. A camera, a stop and everything count the images with any marker; a marker
        counts those in which it was recognised, of all images, whether or not it was in view.

    Notes
    -----
    AD2.3, "Marker detection": 'the success rate of ARToolkit in detecting the markers'. The
    document prints the table but no rate.
    """
    listed = list(seen.images.items())
    if by == "all":
        groups = {"all": [bool(found) for _, found in listed]}
    elif by == "marker":
        groups = {str(n): [n in found for _, found in listed] for n in seen.numbers}
    else:
        at = ("camera", "pose").index(by)
        groups = {}
        for image, found in listed:
            groups.setdefault(image[at], []).append(bool(found))
        if by == "pose":
            groups = {name: groups[name] for name in sorted(groups, key=counting)}
    return {name: Rate(len(found), sum(found)) for name, found in groups.items() if found}


def detection_blocks(
    own: SeenMarkers | None, printed: SeenMarkers | None = None
) -> list[Table | Figure | Text]:
    """Tables and figures of the report, of one's own images, the printed ones, or both."""
    blocks: list[Table | Figure | Text] = [] if own else [Text(PRINTED_ALONE)]
    blocks += [rate_table(by, own, printed) for by in GROUPS]
    blocks.append(image_table(own, printed))
    if own:
        blocks.append(_figure("vision_detections", own, "recognised at each stop"))
    if printed:
        blocks.append(_figure("vision_printed_detections", printed, "recognised, as printed"))
    return blocks


def _figure(name: str, seen: SeenMarkers, what: str) -> Figure:
    """The matrix of images and markers."""
    keys = list(seen.images)
    detected = np.array(
        [[n in seen.images[key] for n in seen.numbers] for key in keys], dtype=bool
    ).reshape(len(keys), len(seen.numbers))
    rows = [f"camera {camera}, pose {pose}" for camera, pose in keys]
    return Figure(
        name,
        f"Which markers each camera {what}.",
        "A matrix of images and markers, filled where a marker was recognised.",
        lambda: _matrix()(detected, rows, [str(n) for n in seen.numbers]),
    )


def _matrix() -> "Callable[..., MatplotlibFigure]":
    """The drawing function, loaded when something is drawn."""
    from vision_gt.campaign.figures import detection_matrix  # noqa: PLC0415

    return detection_matrix


def rate_table(by: By, own: SeenMarkers | None, printed: SeenMarkers | None = None) -> Table:
    """Success rates of one's own images and of the printed ones, and of everything at the end."""
    columns: list[str] = [by]
    formats = [""]
    sides = [(seen, said) for seen, said in ((own, ""), (printed, ", printed")) if seen]
    found = []
    for seen, said in sides:
        columns += [f"{name}{said}" for name in ("images", "recognised", "share [%]", "from", "to")]
        formats += ["", "", ".0f", ".0f", ".0f"]
        found.append(rates(seen, by) | rates(seen, "all"))
    names = list(dict.fromkeys(name for one in found for name in one if name != "all"))
    if by != "camera":
        names.sort(key=counting)
    rows = [[name, *(cell for one in found for cell in _cells(one.get(name)))] for name in names]
    rows.append(["all", *(cell for one in found for cell in _cells(one.get("all")))])
    counted = "that marker was recognised" if by == "marker" else "a marker was recognised"
    note = (
        f"Images in which {counted}; from and to: 95 % interval of the share. The last row counts "
        "images with any marker."
    )
    return Table(f"Marker detection by {by}", columns, rows, formats, note)


def _cells(rate: Rate | None) -> list[int | float | None]:
    """Images, recognised, share and its interval in percent."""
    if rate is None:
        return [None] * 5
    return [rate.images, rate.recognised, *(100 * v for v in (rate.share, *rate.interval))]


def image_table(own: SeenMarkers | None, printed: SeenMarkers | None = None) -> Table:
    """The markers recognised in each image, own and printed."""
    sides = [(seen, said) for seen, said in ((own, ""), (printed, ", printed")) if seen]
    columns = ["camera", "pose"]
    for _, said in sides:
        columns += [f"number{said}", f"markers{said}"]
    images = dict.fromkeys(image for seen, _ in sides for image in seen.images)
    rows: list[list[str | int | float | None]] = []
    for camera, pose in images:
        row: list[str | int | float | None] = [camera, pose]
        for seen, _ in sides:
            found = seen.images.get((camera, pose))
            row += [None, None] if found is None else [len(found), " ".join(map(str, found))]
        rows.append(row)
    return Table("Markers recognised in each image", columns, rows)


def detection_facts(
    own: SeenMarkers | None, printed: SeenMarkers | None = None
) -> dict[str, object]:
    """Success rates for scripts: by camera, pose, marker and all; printed ones apart."""

    def told(seen: SeenMarkers) -> dict[str, object]:
        return {
            by: {
                name: {"images": one.images, "recognised": one.recognised, "share": one.share}
                for name, one in rates(seen, by).items()
            }
            for by in (*GROUPS, "all")
        }

    facts = {} if own is None else told(own)
    return facts if printed is None else {**facts, "printed": told(printed)}


def success_csv(own: SeenMarkers | None, printed: SeenMarkers | None = None) -> str:
    """The rates as a file: one row for each source and each camera, pose, marker, and all."""
    sources = (("images", own), ("printed", printed))
    rows = [row for source, seen in sources if seen for row in _success_rows(source, seen)]
    return csv_text(["source", "by", "name", "images", "recognised", "share", "low", "high"], rows)


def _success_rows(source: str, seen: SeenMarkers) -> Iterator[Sequence[object]]:
    for by in (*GROUPS, "all"):
        for name, one in rates(seen, by).items():
            yield source, by, name, one.images, one.recognised, one.share, *one.interval
