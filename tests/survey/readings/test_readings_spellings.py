"""One set of readings in many spellings: read rightly, or refused with what to do about it."""

import io
import re

import pytest

from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError

TOML = """\
name = "spellings"
[instrument]
tolerance = 0.0015
range_max = 60.0
[vframe]
pole_length = 2.5
[robot_frame]
points = { O = [0.0, 0.0], X = [0.6, 0.0], Y = [0.0, 0.4] }
[survey]
world_points = ["1", "2", "mark_3"]
"""
TRUE = (
    ("O", "X", 2.504),
    ("O", "Y", 2.493),
    ("X", "XY", 2.497),
    ("O", "1", 3.431),
    ("7/O", "2", 5.385),
    ("7/X", "mark_3", 12.025),
    ("7/X", "1", 0.812),
)
HEAD = "time,from,to,distance,observer"


def written(form=lambda d: f"{d:.3f}", head=HEAD, sep=",", top="", quote=""):
    """The readings as text, each distance in some form."""
    lines = [
        sep.join(("2026-03-04T09:00", a, b, f"{quote}{form(d)}{quote}", "A")) for a, b, d in TRUE
    ]
    return top + "\n".join([head.replace(",", sep), *lines]) + "\n"


def comma(d):
    return f"{d:.3f}".replace(".", ",")


def feet(d):
    return f"{d / 0.3048:.4f}"


def eighths(d, form="{}' {} {}/16\""):
    sixteenths = round(d / 0.0254 * 16)
    return form.format(sixteenths // 192, sixteenths % 192 // 16, sixteenths % 16)


def inches(d):
    sixteenths = round(d / 0.0254 * 16)
    return f"{sixteenths // 16} {sixteenths % 16}/16"


def xlsx(rows):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def ods(rows):
    opendocument = pytest.importorskip("odf.opendocument")
    from odf.table import Table, TableCell, TableRow
    from odf.text import P

    document = opendocument.OpenDocumentSpreadsheet()
    sheet = Table(name="readings")
    for cells in rows:
        row = TableRow()
        for cell in cells:
            number = isinstance(cell, float)
            kind = {"valuetype": "float", "value": cell} if number else {"valuetype": "string"}
            made = TableCell(**kind)
            made.addElement(P(text=str(cell)))
            row.addElement(made)
        sheet.addElement(row)
    document.spreadsheet.addElement(sheet)
    stream = io.BytesIO()
    document.write(stream)
    return stream.getvalue()


def sheet_rows(head=("from", "to", "distance"), number=lambda d: d):
    """As a spreadsheet holds them: names that are numbers are numbers."""
    return [
        head,
        *([a, float(b) if b.isdigit() else b, number(d)] for a, b, d in TRUE),
    ]


@pytest.fixture
def load(tmp_path):
    def loaded(content, name="readings.csv", toml=TOML):
        (tmp_path / "campaign.toml").write_text(toml)
        (tmp_path / "survey").mkdir(exist_ok=True)
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / "survey" / name).write_bytes(data)
        campaign = load_campaign(tmp_path)
        return load_readings(campaign, campaign.section("survey", SurveySettings))

    return loaded


