"""The AD2.3 campaign says what the document prints."""

import csv
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from survey.readings.instrument import reading_sigma
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.poses.pose_table import from_csv, in_common, pose_difference
from validation.published.systems import published_tables

FOLDER = Path(__file__).parents[2] / "data_samples" / "ad23"


@pytest.fixture(scope="module")
def campaign():
    return load_campaign(FOLDER, frozenset({"survey", "vision"}))


@pytest.fixture(scope="module")
def survey(campaign):
    return campaign.section("survey", SurveySettings)


def rows(name):
    with (FOLDER / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def printed_readings():
    """(world point, label in print) to distance."""
    return {(r["to"], r["from"]): float(r["distance"]) for r in rows("survey/readings.csv")}


def printed_world_points():
    return {
        r["world_point"]: np.array([float(r["x"]), float(r["y"])])
        for r in rows("survey/published_world_points.csv")
    }


def test_readings_are_labelled_as_printed():
    readings = printed_readings()
    assert len(readings) == 16 * 4 + 1
    row_1 = [readings["1", label] for label in ("O", "X", "Y", "XY")]
    row_12 = [readings["12", label] for label in ("O", "X", "Y", "XY")]
    row_16 = [readings["16", label] for label in ("O", "X", "Y", "XY")]
    assert row_1 == [2.740, 5.190, 3.165, 5.430]
    assert row_12 == [5.581, 3.427, 6.952, 5.378]
    assert row_16 == [1.322, 3.345, 3.716, 4.824]
    assert readings["Y", "X"] == 3.536


def test_the_labels_are_exchanged_by_the_settings_alone(campaign, survey):
    readings = load_readings(campaign, survey).used
    meant = dict(
        zip(zip(readings.end, readings.start, strict=True), readings.distance, strict=True)
    )
    assert meant["1", "Y"] == 5.190
    assert meant["1", "X"] == 3.165
    assert meant["1", "XY"] == 5.430


def test_world_points_and_poses_are_as_printed(campaign):
    assert printed_world_points()["1"].tolist() == [0.746335, -2.636647]
    assert printed_world_points()["13"].tolist() == [-3.622194, 3.993617]
    poses = from_csv(FOLDER / "survey" / "published_poses.csv")
    assert len(poses) == 26
    assert poses.poses[24].tolist() == [-1.5081, 4.2249, 4.9689]
    assert poses.poses[25].tolist() == [-0.9872, 4.8136, 3.5275]
    guesses = from_csv(FOLDER / "survey" / "initial_guesses.csv")
    assert guesses.poses[25].tolist() == [-0.97, 4.77, 3.4907]
    vision, genetic, scanmatch = published_tables(campaign)
    assert (len(vision), len(genetic), len(scanmatch)) == (20, 26, 13)
    assert vision.sources[vision.ids.index("7")] == "camera 4+1"
    assert genetic.poses[25].tolist() == [-0.8123, 4.8442, 3.5406]
    assert scanmatch.poses[-1].tolist() == [-0.9437, 4.8611, 3.5344]
    assert poses.poses[5].tolist() == [0.8781, 1.9556, 5.1869]
    assert genetic.poses[5].tolist() == [0.8780, 1.9556, 5.1869]  # as printed, 0.1 mm off


def test_the_tables_give_the_printed_statistics(campaign):
    """Mean and standard deviation of validation minus system, to the last printed digit."""
    validation = from_csv(FOLDER / "survey" / "published_poses.csv")
    tables = {table.system: table for table in published_tables(campaign)}
    compared = 0
    for printed in rows("published/statistics.csv"):
        if printed["system"] not in tables:
            continue
        table = tables[printed["system"]]
        ids = in_common([validation, table])
        errors = pose_difference(validation.select(ids).poses, table.select(ids).poses)
        column = errors[:, ["x", "y", "theta"].index(printed["component"])]
        for key, value in [("mean", column.mean()), ("std", column.std(ddof=1))]:
            digits = len(printed[key].partition(".")[2])
            # Half a unit where the print was rounded, one where it was cut off.
            assert abs(value - float(printed[key])) <= 10**-digits, (printed, value)
        compared += 1
    assert compared == 9


def fitted(world_point, readings, places):
    """The point whose distances are nearest to the readings, and the residuals."""
    start = printed_world_points()[world_point]
    fit = least_squares(lambda p: np.hypot(*(p - places).T) - readings, start)
    return fit.x, fit.fun


def test_the_assumed_sigmas_add_up_to_the_residuals_that_are_seen(campaign):
    """Standard deviation 3.1 mm with 32 degrees of freedom, as the comment says."""
    readings = printed_readings()
    places = np.array([[0, 0], [0, 2.5], [2.5, 0], [2.5, 2.5]])  # O, X, Y, XY as labelled
    squares, differences = 0.0, {}
    for name, printed in printed_world_points().items():
        measured = np.array([readings[name, label] for label in ("O", "X", "Y", "XY")])
        point, residuals = fitted(name, measured, places)
        squares += residuals @ residuals
        differences[name] = np.abs(point - printed).max()
    seen = np.sqrt(squares / 32)
    instrument, vframe = campaign.settings.instrument, campaign.settings.vframe
    stated = np.hypot(reading_sigma(instrument, 4.0), vframe.sigma)
    assert round(seen * 1000, 1) == 3.1
    assert round(stated * 1000, 1) == 3.1
    assert max(differences, key=differences.get) == "15"
    assert differences["15"] == pytest.approx(0.0031, abs=0.0002)


def test_the_instrument_is_as_specified(campaign):
    instrument = campaign.settings.instrument.model_copy(
        update={"setup_sigma": 0.0, "resolution": 0.0}
    )
    assert 2 * reading_sigma(instrument, [1.0, 30.0, 50.0]) == pytest.approx(
        [0.0015, 0.0015, 0.005]
    )
    assert (instrument.range_min, instrument.range_max) == (0.05, 50.0)
    assert campaign.settings.vframe.sigma == 0.002


def test_nothing_is_stated_that_was_not_printed(campaign):
    assert campaign.settings.room.walls == []
    assert not campaign.settings.robot_frame.sides
    assert all(entry.sigmas is None for entry in campaign.settings.published)
    assert all(not r["time"] and not r["observer"] for r in rows("survey/readings.csv"))


def test_tables_for_the_vision_checks_are_complete():
    height = [float(row["z"]) for row in rows("vision/table_chessboard.csv")]
    assert height == [0.7162, 0.7270, 0.7388, 0.7226, 0.7530, 0.7288]
    assert [row["pose"] for row in rows("vision/table_marker.csv")] == [
        "2",
        "5",
        "6",
        "7",
        "11",
        "23",
    ]
    detections = rows("vision/marker_detections.csv")
    found = Counter(marker for row in detections for marker in row["markers"].split())
    assert set(found) <= {"3", "6", "14", "30", "89", "200"}
    assert len(detections) == 40
