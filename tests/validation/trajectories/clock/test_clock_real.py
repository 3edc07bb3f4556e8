"""Clocks of recordings that nobody here made."""

import os
from pathlib import Path

import numpy as np
import pytest

from rtk_gt.receivers.formats.rawlog import read_rawlog
from validation.poses.earth_frames import ecef_from_geodetic
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.estimate import estimate_clock
from validation.trajectories.formats import read_trajectory

REAL = Path(os.environ.get("GTVAL_REAL_DATA", Path(__file__).parents[5] / "shared" / "real"))
BICOCCA = REAL / "trajectories" / "bicocca_25a"
MALAGA = REAL / "rtk" / "malaga_fragment" / "test_rtk_path.rawlog"


@pytest.mark.skipif(not BICOCCA.exists(), reason="GTVAL_REAL_DATA has no bicocca_25a")
def test_what_is_added_to_real_stamps_is_found():
    reference = read_trajectory(BICOCCA / "GROUNDTRUTH.csv.gz")
    source = read_trajectory(BICOCCA / "GT-extended.csv.gz")
    as_it_is = estimate_clock(reference, source)
    assert as_it_is.verdict == "determined"
    sigma = (as_it_is.high_s - as_it_is.low_s) / 4
    for added in (0.25, -1.3, 18.0):
        found = estimate_clock(reference, source.shifted(-added))
        assert found.verdict == "determined"
        # The same poses: only the way of the search may differ, by a small part of what is open.
        assert abs(found.delay_s - as_it_is.delay_s - added) < 0.1 * sigma


@pytest.mark.skipif(not MALAGA.exists(), reason="GTVAL_REAL_DATA has no malaga_fragment")
def test_antennas_on_one_vehicle_have_no_wrong_delay():
    fixes = read_rawlog(MALAGA).fixes
    records = list(fixes.values()) if isinstance(fixes, dict) else list(fixes)
    latitude, longitude = records[0].geodetic[:, :2].mean(0)
    east = [-np.sin(longitude), np.cos(longitude), 0.0]
    north = [
        -np.sin(latitude) * np.cos(longitude),
        -np.sin(latitude) * np.sin(longitude),
        np.cos(latitude),
    ]
    origin = ecef_from_geodetic(records[0].geodetic).mean(0)
    moving = []
    for record in records:
        places = (ecef_from_geodetic(record.geodetic) - origin) @ np.transpose([east, north])
        kept = np.concatenate([[True], np.diff(record.times) > 0])
        epoch = int(record.times[0])
        times = record.times[kept] - epoch
        moving.append(Trajectory(record.receiver, times, places[kept], "points_plane", epoch=epoch))
    for reference in moving:
        for source in moving:
            if source is not reference:
                found = estimate_clock(reference, source)
                # All stamps are GPS time. An antenna behind another follows it like a delay.
                assert found.verdict != "determined" or found.low_s <= 0 <= found.high_s
