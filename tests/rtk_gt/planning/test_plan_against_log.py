"""A plan held against a log: what was hidden in a simulated drive is found, and nothing else."""

import numpy as np
import pytest
from skies import DAY, MILAN, WANTED, almanac, both_systems, log_of, milan_plan, times

from rtk_gt.planning.against_log import by_minutes, compare
from rtk_gt.planning.figures import log_figure
from rtk_gt.planning.horizon import Horizon, typed_horizon
from rtk_gt.planning.inputs import place_of_log, read_log
from rtk_gt.planning.plan import Place, sky_plan
from rtk_gt.planning.telling_log import log_csv, log_findings, log_tables
from validation.errors import GtvalError
from validation.figures.writing import figure_bytes


def wall(azimuth, width, height):
    """A horizon with a wall of a height between two azimuths."""
    ends = np.mod([azimuth - width / 2, azimuth + width / 2], 360)
    first, last = ends.tolist()
    if first < last:
        return [(first, 0), (first, height), (last, height), (last, 0)]
    return [(0, height), (last, height), (last, 0), (first, 0), (first, height), (360, height)]


def minutes(start_hour, count):
    """Middles of minutes, as a log is held against the plan."""
    return times()[0] + 3600.0 * start_hour + 30.0 + 60.0 * np.arange(count)


def driven(folder, at, hidden, rows):
    """Plan with an open sky, and the record of a drive past a wall in the rows that are given."""
    found = almanac(folder)
    free = sky_plan(found, at, WANTED, MILAN)
    behind = Place("wall", MILAN.frame, Horizon(typed_horizon(hidden)))
    shut = sky_plan(found, at, WANTED, behind)
    used = np.where(rows, shut.used, free.used)
    mixed = sky_plan(found, at, WANTED, MILAN)
    object.__setattr__(mixed, "used", used)
    dop = mixed.dop
    object.__setattr__(dop, "horizontal", np.where(rows, shut.dop.horizontal, free.dop.horizontal))
    path = folder / "drive.nmea"
    path.write_text(log_of(mixed))
    return free, mixed, read_log(path, None)


def test_a_log_is_read_by_minutes(tmp_path):
    at = minutes(9, 30)
    free, _, record = driven(tmp_path, at, wall(180, 10, 20), np.zeros(30, dtype=bool))
    seen = by_minutes(record)
    assert (seen.times == at).all()
    assert (seen.satellites == free.count).all()
    assert np.abs(seen.hdop - free.dop.horizontal).max() <= 0.05
    place = place_of_log(record)
    assert np.linalg.norm(place.frame.origin - MILAN.frame.origin) < 1.0


def test_a_drive_under_the_planned_sky_is_as_planned(tmp_path):
    free, _, record = driven(tmp_path, minutes(9, 90), wall(180, 10, 20), np.zeros(90, dtype=bool))
    held = compare(free, by_minutes(record))
    assert held.stretches == ()
    assert [one.code for one in log_findings(held)] == ["seen_as_planned"]


@pytest.mark.parametrize("drives", [12, pytest.param(240, marks=pytest.mark.full)])
def test_a_wall_is_found_with_its_time_and_its_satellites(tmp_path, drives):
    """Twenty minutes behind a wall: when, and which satellites, over the whole day."""
    rng = np.random.default_rng(6)
    rows = np.zeros(60, dtype=bool)
    rows[20:40] = True
    found = named = 0
    for hour in np.linspace(0, 22, drives).round(1):
        at = minutes(hour, 60)
        hidden = wall(rng.uniform(0, 360), 120.0, 45.0)
        free, mixed, record = driven(tmp_path, at, hidden, rows)
        held = compare(free, by_minutes(record))
        told = within(at, [(one.start, one.end) for one in held.stretches])
        fixed = (mixed.count >= 4) & np.isfinite(mixed.dop.horizontal)
        # Each minute with two satellites less is told; gaps of two minutes are bridged.
        assert told[(free.count - mixed.count >= 2) & fixed].all()
        assert not told[~rows].any()
        silent = within(at, held.silent)
        assert silent[~fixed & (free.count >= 5)].all()
        assert not silent[~rows].any()
        for one in held.stretches:
            middle = int(np.argmin(np.abs(at - (one.start + one.end) / 2)))
            lost = np.flatnonzero(free.used[:, middle] & ~mixed.used[:, middle])
            really = {free.almanac.names[k] for k in lost}
            found += len(one.hidden)
            named += len(really & set(one.hidden))
            assert one.explained
    # From numbers and HDOP alone most of what is named was behind the wall.
    assert named >= 0.85 * found


