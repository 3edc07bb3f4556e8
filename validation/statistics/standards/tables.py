"""The chapter of the report in the words of standards."""

from collections.abc import Sequence

from validation.results import Section, Table, Text
from validation.statistics.standards.repeats import CYCLES
from validation.statistics.standards.summary import Standards
from validation.statistics.standards.tolerance import fewest_values

TITLE = "In the words of standards"
Value = str | int | float | None


def standards_section(found: Sequence[Standards]) -> Section:
    """Tolerance, success, repeats, En numbers and budget of all systems, folded."""
    blocks = [tolerance_table(found), success_table(found)]
    blocks += [table for table in (repeats_table(found), en_table(found)) if table.rows]
    blocks.append(budget_table(found))
    told = "Formulas and assumptions: the page 'In the words of standards' of the documentation."
    return Section(TITLE, [*blocks, Text(told)], folded=True)


def tolerance_table(found: Sequence[Standards]) -> Table:
    """What a share of all errors stays below."""
    content, confidence = (f"{100 * v:g} %" for v in (found[0].content, found[0].confidence))
    rows: list[list[Value]] = [
        [
            *(one.system, f"{part.name} [{part.unit}]", part.n, part.low, part.high),
            *(part.bound, part.free.bound, part.free.reached, part.reason),
        ]
        for one in found
        for part in one.tolerances
    ]
    columns = ["system", "error", "n", "low", "high", "size below", "by order", "reached", "remark"]
    note = (
        f"ISO 16269-6: {content} of all errors are within low and high, and {content} of their "
        f"sizes below the bound, with {confidence} confidence. Low, high and 'size below' assume "
        "normal, independent errors; 'by order' assumes independent ones only and takes "
        f"{fewest_values(found[0].content, found[0].confidence)} stops: with fewer, 'reached' is "
        "the confidence with which the largest is a bound."
    )
    formats = ["", "", "d", *[".4f"] * 4, ".2f", ""]
    return Table("Tolerance intervals of the errors", columns, rows, formats, note)


def success_table(found: Sequence[Standards]) -> Table:
    """How often a stop is within the limits."""
    rows: list[list[Value]] = [
        [
            *(one.system, one.success.n, one.success.successes, one.success.low),
            *(
                one.success.needed,
                "" if one.success_holds else "does not hold: stops depend on each other",
            ),
        ]
        for one in found
    ]
    first = found[0]
    note = (
        f"ASTM F3499: a stop succeeds within {first.limits[0]:g} m and {first.limits[1]:g} rad. "
        f"'shown': probability of success with {100 * first.confidence:g} % confidence (Clopper "
        "and Pearson), for independent stops. 'needed': stops without a failure that would show "
        f"{100 * first.content:g} %."
    )
    columns = ["system", "stops", "successes", "shown", "needed", "remark"]
    return Table("Probability of success", columns, rows, ["", "d", "d", ".3f", "d", ""], note)


def repeats_table(found: Sequence[Standards]) -> Table:
    """Accuracy and repeatability of places visited again."""
    rows: list[list[Value]] = [
        [
            *(one.system, place.place, place.n, place.accuracy, place.repeatability),
            *(place.accuracy_angle, place.repeatability_angle),
        ]
        for one in found
        for place in one.repeats
    ]
    note = (
        f"ISO 9283 asks for {CYCLES} visits. The surveyed pose stands for the commanded one, so "
        "that the noise of the survey is in all numbers."
    )
    columns = ["system", "pose", "visits", "AP [m]", "RP [m]", "AP [rad]", "RP [rad]"]
    title = "Accuracy and repeatability of poses visited again"
    return Table(title, columns, rows, ["", "", "d", *[".4f"] * 4], note)


def en_table(found: Sequence[Standards]) -> Table:
    """Whether system and survey agree within what both state."""
    rows: list[list[Value]] = [
        [one.system, part.name, part.n, part.satisfactory, part.largest, part.stop]
        for one in found
        for part in one.agreements
    ]
    note = (
        "ISO 13528: up to 1 in size is satisfactory. Independent results are assumed: of a system "
        "whose frame or mount was made from the survey, En numbers are too small."
    )
    columns = ["system", "component", "n", "satisfactory", "largest", "at"]
    return Table("En numbers", columns, rows, ["", "", "d", "d", ".2f", ""], note)


def budget_table(found: Sequence[Standards]) -> Table:
    """What each source contributes to the error of one pose."""
    names = dict.fromkeys(
        line.name for one in found for made in one.budgets for line in made.contributions
    )
    rows: list[list[Value]] = []
    for one in found:
        for made in one.budgets:
            lines = {line.name: line.uncertainty for line in made.contributions}
            freedom = made.freedom if made.freedom < 1e6 else None
            rows.append(
                [
                    *(one.system, f"{made.name} [{made.unit}]"),
                    *(lines.get(name) for name in names),
                    *(made.combined, freedom, made.coverage, made.expanded),
                ]
            )
    confidence = f"{100 * found[0].confidence:g} %"
    note = (
        "JCGM 100 (GUM): standard uncertainties of what makes up validation minus system at one "
        "stop, once the systematic part is taken out; u combined, effective degrees of freedom "
        f"(Welch and Satterthwaite; blank: infinite), coverage factor k, and U = k u for "
        f"{confidence}. Where the survey states no uncertainty, it is in the noise."
    )
    columns = ["system", "error", *names, "u", "dof", "k", "U"]
    formats = ["", "", *[".4f"] * len(names), ".4f", ".0f", ".2f", ".4f"]
    return Table("Uncertainty budget", columns, rows, formats, note)
