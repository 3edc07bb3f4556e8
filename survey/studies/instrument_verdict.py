"""The instrument check in words: the verdict, and the lines for campaign.toml."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtri

from survey.studies.instrument_check import CONFIDENCE, InstrumentCheck
from validation.campaign.folder import Instrument
from validation.results import Finding, Severity, Size

NOISE_FACTOR = 2.0
"""'Within specification' is said only where the noise is surely below so many times the stated. A
judgement: eight readings whose noise is as stated show that much, seven do not."""

SHOWN_ROUNDING = 1e-5
"""Metres: what is less is not seen in the numbers printed."""


def verdict(check: InstrumentCheck, lines: Sequence[int] = ()) -> list[Finding]:
    """What is wrong with the instrument; 'within specification' only on evidence.

    Parameters
    ----------
    check : InstrumentCheck
        What was found.
    lines : sequence of int
        Line of the file of each reading; the readings are counted from 1 where there is none.

    Returns
    -------
    list of Finding
        Codes 'instrument-rows', 'instrument-step', 'instrument-lengths' where the errors are no
        offset, scale and noise, and nothing else then; else 'within', 'offset', 'scale',
        'offset_or_scale', 'noise', 'too_few'. 'within' needs
        that neither test objects, that the systematic error is surely below the tolerance over
        the lengths covered, and the noise surely below twice the expected one.
    """
    if check.misfit.is_found:
        return [_misfit_finding(check, lines)]
    found = [*_origin_findings(check), *_noise_findings(check)]
    missing = list(_missing_evidence(check))
    count = Size("readings", check.readings, "readings")
    if found:
        if missing:
            text = f"Beyond this: {'; '.join(missing)}."
            found.append(_finding("note", text, "too_few", count))
        return found
    if missing:
        text = f"Not enough readings to tell: {'; '.join(missing)}."
        return [_finding("warning", text, "too_few", count)]
    return [
        _finding(
            "good",
            f"Within its specification: the systematic error is below "
            f"{_mm(check.largest_error)} between {check.shortest:.2f} m and {check.longest:.2f} m "
            f"({CONFIDENCE:.0%} confidence; stated ±{_mm(check.tolerance)}), the noise "
            f"{_mm(check.noise)} (expected {_mm(check.expected_noise)}).",
            "within",
            Size("largest systematic error", check.largest_error, "m"),
            Size("noise", check.noise, "m", *check.noise_interval, CONFIDENCE),
        )
    ]


def _misfit_finding(check: InstrumentCheck, lines: Sequence[int]) -> Finding:
    """Why no lines for campaign.toml can be given, and what to do."""
    misfit = check.misfit

    def place(row: int) -> str:
        return f"line {lines[row]}" if lines else f"reading {row + 1}"

    if misfit.bad_rows:
        named = ", ".join(place(row) for row in misfit.bad_rows)
        text = (
            f"{len(misfit.bad_rows)} reading(s) do not belong to the others: {named}. The numbers "
            "are those of the others. Measure these lengths again, or delete the rows"
        )
        count = Size("readings that do not belong", len(misfit.bad_rows), "readings")
        return _finding("error", f"{text}; then check once more.", "instrument-rows", count)
    if misfit.step_row is not None:
        text = (
            f"From {place(misfit.step_row)} on the readings are "
            f"{'longer' if misfit.step > 0 else 'shorter'} by {_mm(abs(misfit.step))} ± "
            f"{_mm(misfit.step_sigma)} (1 sigma) than before: something was changed there, the "
            "edge that is measured from (see its display), a target, or a known length. One offset "
            "for all would be wrong everywhere. Measure all lengths anew with one edge, or check "
            "the two parts by themselves."
        )
        step = Size.normal("step", misfit.step, misfit.step_sigma, "m")
        return _finding("error", text, "instrument-step", step)
    text = (
        "The errors differ from length to length by more than readings of one length do "
        f"(p = {misfit.p_lengths:.2g}): they are neither an offset nor a scale error. Check the "
        "known lengths, and measure each from the same place."
    )
    chance = Size("p-value of one offset and scale", misfit.p_lengths)
    return _finding("error", text, "instrument-lengths", chance)


def _origin_findings(check: InstrumentCheck) -> Iterator[Finding]:
    """What is known to be wrong with origin and scale."""
    level = 1 - CONFIDENCE
    if check.p_joint >= level:
        return
    inside = (
        "It stays inside the stated tolerance."
        if check.largest_error <= check.tolerance
        else f"It may reach {_mm(check.largest_error)}, beyond the stated ±{_mm(check.tolerance)}."
    )
    offset = Size.normal("offset", check.offset, _sigma(check, 0), "m")
    if np.isnan(check.p_scale):
        text = (
            f"Readings are off by {_mm(check.offset, sign=True)} at {check.longest:.2f} m "
            f"(p = {check.p_joint:.2g}); one length cannot tell an offset from a scale error. "
        )
        yield _finding("warning", text + inside, "offset", offset)
        return
    separate = False
    if check.p_offset < level:
        separate = True
        text = (
            f"Offset significant: readings are too {_long(check.offset)} by "
            f"{_mm(abs(check.offset))} ± {_mm(_sigma(check, 0))} (1 sigma, "
            f"p = {check.p_offset:.2g}). "
        )
        yield _finding("warning", text + inside, "offset", offset)
    if check.p_scale < level:
        separate = True
        text = (
            f"Scale significant: readings are too {_long(check.scale_error)} by "
            f"{abs(check.scale_error) * 1e6:.0f} ± {_sigma(check, 1) * 1e6:.0f} ppm (1 sigma, "
            f"p = {check.p_scale:.2g}). "
        )
        scale = Size.normal("scale error", check.scale_error, _sigma(check, 1))
        yield _finding("warning", text + inside, "scale", scale)
    if not separate:
        text = (
            f"Readings are significantly off (joint test, p = {check.p_joint:.2g}), but these "
            "lengths cannot tell an offset from a scale error; add short and long ones. "
        )
        size = Size("largest systematic error", check.largest_error, "m")
        yield _finding("warning", text + inside, "offset_or_scale", size)


def _noise_findings(check: InstrumentCheck) -> Iterator[Finding]:
    """Whether the readings scatter more than they should."""
    if check.p_noise < 1 - CONFIDENCE:
        low, high = check.noise_interval
        yield _finding(
            "warning",
            f"Noise larger than specified: {_mm(check.noise)} ({_mm(low)} to {_mm(high)}) instead "
            f"of {_mm(check.expected_noise)} (p = {check.p_noise:.2g}). Look for single bad "
            "readings first; if there are none, enter setup_sigma.",
            "noise",
            Size("noise", check.noise, "m", low, high, CONFIDENCE),
        )


def _missing_evidence(check: InstrumentCheck) -> Iterator[str]:
    """What these readings could not have shown."""
    if np.isnan(check.p_scale):
        yield (
            "all lengths are the same, so a scale error cannot be seen; measure short and long ones"
        )
    if check.largest_error > check.tolerance and check.p_joint >= 1 - CONFIDENCE:
        yield (
            f"a systematic error of {_mm(check.largest_error)} would fit them as well "
            f"(stated ±{_mm(check.tolerance)})"
        )
    dof = check.degrees_of_freedom
    upper = check.noise * np.sqrt(dof / chdtri(dof, CONFIDENCE)) if dof else np.inf
    if upper > NOISE_FACTOR * check.expected_noise and not check.p_noise < 1 - CONFIDENCE:
        said = "cannot be seen at all" if dof == 0 else f"might be as large as {_mm(float(upper))}"
        yield (
            f"with {check.readings} reading{'s' if check.readings > 1 else ''} the noise {said}; "
            "take ten or more"
        )


def _finding(severity: Severity, text: str, code: str, *sizes: Size) -> Finding:
    return Finding(severity, text.strip(), "instrument", code, sizes)


def _sigma(check: InstrumentCheck, which: int) -> float:
    return float(np.sqrt(check.covariance[which, which]))


def _long(error: float) -> str:
    return "long" if error > 0 else "short"


def _mm(length: float, *, sign: bool = False) -> str:
    return f"{length * 1000:{'+' if sign else ''}.2f} mm"


def settings_snippet(check: InstrumentCheck, instrument: Instrument) -> str:
    """Lines for the [instrument] table of campaign.toml; '' where no offset and scale fit.

    Parameters
    ----------
    check : InstrumentCheck
        What was found.
    instrument : Instrument
        Its specification.
    """
    if check.misfit.is_found:
        return ""
    correction = check.correction
    covered = f"{check.shortest:.3f} m and {check.longest:.3f} m"
    lines = [
        "[instrument]",
        f'model = "{_toml_text(instrument.model)}"',
        f"# From {check.readings} reading(s) between {covered}.",
    ]
    if correction.offset == 0.0 and correction.scale == 1.0:
        enough = "too_few" not in {finding.code for finding in verdict(check)}
        seen = "No significant offset or scale error" if enough else "Too few to see an error"
        lines.append(f"# {seen}.")
    else:
        sigma = np.sqrt(np.diagonal(correction.covariance))
        scale = f"scale {sigma[1]:.7f}" if sigma[1] > 0 else "scale taken as 1"
        lines.append(f"# Standard deviations: offset {sigma[0]:.6f} m, {scale}.")
    if check.shared_rounding > SHOWN_ROUNDING:
        lines.append(
            f"# {_mm(check.shared_rounding)} of rounding are the same for all readings of a length."
        )
    lines += [f"offset = {correction.offset:.6f}", f"scale = {correction.scale:.7f}"]
    if check.p_noise < 1 - CONFIDENCE:
        more = np.sqrt(max(check.noise**2 - check.expected_noise**2, 0.0))
        lines.append(f"setup_sigma = {more:.5f}  # what is seen beyond the specification")
    return "\n".join(lines) + "\n"


def _toml_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
