"""What a document concludes, each conclusion beside what the data of the campaign say of it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from validation.campaign.folder import Claim
from validation.results import Finding, Section, Table, Text
from validation.statistics.paired import PairedErrors

SUPPORTED, OPEN, CONTRADICTED, UNTESTED = "supported", "open", "contradicted", "not tested"
_BY_SEVERITY = {"good": SUPPORTED, "note": OPEN, "warning": CONTRADICTED, "error": CONTRADICTED}


@dataclass(frozen=True)
class JudgedClaim:
    """A claim, the verdict on it, and why."""

    claim: Claim
    verdict: str
    reasons: str


def judge_claims(
    claims: Iterable[Claim], pairs: Sequence[PairedErrors], findings: Sequence[Finding]
) -> list[JudgedClaim]:
    """A verdict on every claim.

    Parameters
    ----------
    claims : iterable of Claim
        As campaign.toml states them.
    pairs : sequence of PairedErrors
        Every two systems.
    findings : sequence of Finding
        Of the run.

    Notes
    -----
    That one system errs less than another is supported where it is shown in some component and the
    opposite in none. A claim that a finding decides has the finding's severity: 'good' supports it,
    a note leaves it open, a warning or an error speaks against it; the worst decides.
    """
    return [_judged(claim, pairs, findings) for claim in claims]


def _judged(
    claim: Claim, pairs: Sequence[PairedErrors], findings: Sequence[Finding]
) -> JudgedClaim:
    if claim.less and claim.than:
        return _comparison(claim, pairs)
    if claim.finding:
        own = [
            one
            for one in findings
            if one.code == claim.finding and claim.subject in {"", one.subject}
        ]
        order = ("error", "warning", "note", "good")
        worst = min((one.severity for one in own), key=order.index, default=None)
        verdict = UNTESTED if worst is None else _BY_SEVERITY[worst]
        return JudgedClaim(
            claim, verdict, " ".join([*(one.text for one in own), claim.note]).strip()
        )
    return JudgedClaim(claim, UNTESTED, claim.note)


def _comparison(claim: Claim, pairs: Sequence[PairedErrors]) -> JudgedClaim:
    """Whether one system errs less than the other."""
    own = [one for one in pairs if {one.first, one.second} == {claim.less, claim.than}]
    own = [one for one in own if not one.without]
    better = {one.better for one in own} - {""}
    if not own:
        verdict = UNTESTED
    elif better == {claim.less}:
        verdict = SUPPORTED
    else:
        verdict = CONTRADICTED if claim.than in better else OPEN
    said = []
    for one in own:
        sign = 1 if one.first == claim.than else -1
        low, high = sorted((sign * one.low, sign * one.high))
        numbers = (
            f"{1e3 * sign * one.mean:+.0f} m{one.unit} ({1e3 * low:+.0f} to {1e3 * high:+.0f})"
        )
        said.append(f"{one.component} {numbers}")
    what = f"Sizes of the errors of {claim.than} less those of {claim.less}"
    stops = f" at {own[0].n} stops" if own else ""
    reasons = f"{what}{stops}: {', '.join(said)}. {claim.note}" if said else claim.note
    return JudgedClaim(claim, verdict, reasons.strip())


def claims_section(judged: Sequence[JudgedClaim]) -> Section:
    """What the document concludes, and what the data say."""
    rows = [
        (number, one.claim.says, one.claim.source, one.verdict)
        for number, one in enumerate(judged, 1)
    ]
    table = Table(
        "Conclusions, and what the data of this campaign say of them",
        ("", "conclusion", "where", "verdict"),
        rows,
        note="Open: the data decide neither way, or it states no limit. Not tested: nothing in the "
        "campaign can tell.",
    )
    why = [Text(f"{number}: {one.reasons}") for number, one in enumerate(judged, 1) if one.reasons]
    return Section("Do the data support the conclusions?", [table, *why])
