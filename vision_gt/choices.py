"""What the command line may change of a campaign's settings."""

from dataclasses import dataclass

from vision_gt.settings import VisionSettings


@dataclass(frozen=True)
class Choices:
    """What the command line may change.

    Parameters
    ----------
    workers : int, optional
        Processes; one for each processor by default.
    as_published, merge_cameras, on_floor : bool, optional
        Instead of the campaign's settings.
    """

    workers: int | None = None
    as_published: bool | None = None
    merge_cameras: bool | None = None
    on_floor: bool | None = None

    def applied(self, settings: VisionSettings) -> VisionSettings:
        """The settings with what was chosen here."""
        chosen = {
            name: value
            for name in ("as_published", "merge_cameras", "on_floor")
            if (value := getattr(self, name)) is not None
        }
        return settings.model_copy(update=chosen)
