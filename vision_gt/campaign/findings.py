"""What a person should read about the vision system's results."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy import special

from validation.results import Finding, Severity, Size
from vision_gt.campaign.outcome import StopPose, VisionOutcome
from vision_gt.causes.telling import cause_finding, noise_finding, turned_finding
from vision_gt.images.other_boards import stated_wrongly
from vision_gt.network.exchanged import Exchange
from vision_gt.network.intrinsics import Calibration
from vision_gt.network.solution import NetworkSolution
from vision_gt.network.verdict import calibration_verdict
from vision_gt.optics.transforms import change_between
from vision_gt.robot.robot_pose import RobotPose
from vision_gt.settings import VisionSettings
from vision_gt.stages.inputs import placed
from vision_gt.stages.lacks import Lack

SUBJECT = "vision"
POOR_FIT, POOR_FLOOR = 1e-4, 1e-3
"""p-values below which corners do not fit, and a robot is not on the floor. A judgement: of a
hundred good stops one is called poor in a hundred campaigns, and off the floor in ten."""
_SYMPTOMS = {
    *("poor_fit", "off_floor", "ambiguous", "camera_pose_differs", "snapshot_outliers"),
    *("bar_outliers", "bar_single", "network_unused", "hand_measured", "table_differs"),
    *("survey_check_differs", "displacement_differs"),
}
"""Codes of what a wrong size, place, lens or file brings with it."""
_APART, _TURNED = 0.001, 0.001
"""Metres and radians that a camera's pose is off its stop before it is said. A judgement: it is
shown in whole millimetres, and a poor fit that moves nothing is said of the stop."""
_HAND_LENGTH, _HAND_ANGLE = 0.03, np.deg2rad(8)
"""Metres and radians. A judgement: ruler and plumb-line are good to a centimetre and some degrees;
a wrong id or a marker that was turned is farther off."""


def vision_findings(outcome: VisionOutcome, surveyed: Sequence[str] = ()) -> list[Finding]:
    """All findings, the most important first within their kind.

    Parameters
    ----------
    outcome : VisionOutcome
        What they are about.
    surveyed : sequence of str
        Stops that have a validation pose, with images or without.
    """
    causes = list(_causes(outcome))
    others = [
        *_assumed(outcome.settings),
        *_poses(outcome),
        *_not_fitting(outcome),
        *calibration_findings(outcome.calibrations),
        *network_findings(outcome.network, named=_names_bar(outcome)),
        *_layout(outcome),
        *_steadiness(outcome),
        *outcome.checks.findings,
    ]
    if any(one.code != "corner_noise" for one in causes):
        others = _with_symptoms_gathered(others)
    lacks = lack_findings(outcome.lacks, "warning")
    wrong, odd = _of_wrong_boards(outcome)
    others += oddity_findings(odd)
    return [*wrong, *_coverage(outcome, surveyed), *lacks, *causes, *others]


def lack_findings(lacks: Sequence[Lack], severity: Severity) -> Iterator[Finding]:
    """What could not be solved; a note where it costs no pose."""
    for one in dict.fromkeys(lacks):
        yield Finding(severity if one.costs_poses else "note", one.text, one.part, "part_missing")


def _with_symptoms_gathered(findings: Sequence[Finding]) -> list[Finding]:
    """Findings of which those that may come of a cause told before are one line."""
    symptoms = [one for one in findings if one.code in _SYMPTOMS and one.severity != "good"]
    rest = [one for one in findings if one not in symptoms]
    if not symptoms:
        return rest
    about = [f"{one.subject} ({one.code})" for one in symptoms]
    one = len(symptoms) == 1
    count = "1 other finding" if one else f"{len(symptoms)} other findings"
    again = "is judged again" if one else "are judged again"
    text = f"{count} may come of it, and {again} when it is mended: {_listed(about)}."
    size = Size("findings that may come of it", len(symptoms), "findings")
    return [Finding("note", text, SUBJECT, "symptoms", (size,)), *rest]


def _listed(names: list[str], most: int = 12) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _coverage(outcome: VisionOutcome, surveyed: Sequence[str]) -> Iterator[Finding]:
    """How many stops have a pose, and why the others have none; nothing for a drive alone."""
    if not outcome.stops:
        return
    known = [stop.pose for stop in outcome.stops if stop.chosen is not None]
    missing = [stop.pose for stop in outcome.stops if stop.chosen is None]
    seen = {pose for (_, pose), found in outcome.detections.items() if found.views}
    text = f"{len(known)} of the {len(outcome.stops)} stops with images have a vision pose."
    looked = {pose for _, pose in outcome.detections}
    lost = any(one.part.startswith("camera") for one in outcome.lacks)
    unplaced = [pose for pose in missing if pose not in looked and lost]
    if unplaced:
        text += f" Only cameras that could not be placed see {_listed(unplaced)}."
    blind = [pose for pose in missing if pose not in seen and pose not in unplaced]
    if blind:
        text += f" No marker was found in the images of {_listed(blind)}."
    unsolved = [pose for pose in missing if pose in seen]
    if unsolved:
        text += f" Markers were found, but give no sure pose, for {_listed(unsolved)}."
    with_images = {stop.pose for stop in outcome.stops}
    unseen = [pose for pose in surveyed if pose not in with_images]
    if unseen:
        text += f" No camera has an image of {_listed(unseen)}. Are they out of view?"
    severity: Severity = "good" if not missing and not unseen else "note" if known else "error"
    yield Finding(
        severity, text, SUBJECT, "coverage", (Size("stops without a pose", len(missing), "stops"),)
    )


def _assumed(settings: VisionSettings) -> Iterator[Finding]:
    """Standard deviations that campaign.toml does not state."""
    keys = ["reference.sigmas", "markers.dima_sigmas", "floor.height", "floor.tilt"]
    if settings.bar.second_on_first is not None:
        keys.append("bar.sigmas")
    assumed = []
    for table, key in (name.split(".") for name in keys):
        stated = getattr(settings, table)
        if key not in stated.model_fields_set:
            assumed.append(f"vision.{table}.{key} = {getattr(stated, key)}")
    if assumed:
        yield Finding(
            "note",
            "campaign.toml does not state these standard deviations (metres, radians), so they are "
            f"assumed: {'; '.join(assumed)}. State your own.",
            SUBJECT,
            "assumed_sigmas",
        )


def _causes(outcome: VisionOutcome) -> Iterator[Finding]:
    """What is wrong: one line for each cause."""
    told = [turned_finding(outcome.reference_turn)]
    if outcome.diagnosis is not None:
        told += [cause_finding(outcome.diagnosis), noise_finding(outcome.diagnosis)]
    yield from (one for one in told if one is not None)


def _explained(outcome: VisionOutcome) -> tuple[set[str], set[str]]:
    """Stops whose corners fit, and stops that stand on the floor, once the cause is known."""
    diagnosis = outcome.diagnosis
    if diagnosis is None or diagnosis.cause is None:
        return set(), set()
    return diagnosis.fitting_stops(POOR_FIT, POOR_FLOOR)


def poses_apart(outcome: VisionOutcome) -> Iterator[tuple[float, str, str]]:
    """Poses of single cameras that do not fit their stop: metres, camera, stop."""
    explained, _ = _explained(outcome)
    for stop in outcome.stops:
        for camera, pose in stop.by_camera.items():
            if stop.chosen is None or pose is stop.chosen or stop.pose in explained:
                continue
            length, chance = apart_from(pose, stop.chosen)
            off = change_between(pose.T_gtv_robot, stop.chosen.T_gtv_robot)
            apart = max(np.linalg.norm(off[:3]) / _APART, np.linalg.norm(off[3:]) / _TURNED) > 1
            if chance < POOR_FIT and not pose.ambiguous and apart:
                yield length, camera, stop.pose


def fate(stop: StopPose, camera: str) -> tuple[bool, float, float]:
    """Whether a camera's pose is used, metres from the stop's, chance to fit and be so far off."""
    chosen = stop.chosen
    if chosen is None:
        return False, float("nan"), float("nan")
    return camera in chosen.cameras, *apart_from(stop.by_camera[camera], chosen)


def apart_from(pose: RobotPose, chosen: RobotPose) -> tuple[float, float]:
    """Metres of a camera's pose from its stop's, and the chance that it fits and is so far off."""
    off = change_between(pose.T_gtv_robot, chosen.T_gtv_robot)
    spread = pose.covariance + chosen.covariance
    apart = float(special.chdtrc(6, off @ np.linalg.solve(spread, off)))
    return float(np.linalg.norm(off[:2])), min(pose.p_value, apart)


def _not_fitting(outcome: VisionOutcome) -> Iterator[Finding]:
    """Poses of single cameras that do not fit their stop, whether they are used or not."""
    odd = [
        (length, f"camera {camera} at {stop} ({1e3 * length:.0f} mm off)")
        for length, camera, stop in poses_apart(outcome)
    ]
    if odd:
        listed = _listed([name for _, name in sorted(odd, key=lambda one: -one[0])])
        yield Finding(
            "note",
            f"Poses of single cameras that do not fit their stop: {listed}. Where they are not the "
            "ones used, the result is not touched. Something covers a marker in the image, or the "
            "image is of another stop.",
            SUBJECT,
            "camera_pose_differs",
            (Size("largest distance", max(length for length, _ in odd), "m"),),
        )


def _poses(outcome: VisionOutcome) -> Iterator[Finding]:
    """Ambiguous poses, corners that do not fit, robots off the floor."""
    fitting, standing = _explained(outcome)
    for stop in outcome.stops:
        unsure = [name for name, pose in stop.by_camera.items() if pose.ambiguous]
        if unsure and stop.chosen is None:
            yield Finding(
                "warning",
                f"Pose {stop.pose} is ambiguous. Camera {_listed(unsure)} sees a marker from so "
                "far, or so much from the front, that two poses fit alike. Neither is used. "
                "vision.on_floor = true may decide.",
                f"pose {stop.pose}",
                "ambiguous",
            )
        chosen = stop.chosen
        if chosen is None:
            continue
        best = chosen.best
        if chosen.p_value < POOR_FIT and stop.pose not in fitting:
            yield Finding(
                "note",
                f"Pose {stop.pose}: the corners fit worse than they should (chi² "
                f"{best.chi_square:.0f} with {best.freedom} degrees of freedom). Something covers "
                "the edge of a marker (the sheet of the next marker?), or a marker has moved on "
                "the robot. The covariance of the pose is enlarged.",
                f"pose {stop.pose}",
                "poor_fit",
                (Size("chi-squared per degree of freedom", best.chi_square / best.freedom),),
            )
        if chosen.floor_p < POOR_FLOOR and stop.pose not in standing:
            yield Finding(
                "warning",
                f"Pose {stop.pose}: the robot does not stand on the floor as it should "
                f"(p = {chosen.floor_p:.1g}). A marker or a camera has moved, or the floor is "
                "not even.",
                f"pose {stop.pose}",
                "off_floor",
                (Size("p", float(chosen.floor_p)),),
            )


def calibration_findings(calibrations: Mapping[str, Calibration]) -> Iterator[Finding]:
    """Calibration images: outliers, and what they leave open."""
    for name, calibration in calibrations.items():
        subject = f"camera {name}"
        if calibration.outliers:
            yield Finding(
                "note",
                f"Camera {name}: left out of the calibration as outliers: "
                f"{_listed(list(calibration.outliers))}.",
                subject,
                "calibration_outliers",
                (Size("images left out", len(calibration.outliers), "images"),),
            )
        for lack in calibration_verdict(calibration).shortcomings:
            size = (Size(lack.of, lack.value, lack.unit),)
            text = f"Camera {name}: {lack.text[0].lower()}{lack.text[1:]}"
            code = {
                "few": "calibration_few",
                "blur": "calibration_blur",
                "coverage": "calibration_coverage",
                "tilt": "calibration_tilt",
            }.get(lack.kind, "calibration_undetermined")
            yield Finding("warning", text, subject, code, size)


def _names_bar(outcome: VisionOutcome) -> bool:
    """Whether the bar is what is found to be wrong."""
    told = outcome.diagnosis.cause if outcome.diagnosis is not None else None
    return told is not None and "bar" in told.effect.kind


def network_findings(solution: NetworkSolution, *, named: bool = False) -> Iterator[Finding]:
    """Snapshots that do not agree, and the bar; unless it is named already, as what is wrong."""
    yield from (_exchanged(one) for one in solution.exchanged)
    mixed = {(*one.cameras, snapshot) for one in solution.exchanged for snapshot in one.snapshots}
    for link in solution.links:
        apart = [s for s in link.outliers if (link.first, link.second, s) not in mixed]
        if apart:
            yield Finding(
                "warning",
                f"Cameras {link.first} and {link.second}: snapshots {_listed(apart)} "
                "do not agree with the others and are left out. No exchange of files makes them "
                "agree: did the bar move between the two exposures, or is a board covered?",
                f"cameras {link.first}-{link.second}",
                "snapshot_outliers",
                (Size("snapshots left out", len(apart), "images"),),
            )
    if solution.bar_outliers:
        yield Finding(
            "warning",
            "These images of both boards do not fit the bar: "
            f"{_listed(list(solution.bar_outliers))}. They are left out. Is "
            "vision.bar.second_on_first right?",
            "bar",
            "bar_outliers",
            (Size("images left out", len(solution.bar_outliers), "images"),),
        )
    if solution.bar_single:
        yield Finding(
            "note",
            "Only one of the bar's two boards was found in "
            f"{_listed(list(solution.bar_single))}. These images say nothing about the bar.",
            "bar",
            "bar_single",
            (Size("images with one board", len(solution.bar_single), "images"),),
        )
    if solution.unused:
        yield Finding(
            "note",
            "These images of boards take no part in the camera network: "
            f"{_listed(list(solution.unused))}. The other camera does not show the bar at the "
            "same moment, or the board gives no pose.",
            SUBJECT,
            "network_unused",
            (Size("images not used", len(solution.unused), "images"),),
        )
    network = solution.network
    if network.bar_covariance.any() and network is not solution.averaged and not named:
        built = solution.averaged.bar
        off = change_between(network.bar, built)
        sigma = np.sqrt(np.diagonal(network.bar_covariance))
        yield Finding(
            "note",
            f"The bar differs from what was built by {1e3 * np.linalg.norm(off[:3]):.1f} mm and "
            f"{np.rad2deg(np.linalg.norm(off[3:])):.2f} degrees. It is now known to "
            f"{1e3 * sigma[:3].max():.2f} mm and {np.rad2deg(sigma[3:].max()):.3f} degrees.",
            "bar",
            "bar",
            (
                Size("length off", float(np.linalg.norm(off[:3])), "m"),
                Size("turned", float(np.linalg.norm(off[3:])), "rad"),
            ),
        )


def _exchanged(one: Exchange) -> Finding:
    """Images of the network under wrong names."""
    first, second = one.cameras
    if one.of_cameras:
        a, b = one.partners[0]
        what = (
            f"The images {a} and {b} of cameras {first} and {second} are exchanged: each is the "
            "other camera's. They are left out. Exchange their file names."
        )
    else:
        pairs = "; ".join(f"{a} with {b}" for a, b in one.partners)
        what = (
            f"Images of cameras {first} and {second} are under wrong numbers: these show the same "
            f"moment: {pairs}. They are left out. Name them so that both have the same number."
        )
    subject = f"cameras {first}-{second}"
    size = Size("snapshots left out", len(one.snapshots), "images")
    return Finding("warning", what, subject, "snapshots_exchanged", (size,))


def _layout(outcome: VisionOutcome) -> Iterator[Finding]:
    """Markers that are not where they were measured by hand."""
    layout = outcome.layout.layout
    if outcome.layout.left_out:
        yield Finding(
            "note",
            "These images of the walk around the robot do not show two markers or give no pose, "
            f"so they are not used: {_listed(list(outcome.layout.left_out))}.",
            SUBJECT,
            "layout_unused",
            (Size("images not used", len(outcome.layout.left_out), "images"),),
        )
    for name, hand in outcome.settings.markers.hand_measured.items():
        T = layout.T_robot_marker[layout.index(int(name))]
        off = change_between(T, placed(hand))
        length, angle = np.linalg.norm(off[:3]), np.linalg.norm(off[3:])
        if length > _HAND_LENGTH or angle > _HAND_ANGLE:
            yield Finding(
                "warning",
                f"Marker {name} is {1e3 * length:.0f} mm and {np.rad2deg(angle):.1f} degrees from "
                "where it was measured by hand. Check its id, its side and the hand measurement.",
                f"marker {name}",
                "hand_measured",
                (Size("length off", float(length), "m"), Size("turned", float(angle), "rad")),
            )


def _steadiness(outcome: VisionOutcome) -> Iterator[Finding]:
    """A verdict on each camera."""
    steady = [one.camera for one in outcome.steadiness if one.verdict == "steady"]
    for one in outcome.steadiness:
        if one.verdict == "moved":
            yield Finding(
                "error",
                f"Camera {one.camera} moved between the images before and after. Its poses must "
                "not be used. Calibrate the network again and repeat the stops that it saw.",
                f"camera {one.camera}",
                "camera_moved",
            )
        elif one.verdict == "not known":
            yield Finding(
                "note",
                f"Camera {one.camera}: the images before and after show too little to tell "
                "whether it moved.",
                f"camera {one.camera}",
                "steadiness_unknown",
            )
    if steady:
        yield Finding("good", f"Cameras that did not move: {_listed(steady)}.", SUBJECT, "steady")


def _of_wrong_boards(outcome: VisionOutcome) -> tuple[list[Finding], list[tuple[str, str]]]:
    """What is said of boards that were stated wrongly, and the other oddities.

    Said first: what the images do not give, as a chain to a camera, comes of it. It is an error
    where poses are missing.
    """
    oddities = outcome.oddities
    several = Counter(what for _, what in oddities)
    wrong = [one for one in oddities if stated_wrongly(one[1]) and several[one[1]] > 1]
    costs = any(lack.costs_poses for lack in outcome.lacks)
    told = oddity_findings(wrong, "error" if costs else "warning")
    return list(told), [one for one in oddities if one not in wrong]


def oddity_findings(
    oddities: Sequence[tuple[str, str]], severity: Severity = "warning"
) -> Iterator[Finding]:
    """Images with something odd about them, by what it is: how many, and the first few."""
    kinds: dict[str, list[str]] = {}
    for image, what in oddities:
        kinds.setdefault(what, []).append(image)
    for what, images in kinds.items():
        size = Size("images", len(images), "images")
        count = f"{len(images)} images, " if len(images) > 1 else ""
        said = f"{count}{_listed(images, 6)}: {what}."
        yield Finding(severity, said, SUBJECT, "image", (size,))
