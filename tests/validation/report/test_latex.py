"""Tables as LaTeX takes them: compiled where pdflatex is there, measured everywhere."""

import re
import shutil
import string
import subprocess

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from validation.poses.pose_table import PoseTable
from validation.report.document import Document
from validation.report.latex import PAGE, SIZES, escaped, latex_paper, latex_table, points_of
from validation.report.summary.first_page import first_lines, first_table
from validation.results import Table
from validation.statistics.evaluation import evaluate

PRINTABLE = string.ascii_letters + string.digits
needs_latex = pytest.mark.skipif(
    shutil.which("pdflatex") is None, reason="pdflatex is not installed; CI has it"
)
NAMES = ("a_b%", "x & y #2 {1}", "~^\\", '$5 <b> "q" |é Δt ß|', "W" * 70, "[1] *", "日本")
"""Names of stops and observers that mean something to LaTeX, or that are too long for a column."""
PREAMBLE = (
    r"\documentclass[10pt,a4paper]{article}\usepackage[T1]{fontenc}"
    r"\usepackage{array,booktabs,longtable}\textwidth455pt\oddsidemargin0pt\begin{document}"
)


def compiled(folder, *texts):
    """What pdflatex complains of."""
    (folder / "it.tex").write_text("\n".join([PREAMBLE, *texts, r"\end{document}"]))
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "it.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    said = done.stdout.decode("latin1")
    assert done.returncode == 0, said[-2000:]
    return re.findall(r"^(?:Overfull|Underfull|Missing character).*", said, re.MULTILINE)


def lab_tables():
    """The tables of a paper of systems whose names hold _ and -, and are long."""
    rng = np.random.default_rng(1)
    ids = tuple(map(str, range(12)))
    truth = rng.uniform(-3, 3, (12, 3))
    survey = PoseTable("survey", ids, truth)
    systems = ["a_b", "laser_scanmatch_with_a_mount-v2", "x" * 60, "W_" * 20]
    found = [
        evaluate(survey, PoseTable(name, ids, truth + rng.normal(0, 0.02 * 30**k, (12, 3)) / 30))
        for k, name in enumerate(systems)
    ]
    return first_table(first_lines(found))


def long_table():
    """Every name in cells, headings and the title, in a table wider than the line."""
    rows = [[name, 1.5 * k, "because it is so " * 9, name] for k, name in enumerate(NAMES * 30)]
    return Table(
        f"{NAMES[0]} {NAMES[1]} {NAMES[3]} {NAMES[4]}",
        [NAMES[0], "x [m]", NAMES[1], "who"], rows, ["", ".4f", "", ""], " ".join(NAMES),
    )  # fmt: skip


@needs_latex
def test_tables_of_a_run_compile_without_an_overfull_box(tmp_path, ad23_run):
    folder, _ = ad23_run
    report = folder / "report"
    assert compiled(tmp_path, (report / "tables_paper.tex").read_text()) == []
    assert compiled(tmp_path, (report / "tables.tex").read_text()) == []


@needs_latex
def test_tables_with_any_names_compile_without_an_overfull_box(tmp_path):
    paper = latex_paper(Document("", "", "", (), (), (), paper=tuple(lab_tables())))
    short = Table("Short", ["a_b", "100 %"], [[name, k] for k, name in enumerate(NAMES[:4])])
    said = compiled(tmp_path, paper, latex_table(long_table()), latex_table(short))
    # Seventy W are broken where the line ends, and then do not fill it.
    assert [one for one in said if not one.startswith("Underfull")] == []


def test_no_character_is_wider_than_it_is_taken_for():
    font = FontProperties(family="cmr10")
    for character in PRINTABLE:
        # Outlines leave out the room beside a letter, which is a bit on both sides.
        path = TextPath((0, 0), character * 8, size=10, prop=font)
        assert path.get_extents().width / 8 <= points_of(character) + 0.05, character


def test_tables_are_no_wider_than_a_line():
    for tex in (latex_table(long_table()), *map(latex_table, lab_tables())):
        head = tex.split(r"\toprule")[0]
        columns = [float(one) for one in re.findall(r"p\{([\d.]+)pt\}", head)]
        gap = float(re.search(r"tabcolsep\}\{([\d.]+)pt", tex)[1])
        assert sum(columns) + 2 * gap * len(columns) <= PAGE
        size = SIZES[re.search(r"(\\[a-z]+)\\setlength", tex)[1]]
        for row in re.findall(r"^(.+ & .+) \\\\$", tex, re.MULTILINE):
            for cell, room in zip(re.split(r"(?<!\\) & ", row), columns, strict=True):
                for word in re.split(r" |\\allowbreak\{\}", cell):
                    bare = re.sub(r"\\text[a-z]+\{\}|\\[`'^~=u.\"rHvc]\{(.)\}|\$[^$]+\$", "x", word)
                    assert size * points_of(re.sub(r"\\(.)", r"\1", bare).strip("{}")) <= room


def test_every_character_becomes_something_that_latex_knows():
    assert escaped("a_b % & # Δ é ő 3 × 4 ≤ 5²") == (
        r"a\_b \% \& \# delta \'{e} \H{o} 3 $\times$ 4 $\leq$ 5$^2$"
    )
    assert escaped("日").isascii()
