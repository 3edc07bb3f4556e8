"""Images that ask to be looked at, in the report and as files."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from validation.results import Figure, Section, Table, TableColumn, Text
from vision_gt.images.files import read_image
from vision_gt.looks.look import Look

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

FOLDER = "vision"
"""Of pictures, below results/."""
MOST = 24
"""Images that a run draws by itself; a command draws the others. A judgement: at 40 kB each the
report grows by 1 MB, and the run takes 6 s longer."""
_TOGETHER = 6
_ALL = (
    "`gtval vision look CAMPAIGN` draws every stop, and each image of boards that was left out, "
    "with the outlines found and expected and the reasons, to results/vision; `--image FILE` any "
    "other image."
)
_SAID = (
    "Stops without a sure pose, poses that do not fit, images that are odd, and boards that were "
    "left out."
)


def wanted(looks: Sequence[Look]) -> list[Look]:
    """Those that ask to be looked at, as many as a run draws."""
    return [one for one in looks if one.flagged][:MOST]


def looks_section(looks: Sequence[Look], folder: Path) -> Section:
    """Thumbnails and reasons.

    Parameters
    ----------
    looks : sequence of Look
        Of the campaign.
    folder : Path
        Of the campaign: where the images are.
    """
    flagged, drawn = [one for one in looks if one.flagged], wanted(looks)
    if not flagged:
        return Section("Vision: images", [Text(f"No image asks to be looked at. {_ALL}")])
    more = len(flagged) - len(drawn)
    rest = f" The first {len(drawn)} of them are drawn; {more} more are in the table." * (more > 0)
    blocks: list[Table | Figure | Text] = [Text(f"{_SAID}{rest} {_ALL}")]
    for first in range(0, len(drawn), _TOGETHER):
        some = drawn[first : first + _TOGETHER]
        blocks.append(
            Figure(
                f"vision_images_{first}",
                "Found: solid lines and crosses; expected: dashed; not used, or rough: dotted. "
                f"Larger ones are in results/{FOLDER}.",
                "; ".join(f"{one.title}: {one.verdict}" for one in some),
                partial(_drawn, tuple(some), folder),
            )
        )
    return Section("Vision: images", [*blocks, looks_table(flagged)])


def looks_table(looks: Sequence[Look]) -> Table:
    """What became of images, by their files."""
    columns: list[TableColumn] = [
        ("image", "", [one.image for one in looks]),
        ("shows", "", [one.title for one in looks]),
        ("what became of it", "", [one.became for one in looks]),
    ]
    return Table.of_columns("Images to look at", columns)


def _drawn(looks: Sequence[Look], folder: Path) -> "MatplotlibFigure":
    from vision_gt.looks.drawing import small_pictures  # noqa: PLC0415

    return small_pictures(looks, [read_image(folder / one.image) for one in looks])


def picture_files(looks: Sequence[Look], folder: Path) -> dict[str, str | bytes]:
    """JPEG files of looks, by their names relative to results/."""
    return {f"{FOLDER}/{name_of(one)}": picture_bytes((one, folder)) for one in looks}


def name_of(look: Look) -> str:
    """The picture's file: its image's, folders and all."""
    return "_".join(Path(look.image).with_suffix(".jpg").parts[1:])


def picture_bytes(drawn: tuple[Look, Path]) -> bytes:
    """A look as a JPEG file: of a look, and the folder of its campaign."""
    from validation.figures.writing import photo_bytes  # noqa: PLC0415
    from vision_gt.looks.drawing import DOTS_PER_INCH, picture  # noqa: PLC0415

    look, folder = drawn
    image = read_image(folder / look.image)
    try:
        return photo_bytes(picture(look, image), DOTS_PER_INCH)
    except (ArithmeticError, LookupError, ValueError) as error:  # no picture may end a run
        bare = replace(look, outlines=(), rejections=(), verdict=f"its lines: {error}")
        return photo_bytes(picture(bare, image), DOTS_PER_INCH)
