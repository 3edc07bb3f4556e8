"""What a person should read of an RTK drive, in sentences."""

from collections.abc import Iterator

import numpy as np

from rtk_gt.campaign.digits import coarse_heights, coarse_positions, too_coarse
from rtk_gt.campaign.lasting_findings import (
    clock_findings,
    lasting_findings,
    short_errors,
    slow_findings,
    unseen_findings,
)
from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.offsets.checks import differences_said
from rtk_gt.offsets.estimate import distance_names
from rtk_gt.path.vehicle_path import heading_span, tilt_spread
from rtk_gt.receivers.fixes import Fixes
from validation.poses.angles import Array
from validation.results import Finding, Severity, Size

SUBJECT = "rtk"
AXES = ("x", "y", "z")
LARGEST_SLIP = np.radians(1.0)
"""Radians that the body of a vehicle stands off its wheels at most: a judgement; loads and springs
make some tenths of a degree."""
BACKWARDS = np.radians(60.0)
"""Radians between nose and motion that no wheels explain: receivers in another order make 60 to 180
degrees with antennas at the corners of a triangle."""
UNLIKELY = 1e-3
"""Probability by chance below which stated offsets are said to differ from those of the drive: one
good drive in a thousand is warned of."""
LARGEST_MISFIT = 0.01
"""Metres that distances may be off a rigid body: a judgement."""
HOPELESS = 0.5
"""Metres of sigma beyond which an offset is an error: over 1.8 m between front and rear the
attitude is then open by 15 degrees."""

OTHER_ETA = 2.0
"""Factor between eta and what receivers state from which on it is said: covariances are then wrong
by four, where NMEA's rounding and the sky make 1.5."""


def rtk_findings(outcome: RtkOutcome) -> list[Finding]:
    """All findings, in reading order."""
    return [
        *_coverage(outcome),
        *_offsets(outcome),
        *_chosen(outcome),
        *_prior(outcome),
        *_motion(outcome),
        *_antennas(outcome),
        *_consistency(outcome),
        *clock_findings(outcome),
        *lasting_findings(outcome),
        *(() if too_coarse(outcome.records) else unseen_findings(outcome, outcome.seen_of_some)),
        *_leaps(outcome),
        *_assumed(outcome),
        *_records(outcome),
    ]


def undetermined(outcome: RtkOutcome) -> list[tuple[Array, float]]:
    """Directions (3 (r - 1),) of the offsets that the drive alone leaves open, with sigmas."""
    offsets = outcome.offsets
    limit = outcome.settings.largest_offset_sigma
    found = []
    for value, direction in zip(offsets.signal, offsets.directions.T, strict=True):
        sigma = np.inf if value <= 0 else np.sqrt(offsets.correlation_time / value)
        if sigma > limit:
            found.append((direction, float(sigma)))
    return found


def direction_words(direction: Array, receivers: tuple[str, ...]) -> str:
    """A direction of the offsets in words: its largest parts, receiver by receiver."""
    parts = direction.reshape(-1, 3)
    parts = parts * np.sign(parts.ravel()[np.abs(parts).argmax()])
    said = []
    # A judgement: parts below a fifth of the largest are left out of the words.
    for name, part in zip(receivers[1:], parts, strict=True):
        shown = [f"{v:+.2f} {axis}" for v, axis in zip(part, AXES, strict=True) if abs(v) > 0.2]
        if shown:
            said.append(f"{name} ({', '.join(shown)})")
    return " with ".join(said)


def _coverage(outcome: RtkOutcome) -> Iterator[Finding]:
    found = outcome.coverage
    share = found.share_of_time
    text = (
        f"{found.poses} poses; ground truth covers {100 * share:.0f} % of the time and "
        f"{100 * found.share_of_length:.0f} % of the {found.length:.0f} m driven."
    )
    if found.gaps and found.gaps[0].duration > found.max_gap:
        gap = found.gaps[0]
        text += (
            f" The longest gap lasts {gap.duration:.1f} s ({gap.length:.0f} m), from second "
            f"{gap.start - found.start:.1f} on. Gaps hold no ground truth; nothing is "
            "interpolated across them."
        )
    size = (Size("share of the time with ground truth", share),)
    # A judgement: with less than half of the drive, results may not be of the whole of it.
    yield Finding("note" if share > 0.5 else "warning", text, SUBJECT, "coverage", size)