MM = {"units": "mm"}
READ = {
    "plain": (written(), {}),
    "semicolons": (written(sep=";"), {}),
    "semicolons and decimal commas": (written(comma, sep=";"), {}),
    "tabs": (written(sep="\t"), {}),
    "sep=;": (written(comma, sep=";", top="sep=;\r\n"), {}),
    "quoted decimal commas": (written(comma, quote='"'), {}),
    "byte-order mark": (written().encode("utf-8-sig"), {}),
    "UTF-16": (written().encode("utf-16"), {}),
    "UTF-16 with tabs, as Excel saves Unicode text": (written(sep="\t").encode("utf-16"), {}),
    "UTF-16 without mark": (written().encode("utf-16-le"), {}),
    "Windows lines": (written().replace("\n", "\r\n"), {}),
    "header in capitals": (written(head=HEAD.title()), {}),
    "header all capitals": (written(head=HEAD.upper()), {}),
    "blanks around the names": (written(head=" time , from , to , distance , observer"), {}),
    "2.504 m": (written(lambda d: f"{d:.3f} m"), {}),
    "2504 mm": (written(lambda d: f"{1000 * d:.0f} mm"), {}),
    "250.4cm": (written(lambda d: f"{100 * d:.1f}cm"), {}),
    "8.215 ft": (written(lambda d: f"{feet(d)} ft"), {}),
    "98 9/16 in": (written(lambda d: f"{d / 0.0254:.3f} in"), {}),
    "11' 4 7/8\"": (written(eighths), {"within": 0.0254 / 32}),
    "11 ft 4 7/8 in": (
        written(lambda d: eighths(d, "{} ft {} {}/16 in")),
        {"within": 0.0254 / 32},
    ),
    "11' 4 7/8 without the inch mark, which a quote ate": (
        written(eighths, quote='"').replace('""', '"'),
        {"within": 0.0254 / 32},
    ),
    "distance [mm]": (
        written(lambda d: f"{1000 * d:.0f}", HEAD.replace("distance", "Distance [mm]")),
        {},
    ),
    "distance (cm)": (
        written(lambda d: f"{100 * d:.1f}", HEAD.replace("distance", "distance (cm)")),
        {},
    ),
    "distance in feet": (written(feet, HEAD.replace("distance", "distance in feet")), {}),
    "distance_m": (written(head=HEAD.replace("distance", "distance_m")), {}),
    "units = mm": (written(lambda d: f"{1000 * d:.0f}"), MM),
    "units = ft": (written(feet), {"units": "ft"}),
    "units = mm, one row in metres that says so": (
        written(lambda d: "2.504 m" if d == 2.504 else f"{1000 * d:.0f}"),
        MM,
    ),
    "blanks about the slash": (written().replace("7/O", "7 / O"), {}),
    "blanks in a name": (written().replace("mark_3", " mark  3 "), {}),
    "xlsx": (lambda: xlsx(sheet_rows()), {"name": "readings.xlsx"}),
    "xlsx in millimetres by its heading": (
        lambda: xlsx(sheet_rows(("From", "To", "Distance [mm]"), lambda d: round(1000 * d))),
        {"name": "readings.xlsx"},
    ),
    "xlsx called csv": (lambda: xlsx(sheet_rows()), {}),
    "ods": (lambda: ods(sheet_rows()), {"name": "readings.ods"}),
    "ods with units": (
        lambda: ods(sheet_rows(number=lambda d: f"{d:.3f} m")),
        {"name": "readings.ods"},
    ),
    "bars": (written(sep="|"), {}),
    "distance (mm.)": (
        written(lambda d: f"{1000 * d:.0f}", HEAD.replace("distance", "distance (mm.)")),
        {},
    ),
    "2.504 [m]": (written(lambda d: f"{d:.3f} [m]"), {}),
    "units = in, with fractions": (
        written(inches),
        {"units": "in", "within": 0.0254 / 32},
    ),
    "ü as a Mac writes it": (
        written().replace("mark_3", "tu\u0308r"),
        {"names": {"mark_3": "tür"}},
    ),
    "a first column of numbers": (
        "\n".join(
            [f"nr,{HEAD}", *(f"{i},{line}" for i, line in enumerate(written().splitlines()[1:]))]
        ),
        {},
    ),
    "an inch mark of two apostrophes": (
        written(lambda d: eighths(d, "{}' {} {}/16''")),
        {"within": 0.0254 / 32},
    ),
    "no-break blanks": (written(lambda d: f"{d:.3f}\u00a0m"), {}),
    "a pair read twice in the same minute": (
        written() + "2026-03-04T09:00,O,X,2.504,A\n",
        {"more": [2.504]},
    ),
}


@pytest.mark.parametrize("spelling", READ)
def test_it_is_read_rightly(load, spelling):
    content, how = READ[spelling]
    content = content() if callable(content) else content
    toml = TOML + (f'units = "{how["units"]}"\n' if "units" in how else "")
    names = how.get("names", {})
    for old, new in names.items():
        toml = toml.replace(old, new)
    used = load(content, how.get("name", "readings.csv"), toml).used
    true = [d for *_, d in TRUE] + how.get("more", [])
    # Feet with four decimals and inches with three round by 15 and 13 micrometres.
    assert used.distance == pytest.approx(true, abs=how.get("within", 2e-5))
    assert list(zip(used.start, used.end, strict=True))[: len(TRUE)] == [
        (a, names.get(b, b)) for a, b, _ in TRUE
    ]


