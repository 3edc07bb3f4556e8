"""One synthetic room of a study: drawn, worked out, and held against its truth."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args

import numpy as np

from data_samples.room_campaign import write_room
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.laser_campaign import with_faults
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.simulate import HAND_LASER, RIG, ExampleSystem, SimulationSettings
from data_samples.studies.plan import TrialSettings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError
from validation.pieces.results import results_kept_in
from validation.pieces.store import KeptPieces, code_of, key_of
from validation.poses.angles import Array
from validation.poses.pose_table import PLANAR, PoseTable, pose_difference
from validation.results import Severity
from validation.run import run_campaign
from validation.statistics.consistency import nees

CODE = (
    "data_samples.faults",
    "data_samples.motion",
    "data_samples.rendering",
    "data_samples.rooms",
    "data_samples.room_campaign",
    "data_samples.studies.trial",
    "laser_gt",
    "survey",
    "validation",
    "vision_gt",
)
"""What the result of a trial is made by."""


@dataclass(frozen=True)
class TrialJob:
    """A room to be worked out.

    Parameters
    ----------
    settings : TrialSettings
        What it is.
    seed : int
        Of all that is drawn.
    """

    settings: TrialSettings
    seed: int

    @property
    def key(self) -> str:
        """Hash of all that the trial depends on."""
        told = f"{self.seed} {self.settings.model_dump_json()}"
        return key_of(code_of(*CODE), told.encode())


@dataclass(frozen=True)
class SystemErrors:
    """Poses of one system against the truth.

    Parameters
    ----------
    errors : (n, 3) array
        x, y (metres), theta (radians); of every pose that it has.
    sigmas : (n, 3) array
        Standard deviations it states; NaN where it states none.
    nees : (n,) array
        Squared distance from the truth by its covariances; NaN where it states none.
    """

    errors: Array
    sigmas: Array
    nees: Array

    def __post_init__(self) -> None:
        n = len(self.errors)
        shapes = (self.errors.shape, self.sigmas.shape, self.nees.shape)
        if shapes != ((n, 3), (n, 3), (n,)):
            raise ValueError(f"errors, sigmas and NEES of {n} poses, not {shapes}")


@dataclass(frozen=True)
class Trial:
    """What came of one room.

    Parameters
    ----------
    systems : mapping of str to SystemErrors
        Those that have poses.
    stops : int
        Of the room.
    findings : frozenset of (str, str, str)
        Severity, code and subject.
    refused : str
        Why there is no result; '' where there is one.
    """

    systems: dict[str, SystemErrors]
    stops: int
    findings: frozenset[tuple[str, str, str]] = frozenset()
    refused: str = ""


def run_trial(job: TrialJob) -> Trial:
    """A room drawn, worked out as `gtval run` does, and held against its truth."""
    # The room is gone when it is worked out: only what comes of it is kept.
    with TemporaryDirectory(prefix="gtval-trial-") as made, results_kept_in(None):
        folder, stops = Path(made), job.settings.room.stops
        try:
            truth = _drawn(folder, job)
            done = run_campaign(load_campaign(folder))
        except GtvalError as error:
            return Trial({}, stops, refused=" ".join(str(error).split())[:500])
        tables = [table for table in done.tables if table.components == PLANAR and len(table)]
        found = {table.system: _errors(truth, table) for table in tables}
        told = {(one.severity, one.code, one.subject) for one in done.findings}
        return Trial(found, len(truth), frozenset(told))


def _drawn(folder: Path, job: TrialJob) -> PoseTable:
    """The true poses of a campaign that is written to a folder."""
    plan = job.settings
    own = plan.survey
    stated = {"setup_sigma": own.setup_sigma, "tolerance_per_metre": own.tolerance_per_metre}
    example = plan.example
    systems = () if example is None else (ExampleSystem("example", example.sigmas, example.bias),)
    settings = SimulationSettings(
        instrument=HAND_LASER.model_copy(update=stated),
        robot_frame=RIG.model_copy(update={"marking_sigma": own.marking_sigma}),
        systems=systems,
        missing=own.missing,
        blunders=own.blunders,
        blunder_size=own.blunder_size,
        typos=own.typos,
        mirror_trap=own.mirror_trap,
        hand_points=own.hand_points,
        spot_height=own.spot_height,
        tail_freedom=own.tail_freedom,
    )
    room = RoomSettings(**plan.room.model_dump())
    laser = None if plan.laser is None else with_faults(plan.laser.faults, plan.laser.mount_error)
    vision = None if plan.vision is None else VisionSettings()
    return write_room(folder, job.seed, room, settings, laser, vision).truth.poses


def _errors(truth: PoseTable, table: PoseTable) -> SystemErrors:
    """The poses of a system against the true ones."""
    errors = pose_difference(table.poses, truth.select(table.ids).poses)
    sigmas = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))
    return SystemErrors(errors, sigmas, nees(errors, table.covariances))


class KeptTrials(KeptPieces):
    """Trials of earlier runs of a study, and those that this one adds.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "trials")

    def written(self, result: Trial, _job: TrialJob) -> dict[str, Any] | None:
        """A trial as values that JSON has; not one that may have failed by chance."""
        if any(code == "unexpected" for _, code, _ in result.findings):
            return None
        systems = {
            name: [_listed(one.errors), _listed(one.sigmas), _listed(one.nees)]
            for name, one in result.systems.items()
        }
        told = sorted(result.findings)
        return {
            "systems": systems,
            "stops": result.stops,
            "findings": told,
            "refused": result.refused,
        }

    def read(self, told: dict[str, Any], _job: TrialJob) -> Trial:
        """The trial that a line of the file holds."""
        systems = {
            name: SystemErrors(*(np.array(one, dtype=float) for one in arrays))
            for name, arrays in told["systems"].items()
        }
        findings = frozenset((severity, code, who) for severity, code, who in told["findings"])
        if not {severity for severity, _, _ in findings} <= set(get_args(Severity)):
            raise ValueError(findings)
        return Trial(systems, int(told["stops"]), findings, str(told["refused"]))


def _listed(values: Array) -> Any:
    if np.ndim(values):
        return [_listed(one) for one in values]
    return float(values) if np.isfinite(values) else None
