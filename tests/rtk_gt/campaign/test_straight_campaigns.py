"""Straight roads and wrong files from campaign folders: what the command says of them."""

from dataclasses import replace

import numpy as np
import pytest
from trials.straight_roads import NAMES, road_of, write_road

from rtk_gt.campaign.solve import solve_campaign
from rtk_gt.system import result_of
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError

DISTANCES = """
[rtk.known_distances]
sigma = 0.01
values = { "rear - front_left" = 1.8213, "rear - front_right" = 1.8252, "front_left - front_right" = 1.1451 }
"""  # noqa: E501
ZERO = """
[rtk.known_offsets]
up = "ellipsoid"
sigma = 0.003
values = { front_left = [0, 0, 0], front_right = [0, 0, 0] }
"""


def solved(folder):
    outcome = solve_campaign(load_campaign(folder))
    return outcome, {finding.code: finding for finding in result_of(outcome).findings}


def test_half_a_turn_is_said(tmp_path):
    road = road_of(0, degrees=1.0, interval=1.0)
    write_road(tmp_path / "road", road.steps, DISTANCES)
    outcome, codes = solved(tmp_path / "road")
    assert codes["offsets_by_motion"].severity == "warning"
    # Twice the arm of the front antennas: 3.64 m.
    assert codes["offsets_by_motion"].sizes[0].value == pytest.approx(3.64, abs=0.1)
    off = np.abs(outcome.offsets.offsets.values - road.offsets)
    assert (off[1:] < 4 * outcome.offsets.offset_sigmas[1:]).all()


def test_a_vehicle_in_reverse_is_an_error(tmp_path):
    """With the right offsets stated nothing but the motion shows it."""
    road = road_of(1, degrees=2.0, interval=1.0, bases=False)
    steps = replace(road.steps, positions=road.steps.positions[::-1])
    write_road(tmp_path / "back", steps, ZERO)
    _, codes = solved(tmp_path / "back")
    assert codes["nose_against_motion"].severity == "error"
    assert codes["nose_against_motion"].sizes[0].value == pytest.approx(np.pi, abs=0.05)


def test_one_file_for_two_receivers_is_named(tmp_path):
    road = road_of(2, interval=2.0)
    positions = road.steps.positions.copy()
    positions[:, 2] = positions[:, 1]
    write_road(tmp_path / "copy", replace(road.steps, positions=positions))
    with pytest.raises(InputError, match=r"front_right.*record of receiver front_left.*once more"):
        solve_campaign(load_campaign(tmp_path / "copy"))


def test_a_receiver_on_another_continent_is_named(tmp_path):
    road = road_of(2, interval=2.0)
    for name in NAMES:
        folder = tmp_path / name
        write_road(folder, road.steps)
        log = folder / "rtk" / f"{name}.csv"
        log.write_text(log.read_text().replace(",45.", ",-15.").replace(",9.1", ",-70.1"))
        with pytest.raises(InputError, match=rf"{name}\.csv, line 2.*km from"):
            solve_campaign(load_campaign(folder))


def test_exchanged_files_are_named(tmp_path):
    road = road_of(3, degrees=120.0, slope=6.0, interval=1.0)
    write_road(tmp_path / "swapped", road.steps)
    logs = [tmp_path / "swapped" / "rtk" / f"{name}.csv" for name in ("rear", "front_right")]
    texts = [log.read_text() for log in logs]
    for log, text in zip(logs, reversed(texts), strict=True):
        log.write_text(text)
    with pytest.raises(GtvalError, match="files of rear and front_right are exchanged"):
        solve_campaign(load_campaign(tmp_path / "swapped"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "1.8213",
            "182.13",
            r"rear - front_left': '182\.13'.*metres \(1\.8213 if it is in cent",
        ),
        ("1.8213", "5.975", r"stated as 5\.975 m .* 3\.28084 times less.*in feet; write .*1\.821"),
        ("1.8213", "71.70", r"field 'rtk\.known_distances\.rear - front_left': '71\.7'"),
        ("height = 0.", "height = 62.", r"rear\.height': '62.* no antenna's height on a vehicle"),
    ],
    ids=["centimetres", "feet", "inches", "height"],
)
def test_lengths_in_another_unit_are_named(tmp_path, old, new, words):
    road = road_of(0, degrees=90.0, interval=1.0)
    write_road(tmp_path / "road", road.steps, DISTANCES.replace(old, new))
    toml = tmp_path / "road" / "campaign.toml"
    if old.startswith("height"):
        toml.write_text(toml.read_text().replace(old, new))
    with pytest.raises(GtvalError, match=words):
        solved(tmp_path / "road")
