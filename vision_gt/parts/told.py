"""What is told of a campaign whose images do not give poses in the Vframe."""

from collections.abc import Iterator, Sequence

import numpy as np

from validation.results import Finding, Section, Severity, Size, SystemResult, Table, TableColumn
from validation.text_files.csv_text import csv_text
from vision_gt.campaign.findings import (
    calibration_findings,
    lack_findings,
    network_findings,
    oddity_findings,
)
from vision_gt.campaign.result_files import PLACED, cameras_csv, layout_csv, rejected_csv
from vision_gt.campaign.sections import calibration_blocks, camera_table, link_table
from vision_gt.network.verdict import calibration_verdict
from vision_gt.optics.written_cameras import write_camera
from vision_gt.parts.solve import VFRAME, PartialOutcome, Placed
from vision_gt.stages.lenses import examples, left_out

MM = 1e3


def parts_result(outcome: PartialOutcome) -> SystemResult:
    """Findings, tables and files of what was solved."""
    begun = outcome.begun
    robot = begun.given.shows_robot
    severity: Severity = "error" if robot else "note"
    findings = [
        _solved(outcome),
        *lack_findings(begun.lacks, severity),
        *calibration_findings(begun.calibrations),
        *([] if outcome.solution is None else network_findings(outcome.solution)),
        *oddity_findings(begun.given.oddities),
    ]
    blocks = calibration_blocks(begun.calibrations, examples(begun))
    sections = [Section("Vision: intrinsic parameters", blocks)]
    overview = [lens_table(outcome)]
    if outcome.solution is not None:
        tables = [camera_table(outcome.solution, outcome.frame), link_table(outcome.solution)]
        sections.append(Section("Vision: cameras", tables))
        overview.append(tables[0])
    if outcome.placed:
        sections.append(Section("Vision: poses by single images", [placed_table(outcome.placed)]))
        overview.append(placed_table([one for one in outcome.placed if one.number is None]))
    return SystemResult(
        findings=findings,
        sections=sections,
        files=parts_files(outcome),
        facts=_facts(outcome),
        overview=[table for table in overview if table.rows],
        without_poses=not robot,
    )


def _solved(outcome: PartialOutcome) -> Finding:
    """What there is."""
    begun, solution = outcome.begun, outcome.solution
    said = [f"the lenses of {len(begun.cameras)} cameras"]
    if solution is not None:
        said.append(f"the places of {len(solution.network.cameras)} cameras in {outcome.frame}")
    if outcome.layout is not None:
        said.append(f"the places of {len(outcome.layout.layout.numbers)} markers on the robot")
    robot = sum(one.number is None for one in outcome.placed)
    if robot:
        said.append(f"{robot} poses of the robot by single images")
    if len(outcome.placed) > robot:
        said.append(f"{len(outcome.placed) - robot} poses of markers in the frames of cameras")
    need = "" if begun.lacks else _next(outcome)
    text = f"Solved from these images: {', '.join(said)}.{need}"
    count = Size("cameras with a lens", len(begun.cameras), "cameras")
    return Finding("good", text, "vision", "parts", (count,))


def _next(outcome: PartialOutcome) -> str:
    """What to add for poses of the robot."""
    images = outcome.begun.given.images
    wanted = [
        ("network/1-2-1 (snapshots of the double pattern)", not images.network),
        ("reference/CAMERA (the reference pattern)", not images.reference),
        ("layout/CAMERA (a walk around the robot)", not images.movie),
        ("poses/CAMERA/poseX (the robot at its stops)", not images.poses),
    ]
    missing = [what for what, none in wanted if none]
    return f" For poses of the robot add images {', '.join(missing)}." if missing else ""


