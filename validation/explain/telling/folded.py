"""One cause is one line: what the comparison says of poses that a known mistake spoils."""

from collections.abc import Iterable, Mapping, Sequence

from validation.explain.analysis import Explanation
from validation.results import SPOILT, Finding, Size

MAY_COME_OF_IT = frozenset({
    "bias", "nees_above", "nees_below", "covariance_too_small", "covariance_too_large",
    "systematic_error", "evidence", "inferred_reference", "reference_slip", "not_observable",
    "rivals", "hint", "left", "noise_estimated", "dependent_errors", "differs_by_source",
    "source_hint", "wrong_pose", "likely_wrong_pose", "disputed_pose", "different_mounts",
})  # fmt: skip
"""Codes of findings on the size, the shape and the place of errors. What no mistake of a system can
make of its own poses, as degrees for radians or mirrored axes, is told as ever."""


def folded(
    findings: Sequence[Finding],
    own: Mapping[str, Sequence[Finding]],
    explanation: Explanation | None,
) -> list[Finding]:
    """The findings, with one line for all that may come of a cause a system names itself.

    Parameters
    ----------
    findings : sequence of Finding
        Of the whole run.
    own : mapping of str to sequence of Finding
        What each system found of its own data, by the name of its table.
    explanation : Explanation, optional
        For who is wrong at which stop.
    """
    causes = {name: cause for name, told in own.items() if (cause := _cause(told)) is not None}
    blamed: dict[str, set[str]] = {}
    for verdict in explanation.arbitration.verdicts if explanation is not None else ():
        blamed.setdefault(f"pose {verdict.stop}", set()).update(verdict.blamed)
    result: list[Finding] = []
    gathered: dict[str, list[Finding]] = {name: [] for name in causes}
    for one in findings:
        names = blamed.get(one.subject, {one.subject})
        if one.code not in MAY_COME_OF_IT or one.severity == "good" or not names <= set(causes):
            result.append(one)
            continue
        for name in sorted(names):
            gathered[name].append(one)
    return [*result, *(_line(name, causes[name], told) for name, told in gathered.items() if told)]


def _cause(told: Iterable[Finding]) -> Finding | None:
    """The first error that names what spoils the poses."""
    errors = (one for one in told if one.severity == "error")
    return next((e for e in errors if any(s.of == SPOILT and s.value for s in e.sizes)), None)


def _line(system: str, cause: Finding, told: Sequence[Finding]) -> Finding:
    one = len(told) == 1
    count = "1 finding" if one else f"{len(told)} findings"
    about = dict.fromkeys(
        f"{it.subject} ({it.code})" if it.subject != system else it.code for it in told
    )
    text = (
        f"{count} of the comparison may come of what is named above: {cause.sentence} Nothing else "
        f"is claimed of the errors of {system} until it is mended; then run again. They are: "
        f"{', '.join(about)}; the tables of the report have their numbers."
    )
    size = Size("findings that may come of it", len(told), "findings")
    return Finding("note", text, system, "spoilt_by_cause", (size,))