def within(times, spans):
    told = np.zeros(len(times), dtype=bool)
    for start, end in spans:
        told |= (times > start) & (times < end)
    return told


def test_a_log_that_counts_to_twelve_is_not_short_of_satellites(tmp_path):
    at = minutes(9, 10)
    plan = milan_plan(tmp_path, at=at, form="rinex3", rows=both_systems())
    assert plan.count.min() > 13
    path = tmp_path / "old.nmea"
    text = log_of(plan)
    object.__setattr__(plan, "used", plan.used & (np.cumsum(plan.used, axis=0) <= 12))
    path.write_text(log_of(plan))
    assert text != path.read_text()
    again = milan_plan(tmp_path, at=at, form="rinex3", rows=both_systems())
    held = compare(again, by_minutes(read_log(path, None)))
    assert held.capped
    assert held.stretches == ()
    assert {one.code for one in log_findings(held)} == {"seen_as_planned", "seen_at_most"}


def test_more_satellites_than_planned_are_told(tmp_path):
    at = minutes(9, 20)
    free, _, record = driven(tmp_path, at, wall(180, 10, 20), np.zeros(20, dtype=bool))
    high = Place("court", MILAN.frame, Horizon(typed_horizon([(0, 40), (180, 40)])))
    held = compare(sky_plan(free.almanac, at, WANTED, high), by_minutes(record))
    assert "seen_more" in {one.code for one in log_findings(held)}


def test_tables_figure_and_csv_of_a_drive_past_a_wall(tmp_path):
    rows = np.zeros(60, dtype=bool)
    rows[20:40] = True
    free, _, record = driven(tmp_path, minutes(18, 60), wall(180, 170, 50), rows)
    held = compare(free, by_minutes(record))
    told = log_findings(held)
    assert told[0].code == "seen_less"
    assert "18:20 to 18:40 UTC" in told[0].text
    assert len(log_tables(held)) == 2
    assert len(log_csv(held).splitlines()) == 61
    assert figure_bytes(log_figure(held), ".png", "x.png", 40).startswith(b"\x89PNG")


def test_satellites_lost_on_all_sides_are_no_obstacle(tmp_path):
    """A receiver that loses the highest satellites: no wall does that."""
    at = minutes(18, 30)
    plan, again = milan_plan(tmp_path, at=at), milan_plan(tmp_path, at=at)
    order = np.argsort(np.argsort(-plan.rover.elevation, axis=0), axis=0)
    object.__setattr__(plan, "used", plan.used & (order >= 4))
    path = tmp_path / "odd.nmea"
    path.write_text(log_of(plan))
    held = compare(again, by_minutes(read_log(path, None)))
    assert (held.missing == 4).all()
    told = log_findings(held)[0]
    assert told.code == "seen_less"


def test_logs_without_what_is_needed_are_refused(tmp_path):
    at = minutes(9, 3)
    plan = milan_plan(tmp_path, at=at)
    path = tmp_path / "undated.nmea"
    path.write_text("\n".join(log_of(plan).splitlines()[1:]))
    with pytest.raises(GtvalError, match="does not tell its date; give it with --day"):
        read_log(path, None)
    assert by_minutes(read_log(path, DAY)).times == pytest.approx(at)
    table = tmp_path / "fixes.csv"
    table.write_text("time,latitude,longitude,height\n1780000000,45.5,9.2,150\n")
    with pytest.raises(GtvalError, match="no fix tells how many satellites"):
        by_minutes(read_log(table, None))
