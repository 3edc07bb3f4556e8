"""What a lab must state of its own instrument, frame and rig: nobody else can know it."""

from validation.campaign.folder import Campaign
from validation.errors import Problem

_SQUARE = 'pole_length = 2.5, or any points = { "A" = [0.0, 0.0], "B" = [3.0, 0.0] }'
_RIG = 'points = { "O" = [0.0, 0.0], "X" = [0.6, 0.0], "Y" = [0.0, 0.4] }'
_SIGMAS = {
    "instrument": ("setup_sigma",),
    "vframe": ("sigma",),
    "robot_frame": ("marking_sigma", "shape_sigma"),
}


def missing_hardware(
    campaign: Campaign, *, tolerance: bool = True, frame: bool = True, rig: bool = True
) -> list[Problem]:
    """What campaign.toml does not state of the hardware, with an example line for each.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    tolerance, frame, rig : bool
        Whether the instrument, the Vframe and the rig are used at all.
    """
    settings = campaign.settings
    stated = settings.vframe.model_fields_set
    keys = (
        ("instrument", "tolerance", tolerance, "tolerance = 0.0015"),
        ("vframe", "points", frame and "pole_length" not in stated, _SQUARE),
        ("robot_frame", "points", rig, _RIG),
    )
    return [
        Problem(
            campaign.toml,
            f"needed, in metres, as it is for your own. Write under [{table}], for example: "
            f"{example}",
            field=f"{table}.{key}",
        )
        for table, key, needed, example in keys
        if needed and key not in getattr(settings, table).model_fields_set
    ]


def assumed_sigmas(campaign: Campaign, *, rig: bool = True) -> dict[str, float]:
    """Standard deviations that campaign.toml does not state, with what is assumed, in metres.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    rig : bool
        Whether the rig is used at all.
    """
    return {
        f"{table}.{key}": float(getattr(getattr(campaign.settings, table), key))
        for table, keys in _SIGMAS.items()
        if rig or table != "robot_frame"
        for key in keys
        if key not in getattr(campaign.settings, table).model_fields_set
    }
