import contextlib
import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from surveys import AD23

from survey.readings.point_names import robot_point
from survey.readings.readings import Readings, load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError

HEADER = "time,from,to,distance,observer"


@pytest.fixture
def folder(tmp_path):
    copy = tmp_path / "ad23"
    shutil.copytree(AD23, copy)
    return copy


def load(folder, text):
    path = folder / "survey" / "readings.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    campaign = load_campaign(folder)
    return load_readings(campaign, campaign.section("survey", SurveySettings))


def problem(folder, text):
    with pytest.raises(InputError) as caught:
        load(folder, text)
    assert all(p.file.name == "readings.csv" for p in caught.value.problems)
    return caught.value.problems


def test_good_rows_are_distances_between_points_with_labels_replaced(folder):
    used = load(folder, f"{HEADER}\n,O,1,2.740,A\n,1,X,5.190,B\n,7/O,16,3.1,\n").used
    assert used.start == ("O", "1", "7/O")
    assert used.end == ("1", "Y", "16")
    assert used.distance == pytest.approx([2.740, 5.190, 3.1])
    assert used.line == (2, 3, 4)
    assert used.poses == ["7"]


def test_offset_and_scale_of_the_instrument_are_applied(folder):
    toml = folder / "campaign.toml"
    toml.write_text(
        toml.read_text().replace("[instrument]", "[instrument]\noffset = 0.01\nscale = 1.001")
    )
    assert load(folder, f"{HEADER}\n,O,1,2.000,\n").used.distance[0] == pytest.approx(2.012)


@pytest.mark.parametrize(
    ("row", "field", "words"),
    [
        (",O,1,,A", "distance", "empty"),
        (",O,1,nan,A", "distance", "not a number"),
        (",O,1,-2.7,A", "distance", "out of range"),
        (",O,1,0.01,A", "distance", "from 0.05 to 50 m"),
        (",O,1,51,A", "distance", "from 0.05 to 50 m"),
        (",O,1,2.7V,A", "distance", "not a number"),
        (",O,1,2.7mm,A", "distance", "out of range"),
        (",O,1,1e999,A", "distance", "out of range"),
        (",O,17,2.7,A", "to", "unknown point"),
        (",Q,1,2.7,A", "from", "unknown point"),
        (",7/Q,1,2.7,A", "from", "POSE/POINT"),
        (",/O,1,2.7,A", "from", "POSE/POINT"),
        (",O,O,2.7,A", "to", "itself"),
        (",,1,2.7,A", "from", "empty"),
    ],
)
def test_a_bad_cell_is_named_by_line_field_and_value(folder, row, field, words):
    (found,) = problem(folder, f"{HEADER}\n,O,2,2.698,A\n{row}\n")
    assert found.line == 3
    assert found.field == field
    assert words in found.expected
    assert found.value == row.split(",")[("time", "from", "to", "distance").index(field)]


def test_all_bad_places_are_reported_at_once(folder):
    found = problem(folder, f"{HEADER}\n,O,99,2.7,\n,O,1,x,\n,O,1,2.7,\n,O,O,2.7,\n")
    assert [p.line for p in found] == [2, 3, 5]


def test_a_repeated_measurement_counts_whatever_its_time_and_the_same_row_twice_is_told(folder):
    file = load(folder, f"{HEADER}\n10:00,O,1,2.7,\n10:00,1,O,2.7,\n")
    assert (len(file.used), file.said_before) == (2, (3,))
    file = load(folder, f"{HEADER}\n10:00,O,1,2.7,\n10:05,O,1,2.7,\n10:05,O,1,2.701,\n")
    assert (len(file.used), file.said_before) == (3, ())


