"""Two receivers: position and heading, or the position alone where the heading is open."""

from dataclasses import replace

import numpy as np
import pytest
from trials.straight_roads import SITE, road_of

from data_samples.drives.drive import ANTENNAS
from rtk_gt.positions.result import heading_table, positions_result
from rtk_gt.positions.solve import solve_positions
from validation.campaign.folder import load_campaign
from validation.poses.angles import wrap

HEAD = """name = "Two"
[rtk]
origin = { latitude = 45.5, longitude = 9.16, height = 177.0 }
eta = 1.75
"""
ZERO = """
[rtk.known_offsets]
up = "ellipsoid"
sigma = 0.003
values = { front = [0, 0, 0] }
"""
TAPE = """
[rtk.known_distances]
sigma = 0.01
values = { "rear - front" = 1.8213 }
"""


def solved(folder, road, known="", order=(0, 1)):
    """The rear and the left front receiver of a road as a campaign, solved."""
    (folder / "rtk").mkdir(parents=True)
    toml = HEAD
    for name, column, place in zip(("rear", "front"), order, ANTENNAS[:2], strict=True):
        places = SITE.to_geodetic(road.steps.positions[:, column])
        lines = ["time,latitude,longitude,height,fix"]
        lines += [
            f"{time:.3f},{np.degrees(north):.11f},{np.degrees(east):.11f},{height:.4f},4"
            for time, (north, east, height) in zip(road.steps.times, places, strict=True)
        ]
        (folder / "rtk" / f"{name}.csv").write_text("\n".join(lines) + "\n")
        toml += f'[[rtk.receivers]]\nname = "{name}"\nfile = "rtk/{name}.csv"\n'
        toml += f"position = {place.tolist()}\n"
    (folder / "campaign.toml").write_text(toml + known)
    return solve_positions(load_campaign(folder))


def squares_of(outcome, road):
    """Squared normalised errors (n,) of position and heading."""
    table = heading_table(outcome)
    rear = road.poses[:, :3] + [0, 0, ANTENNAS[0, 2]]
    rows = np.searchsorted(road.steps.times, outcome.headings.times - 1e-3)
    errors = np.column_stack(
        [table.poses[:, :3] - rear[rows], wrap(table.poses[:, 3] - road.poses[rows, 3])]
    )
    inverse = np.linalg.inv(table.covariances)
    return np.einsum("ti,tij,tj->t", errors, inverse, errors)


@pytest.mark.parametrize(
    ("kind", "known"),
    [
        ({"degrees": 300.0}, ""),
        ({"degrees": 3.0}, TAPE),
        ({"degrees": 3.0, "bases": False}, ZERO),
        ({"moving": False, "bases": False}, ZERO),
    ],
    ids=["turns", "straight with a tape measure", "straight on one base", "stands on one base"],
)
def test_headings_fit_their_covariance(tmp_path, kind, known):
    means = []
    for seed in range(6):
        road = road_of(seed, interval=2.0, **kind)
        outcome = solved(tmp_path / str(seed), road, known)
        assert outcome.headings is not None, outcome.without_heading
        means.append(np.median(squares_of(outcome, road)))
    # Median of chi-squared of 4 is 3.36; the offset's error, the same along a drive, spreads those
    # of single drives as chi-squared of 1 to 2.
    assert 1.8 < np.median(means) < 6


def test_a_heading_that_is_open_leaves_the_position(tmp_path):
    road = road_of(0, moving=False, interval=2.0)
    outcome = solved(tmp_path / "stands", road)
    assert outcome.headings is None
    result = positions_result(outcome)
    codes = {finding.code: finding for finding in result.findings}
    assert "heading_open" in codes
    assert "known_offsets" in codes["heading_open"].text
    (table,) = result.tables
    assert [one.name for one in table.components] == ["x", "y", "z"]
    assert len(table) == len(road.steps)


def test_exchanged_receivers_point_against_the_motion(tmp_path):
    road = road_of(1, degrees=300.0, interval=2.0)
    result = positions_result(solved(tmp_path / "swapped", road, order=(1, 0)))
    codes = {finding.code: finding for finding in result.findings}
    assert codes["nose_against_motion"].severity == "error"
    # Half a turn, seen from an arm that points 18 degrees to the left.
    assert codes["nose_against_motion"].sizes[0].value == pytest.approx(np.pi, abs=0.1)


def test_a_vehicle_in_reverse_on_a_straight_road_is_told_by_stated_offsets(tmp_path):
    road = road_of(1, degrees=3.0, interval=2.0, bases=False)
    back = road._replace(steps=replace(road.steps, positions=road.steps.positions[::-1]))
    result = positions_result(solved(tmp_path / "back", back, ZERO))
    assert "nose_against_motion" in {finding.code for finding in result.findings}