def _offsets(outcome: RtkOutcome) -> Iterator[Finding]:
    span, tilt = heading_span(outcome.path), tilt_spread(outcome.path)
    drive = (
        f"the headings span {np.degrees(span):.0f} degrees and the vehicle tilts by "
        f"{np.degrees(tilt):.1f} degrees"
    )
    open_directions = undetermined(outcome)
    if not open_directions:
        worst = outcome.offsets.offset_sigmas.max()
        text = f"The drive determines all offsets, the weakest to {1000 * worst:.1f} mm ({drive})."
        size = (Size("weakest sigma of an offset", float(worst), "m"),)
        yield Finding("good", text, SUBJECT, "offsets_determined", size)
        return
    listed = "; ".join(
        f"{direction_words(direction, outcome.offsets.receivers)}: "
        + ("not at all" if np.isinf(sigma) else f"{100 * sigma:.1f} cm")
        for direction, sigma in open_directions
    )
    count, total = len(open_directions), len(outcome.offsets.signal)
    text = (
        f"The drive alone leaves {count} of {total} directions of the offsets open (sigma above "
        f"{1000 * outcome.settings.largest_offset_sigma:.0f} mm), as {drive}: {listed}. "
    )
    worst = float(outcome.offsets.offset_sigmas.max())
    weakest = (Size("weakest sigma of an offset", worst, "m"),)
    if worst > outcome.settings.largest_offset_sigma:
        text += (
            f"{_beforehand(outcome)} The sigmas are up to {_metres(worst)}, which makes up to "
            f"{_degrees_of(outcome)} degrees of attitude. The offsets must come from a longer "
            "drive with turns and slopes, or be stated in [rtk.known_offsets]."
        )
        yield Finding(
            "error" if worst > HOPELESS else "warning",
            text,
            SUBJECT,
            "offsets_undetermined",
            weakest,
        )
    else:
        text += (
            "There the offsets are those of campaign.toml, which this drive cannot check; "
            if outcome.settings.known_offsets or outcome.settings.known_distances
            else f"No single offset is worse than {_metres(worst)}; "
        )
        text += f"their error makes up to {_degrees_of(outcome)} degrees of attitude at all poses."
        yield Finding("warning", text, SUBJECT, "offsets_from_prior", weakest)


def _chosen(outcome: RtkOutcome) -> Iterator[Finding]:
    """That the distances allow another solution, which the motion excludes."""
    if not outcome.left:
        return
    away = max(
        float(np.linalg.norm(one.offsets.values - outcome.offsets.offsets.values, axis=1).max())
        for one in outcome.left
    )
    text = (
        f"The distances allow {len(outcome.left) + 1} solutions, whose offsets differ by up to "
        f"{_metres(away)}: on a road this straight the antennas move the same way with the vehicle "
        "turned by half a turn. The one whose nose points where the vehicle drives was taken. If "
        "it drove in reverse all the way, the other is right; a drive with turns, or "
        "[rtk.known_offsets], settles it."
    )
    size = (Size("difference of the offsets", away, "m"),)
    yield Finding("warning", text, SUBJECT, "offsets_by_motion", size)


def _beforehand(outcome: RtkOutcome) -> str:
    if outcome.settings.known_offsets or outcome.settings.known_distances:
        return "What campaign.toml states beforehand does not determine them."
    return "campaign.toml states nothing of them."


def _metres(value: float) -> str:
    return f"{value:.1f} m" if value >= 1 else f"{100 * value:.1f} cm"


def _degrees_of(outcome: RtkOutcome) -> str:
    """Largest standard deviation of an angle that offsets and distances cause."""
    systematic = outcome.path.systematic_covariances
    sigma = np.sqrt(np.diagonal(systematic, axis1=1, axis2=2)[:, 3:].max())
    return f"{np.degrees(sigma):.2g}" if sigma < 1 else "many"


def _prior(outcome: RtkOutcome) -> Iterator[Finding]:
    """Stated offsets and measured distances that the drive contradicts."""
    if outcome.stated is not None and outcome.stated.probability < UNLIKELY:
        said = differences_said(outcome.stated, outcome.offsets.receivers[1:], 2.0)
        text = (
            "The stated offsets do not agree with those of the drive alone (probability "
            f"{100 * outcome.stated.probability:.2g} %): {said or 'in their combination'}. "
            "Their sigma may be too small, or they belong to another drive or frame."
        )
        size = (Size("p", float(outcome.stated.probability)),)
        yield Finding("warning", text, SUBJECT, "offsets_differ", size)
    known = outcome.settings.known_distances
    if known is None:
        return
    names = distance_names(outcome.offsets.receivers)
    for row, name in enumerate(names):
        stated = known.of_pair(name, np.nan)
        if np.isnan(stated):
            continue
        off = outcome.offsets.distances[row] - stated
        sigma = np.hypot(known.sigma, outcome.offsets.distance_sigmas[row])
        if abs(off) > 3 * sigma:
            text = (
                f"The distance {name} is {1000 * off:+.0f} mm from the measured one, "
                f"{abs(off) / sigma:.1f} standard deviations: check the tape measure's reading, "
                "the known offsets, and the time of the receivers."
            )
            size = (Size.normal(f"distance {name}: found less measured", off, sigma, "m"),)
            yield Finding("warning", text, SUBJECT, "distance_differs", size)