REFUSED = {
    "millimetres": (written(lambda d: f"{1000 * d:.0f}"), r'millimetres.*write units = "mm" under'),
    "centimetres": (written(lambda d: f"{100 * d:.1f}"), r'centimetres.*write units = "cm" under'),
    "feet": (written(feet), r'feet.*write units = "ft" under'),
    "inches": (written(lambda d: f"{d / 0.0254:.2f}"), r'inches.*write units = "in" under'),
    "millimetres without a frame": (
        "from,to,distance\n7/O,1,3431\n7/O,2,5385\n7/X,1,7250\n",
        r'out of range, like 3 of 3 cells.*under \[survey\].*units = "mm"',
    ),
    "two units in one frame": (
        written(lambda d: f"{1000 * d:.0f}" if d == 2.493 else f"{d:.3f}"),
        "'2493' — out of range.*if it is in millimetres, write '2493 mm'",
    ),
    "feet at two sides of the frame, metres elsewhere": (
        written(lambda d: feet(d) if d in (2.493, 2.504) else f"{d:.3f}"),
        "by .vframe. this is in feet, and other rows are not; write the unit behind the number",
    ),
    "a heading of another name": (
        written(head=HEAD.replace("distance", "Distanz")),
        "write 'distance' instead of 'Distanz'",
    ),
    "a title above the header": (written(top="Survey of the hall\n"), "the header is on line 2"),
    "no header": (written().split("\n", 1)[1], "write a first line with the headings"),
    "an unknown unit in the heading": (
        written(head=HEAD.replace("distance", "distance [yd]")),
        "the heading says 'yd'; write m",
    ),
    "decimal commas between commas": (written(comma), "needs quotes, or ';' between the cells"),
    "an inch mark in quotes": (
        written(eighths, quote='"'),
        "not a CSV table.*inch mark inside quotes is written twice",
    ),
    "thousands": (written(lambda d: f"{1000 * d:,.1f}", quote='"'), "between the thousands"),
    "another letter case in a name": (
        written().replace("mark_3", "Mark_3"),
        "did you mean 'mark_3'",
    ),
    "Latin letters in another encoding": (
        written().replace(",A\n", ",Ren\xe9\n").encode("latin-1"),
        "save the file as UTF-8",
    ),
    "no sheet called xlsx": (b"PK\x03\x04 nothing", "save it as CSV UTF-8"),
    "an empty file": (b"", "empty"),
    "blanks between the cells": (
        written(sep=" "),
        "write ',' or ';' between the cells",
    ),
    "cells in apostrophes": (written(quote="'"), "write it without quotes"),
    "headings of another language": (
        written(head="Zeit,von,nach,Distanz,wer"),
        "the header has: .*rename the one that holds it to 'from'",
    ),
    "what a sheet says instead of a number": (
        written(lambda d: "#N/A" if d == 0.812 else f"{d:.3f}"),
        "leave the row out where nothing was measured",
    ),
    "thousands with their unit": (
        written(lambda d: f"{1000 * d:,.0f} mm", quote='"'),
        "write it without signs between the thousands",
    ),
    "a unit that is none here": (
        written(lambda d: f"{d / 0.9144:.4f} yd"),
        "write it without the unit, in m, cm, mm, ft or in",
    ),
    "a tolerance behind the number": (
        written(lambda d: f"{d:.3f} ± 0.001"),
        "write it like 2.504, 2.504 m or",
    ),
    "metres and centimetres": (
        written(lambda d: f"{int(d)} m {100 * (d % 1):.1f} cm"),
        "write it like 2.504, 2.504 m or",
    ),
    "a mark that a spreadsheet made a date": (
        written().replace("7/O", "2026-07-01"),
        "made a date of it, write it as text",
    ),
    "formulas that nobody has computed": (
        lambda: xlsx(sheet_rows(number=lambda d: f"={d}")),
        "line 2: a formula whose value the file does not hold.*save it again",
    ),
    "two sheets": (
        "two sheets",
        "2 sheets hold cells .*leave one, or save that one as CSV",
    ),
    "a frame in metres under units = ft": (written(), r'in metres.*write units = "m" under'),
}


def two_sheets():
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["from", "to", "distance"])
    book.create_sheet("old").append(["from", "to", "distance"])
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


@pytest.mark.parametrize("spelling", REFUSED)
def test_it_is_refused_with_what_to_do(load, spelling):
    content, words = REFUSED[spelling]
    content = two_sheets() if content == "two sheets" else content
    content = content() if callable(content) else content
    toml = TOML + ('units = "ft"\n' if "units = ft" in spelling else "")
    with pytest.raises(GtvalError) as caught:
        load(content, toml=toml)
    assert re.search(words, str(caught.value), re.DOTALL), str(caught.value)
    assert len(str(caught.value)) < 2500


def test_a_unit_told_once_is_told_once(load):
    with pytest.raises(GtvalError) as caught:
        load(REFUSED["millimetres"][0])
    assert len(caught.value.problems) == 1


def test_without_the_extra_a_sheet_is_refused_with_what_to_install(load, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "python_calamine", None)
    with pytest.raises(GtvalError, match=r"save it as CSV, or .* pip install gtval\[sheets\]"):
        load(xlsx(sheet_rows()), "readings.xlsx")


def test_there_are_forty_spellings_and_more():
    assert len(READ) + len(REFUSED) >= 40
