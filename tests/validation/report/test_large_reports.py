"""Reports of many poses: what nobody can read is not drawn."""

import numpy as np

from validation.figures.errors import MOST_NAMES, error_against_heading
from validation.poses.pose_table import PoseTable
from validation.report.checked import MOST_ROWS, checked_sections
from validation.report.svg import drawn_svg
from validation.results import Figure, Section, Table
from validation.statistics.comparison import compare


def test_a_table_of_too_many_rows_has_the_first_and_says_so():
    def made(rows):
        table = Table("poses", ["pose"], [[number] for number in range(rows)], note="All of them.")
        (section,) = checked_sections([Section("Poses", [table])], [])
        return section.blocks[0]

    assert made(MOST_ROWS).note == "All of them."
    shortened = made(MOST_ROWS + 5)
    assert len(shortened.rows) == MOST_ROWS
    assert shortened.rows[-1] == [MOST_ROWS - 1]
    assert f"The first {MOST_ROWS} of {MOST_ROWS + 5} rows" in shortened.note


def many(system, n, shift=0.0):
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(0, 9, (n, 2)), rng.uniform(-3, 3, n)])
    ids = tuple(map(str, range(n)))
    return PoseTable(system, ids, poses + shift * rng.standard_normal((n, 3)))


def test_few_of_many_poses_are_named():
    drawn = error_against_heading(compare(many("survey", 900), many("rig", 900, 0.01)))
    assert [len(axes.texts) for axes in drawn.axes] == [MOST_NAMES] * 3


def test_many_arrows_are_an_image_and_few_are_lines():
    from matplotlib.figure import Figure as Drawn

    def size(arrows):
        def draw():
            figure = Drawn(figsize=(4, 4))
            figure.subplots().quiver(*np.random.default_rng(2).normal(size=(4, arrows)))
            return figure

        return drawn_svg(Figure("arrows", "", "", draw))

    assert "<image" not in size(50)
    large = size(5000)
    assert "<image" in large
    assert len(large) < 400_000
