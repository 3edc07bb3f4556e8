"""The report: everything in one file, nothing taken for markup, the same bytes every time."""

import re
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import pytest
from matplotlib.figure import Figure as MatplotlibFigure
from small_campaigns import FixedSystem, three_stops

from validation.campaign.folder import load_campaign
from validation.report.document import build_document
from validation.report.files import report_files
from validation.report.latex import latex_table
from validation.report.markdown import markdown_table
from validation.report.svg import inline_svg
from validation.results import Figure, Finding, Section, SystemResult, Table, Text
from validation.run import RunResult, run_campaign

NASTY = "<script>alert('x')</script> & | \\ {%\n_#^~ ]]> \"q\""


class Page(HTMLParser):
    """Tags and attributes of a page, and whether they nest."""

    VOID = frozenset({"meta", "link", "br", "img", "hr", "input"})

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.headings: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def draw() -> MatplotlibFigure:
    figure = MatplotlibFigure(figsize=(3, 2))
    axes = figure.add_subplot()
    axes.plot([0, 1], [1, 0], "o-")
    axes.set_title("a < b & c")
    return figure


@pytest.fixture(scope="module")
def nasty_run(tmp_path_factory) -> RunResult:
    """A campaign in which every text is an attempt at markup."""
    folder = tmp_path_factory.mktemp("nasty")
    (folder / "campaign.toml").write_text(
        "name = '''" + NASTY + "'''\ndescription = '''" + NASTY + "'''\n"
    )
    table = Table(NASTY, [NASTY, "x [m]"], [[NASTY, 0.5]], ["", ".3f"], NASTY)
    figure = Figure("nasty", NASTY, NASTY, draw)
    survey = SystemResult(
        tables=[three_stops("survey")],
        findings=[Finding("error", NASTY, NASTY)],
        sections=[Section(NASTY, [Text(NASTY), table, figure, figure])],
    )
    nasty = SystemResult(tables=[three_stops("rig", shift=0.01, sources=(NASTY, "", ""))])
    systems = [FixedSystem("survey", survey), FixedSystem("rig", nasty)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("validation.run.installed_systems", lambda: systems)
        return run_campaign(load_campaign(folder, frozenset()))


@pytest.fixture(scope="module")
def nasty_files(nasty_run) -> dict[str, str]:
    return report_files(nasty_run)[1]


@pytest.fixture(scope="module")
def ad23_page(ad23_run) -> str:
    folder, _ = ad23_run
    return (folder / "report/report.html").read_text()


def test_the_page_is_well_formed_and_its_ids_are_unique(nasty_files, ad23_page):
    for html in (nasty_files["report.html"], ad23_page):
        page = Page(html)
        assert page.open == []
        ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
        assert len(ids) == len(set(ids))
        references = [
            value[1:]
            for _, attributes in page.tags
            for name, value in attributes.items()
            if name in {"href", "xlink:href"} and value and value.startswith("#")
        ]
        references += re.findall(r"url\(#([^)]+)\)", html)
        for _, attributes in page.tags:
            references += (attributes.get("aria-labelledby") or "").split()
        assert set(references) <= set(ids)


def test_nothing_is_taken_for_markup(nasty_files):
    html = nasty_files["report.html"]
    assert "<script" not in html
    assert html.count("&lt;script&gt;") >= 10


def test_the_page_needs_nothing_else(ad23_page):
    page = Page(ad23_page)
    loading = [
        value
        for tag, attributes in page.tags
        for name, value in attributes.items()
        if name in {"src", "href", "xlink:href", "data", "srcset"} and value
        if not value.startswith(("#", "data:"))
    ]
    assert loading == []
    assert not any(tag in {"script", "iframe", "object"} for tag, _ in page.tags)
    assert "@import" not in ad23_page
    # What is left of addresses are the names of the XML vocabularies of SVG.
    addresses = set(re.findall(r"https?://[^\"'<>\s]+", ad23_page))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


def test_readers_who_cannot_see_are_served(ad23_page):
    page = Page(ad23_page)
    tags = [tag for tag, _ in page.tags]
    assert dict(page.tags)["html"]["lang"] == "en"
    for landmark in ("header", "nav", "main"):
        assert tags.count(landmark) == 1
    assert page.headings[0] == "h1"
    assert set(page.headings[1:]) == {"h2"}
    assert tags.count("caption") == tags.count("table") > 5
    assert all(a.get("scope") in {"col", "row"} for tag, a in page.tags if tag == "th")
    images = [a for tag, a in page.tags if tag == "svg"]
    assert len(images) >= 7
    assert all(a["role"] == "img" and a["aria-labelledby"] for a in images)
    boxes = [a for _, a in page.tags if a.get("class") == "scroll"]
    assert all(a["tabindex"] == "0" and a["role"] == "region" for a in boxes)
    assert all(a.get("aria-label") or a.get("aria-labelledby") for a in boxes)


def luminance(colour: str) -> float:
    """Relative luminance of '#rrggbb' or '#rgb', WCAG 2.2."""
    digits = colour.lstrip("#")
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    channels = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_every_text_colour_has_a_contrast_of_4_5(ad23_page):
    style = ad23_page.split("<style>")[1].split("</style>")[0]
    inks = re.findall(r"--(?:ink|quiet|link): (#\w+)", style)
    badges = re.findall(r"\.severity \{ background: (#\w+)", style)
    assert len(inks) == 3
    assert len(badges) == 4
    for colour in inks + badges:  # on white, and white on it
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5


def test_faults_of_the_survey_come_before_everything(nasty_run, nasty_files):
    document = build_document(nasty_run)
    assert document.alarm.startswith("The survey itself found errors")
    assert document.findings[0].severity == "error"
    html = nasty_files["report.html"]
    assert html.index('role="alert"') < html.index('id="facts"')


def test_a_sound_survey_raises_no_alarm(ad23_page):
    assert 'role="alert"' not in ad23_page


def test_the_printed_conclusion_is_in_the_page(ad23_page):
    # AD2.3, "Overall conclusions for indoor validation".
    for printed in ("0.08037", "0.03657", "0.04228", "0.09042", "-0.06543", "0.12173"):
        assert printed in ad23_page


def test_the_systems_own_sections_are_in_the_page(nasty_run):
    titles = [section.title for section in build_document(nasty_run).sections]
    assert titles[:3] == ["In short", "All systems", "Where the errors come from"]
    assert titles[3] == "System rig"
    # The survey stands in the appendix.
    assert titles[-2:] == [NASTY, "Inputs"]


def test_the_same_run_gives_the_same_bytes(nasty_run, nasty_files):
    assert report_files(nasty_run)[1] == nasty_files


def test_a_figure_is_an_image_with_a_name_and_ids_of_its_own():
    svg = inline_svg(Figure("f", "cap & <tion>", "what is seen", draw), "p1")
    root = ET.fromstring(svg)
    space = "{http://www.w3.org/2000/svg}"
    assert root.attrib["role"] == "img"
    assert "width" not in root.attrib
    assert "viewBox" in root.attrib
    assert root.findtext(f"{space}title") == "cap & <tion>"
    assert root.findtext(f"{space}desc") == "what is seen"
    assert all(e.attrib["id"].startswith("p1-") for e in root.iter() if "id" in e.attrib)
    assert "a &lt; b &amp; c" in svg
    assert "metadata" not in svg


TABLE = Table(
    "Poses of a|b & c_d",
    ["pose", "x [m]", "100 %"],
    [["7'", -0.5, None], ["[8]", 1.0, 2.0], ["*9*", float("nan"), 3.0]],
    ["", ".2f", ".1f"],
    "n < 3 ~\n5",
)


def test_a_table_in_markdown():
    assert markdown_table(TABLE).splitlines() == [
        r"**Poses of a\|b & c\_d**",
        "",
        r"| pose | x \[m\] | 100 % |",
        "|---|---:|---:|",
        "| 7' | -0.50 | – |",
        r"| \[8\] | 1.00 | 2.0 |",
        r"| \*9\* | – | 3.0 |",
        "",
        r"n \< 3 \~ 5",
    ]


def test_a_table_in_latex():
    assert latex_table(TABLE).splitlines() == [
        r"\begin{longtable}{lrr}",
        r"\caption{Poses of a\textbar{}b \& c\_d} \\",
        r"\toprule",
        r"pose & x [m] & 100 \% \\",
        r"\midrule",
        r"\endhead",
        r"7' & -0.50 & -- \\",
        r"{[8]} & 1.00 & 2.0 \\",
        r"{*9*} & -- & 3.0 \\",
        r"\bottomrule",
        (
            r"\multicolumn{3}{>{\raggedright\arraybackslash}p{0.9\linewidth}}"
            r"{\footnotesize n \textless{} 3 \textasciitilde{} 5} \\"
        ),
        r"\end{longtable}",
    ]


def test_all_tables_are_in_markdown_and_latex(nasty_run, nasty_files):
    count = len(build_document(nasty_run).tables)
    assert nasty_files["tables.tex"].count(r"\begin{longtable}") == count
    assert nasty_files["tables.md"].count("|---") >= count
    assert "<script>" not in nasty_files["tables.md"]
