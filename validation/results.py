"""What a system hands over: poses, findings, and blocks for the report."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, get_args

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.poses.pose_table import PoseTable
    from validation.poses.trajectory import Trajectory
    from validation.text_files.writing import Content

VALIDATION_SYSTEM = "survey"
"""The system whose poses the others are compared with."""

AS_PUBLISHED = "_as_published"
"""Ends the name of a table that has a system's poses by the way of a document, from the same data:
it stands beside the system's own, and is no witness of its own."""
APPENDIX = "Appendix"
"""Sections whose title begins so are the last of the report."""
TableColumn = tuple[str, str, Iterable[str | int | float | None]]
"""Heading with its unit, format of the numbers (or ''), and values from the top."""
MOST_LISTED = 30
"""Ids that a sentence lists; of more it gives the first and the count. The longest list of the
published campaign has 13."""
Severity = Literal["good", "note", "warning", "error"]


def listed_ids(ids: Sequence[str], most: int = MOST_LISTED) -> str:
    """'3, 9, 14'; of many the first ten, and how many more there are."""
    if len(ids) <= most:
        return ", ".join(ids)
    return f"{', '.join(ids[:10])} and {len(ids) - 10} more"


_END_OF_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z'`])")


def sentences(text: str) -> tuple[str, str]:
    """The first sentence of a text, and the reasoning that follows."""
    first, *rest = _END_OF_SENTENCE.split(text, maxsplit=1)
    return first, " ".join(rest)


TWO_SIDED = 1.96
"""Standard deviations of a two-sided 95 % interval of a normal error."""


@dataclass(frozen=True)
class Size:
    """How large something that was found is.

    Parameters
    ----------
    of : str
        What is measured: 'mean error in x', 'mount x'.
    value : float
        How large it is.
    unit : str
        'm', 'rad', 's', 'poses'; empty for a ratio.
    low, high : float
        Its interval; NaN where none is given.
    confidence : float
        Of the interval; NaN without one.
    """

    of: str
    value: float
    unit: str = ""
    low: float = math.nan
    high: float = math.nan
    confidence: float = math.nan

    @classmethod
    def normal(cls, of: str, value: float, sigma: float, unit: str = "") -> "Size":
        """With the 95 % interval of a normal error of standard deviation ``sigma``."""
        value, half = float(value), TWO_SIDED * float(sigma)
        return cls(of, value, unit, value - half, value + half, 0.95)


SPOILT = "poses that it spoils"
"""What a size is of where an error names a cause of wrong poses (`explain.telling.folded`)."""


@dataclass(frozen=True)
class Finding:
    """One sentence that a person should read.

    Parameters
    ----------
    severity : {"good", "note", "warning", "error"}
        'error' means that numbers must not be used before it is settled.
    text : str
        What was found and what to do about it.
    subject : str
        What it is about: 'pose 7', 'vframe', 'vision'.
    code : str
        Stable short name for scripts: 'blunder', 'mirror', ...
    sizes : tuple of Size
        How large it is, the most important first; empty where nothing was measured, as of a file
        that is missing.
    sentence : str
        The first sentence of the text: what was found. The rest says why, and what to do.

    Raises
    ------
    ValueError
        For another severity.
    """

    severity: Severity
    text: str
    subject: str = ""
    code: str = ""
    sizes: tuple[Size, ...] = ()
    sentence: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", sentences(self.text)[0])
        if self.severity not in get_args(Severity):
            raise ValueError(f"a finding is {', '.join(get_args(Severity))}, not '{self.severity}'")


@dataclass(frozen=True)
class Table:
    """A table for terminal, HTML, Markdown and LaTeX; rendered in ``validation.report``.

    Parameters
    ----------
    title : str
        What it shows; also its caption.
    columns : sequence of str
        Headings with their units: 'x [m]'.
    rows : sequence of sequences
        str, int, float or None (no value).
    formats : sequence of str, optional
        Format of the numbers of each column, as for `format`: '.4f'. Empty: as they are.
    note : str
        A sentence under the table.
    folded : bool
        Whether a page shows only its title until it is opened; a long table always is.

    Raises
    ------
    ValueError
        If a row or the formats do not match the columns.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str | int | float | None]]
    formats: Sequence[str] = ()
    note: str = ""
    folded: bool = False

    def __post_init__(self) -> None:
        wrong = {len(row) for row in self.rows} - {len(self.columns)}
        if wrong or len(self.formats) not in {0, len(self.columns)}:
            raise ValueError(
                f"table '{self.title}': {len(self.columns)} columns, {len(self.formats)} formats, "
                f"rows of {sorted(wrong) or 'that length'}"
            )

    @classmethod
    def of_columns(
        cls,
        title: str,
        columns: "Sequence[TableColumn]",
        note: str = "",
    ) -> "Table":
        """A table from its columns."""
        headings, formats, values = zip(*columns, strict=True)
        return cls(title, headings, list(zip(*values, strict=True)), formats, note)


@dataclass(frozen=True)
class Figure:
    """A figure that is drawn only when a report wants it.

    Parameters
    ----------
    name : str
        File name without ending, unique in the report.
    caption : str
        What it shows, in a sentence.
    alternative : str
        What a reader who cannot see it should know.
    draw : callable
        Returns a matplotlib Figure.
    folded : bool
        Whether a page shows only its caption until it is opened.
    """

    name: str
    caption: str
    alternative: str
    draw: "Callable[[], MatplotlibFigure]"
    folded: bool = False


@dataclass(frozen=True)
class Text:
    """A paragraph of plain text."""

    text: str


@dataclass(frozen=True)
class Section:
    """A part of the report; of a folded one a page shows the title, until it is opened."""

    title: str
    blocks: Sequence[Table | Figure | Text]
    folded: bool = False


@dataclass(frozen=True)
class SystemResult:
    """All that one system makes of a campaign.

    Parameters
    ----------
    tables : sequence of PoseTable
        One for each variant of the system; written to results/poses_<system>.csv.
    findings : sequence of Finding
        In the order in which they should be read.
    sections : sequence of Section
        For the report.
    files : mapping of str to str or bytes
        Further files, named relative to results/.
    facts : mapping
        Numbers for ``--json`` and results/run.json.
    landmarks : mapping of str to (float, float)
        Named points of the room map, in the GTV frame.
    overview : sequence of Table
        What a terminal shows after this system has been solved by itself.
    trajectories : sequence of Trajectory
        Poses on the move, in the GTV frame unless said otherwise; compared in time.
    without_poses : bool
        That there is none is what was found, and no failure: a receiver that was never RTK-fixed.
    """

    tables: "Sequence[PoseTable]" = ()
    findings: Sequence[Finding] = ()
    sections: Sequence[Section] = ()
    files: "Mapping[str, Content]" = field(default_factory=dict)
    facts: Mapping[str, object] = field(default_factory=dict)
    landmarks: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    overview: Sequence[Table] = ()
    trajectories: "Sequence[Trajectory]" = ()
    without_poses: bool = False
