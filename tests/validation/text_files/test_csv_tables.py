"""CSV files as they come: what is read, and that bad ones are told plainly."""

import contextlib
import math
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.errors import GtvalError, InputError
from validation.poses.pose_table import from_csv
from validation.text_files.csv_tables import MAX_PROBLEMS, Column, read_csv

COLUMNS = [
    Column("pose"),
    Column("x", "number", low=-100, high=100, unit="m"),
    Column("note", required=False, blank=True),
]


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "table.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(folder: Path, content: str | bytes):
    table = read_csv(written(folder, content), COLUMNS)
    table.raise_problems()
    return table


def message(folder: Path, content: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, content)
    return str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        "pose,x\n1,1.5\n2,-2\n",
        "pose;x\n1;1.5\n2;-2\n",
        "pose\tx\r\n1\t1.5\r\n2\t-2\r\n",
        "\ufeffpose,x\n1,1.5\n2,-2\n",
        "pose , x \n 1 , 1.5 \n\n2,-2.0e0\n",
        'pose;x\n1;1,5\n2;"-2,0"\n',
        'pose,x\n1,"1,5"\n2,-2',
        "x,pose,more\n1.5,1,?\n-2,2,?\n",
        "pose,x\n1,1.5,\n2,-2,,\n",
        "\n\npose,x\n1,+1.5\n2,-2.\n",
        "pose,x\n1,1.5\n2,-2\n".encode("utf-16"),
        "pose,x\n1,1.5\n2,-2\n".encode("utf-16-le"),
        "pose,x\n1,1.5\n2,-2\n".encode("utf-16-be"),
        "sep=;\npose;x\n1;1,5\n2;-2\n",
        "Pose,X\n1,1.5\n2,-2\n",
        "pose,x [cm]\n1,150\n2,-200\n",
        "pose,x\n1,1.5 m\n2,-200 cm\n",
        "sep=;\npose;x;y\n1;1,5;0\n2,-2.0,0\n",
        "pose,x\n1,1.5\n2;-2\n",
    ],
)
def test_the_same_table_in_many_dresses(tmp_path, content):
    table = read(tmp_path, content)
    assert table.text["pose"] == ["1", "2"]
    assert table.numbers["x"] == [1.5, -2.0]
    assert table.text["note"] == ["", ""]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("pose,y\n1,2\n", "line 1, field 'x': the column is missing"),
        ("pose,x,x\n1,2,3\n", "the column stands twice"),
        ("pose,x\n1,abc\n", "line 2, field 'x': 'abc' — not a number"),
        ("pose,x\n1,\n", "the cell is empty; expected a number from -100 to 100 m"),
        ("pose,x\n1\n", "the cell is empty"),
        ("pose,x\n,1\n", "line 2, field 'pose': '' — the cell is empty; expected a name"),
        ("pose,x\n1,nan\n", "'nan' — not a number"),
        ("pose,x\n1,inf\n", "'inf' — not a number"),
        ("pose,x\n1,-Infinity\n", "not a number"),
        ("pose,x\n1,1e999\n", "out of range"),
        ("pose,x\n1,101\n", "'101' — out of range; expected a number from -100 to 100 m"),
        ("pose,x\n1,0x10\n", "not a number"),
        ("pose,x\n1,1_000\n", "not a number"),
        ("pose,x\n1,1,5\n", "a decimal comma needs quotes"),
        ("pose,x\n1,1.2.3\n", "not a number"),
        (b"pose,x\n\xe9,1\n", "not UTF-8"),
        ("pose,x\n1,2.5 V\n", "'2.5 V' — not a number; write it without the unit"),
        ("pose,x\n1,8°\n", "write it without the unit"),
        ("pose,x\n1,1 200\n", "without signs between the thousands"),
        ("Posse,X\n1,2.5\n", "write 'pose' instead of 'Posse'"),
        ("my survey\npose,x\n1,2\n", "the header is on line 2: delete what stands above it"),
        ("1,2\n2,3\n", "write a first line with the headings, such as pose,x"),
        ("pose,x [V]\n1,2\n", "the heading says 'v'; write m"),
        (b"pose,x\n1\x00,1\n", "control characters"),
        ('pose,x\n"1,1\n2,2\n', "not a CSV table"),
        ('pose,x\n"1"2,1\n', "not a CSV table"),
        ("pose,x\n" + "1" * 200_000 + ",1\n", "field larger than field limit"),
        ("pose,x\n1," + "9" * 100_000 + "\n", "out of range"),
    ],
)
def test_a_bad_table_is_told_with_its_place(tmp_path, content, expected):
    said = message(tmp_path, content)
    assert expected in said
    assert str(tmp_path / "table.csv") in said
    assert len(said) < 2000


