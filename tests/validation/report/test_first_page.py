"""The first page answers three questions, and its tables fit a line of a paper."""

import re
from html import unescape

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from scipy import stats

from validation.poses.pose_table import PoseTable
from validation.report.latex import PAGE, latex_table
from validation.report.markdown import escaped
from validation.report.summary.first_page import first_lines, mean_text, three_sentences, verdict
from validation.report.summary.to_do import shown_by, to_do
from validation.results import Finding, Table, listed_ids, sentences
from validation.statistics.evaluation import evaluate


def evaluation(sigma, bias=0.0, n=40, name="rig", seed=1):
    """A system with independent Gaussian errors over n stops."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(-3, 3, (n, 3))
    off = rng.normal(size=(n, 3)) * [sigma, sigma, 0.001] + [bias, 0, 0]
    ids = tuple(str(k + 1) for k in range(n))
    return evaluate(PoseTable("survey", ids, true), PoseTable(name, ids, true - off))


LIMITS = (0.02, 0.02, np.inf)


@pytest.mark.parametrize(
    ("sigma", "bias", "expected"),
    [(0.005, 0.0, "yes"), (0.005, 0.05, "no"), (0.05, 0.0, "no"), (0.018, 0.0, "not shown")],
)
def test_a_verdict_is_what_is_shown(sigma, bias, expected):
    assert verdict(evaluation(sigma, bias), LIMITS) == expected


def test_neither_verdict_is_given_wrongly_more_often_than_stated():
    # At the limit itself either answer is an error: sigma = d is 'no' or 'yes' in 5 % a component.
    told = [verdict(evaluation(0.02, n=20, seed=seed), LIMITS) for seed in range(200)]
    assert told.count("yes") <= 10  # 5 % of 200, and both components must be lucky
    assert told.count("no") <= 0.1 * 200 + 3 * (200 * 0.1 * 0.9) ** 0.5


def test_three_sentences_answer_three_questions():
    both = [evaluation(0.004, name="good"), evaluation(0.06, name="bad", seed=2)]
    best, enough, following = (
        one.text for one in three_sentences(first_lines(both), "survey.", faulty=False)
    )
    assert best.startswith("good has the smallest position errors")
    assert best.endswith("that it errs less is shown.")
    assert "For 20 mm, good enough: good; not good enough: bad." in enough
    assert following == "Next: survey."


def test_what_to_do_begins_with_what_forbids_to_use_the_numbers():
    findings = [
        Finding("warning", "Odd. Because.", "laser", "odd"),
        Finding("error", "Mirrored. Turn it.", "vframe", "mirror"),
        Finding("note", "Nothing.", "laser", "nothing"),
    ]
    told = to_do(findings, [], None)
    assert [one.text for one in told] == ["Settle this first: Mirrored.", "Look at this: Odd."]


def test_the_reasoning_is_apart_from_the_sentence():
    assert sentences("Off by 3 mm (95 %: 1.2 to 4.8). It may turn. See.") == (
        "Off by 3 mm (95 %: 1.2 to 4.8).",
        "It may turn. See.",
    )


@pytest.mark.parametrize(
    ("mean", "half", "expected"),
    [
        (-0.00002, 0.1179, "0 ± 118"),
        (0.0804, 0.0569, "+80 ± 57"),
        (-0.00004, 0.00996, "0 ± 10"),
        (0.0012345, 0.0002, "+1.23 ± 0.20"),
        (0.0, 1e-7, "0.000 ± 0.000"),
        (-0.00001, np.nan, "0.0 ± withheld"),
        (np.nan, np.nan, "–"),
    ],
)
def test_a_mean_has_the_digits_of_its_interval_and_zero_no_sign(mean, half, expected):
    assert mean_text(mean, mean - half, mean + half) == expected


def advice(**kinds):
    """What to do about the only system, where nothing else was found."""
    return [one.text for one in to_do([], first_lines([evaluation(**kinds)]), None)]


def test_more_stops_are_advised_where_they_help_and_something_else_where_they_do_not():
    (few,) = advice(sigma=0.018, n=3)
    assert few == (
        "Survey 9 stops or more: 3 tell the spread of the errors only to a factor of 6.3."
    )
    (some,) = advice(sigma=0.046, n=12)
    assert re.match(r"Survey (1[3-9]|[2-9]\d|100) stops instead of 12: ", some)
    (spread,) = advice(sigma=0.044, n=20, seed=2)
    assert spread.startswith("More stops are not what helps: x ")
    (shifted,) = advice(sigma=0.01, bias=0.048, n=20, seed=2)
    assert shifted.startswith("Find what shifts its errors by +49 mm in x, and take it out: 20 ")


def test_what_a_hundred_stops_would_show_is_shown_as_often_as_said():
    (planned,) = evaluation(0.05, 0.01, n=100).statistics[:1]
    # With its own mean and spread as the truth: the farther of both bounds holds nine times of ten.
    limit, rng = shown_by(planned, 100), np.random.default_rng(3)
    runs = rng.normal(planned.mean, planned.std, (400, 100))
    bias = np.abs(runs.mean(1)) + stats.t.ppf(0.95, 99) * runs.std(1, ddof=1) / 10
    deviation = runs.std(1, ddof=1) * np.sqrt(99 / stats.chi2.ppf(0.05, 99))
    shown = np.mean((bias < limit) & (deviation < limit))
    assert abs(shown - 0.9) < 3.3 * np.sqrt(0.9 * 0.1 / 400)


def test_a_thousand_ids_are_counted():
    told = listed_ids([str(k) for k in range(2000)])
    assert told == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9 and 1990 more"


COLUMN = re.compile(r"p\{([\d.]+)pt\}")


def width(tex):
    """Points of a table whose columns have widths: them and their gaps."""
    gap = float(re.search(r"tabcolsep\}\{([\d.]+)pt", tex)[1])
    columns = [float(one) for one in COLUMN.findall(tex.split(r"\toprule")[0])]
    return sum(columns) + 2 * gap * len(columns)


def test_tables_of_a_paper_are_no_wider_than_a_line(ad23_run):
    folder, _ = ad23_run
    tables = (folder / "report/tables_paper.tex").read_text().split(r"\begin{table}")[1:]
    assert len(tables) == 2
    for tex in tables:
        assert width(tex) <= PAGE
        assert overfull(tex) == []


def overfull(tex):
    """Words that are wider than their column, by the outlines of Computer Modern."""
    size = re.search(r"(\\[a-z]+)\\setlength", tex)[1]
    points = {r"\footnotesize": 8, r"\scriptsize": 7, r"\tiny": 5}[size]
    # Small sizes are cut wider than the one of 10 pt: digits 4.25, 3.98, 3.4 against 0.5 em.
    wider = {8: 4.25 / 4, 7: 3.98 / 3.5, 5: 3.4 / 2.5}[points]
    font = FontProperties(family="cmr10")
    head, body = tex.split(r"\toprule", 1)
    columns = [float(one) for one in COLUMN.findall(head)]
    rows = re.findall(r"^(.+ & .+) \\\\$", body.split(r"\bottomrule")[0], re.MULTILINE)
    return [
        word
        for row in rows
        for cell, room in zip(row.replace(r"\_", "_").split(" & "), columns, strict=True)
        for word in cell.replace(r"$\pm$", "+").replace("\\", "").split()
        if TextPath((0, 0), word.replace("_", "x"), size=points, prop=font).get_extents().width
        * wider
        > room
    ]


def test_a_wide_long_table_gets_columns_that_share_the_line():
    table = Table("Wide", ["stop", "why", "x [m]"], [["1", "because it is so " * 20, 1.25]])
    tex = latex_table(table)
    assert width(tex) <= PAGE
    assert overfull(tex) == []


def test_on_paper_what_is_closed_says_where_it_is(ad23_run):
    folder, _ = ad23_run
    page = (folder / "report/report.html").read_text()
    main = page.split("<main")[1]
    summaries = re.findall(r"<summary>(.*?)</summary>", main, re.DOTALL)
    outside = [one for one in summaries if one != "Why, and what to do"]
    assert len(outside) > 10
    assert all('class="where"' in one for one in outside)
    # What is named holds them: all tables are in tables.md.
    tables = (folder / "report/tables.md").read_text()
    titles = re.findall(r"<summary>([^<(:]+) \(\d+ rows\)", main)
    assert [one for one in map(unescape, titles) if escaped(one) not in tables] == []