def _motion(outcome: RtkOutcome) -> Iterator[Finding]:
    """Whether the nose points where the vehicle goes."""
    found = outcome.motion
    if found is None:
        return
    away = float(np.hypot(found.left, found.up))
    if away > BACKWARDS:
        text = (
            f"The nose points {np.degrees(away):.0f} degrees off the direction of motion "
            f"({found.steps} steps). Either the vehicle drove so all the way (in reverse, say), or "
            "the receivers are not listed as rear, front left, front right, or the stated offsets "
            "and places belong to another order. The heading must not be used before that is known."
        )
        size = (Size("angle of the nose to the motion", away, "rad"),)
        yield Finding("error", text, SUBJECT, "nose_against_motion", size)
        return
    length = float(np.ptp(outcome.antennas.positions[:, 0]))
    for angle, sigma, where, opposite, what in (
        (found.up, found.up_sigma, "above", "below", "vertical"),
        (found.left, found.left_sigma, "left of", "right of", "lateral"),
    ):
        if abs(angle) < max(LARGEST_SLIP, 3 * sigma):
            continue
        side = opposite if angle > 0 else where
        text = (
            f"The vehicle's x axis points {abs(np.degrees(angle)):.1f} degrees {side} its "
            f"direction of motion on average ({found.steps} steps, standard error "
            f"{np.degrees(sigma):.1f}). A {what} offset between front and rear that is wrong by "
            f"{100 * length * abs(np.tan(angle)):.0f} cm would do that, or stated antenna "
            "positions that are; the antenna distances cannot show it."
        )
        size = (Size.normal(f"{what} angle to the motion", angle, sigma, "rad"),)
        yield Finding("warning", text, SUBJECT, "nose_off_motion", size)


def _antennas(outcome: RtkOutcome) -> Iterator[Finding]:
    worst = float(np.abs(outcome.antennas.misfit).max())
    if worst > LARGEST_MISFIT:
        text = (
            f"The distances do not fit antennas on a rigid body: {1000 * worst:.0f} mm are left. "
            "One antenna moved, or an offset is wrong."
        )
        size = (Size("largest misfit of a distance", worst, "m"),)
        yield Finding("warning", text, SUBJECT, "antennas_misfit", size)
    heights = ", ".join(f"{z:.3f}" for z in outcome.antennas.positions[:3, 2])
    text = (
        f"The heights of the first three antennas on the vehicle ({heights} m) are stated, not "
        "measured by this drive: they decide what is called level."
    )
    yield Finding("note", text, SUBJECT, "heights_stated")


def _consistency(outcome: RtkOutcome) -> Iterator[Finding]:
    found = outcome.consistency
    low, high = found.mean_square_interval
    yield Finding(
        "note" if found.share_beyond <= 3 * (1 - found.confidence) else "warning",
        f"{100 * found.share_beyond:.1f} % of the poses are beyond the bound q = "
        f"{found.bound:.2f} that {100 * (1 - found.confidence):.0f} % should pass.",
        SUBJECT,
        "consistency",
        (Size("share of poses beyond the bound", float(found.share_beyond)),),
    )
    if not low <= found.mean_square <= high:
        side = "smaller" if found.mean_square < low else "larger"
        text = (
            f"The noise is {side} than assumed: the mean of q^2 is {found.mean_square:.2f} times "
            f"what it should be ({low:.2f} to {high:.2f})."
        )
        size = (Size("mean square over the assumed one", float(found.mean_square)),)
        severity: Severity = "note" if side == "smaller" else "warning"
        yield Finding(severity, text, SUBJECT, "noise_level", size)
    yield from slow_findings(outcome)
    names = distance_names(outcome.offsets.receivers)
    for name, off, bad in zip(names, found.bias, found.biased, strict=True):
        if bad:
            text = (
                f"The distance {name} is {1000 * off:+.1f} mm from its constant value on "
                "average, more than chance allows: offsets or distances do not fit this drive."
            )
            size = (Size(f"mean error of the distance {name}", float(off), "m"),)
            yield Finding("warning", text, SUBJECT, "distance_biased", size)
    false = int((outcome.offsets.weights == 0).sum()) + short_errors(outcome)
    if false:
        text = f"The antenna distances show a false fix in {false} steps, which give no pose."
        size = (Size("steps with a false fix", false, "steps"),)
        yield Finding("note", text, SUBJECT, "false_fixes", size)