def test_decimal_commas_are_accepted_where_they_are_unambiguous(folder):
    quoted = load(folder, f'{HEADER}\n,O,1,"2,740",\n').used
    semicolons = load(folder, f"{HEADER.replace(',', ';')}\n;O;1;2,740;\n").used
    assert quoted.distance == semicolons.distance == pytest.approx([2.74])
    (found,) = problem(folder, f"{HEADER}\n,O,1,2,740,A\n")
    assert found.line == 2
    assert "comma" in found.expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "empty"),
        (b"\n\n", "empty"),
        (f"{HEADER}\n".encode(), "no reading"),
        (b"time,from,to,observer\n,O,1,A\n", "missing"),
        (f"{HEADER}\n,O,1,2.7,Ren\xe9\n".encode("latin-1"), "UTF-8"),
        (f"{HEADER}\n,O,1,2.7,\0\n".encode(), "control"),
        (f'{HEADER}\n,O,"1,2.7,A\n'.encode(), "CSV"),
    ],
)
def test_a_bad_file_is_named_with_its_fault(folder, text, words):
    found = problem(folder, text)
    assert words in str(found[0])


def test_a_file_of_a_hundred_megabytes_is_refused_unread(folder):
    path = folder / "survey" / "readings.csv"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    campaign = load_campaign(folder)
    with pytest.raises(InputError, match="100 MB"):
        load_readings(campaign, campaign.section("survey", SurveySettings))


def test_readings_set_aside_by_hand_are_kept_apart(folder):
    file = load(folder, "from,to,distance,use,note\nO,1,2.74,,\nO,2,9.9,no,spot on a cable\n")
    assert len(file.used) == 1
    assert file.set_aside.end == ("2",)
    assert file.notes == ("spot on a cable",)


@given(st.binary(max_size=300))
@settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
def test_no_bytes_lead_to_anything_but_readings_or_a_known_error(folder, noise):
    for text in (noise, HEADER.encode() + b"\n,O,1,2.7,\n" + noise):
        with contextlib.suppress(GtvalError):
            assert len(load(folder, text).used) >= 0


cell = st.sampled_from(
    ["O", "1", "7/O", "X", "2.5", "-1", "nan", '"', ";", "1,5", "", "yes", "1e400", "é"]
)


@given(st.lists(st.lists(cell, max_size=7).map(",".join), max_size=6))
@settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
def test_no_rows_lead_to_anything_but_good_readings_or_a_known_error(folder, rows):
    try:
        file = load(folder, "\n".join([HEADER, *rows]))
    except GtvalError:
        return
    assert np.isfinite(file.used.distance).all()
    assert (file.used.distance >= 0.05).all()
    assert (file.used.sigma > 0).all()


def test_names_of_robot_points():
    assert robot_point("7/O") == ("7", "O")
    assert robot_point("7") is None


def test_readings_touching_turn_to_start_where_asked():
    readings = Readings(("O", "1", "X"), ("1", "X", "Y"), [1.0, 2.0, 3.0], 0.001)
    own = readings.touching(["1"], ["O", "X", "Y"])
    assert own.start == ("1", "1")
    assert own.end == ("O", "X")
    assert own.distance == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize(("unit", "per_metre"), [("feet", 1 / 0.3048), ("inches", 1 / 0.0254)])
def test_a_frame_measured_in_another_unit_is_told_once(folder, unit, per_metre):
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("range_max = ", "range_max = 200.0  # "))
    rows = "".join(f",{a},{b},{d * per_metre:.3f},A\n" for a, b, d in (
        ("O", "1", 2.74), ("O", "X", 2.501), ("O", "Y", 2.498), ("X", "XY", 2.5)
    ))  # fmt: skip
    (only,) = problem(folder, f"{HEADER}\n{rows}")
    assert (only.line, only.field) == (3, "distance")
    assert unit in str(only)
    assert f'write units = "{unit[:1]}' in str(only)


def test_one_wrong_side_of_the_frame_is_no_unit(folder):
    rows = ",O,X,8.2,A\n,O,Y,2.498,A\n,X,XY,2.5,A\n"
    assert len(load(folder, f"{HEADER}\n{rows}").used) == 3
