"""A cause in words: what is wrong, by how much, what it spoils, and what to do."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from validation.results import SPOILT, TWO_SIDED, Finding, Severity, Size, listed_ids
from vision_gt.causes.diagnosis import Diagnosis
from vision_gt.causes.effects import Effect, Moved, Scaled
from vision_gt.causes.evidence import WALK
from vision_gt.causes.exchanges import Exchanged
from vision_gt.causes.in_full import Cause
from vision_gt.causes.reference import ReferenceTurn
from vision_gt.causes.trial import Noise

_ERROR = 3.0
"""Standard deviations of a pose from which on it is spoilt."""
_NOISIER = 1.5
"""Times the stated noise from which on corners are called noisier, with 95 % confidence. Stated
noise is within 20 per cent of the true one on rendered images, and something covers an edge now
and then."""
_WORSE = 1.5
"""Times the scatter of the other cameras, in pixels, from which on a camera's corners are told,
with 95 % confidence. A judgement: in clean rendered campaigns cameras are within 1.2 of each other;
grain of 12 grey levels where others have 2 makes 2.2 of boards and 3.4 of markers."""
_LARGE_PRINT = 0.005
"""Share of a length from which on it is an error whatever the stated uncertainty of poses: 2 cm of
a robot 4 m away. Paper by itself changes by 1 or 2 per mille with the weather."""
_KEYS = {
    "bar_scale": ("the squares of the bar's boards", "vision.bar.first.square and .second.square"),
    "whole_bar_scale": (
        "the whole bar, its boards and the distance between them,",
        "the squares and second_on_first of vision.bar",
    ),
    "reference_scale": (
        "the squares of the reference pattern",
        "vision.reference.board.square",
    ),
    "board_scale": (
        "the squares of the bar's boards and of the reference pattern, all of them,",
        "the squares of vision.bar and vision.reference",
    ),
    "marker_scale": ("the sides of all markers", "vision.markers.sides"),
    "bar_and_marker_scale": (
        "the squares of the bar's boards and the sides of all markers, all of them,",
        "the squares of vision.bar and vision.markers.sides",
    ),
}


def cause_finding(diagnosis: Diagnosis) -> Finding | None:
    """One sentence on the cause, and what follows from it; None without a cause."""
    cause = diagnosis.cause
    if cause is None:
        return None
    effect = cause.effect
    if isinstance(effect, Exchanged) and len(diagnosis.alike) > 1:
        return _either(diagnosis)
    cause = replace(cause, moments=tuple(one.since for one in diagnosis.alike))
    named = (cause, *diagnosis.others)
    # Poses are off by their distance from the camera times that.
    scaled = any(o.effect.kind in _KEYS and abs(o.size[0]) > _LARGE_PRINT for o in named)
    exchanged = any(isinstance(o.effect, Exchanged) for o in named)
    bad = exchanged or scaled or bool((diagnosis.harm > _ERROR).any())
    severity: Severity = "error" if bad and not diagnosis.against else "warning"
    if len(named) > 1:
        return _with_harm(_one_of(diagnosis, named, severity), diagnosis)
    more = f"{_spoilt(diagnosis)}{_odds(diagnosis)}{_by_survey(diagnosis)}"
    found = _told(cause, severity, lambda what, do: f"{what} {more} {do}")
    return _with_harm(found, diagnosis)


def _with_harm(found: Finding, diagnosis: Diagnosis) -> Finding:
    """A finding with how many poses its cause spoils."""
    if diagnosis.against or not (count := int((diagnosis.harm > _ERROR).sum())):
        return found
    return replace(found, sizes=(*found.sizes, Size(SPOILT, count, "poses")))


def _told(cause: Cause, severity: Severity, joined: "Joined") -> Finding:
    return _TELLERS[_teller(cause.effect)](cause, severity, joined)


def _one_of(diagnosis: Diagnosis, named: Sequence[Cause], severity: Severity) -> Finding:
    """Hypotheses that nothing tells apart, the likeliest first."""
    said = [f"{'Or' if i else 'Either'}: {said_of(one)}" for i, one in enumerate(named)]
    criterion = {one.what.effect: one.criterion for one in diagnosis.ranking.tried}
    least = criterion[named[0].effect]
    odds = [f"{np.exp((least - criterion[one.effect]) / 2):.2g}" for one in named]
    asked = diagnosis.seen.surveyed.common(named[0].solution.evidence.stops)
    teller = (
        "Neither the images nor the surveyed stops tell which"
        if asked
        else "The images do not tell which, a survey of the stops may"
    )
    do = dict.fromkeys(_told(one, "note", lambda _, do: do).text for one in named)
    text = (
        f"{' '.join(said)} {teller} (odds {' : '.join(odds)}). {_spoilt(diagnosis, 'may spoil')}"
        f"{_odds(diagnosis)}{_by_survey(diagnosis)} {' Or: '.join(do)}"
    )
    return _told(named[0], severity, lambda _, __: text)


def _by_survey(diagnosis: Diagnosis) -> str:
    """What only the surveyed stops tell."""
    if diagnosis.against:
        return (
            " But the surveyed stops agree with the poses as they are, and not with this: it is "
            "the best of what was tried, and not the cause."
        )
    out = {one.kind: one for one in diagnosis.excluded}
    if not out:
        return ""
    causes = {one.what.effect: one.what for one in diagnosis.ranking.tried}
    others = " ".join(said_of(causes[one]) for one in out.values())
    return f" The images alone would allow others, which the surveyed stops exclude: {others}"


def said_of(cause: Cause) -> str:
    """A hypothesis in one sentence.

    Parameters
    ----------
    cause : Cause
        With its numbers.
    """
    return _told(cause, "note", lambda what, _: what).text


def _teller(effect: Effect) -> str:
    if isinstance(effect, Scaled):
        return "lens" if effect.what == "focal" else "size"
    if isinstance(effect, Exchanged):
        return "exchanged"
    if isinstance(effect, Moved):
        return "moved"
    return "lens" if effect.kind == "lens" else "place"


Joined = Callable[[str, str], str]
"""What is wrong, and what to do, as one text."""


def _size(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    effect, share, sigma = cause.effect, float(cause.size[0]), float(cause.sigma[0])
    if effect.kind == "marker_side":
        what = f"the side of marker {effect.subject}"
        key, subject = f"vision.markers.sides.{effect.subject}", f"marker {effect.subject}"
    else:
        what, key = _KEYS[effect.kind]
        subject = {"marker_scale": "markers", "reference_scale": "reference"}.get(
            effect.kind, "bar"
        )
    more = "larger" if share > 0 else "smaller"
    half = TWO_SIDED * sigma
    verb = "are" if "squares" in what or "sides" in what else "is"
    text = (
        f"{what[0].upper()}{what[1:]} {verb} {100 * abs(share):.2f} % {more} than stated (95 %: "
        f"{100 * (abs(share) - half):.2f} to {100 * (abs(share) + half):.2f} %)."
    )
    do = (
        "Measure them with a steel ruler, over ten squares or a whole side, and correct "
        f"{key} (times {1 + share:.4f}): a printer that fits to the page makes such an error."
    )
    sizes = (Size.normal("larger than stated, as a share", share, sigma),)
    return Finding(severity, joined(text, do), subject, "print_size", sizes)


def _lens(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    effect = cause.effect
    name = f"camera {effect.subject}"
    if effect.kind == "lens":
        f = float(cause.size[0])
        text = f"The file of camera {effect.subject} is not that of its lens."
        sizes = (Size.normal("focal length longer than stated", f, float(cause.sigma[0]), "px"),)
    else:
        share, sigma = float(cause.size[0]), float(cause.sigma[0])
        longer = "longer" if share > 0 else "shorter"
        text = f"The focal length of {name} is {100 * abs(share):.2f} % {longer} than " + (
            "when it was calibrated." if effect.kind == "zoom" else "its file says."
        )
        sizes = (Size.normal("longer than stated, as a share", share, sigma),)
    do = (
        "Calibrate the camera again with its focus and zoom as they are now, with images of the "
        "same size, or give its own file in vision.camera_files."
    )
    return Finding(severity, joined(text, do), name, "focal_length", sizes)


def _length_angle(cause: Cause) -> tuple[str, tuple[Size, ...]]:
    length, angle = (float(np.linalg.norm(cause.size[i : i + 3])) for i in (0, 3))
    sizes = (Size("moved", length, "m"), Size("turned", angle, "rad"))
    return f"{1e3 * length:.1f} mm and {np.rad2deg(angle):.2f} degrees", sizes


def _moved(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    kind, name = cause.effect.kind, cause.effect.subject
    by, sizes = _length_angle(cause)
    if kind == "camera_moved":
        subject, always = f"camera {name}", "since the network was calibrated"
        text = f"Camera {name} moved by {by}, {_when(cause, always)}."
        do = (
            "Calibrate the network again, and repeat the stops that this camera saw since then, or "
            "take its images out."
        )
    else:
        subject, always = f"marker {name}", "since the walk around the robot"
        text = f"Marker {name} moved on the robot by {by}, {_when(cause, always)}."
        do = (
            "Fix it, take the walk around the robot again, and repeat the stops since then, or "
            "take the marker out of vision.markers.sides."
        )
    code = "camera_moved" if kind == "camera_moved" else "marker_moved"
    return Finding(severity, joined(text, do), subject, code, sizes)


def _when(cause: Cause, always: str) -> str:
    effect = cause.effect
    assert isinstance(effect, Moved)
    named = effect.stops(cause.solution.evidence)
    since = [named.index(stop) for stop in (effect.since, *cause.moments)]
    first, last = min(since), named[max(since)]
    if first == 0:
        return always if max(since) == 0 else f"at some time before stop {last}"
    return f"between stop {named[first - 1]} and stop {last}"


def _place(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    by, sizes = _length_angle(cause)
    kind, number = cause.effect.kind.removesuffix("_height"), cause.effect.subject
    what, key, subject = {
        "bar": (
            "The bar's second board is not where it was stated to be",
            "vision.bar.second_on_first",
            "bar",
        ),
        "reference": (
            "The reference pattern does not lie as stated",
            "vision.reference.height, and its level",
            "reference",
        ),
        "dima": (
            f"Marker {number}, which carries the robot frame, is not where stated",
            "vision.markers.dima_on_robot",
            f"marker {number}",
        ),
    }[kind]
    code = "bar_place" if kind == "bar" else "dima_place" if number else "reference_place"
    if kind != cause.effect.kind:
        return _height(cause, severity, joined)
    x, y, z = 1e3 * cause.size[:3]
    text = f"{what}: it is off by {by} ({x:+.1f}, {y:+.1f}, {z:+.1f} mm)."
    return Finding(
        severity, joined(text, f"Measure it again, and correct {key}."), subject, code, sizes
    )


def _height(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    """A thing that lies higher or lower than stated."""
    height, sigma = float(cause.size[2]), float(cause.sigma[2])
    marker = cause.effect.subject
    what, key, subject, code = (
        (
            f"Marker {marker}, which carries the robot frame, sits",
            "the third number of vision.markers.dima_on_robot's translation",
            f"marker {marker}",
            "dima_place",
        )
        if marker
        else (
            "The reference pattern lies",
            "vision.reference.height",
            "reference",
            "reference_place",
        )
    )
    half = TWO_SIDED * sigma
    text = (
        f"{what} {1e3 * abs(height):.1f} mm {'higher' if height > 0 else 'lower'} than stated "
        f"(95 %: {1e3 * (abs(height) - half):.1f} to {1e3 * (abs(height) + half):.1f} mm)."
    )
    do = f"Measure its height again, and correct {key} (by {1e3 * height:+.1f} mm)."
    sizes = (Size.normal("higher than stated", height, sigma, "m"),)
    return Finding(severity, joined(text, do), subject, code, sizes)


def _exchanged(cause: Cause, severity: Severity, joined: Joined) -> Finding:
    effect = cause.effect
    assert isinstance(effect, Exchanged)
    a, b = effect.pair
    if effect.kind == "images_exchanged":
        text = f"The images of stops {a} and {b} of camera {effect.subject} are exchanged."
        do = "Exchange their file names."
        subject = f"camera {effect.subject}"
    elif effect.kind == "cameras_exchanged":
        text = f"The images of the stops of cameras {a} and {b} are exchanged."
        do, subject = "Exchange the names of their folders.", f"cameras {a}-{b}"
    elif effect.kind == "bar_exchanged":
        text = "The two boards of the bar are exchanged: the first was stated as the second."
        do, subject = "Exchange vision.bar.first and vision.bar.second (first_id).", "bar"
    elif effect.kind == "calibrations_exchanged":
        text = f"The images of the calibration of cameras {a} and {b} are exchanged."
        do, subject = "Exchange the names of their folders.", f"cameras {a}-{b}"
    else:
        text = f"The files of cameras {a} and {b} are exchanged."
        do, subject = "Exchange them in vision.camera_files.", f"cameras {a}-{b}"
    return Finding(severity, joined(text, do), subject, "exchanged", ())


def _either(diagnosis: Diagnosis) -> Finding:
    """Images of two stops that are exchanged, of one camera or of another."""
    best = diagnosis.alike[0]
    assert isinstance(best, Exchanged)
    a, b = best.pair
    cameras = [effect.subject for effect in diagnosis.alike]
    text = (
        f"The images of stops {a} and {b} are exchanged, those of camera "
        f"{' or those of camera '.join(cameras)}: what the cameras see does not tell which, a "
        f"survey of these stops would. {_spoilt(diagnosis, 'may spoil')}{_odds(diagnosis)} Look at "
        "the images, and exchange the file names of that camera."
    )
    return Finding("error", text, f"cameras {'-'.join(cameras)}", "exchanged", ())


_TELLERS: dict[str, Callable[[Cause, Severity, Joined], Finding]] = {
    "size": _size,
    "lens": _lens,
    "moved": _moved,
    "place": _place,
    "exchanged": _exchanged,
}


def _spoilt(diagnosis: Diagnosis, spoils: str = "spoils") -> str:
    """How many poses it moves, and by how much."""
    shifts = np.linalg.norm(diagnosis.shifts[:, :2], axis=1)
    spoilt = diagnosis.harm > _ERROR
    if not spoilt.any():
        return "It moves no pose by more than three of the pose's standard deviations."
    largest = 1e3 * float(shifts[spoilt].max())
    count = int(spoilt.sum())
    stops = "the pose of 1 stop" if count == 1 else f"the poses of {count} stops"
    return f"It {spoils} {stops}, by up to {largest:.1f} mm."


def _odds(diagnosis: Diagnosis) -> str:
    """How sure it is that something is wrong."""
    ranking = diagnosis.ranking
    odds = ranking.odds(diagnosis.nothing)
    text = " The odds against 'nothing is wrong' are more than a million to one."
    if odds < 1e6:
        text = f" The odds against 'nothing is wrong' are {odds:.2g} to one."
    return text


def noise_finding(diagnosis: Diagnosis) -> Finding | None:
    """Corners noisier than the detector states, of one camera or of all, or than other cameras'."""
    noisy = [one for one in diagnosis.noise if one.factor - TWO_SIDED * one.sigma > _NOISIER]
    cause = diagnosis.cause
    if cause is not None and isinstance(cause.effect, Exchanged):
        return None
    if not noisy:
        return _worse_finding(diagnosis.noise)
    names = list(dict.fromkeys(one.camera for one in noisy))
    everyone = set(names) >= {one.camera for one in diagnosis.noise} - {WALK}
    most = max(noisy, key=lambda one: one.factor)
    which = "of all cameras" if everyone else f"of camera {listed_ids(names)}"
    where = f"{most.kind} of camera {most.camera}" if len(names) > 1 else most.kind
    text = (
        f"The corners {which} scatter {most.factor:.1f} times as much as stated "
        f"({where}). The poses take it into account. Look for blur by "
        "motion, for compression, for something that covers the edges, and for a lens that was "
        "calibrated with other images."
    )
    sizes = (Size.normal("scatter over what is stated", most.factor, most.sigma),)
    subject = "vision" if everyone else f"camera {names[0]}"
    return Finding("note", text, subject, "corner_noise", sizes)