def lens_table(outcome: PartialOutcome) -> Table:
    """Lenses, and what each calibration is worth."""
    begun = outcome.begun
    names = list(begun.cameras)
    made = [begun.calibrations.get(name) for name in names]
    columns: list[TableColumn] = [
        ("camera", "", names),
        ("fx [px]", ".2f", [float(begun.cameras[name].parameters[0]) for name in names]),
        ("sigma [px]", ".2f", [float(begun.cameras[name].sigmas[0]) for name in names]),
        ("images", "", [None if one is None else len(one.views) for one in made]),
        ("rms [px]", ".3f", [None if one is None else one.rms for one in made]),
        (
            "verdict",
            "",
            ["from a file" if o is None else calibration_verdict(o).word for o in made],
        ),
    ]
    return Table.of_columns("Lenses", columns)


def placed_table(placed: Sequence[Placed]) -> Table:
    """Poses by single images, each in its frame."""
    T = [one.pose.T_gtv_robot for one in placed]
    sigmas = [MM * float(np.sqrt(np.diagonal(one.pose.covariance)[:3]).max()) for one in placed]
    columns: list[TableColumn] = [
        ("stop", "", [one.stop for one in placed]),
        ("camera", "", [one.camera for one in placed]),
        ("of", "", [_of(one) for one in placed]),
        ("frame", "", [one.frame for one in placed]),
        ("x [m]", ".4f", [float(one.translation[0]) for one in T]),
        ("y [m]", ".4f", [float(one.translation[1]) for one in T]),
        ("z [m]", ".4f", [float(one.translation[2]) for one in T]),
        ("largest sigma [mm]", ".1f", sigmas),
        ("ambiguous", "", ["yes" if one.pose.ambiguous else "no" for one in placed]),
    ]
    note = "A camera's frame has x right, y down, z ahead. Rotations are in vision_image_poses.csv."
    return Table.of_columns("Poses by single images", columns, note)


def _of(one: Placed) -> str:
    return "robot" if one.number is None else f"marker {one.number}"


def parts_files(outcome: PartialOutcome) -> dict[str, str | bytes]:
    """Files under results/."""
    begun, solution = outcome.begun, outcome.solution
    cameras = dict(begun.cameras)
    files: dict[str, str | bytes] = {}
    if solution is not None:
        cameras |= {camera.name: camera for camera in solution.network.cameras}
        name = "vision_cameras.csv" if outcome.frame == VFRAME else "vision_cameras_relative.csv"
        files[name] = cameras_csv(solution.network)
    if outcome.layout is not None:
        files["vision_layout.csv"] = layout_csv(outcome.layout.layout)
    if outcome.placed:
        files["vision_image_poses.csv"] = placed_csv(outcome.placed)
    left = [*begun.given.rejections, *left_out(begun, solution)]
    files["vision_rejected.csv"] = rejected_csv(left)
    for name, camera in cameras.items():
        files[f"vision_camera_{name}.yaml"] = write_camera(".yaml", "opencv", camera)
    return files


def placed_csv(placed: Sequence[Placed]) -> str:
    """Poses by single images: translations (metres), rotation vectors (radians), sigmas."""
    header = ["stop", "camera", "of", "frame", *PLACED, *(f"sigma_{name}" for name in PLACED)]
    return csv_text([*header, "p_value", "ambiguous"], list(_rows(placed)))


def _rows(placed: Sequence[Placed]) -> Iterator[list[object]]:
    for one in placed:
        T = one.pose.T_gtv_robot
        yield [
            one.stop,
            one.camera,
            _of(one),
            one.frame,
            *T.translation.tolist(),
            *T.rotation.as_rotvec().tolist(),
            *np.sqrt(np.diagonal(one.pose.covariance)).tolist(),
            one.pose.p_value,
            "yes" if one.pose.ambiguous else "no",
        ]


def _facts(outcome: PartialOutcome) -> dict[str, object]:
    """For scripts."""
    begun, solution = outcome.begun, outcome.solution
    return {
        "stops": 0,
        "stops_with_pose": [],
        "calibration_rms": {name: one.rms for name, one in begun.calibrations.items()},
        "calibration_verdict": {
            name: calibration_verdict(one).word for name, one in begun.calibrations.items()
        },
        "network": [] if solution is None else list(solution.network.names),
        "frame": outcome.frame,
        "lacks": {one.part: one.text for one in begun.lacks},
        "image_poses": len(outcome.placed),
    }
