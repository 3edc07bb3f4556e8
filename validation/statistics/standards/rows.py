"""standards.csv: every number in the words of standards, one a row."""

from collections.abc import Iterator, Sequence

from validation.statistics.standards.from_errors import DEPENDENT
from validation.statistics.standards.summary import Standards
from validation.text_files.csv_text import csv_text

Row = tuple[str, str, str, float, str, int, str]


def standards_csv(found: Sequence[Standards]) -> str:
    """One row a number: ``system,method,subject,quantity,value,unit,n,confidence,remark``."""
    header = [
        *("system", "method", "subject", "quantity", "value", "unit"),
        *("n", "confidence", "remark"),
    ]
    rows = [[one.system, *row[:-1], one.confidence, row[-1]] for one in found for row in _rows(one)]
    return csv_text(header, rows)


def _rows(one: Standards) -> Iterator[Row]:
    """Method, subject, quantity, value, unit, n and remark."""
    share = f"{100 * one.content:g} %"
    for part in one.tolerances:
        for name, value in (
            (f"low end that holds {share}", part.low),
            (f"high end that holds {share}", part.high),
            (f"{share} of sizes below, normal", part.bound),
            (f"{share} of sizes below, by order", part.free.bound),
        ):
            yield "ISO 16269-6", part.name, name, value, part.unit, part.n, part.reason
    done = one.success
    remark = "" if one.success_holds else f"does not hold: {DEPENDENT}"
    limits = f"within {one.limits[0]:g} m and {one.limits[1]:g} rad"
    yield "ASTM F3499", limits, "successes", float(done.successes), "", done.n, remark
    yield "ASTM F3499", limits, "probability of success at least", done.low, "", done.n, remark
    for place in one.repeats:
        few = "" if place.enough else "fewer visits than the standard asks for"
        for name, value, unit in (
            ("AP_P", place.accuracy, "m"),
            ("RP_l", place.repeatability, "m"),
            ("AP_a", place.accuracy_angle, "rad"),
            ("RP_a", place.repeatability_angle, "rad"),
        ):
            yield "ISO 9283", place.place, name, value, unit, place.n, few
    for agreed in one.agreements:
        where = f"at {agreed.stop}"
        yield "ISO 13528", agreed.name, "satisfactory", float(agreed.satisfactory), "", agreed.n, ""
        yield "ISO 13528", agreed.name, "largest En", agreed.largest, "", agreed.n, where
    n = one.success.n
    for made in one.budgets:
        lacking = f"not told apart: {', '.join(made.missing)}" if made.missing else ""
        for line in made.contributions:
            name = f"u of {line.name}"
            yield "JCGM 100", made.name, name, line.uncertainty, made.unit, n, lacking
        yield "JCGM 100", made.name, "u combined", made.combined, made.unit, n, lacking
        yield "JCGM 100", made.name, "effective degrees of freedom", made.freedom, "", n, lacking
        yield "JCGM 100", made.name, "coverage factor", made.coverage, "", n, lacking
        yield "JCGM 100", made.name, "U expanded", made.expanded, made.unit, n, lacking