def test_all_bad_places_are_told_at_once(tmp_path):
    said = message(tmp_path, "pose,x\n1,a\n2,2\n,3\n4,1000\n")
    assert [line.split(", ")[1] for line in said.splitlines()] == ["line 2", "line 4", "line 5"]


def test_lines_are_counted_over_quoted_line_breaks(tmp_path):
    said = message(tmp_path, 'pose,x,note\n1,1,"two\nlines"\n2,b,\n')
    assert "line 2, field 'note'" in said
    assert "line 4, field 'x': 'b'" in said


def test_duplicate_rows_are_told_with_both_lines(tmp_path):
    table = read_csv(written(tmp_path, "pose,x\n7,1\n8,1\n7 ,2\n"), COLUMNS)
    table.flag_duplicates(["pose"])
    with pytest.raises(InputError, match=r"line 4.*the same as line 2 \(pose = 7\)"):
        table.raise_problems()


def test_an_optional_number_may_be_blank(tmp_path):
    columns = [Column("pose"), Column("xx", "number", required=False, blank=True)]
    table = read_csv(written(tmp_path, "pose,xx\n1,\n2,3\n"), columns)
    assert math.isnan(table.numbers["xx"][0])
    assert table.numbers["xx"][1] == 3
    assert read_csv(written(tmp_path, "pose\n1\n"), columns).problems == []


def test_a_missing_file_a_folder_and_a_device_are_told(tmp_path):
    for path, expected in (
        (tmp_path / "none.csv", "there is no such file"),
        (tmp_path, "no file, but a folder"),
        (Path(os.devnull), "no file, but a folder or a device"),
    ):
        with pytest.raises(InputError, match=expected):
            read_csv(path, COLUMNS)


def test_an_impossible_name_is_told():
    with pytest.raises(GtvalError, match="cannot read"):
        read_csv(Path("a\0b.csv"), COLUMNS)


def test_a_huge_file_is_refused_unread(tmp_path):
    path = tmp_path / "sparse.csv"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    with pytest.raises(InputError, match="the file has 100 MB; more than 20 MB"):
        read_csv(path, COLUMNS)


def test_a_file_bad_in_every_line_is_given_up(tmp_path):
    path = written(tmp_path, "pose,x\n" + "1,?\n" * 100_000)
    with pytest.raises(InputError, match="more") as caught:
        read_csv(path, COLUMNS)
    assert len(caught.value.problems) == MAX_PROBLEMS
    assert len(str(caught.value).splitlines()) < 30


def test_a_long_header_is_shortened_in_the_message(tmp_path):
    said = message(tmp_path, ",".join(["name" * 100] * 1000) + "\n")
    assert len(said) < 4000


ANY_BYTES = st.one_of(
    st.binary(max_size=300),
    st.text(alphabet='pose,x;\t"\r\n1.5e-7\0é', max_size=80).map(
        lambda text: ("pose,x,y,theta,xx,source\n" + text).encode()
    ),
    st.lists(
        st.lists(
            st.sampled_from(["1", "-2.5", "1e308", "1e-320", "", "nan", '"', "a", "0", "9,9"]),
            min_size=4,
            max_size=11,
        ).map(",".join),
        max_size=4,
    ).map(lambda rows: "\n".join(["pose,x,y,theta,xx,xy,xt,yy,yt,tt,source", *rows]).encode()),
)


@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=ANY_BYTES)
def test_whatever_the_bytes_only_plain_errors_come_out(tmp_path, content):
    path = written(tmp_path, content)
    # Any other exception, and any warning, fails the test.
    with contextlib.suppress(GtvalError):
        assert len(from_csv(path)) > 0


def test_a_column_in_millimetres_is_told_once(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("pose,x\n" + "".join(f"{n},{2500 + n}\n" for n in range(40)) + "41,far\n")
    with pytest.raises(InputError) as caught:
        read_csv(path, COLUMNS).raise_problems()
    (only,) = caught.value.problems
    assert (only.line, only.field, only.value) == (2, "x", "2500")
    assert "divide millimetres by 1000" in str(only)


def test_few_lengths_out_of_range_are_told_one_by_one(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("pose,x\n" + "".join(f"{n},2.5\n" for n in range(40)) + "41,250\n42,2500\n")
    with pytest.raises(InputError) as caught:
        read_csv(path, COLUMNS).raise_problems()
    assert [one.line for one in caught.value.problems] == [42, 43]


def test_a_row_that_is_divided_otherwise_is_told_where_it_may_mean_two_things(tmp_path):
    # 2,801 may be a decimal comma, and then the row has two cells.
    with pytest.raises(InputError, match=r"line 3.* not divided"):
        read(tmp_path, "pose;x;y\n1;1,5;0\n2,2,801\n")