def _worse_finding(noise: Sequence[Noise]) -> Finding | None:
    """The camera whose corners scatter much more than those of the others, as is stated."""
    found = []
    hung = [one for one in noise if one.camera != WALK]
    for one in hung:
        same = [o for o in hung if (o.kind, o.calibrated) == (one.kind, one.calibrated)]
        others = [o for o in same if o.camera != one.camera]
        if others:
            times = one.scatter / float(np.median([o.scatter for o in others]))
            unsure = max(o.sigma / o.factor for o in others)
            sigma = times * float(np.hypot(one.sigma / one.factor, unsure))
            if times - TWO_SIDED * sigma > _WORSE:
                found.append((times, one, sigma))
    if not found:
        return None
    times, most, sigma = max(found, key=lambda told: told[0])
    text = (
        f"The corners of camera {most.camera} scatter by {most.scatter:.2f} px, {times:.1f} times "
        f"as much as those of the other cameras ({most.kind}). The detector states it, and the "
        "poses take it into account. Look for too little light, gain, blur and compression, or "
        "bring the camera nearer."
    )
    sizes = (Size.normal("scatter over that of other cameras", times, sigma),)
    return Finding("note", text, f"camera {most.camera}", "corner_noise", sizes)


def turned_finding(turn: ReferenceTurn | None) -> Finding | None:
    """A reference pattern that was read from another corner."""
    if turn is None:
        return None
    x, y, heading = turn.frame
    along, across = turn.corner
    where = []
    if along or across:
        where.append(
            f"its inner corner {1e3 * along:.0f} mm along its rows and {1e3 * across:.0f} mm along "
            "its columns lies at the stated place"
        )
    if turn.quarters:
        where.append(f"it is turned by {90 * turn.quarters} degrees")
    text = (
        f"The reference pattern was read from another corner than it lies: {', and '.join(where)}. "
        f"All poses are off by x {x:+.3f} m, y {y:+.3f} m, {np.rad2deg(heading):+.1f} degrees of "
        f"the frame; {turn.stops} surveyed stops say so, to {1e3 * turn.scatter:.0f} mm. Correct "
        "vision.reference.position and heading, or vision.reference.origin_near."
    )
    sizes = (
        Size("frame off", float(np.hypot(x, y)), "m"),
        Size("frame turned", float(heading), "rad"),
    )
    return Finding("error", text, "reference", "reference_turned", sizes)
