"""From the rig's file to poses."""

from dataclasses import dataclass

import numpy as np

from gtval.plugins import Campaign, Column, PoseTable, read_csv
from my_system.settings import MocapSettings


@dataclass(frozen=True)
class RigPoses:
    """What the rig recorded.

    Parameters
    ----------
    table : PoseTable
        Poses that are good enough.
    markers : tuple of int
        How many markers each was computed from.
    left_out : tuple of str
        Stops that too few markers saw.
    """

    table: PoseTable
    markers: tuple[int, ...]
    left_out: tuple[str, ...]


def rig_poses(campaign: Campaign, settings: MocapSettings) -> RigPoses:
    """The rig's poses in the GTV frame.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    settings : MocapSettings
        Its table [mocap].

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    table = read_csv(
        campaign.folder / settings.file,
        [
            Column("pose"),
            Column("x", "number", low=-100, high=100, unit="m"),
            Column("y", "number", low=-100, high=100, unit="m"),
            Column("theta", "number", low=-7, high=7, unit="rad"),
            Column("markers", "number", low=0, high=100),
        ],
    )
    table.flag_duplicates(["pose"])
    table.raise_problems()
    poses = np.column_stack([table.numbers[name] for name in ("x", "y", "theta")])
    markers = np.array(table.numbers["markers"], dtype=int)
    good = markers >= settings.least_markers
    # Half of the markers, half of the information.
    factor = markers.max(initial=1) / markers[good]
    covariances = factor[:, None, None] * np.diag(np.square(settings.sigmas))
    names = np.array(table.text["pose"])
    return RigPoses(
        PoseTable(
            system="mocap",
            ids=tuple(names[good].tolist()),
            poses=poses[good],
            covariances=covariances,
            sources=tuple(f"{count} markers" for count in markers[good]),
        ),
        tuple(markers[good].tolist()),
        tuple(names[~good].tolist()),
    )
