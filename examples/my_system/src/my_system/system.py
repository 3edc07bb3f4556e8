"""The rig as a system of gtval. Nothing heavy is imported before it is asked to solve."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gtval.plugins import Campaign, Finding, Progress, Section, SystemResult, Table, Text
from my_system.settings import MocapSettings

if TYPE_CHECKING:
    from my_system.rig import RigPoses


class MocapSystem:
    """Poses of the motion-capture rig."""

    name = "mocap"

    def has_data(self, campaign: Campaign) -> bool:
        """Whether the campaign states the rig."""
        return self.name in campaign.extra

    def inputs(self, campaign: Campaign) -> Sequence[Path]:
        """The files that `solve` reads: its results are out of date when one of them changes."""
        return [campaign.folder / campaign.section(self.name, MocapSettings).file]

    def solve(self, campaign: Campaign, progress: Progress) -> SystemResult:
        """Poses, findings and a section of the report.

        Raises
        ------
        GtvalError
            If the settings or the file are bad.
        """
        from my_system.rig import rig_poses

        progress("reading the rig", 0.0)
        found = rig_poses(campaign, campaign.section(self.name, MocapSettings))
        table = _table(found)
        words = "Poses of the motion-capture rig, with the markers that each came from."
        return SystemResult(
            tables=[found.table],
            findings=_findings(found),
            sections=[Section("Motion capture", [Text(words), table])],
            facts={"poses": len(found.table), "left_out": found.left_out},
            overview=[table],
        )


def _findings(found: "RigPoses") -> list[Finding]:
    """What a person should know."""
    if not found.left_out:
        return [Finding("good", "All poses had enough markers.", "mocap", "mocap_markers")]
    text = f"Left out, too few markers: {', '.join(found.left_out)}. Move the robot or a camera."
    return [Finding("warning", text, "mocap", "mocap_markers")]


def _table(found: "RigPoses") -> Table:
    """Every pose."""
    rows: list[list[str | float]] = [
        [name, *map(float, pose), count]
        for name, pose, count in zip(found.table.ids, found.table.poses, found.markers, strict=True)
    ]
    columns = ["pose", "x [m]", "y [m]", "theta [rad]", "markers"]
    return Table("Poses of the rig", columns, rows, ["", ".4f", ".4f", ".4f", "d"])


SYSTEM = MocapSystem()
