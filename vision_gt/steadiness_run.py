"""The steadiness of a campaign's cameras, from the images of before and after."""

from collections.abc import Mapping, Sequence

from vision_gt.images.files import CampaignImages, read_image
from vision_gt.network.steadiness import Steadiness, board_move, image_move
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView


def camera_steadiness(
    names: Sequence[str],
    images: CampaignImages,
    boards: Mapping[str, Sequence[BoardView]],
    cameras: Mapping[str, Camera],
) -> tuple[Steadiness, ...]:
    """A verdict on each camera with images of before and after.

    Parameters
    ----------
    names : sequence of str
        Cameras to judge.
    images : CampaignImages
        With ``before`` and ``after``.
    boards : mapping of str to sequence of BoardView
        Boards found in them, under the same two names.
    cameras : mapping of str to Camera
        By name.
    """
    seen = {
        (view.camera, purpose): view
        for purpose in ("before", "after")
        for view in boards.get(purpose, ())
    }
    verdicts = []
    for name in names:
        if name not in images.before or name not in images.after:
            continue
        before, after = (read_image(folder[name]) for folder in (images.before, images.after))
        pair = [seen.get((name, purpose)) for purpose in ("before", "after")]
        board = None
        if pair[0] is not None and pair[1] is not None:
            board = board_move(pair[0], pair[1], cameras[name])
        verdicts.append(Steadiness(name, board, image_move(before, after), before, after))
    return tuple(verdicts)
