"""The looks of a campaign that was solved: stops, and boards that were left out."""

from collections.abc import Iterator, Mapping, Sequence

from scipy.spatial.transform import RigidTransform

from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.looks.boards import board_looks
from vision_gt.looks.look import Known, Look, by_image
from vision_gt.looks.robot import stop_looks, stop_views
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.robot_pose import Floor
from vision_gt.stages.inputs import VisionInputs


def looks_of(outcome: VisionOutcome, given: VisionInputs) -> Iterator[Look]:
    """All stops, then all images of boards that were not used, or not wholly.

    Parameters
    ----------
    outcome : VisionOutcome
        Of the campaign.
    given : VisionInputs
        Its images.
    """
    known = known_of(outcome)
    left = by_image(outcome.rejections)
    images = {key: given.shown(path) for key, path in given.stop_images().items()}
    yield from stop_looks(outcome.detections, images, stop_views(outcome.stops), known, left)
    for purpose, views in outcome.boards.items():
        by_file: dict[str, list[BoardView]] = {}
        for view in views:
            by_file.setdefault(given.image_of(purpose, view), []).append(view)
        yield from board_looks(purpose, by_file, titles_of(given, purpose, left), known, left)


def titles_of(
    given: VisionInputs, purpose: str, left: Mapping[str, Sequence[Rejection]]
) -> dict[str, str]:
    """Titles of the images of a purpose of which a board, or all, was not used."""
    titles = {}
    for kind, camera, path, moment in given.board_images():
        image = given.shown(path)
        if kind == purpose and any(one.kind in {"board", "image"} for one in left.get(image, ())):
            titles[image] = title_of(kind, camera, moment)
    return titles


def title_of(purpose: str, camera: str, moment: str) -> str:
    """What an image of boards is called."""
    name = moment.rsplit("/", maxsplit=1)[-1]
    what = {"network": f"snapshot {name}", "bar": f"both boards of the bar, {name}"}
    other = purpose if name == purpose else f"{purpose} {name}"
    return f"{what.get(purpose, other)}, camera {camera}"


def known_of(outcome: VisionOutcome) -> Known:
    """Cameras and markers of a campaign that was solved."""
    settings, network = outcome.settings, outcome.network.network
    cells = Family(settings.markers.family, settings.markers.border).cells
    bar = RigidTransform.concatenate([RigidTransform.identity(), network.bar])
    floor = Floor(settings.floor.height, settings.floor.tilt)
    cameras = {name: one.camera for name, one in outcome.calibrations.items()}
    cameras |= {camera.name: camera for camera in network.cameras}
    return Known(cameras, network, outcome.layout.layout, floor, cells, bar)
