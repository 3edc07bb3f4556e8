"""What the report says, in order, before any format: the one source of HTML, Markdown, LaTeX."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

from validation.report.beside import beside_section
from validation.report.checked import checked_sections, section_or_sentence
from validation.report.evaluation_tables import (
    coverage_table,
    magnitude_table,
    overview_table,
    pose_table,
    statistics_table,
)
from validation.report.summary.evidence import dependence_table, evidence_figure
from validation.report.summary.first_page import first_lines, first_section, first_table
from validation.report.summary.to_do import ToDo, to_do
from validation.report.terminal import most_severe_first
from validation.results import (
    APPENDIX,
    VALIDATION_SYSTEM,
    Figure,
    Finding,
    Section,
    SystemResult,
    Table,
    Text,
)
from validation.run import RunResult
from validation.solving import unexpected
from validation.statistics.evaluation import Evaluation

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

SHORT = "In short"
DETAILS = ("explain_heading_", "explain_ellipses")
"""Figures that stand closed: what they show is in another figure or in a table too."""
FAULTY = (
    "The survey itself found errors (listed first among the findings). Until they are settled, "
    "neither the validation poses nor any error computed from them may be used."
)


@dataclass(frozen=True)
class Document:
    """The report, ready to be set.

    Parameters
    ----------
    title : str
        Name of the campaign.
    description : str
        One sentence on it.
    alarm : str
        What has to be read before anything else; mostly empty.
    facts : sequence of (str, str)
        What, and its value.
    findings : sequence of Finding
        The most severe first.
    sections : sequence of Section
        In reading order.
    overview : Section, optional
        That of the sections which sums up all systems: it is read before the findings.
    failures : sequence of SystemResult
        What stands in for parts that could not be made.
    to_do : sequence of ToDo
        What to measure, look at or repeat, the most valuable first.
    paper : sequence of Table
        Narrow tables for a paper.
    tables_in : str
        What holds all tables: paper says so in place of those that are closed.
    """

    title: str
    description: str
    alarm: str
    facts: Sequence[tuple[str, str]]
    findings: Sequence[Finding]
    sections: Sequence[Section]
    overview: Section | None = None
    failures: Sequence[SystemResult] = ()
    to_do: Sequence[ToDo] = ()
    paper: Sequence[Table] = ()
    tables_in: str = "tables.md"

    @property
    def tables(self) -> list[Table]:
        """All tables in reading order."""
        return [b for section in self.sections for b in section.blocks if isinstance(b, Table)]


def build_document(run: RunResult) -> Document:
    """The report of a run, its figures drawn; of a part that fails it says so."""
    settings = run.campaign.settings
    failures: list[SystemResult] = []
    told = run.explained.explanation if run.explained else None
    overview, todo, paper = None, [], []
    if run.evaluations:
        try:
            lines = first_lines(run.evaluations, told)
            todo, paper = to_do(run.findings, lines, told), first_table(lines)
            first = f"{todo[0].subject}: {todo[0].text}" if todo else ""
            room, faulty = settings.room, run.validation_is_faulty
            make = partial(first_section, lines, first, room.walls, run.landmarks, faulty=faulty)
            overview = section_or_sentence(SHORT, make, failures)
        except Exception as error:  # noqa: BLE001  (the first page must not take the report)
            failures.append(unexpected(f"report: {SHORT}", error))
    own = checked_sections(run.sections, failures)
    last = [section for section in own if section.title.startswith(APPENDIX)]
    surveyed = {
        one.title
        for system in run.systems
        if system.name == VALIDATION_SYSTEM
        for one in system.result.sections
    }
    survey = [one for one in own if one not in last and one.title in surveyed]
    sections = [
        *([overview] if overview is not None else []),
        *_system_sections(run, failures),
        *(one for one in own if one not in last and one not in survey),
        *checked_sections(run.statements.sections, failures),
        *checked_sections([beside] if (beside := _beside(run)) is not None else (), failures),
        *checked_sections(run.in_time.sections if run.in_time else (), failures),
        *checked_sections(run.statements.last_sections, failures),
        *survey,
        *last,
        _inputs_section(run),
    ]
    return Document(
        title=settings.name,
        description=settings.description,
        alarm=FAULTY if run.validation_is_faulty else "",
        facts=_facts(run),
        findings=most_severe_first(run.with_failures(failures).findings),
        sections=sections,
        overview=overview,
        failures=failures,
        to_do=todo,
        paper=paper,
    )


def _beside(run: RunResult) -> Section | None:
    return beside_section(run.tables, run.evaluations)


def _system_sections(run: RunResult, failures: list[SystemResult]) -> list[Section]:
    """All systems together, then the evidence by system: its errors, and where they come from."""
    explained = {one.title: one for one in run.explained.sections} if run.explained else {}
    sections = []
    if run.evaluations:
        make = partial(_overview_section, run.evaluations)
        sections.append(section_or_sentence("All systems", make, failures))
    for one in run.evaluations:
        make = partial(_evaluation_section, run, one)
        sections.append(section_or_sentence(f"System {one.system}", make, failures))
        cause = explained.pop(f"Where the errors of {one.system} come from", None)
        sections += checked_sections([_folded(cause)] if cause is not None else (), failures)
    general = checked_sections((_folded(one) for one in explained.values()), failures)
    return [*sections[:1], *general, *sections[1:]]


def _folded(section: Section) -> Section:
    """The section with its figures of detail folded."""
    blocks: Iterable[Table | Figure | Text] = (
        replace(one, folded=True)
        if isinstance(one, Figure) and one.name.startswith(DETAILS)
        else one
        for one in section.blocks
    )
    return replace(section, blocks=list(blocks))


def _facts(run: RunResult) -> list[tuple[str, str]]:
    """What a reader must know of the campaign, as far as it is stated."""
    settings = run.campaign.settings
    instrument = settings.instrument
    poses = "none" if run.validation is None else str(len(run.validation))
    taken_over = {} if run.validation is None else run.validation.provenance
    source = str(taken_over.get("published") or taken_over.get("file") or "")
    if "published" in taken_over:
        poses += f", taken over from {source}"
    surveyed = any(system.name == VALIDATION_SYSTEM for system in run.systems)
    surveyed &= "published" not in taken_over
    hand_laser = f"{instrument.model}, ±{1000 * instrument.tolerance:g} mm"
    if "instrument" not in settings.model_fields_set:
        hand_laser += " (assumed: campaign.toml has no [instrument])"
    if not surveyed:
        hand_laser = ""
    stated = [
        ("place", settings.place),
        ("date", settings.date),
        ("instrument", hand_laser),
        ("validation poses", poses),
        ("systems compared", ", ".join(one.system for one in run.evaluations) or "none"),
        *settings.facts.items(),
        ("made with", f"gtval {version('gtval')}"),
    ]
    return [(name, value) for name, value in stated if value]


def _overview_section(evaluations: Sequence[Evaluation]) -> Section:
    strips = Figure(
        "error_strips",
        "Every error, with the mean (tick) and its interval (bar) below the points.",
        "Errors of each component as points, one row for each system. The numbers are in the "
        "tables of the systems.",
        partial(_draw, "error_strips", evaluations),
    )
    return Section(
        "All systems", [overview_table(evaluations), strips, coverage_table(evaluations)]
    )


def _evaluation_section(run: RunResult, evaluation: Evaluation) -> Section:
    """Tables and figures of one system."""
    comparison, system = evaluation.comparison, evaluation.system
    told = run.explained.explanation if run.explained else None
    known = {one.system: one for one in told.systems} if told is not None else {}
    times = told.question.times if told is not None else None
    blocks: list[Table | Figure | Text] = [statistics_table(evaluation)]
    evidence = evidence_figure(evaluation, known.get(system), times)
    blocks += [evidence] if evidence is not None else []
    dependence = dependence_table(evaluation, known.get(system))
    blocks += [dependence] if dependence is not None else []
    lengths = [component for component in comparison.components if component.kind == "length"]
    own = known.get(system)
    # The explanation draws both, with what it takes away.
    drawn = own is not None and own.settled is not None
    if len(lengths) >= 2 and not drawn:
        walls, landmarks = run.campaign.settings.room.walls, run.landmarks
        blocks.append(
            Figure(
                f"error_map_{system}",
                "Errors on the map of the room. Dots: validation poses; arrows: from there "
                "towards the GT pose, enlarged by the factor in the title.",
                f"Map with an arrow for each of the {len(comparison)} poses of {system}. The "
                "numbers are in the table of its poses.",
                partial(_draw, "error_map", comparison, walls, landmarks),
                folded=True,
            )
        )
    turns = any(component.name in {"theta", "yaw"} for component in comparison.components)
    if turns and not drawn:
        blocks.append(
            Figure(
                f"error_heading_{system}",
                "Errors against the heading of the robot. A wrong sensor mount shows as a wave "
                "of one period; noise does not. Named are the poses farthest from the median.",
                f"Scatter plots of the errors of {system} over the heading, a component each.",
                partial(_draw, "error_against_heading", comparison),
                folded=True,
            )
        )
    blocks += [pose_table(comparison), magnitude_table(comparison)]
    return Section(f"System {system}", blocks)


def _draw(name: str, *arguments: object) -> "MatplotlibFigure":
    """A figure of `validation.figures.errors`, which is imported only when something is drawn."""
    from validation.figures import errors as figures  # noqa: PLC0415  (half a second that other formats do without)

    draw: Callable[..., MatplotlibFigure] = getattr(figures, name)
    return draw(*arguments)


def _inputs_section(run: RunResult) -> Section:
    rows = [[name, digest] for name, digest in run.inputs.items()]
    note = "Versions, settings and seeds are in results/run.json."
    return Section(
        "Inputs", [Table("Files of the campaign folder", ["file", "SHA-256"], rows, note=note)]
    )