def _leaps(outcome: RtkOutcome) -> Iterator[Finding]:
    """Poses that their neighbours contradict, though their distances are right."""
    rows = np.flatnonzero(outcome.leaps)
    if len(rows) == 0:
        return
    seconds = ", ".join(
        f"{outcome.path.times[row] - outcome.coverage.start:.1f}" for row in rows[:10]
    )
    more = f" and {len(rows) - 10} more" if len(rows) > 10 else ""
    text = (
        f"{len(rows)} {'pose leaps' if len(rows) == 1 else 'poses leap'} in height, pitch or roll "
        "against the neighbours, at second "
        f"{seconds}{more}. A false fix that moves an antenna up or down does that and keeps all "
        "distances; so does a kerb. Such poses stay in the path, marked 'leaps' in its sources."
    )
    count = Size("poses that leap", len(rows), "poses")
    yield Finding("warning", text, SUBJECT, "leaps", (count,))


def _assumed(outcome: RtkOutcome) -> Iterator[Finding]:
    """What campaign.toml could state of the noise and of hand measurements, and does not."""
    settings, known = outcome.settings, outcome.settings.known_distances
    said = []
    if "eta" not in settings.model_fields_set:
        said.append(f"vertical noise is {settings.eta:g} times the horizontal one (eta)")
    if known is not None and "sigma" not in known.model_fields_set:
        said.append(f"measured distances have a sigma of {1000 * known.sigma:g} mm (sigma)")
    open_sensors = [one for one in settings.sensors if "sigmas" not in one.model_fields_set]
    if open_sensors:
        sigmas = open_sensors[0].sigmas
        names = ", ".join(one.name for one in open_sensors)
        said.append(
            f"the places of the sensors {names} have sigmas of {1000 * sigmas[0]:g} mm and "
            f"{np.degrees(sigmas[3]):.1f} degrees (sigmas)"
        )
    if said:
        text = f"Assumed, as campaign.toml does not state it: {'; '.join(said)}."
        yield Finding("note", text, SUBJECT, "assumed_sigmas")


def _records(outcome: RtkOutcome) -> Iterator[Finding]:
    """Remarks of the readers, and what they tolerated."""
    for record in outcome.records:
        yield from record_findings(record)
    yield from coarse_heights(outcome)
    yield from coarse_positions(outcome.records, outcome.noise.sigma)
    yield from _eta_beside_stated(outcome)


def record_findings(record: Fixes) -> Iterator[Finding]:
    """Remarks of the reader of one record, and what it tolerated."""
    yield from _frozen(record)
    for note in record.notes:
        yield Finding("note", note, record.receiver, "record")
    if record.tolerated:
        said = ", ".join(f"{what}: {count}" for what, count in record.tolerated.items())
        text = f"{record.source.name}, accepted: {said}."
        yield Finding("note", text, record.receiver, "tolerated")


def _eta_beside_stated(outcome: RtkOutcome) -> Iterator[Finding]:
    """That what receivers state of their errors contradicts eta."""
    ratios = [
        np.sqrt(2 * c[:, 2, 2] / (c[:, 0, 0] + c[:, 1, 1]))
        for c in (one.covariances[one.fixed] for one in outcome.records)
    ]
    told = np.concatenate(ratios)
    told = told[np.isfinite(told)]
    if not len(told):
        return
    stated, eta = float(np.median(told)), outcome.settings.eta
    if max(stated / eta, eta / stated) < OTHER_ETA:
        return
    text = (
        f"eta is {eta:.2g}, but the receivers state errors upwards that are {stated:.2g} times the "
        "level ones. Heights, pitch and roll, and their covariances, go with eta: state it as the "
        "receivers do, or as `gtval rtk noise` tells it of a record that stands."
    )
    yield Finding(
        "warning", text, SUBJECT, "eta_contradicted", (Size("eta", eta), Size("stated", stated))
    )


def _frozen(record: Fixes) -> Iterator[Finding]:
    """That a receiver hung while the vehicle drove."""
    if not record.frozen:
        return
    worst = max(record.frozen, key=lambda one: one.leap)
    seconds = sum(one.end - one.begin for one in record.frozen)
    start = record.times[0]
    text = (
        f"Receiver {record.receiver} hung while the vehicle drove: from second "
        f"{worst.begin - start:.1f} to {worst.end - start:.1f} of its record (line {worst.line}) "
        f"its position is the same to the last digit {worst.fixes} times, and then leaps by "
        f"{worst.leap:.1f} m. "
    )
    if len(record.frozen) > 1:
        text += f"It hung {len(record.frozen)} times, for {seconds:.0f} s in all. "
    text += (
        "These positions say RTK fixed; they were left out as not fixed. Look at the receiver's "
        "load, its output rate and its firmware."
    )
    sizes = (Size("largest leap", worst.leap, "m"), Size("time in which it hung", seconds, "s"))
    yield Finding("warning", text, record.receiver, "receiver_hung", sizes)
