"""The synthetic room from scans to poses, against its truth."""

import numpy as np
import pytest
from laser_rooms import solved, write_campaign
from scipy.stats import chi2

from data_samples.rooms.scanners import SICK_FRONT
from laser_gt.placing.solution import solve
from laser_gt.scans.planar import between, compose
from validation.poses.angles import wrap
from validation.poses.pose_table import from_csv


def _errors(folder, stops, poses):
    truth = from_csv(folder / "truth" / "poses.csv").select(stops).poses
    difference = poses - truth
    difference[:, 2] = wrap(difference[:, 2])
    return difference


def _use_references(folder, references):
    toml = folder / "campaign.toml"
    names = ", ".join(f'"{stop}"' for stop in references)
    toml.write_text(toml.read_text().replace("[laser]\n", f"[laser]\nreference = [{names}]\n"))


def test_a_small_room_is_placed_and_its_errors_fit_their_covariance(tmp_path):
    write_campaign(tmp_path, seed=9, stops=7)
    outcome = solved(tmp_path)
    solution = outcome.solutions["scanmatch"]
    assert solution.lost == ()
    difference = _errors(tmp_path, solution.stops, solution.placement.poses).ravel()
    nees = difference @ np.linalg.solve(solution.placement.joint, difference)
    # chi-squared with 21 degrees of freedom, 0.01 % on either side
    assert 4 < nees < 53


def test_without_odometry_the_scans_find_their_way_alone(tmp_path):
    write_campaign(tmp_path, seed=9, stops=7)
    (tmp_path / "laser" / "odometry.csv").unlink()
    outcome = solved(tmp_path)
    assert outcome.trajectory.source.startswith("scans matched")
    solution = outcome.solutions["scanmatch"]
    assert solution.lost == ()
    difference = _errors(tmp_path, solution.stops, solution.placement.poses)
    assert np.abs(difference[:, :2]).max() < 0.02


@pytest.mark.parametrize("initial", ["gpm", "kiss"])
def test_other_initialisers_lead_to_the_same_poses(tmp_path, initial):
    write_campaign(tmp_path, seed=9, stops=4)
    usual = solved(tmp_path)
    toml = tmp_path / "campaign.toml"
    toml.write_text(toml.read_text().replace("[laser]\n", f'[laser]\ninitial = "{initial}"\n'))
    other = solved(tmp_path)
    assert other.settings.initial == initial
    poses, same = (one.solutions["scanmatch"].placement.poses for one in (usual, other))
    # the matcher ends where the scans say, whatever it starts from
    assert np.abs(poses - same).max() < 1e-3


def test_a_pair_that_closes_no_loop_is_no_longer_accepted(tmp_path):
    from dataclasses import replace

    from laser_gt.placing.loops import with_loops

    write_campaign(tmp_path, seed=9, stops=8)
    outcome = solved(tmp_path)
    matching = outcome.matchings["scanmatch"]
    in_loop = set(matching.loops[0].stops)
    good = sorted(matching.accepted, key=lambda m: not {m.reference, m.moving} <= in_loop)
    moved = good[0].pose + np.array([0.2, 0.0, 0.0])
    wrong = replace(good[0], pose=moved, seen_pose=moved)
    found, _ = with_loops([wrong, *good[1:]])
    assert found[0].verdict == "may be wrong"
    assert "loops" in found[0].reasons[-1]
    # the rest of the graph does without it
    matching = replace(matching, matches=found)
    read = outcome.inputs
    again = solve(
        read.stops,
        read.mount,
        read.mount_sigmas,
        outcome.trajectory.poses,
        matching,
        outcome.surveyed,
    )
    difference = again.placement.poses - outcome.solutions["scanmatch"].placement.poses
    assert np.abs(difference[:, :2]).max() < 0.005


def _chi_squared(folder):
    """Squared errors of a room's matches and of its poses in units of their covariances."""
    outcome = solved(folder)
    solution = outcome.solutions["scanmatch"]
    errors = _errors(folder, solution.stops, solution.placement.poses).ravel()
    joint = errors @ np.linalg.solve(solution.placement.joint, errors)
    truth = from_csv(folder / "truth" / "poses.csv")
    laser = dict(zip(truth.ids, compose(truth.poses, np.array(SICK_FRONT.mount)), strict=True))
    matches = []
    for one in solution.matching.accepted:
        difference = one.pose - between(laser[one.reference], laser[one.moving])
        difference[2] = wrap(difference[2])
        matches.append(difference @ np.linalg.solve(one.covariance, difference))
    return float(joint), errors.size, float(np.mean(matches))


@pytest.mark.full
def test_covariances_of_matches_and_poses_are_right_over_many_rooms(tmp_path):
    rooms, stops = 20, 6
    for room in range(rooms):
        write_campaign(tmp_path / str(room), seed=8000 + room, stops=stops)
    joint, size, matches = zip(
        *(_chi_squared(tmp_path / str(room)) for room in range(rooms)), strict=True
    )
    low, high = chi2.ppf([0.025, 0.975], sum(size))
    assert low < sum(joint) < high
    # The matches of a room say how its scans lie to each other, and no more is independent.
    free = (stops - 1) * rooms
    low, high = chi2.ppf([0.025, 0.975], 3 * free) / free
    assert low < np.mean(matches) < high


@pytest.mark.full
def test_a_room_of_26_stops_to_millimetres_by_both_engines(tmp_path):
    write_campaign(tmp_path, seed=3, stops=26)
    outcome = solved(tmp_path, None)
    assert set(outcome.solutions) == {"scanmatch", "genetic"}
    for solution in outcome.solutions.values():
        difference = _errors(tmp_path, solution.stops, solution.placement.poses)
        assert len(difference) == 26
        assert np.abs(difference.mean(0)[:2]).max() < 0.003
        assert difference.std(0, ddof=1)[:2].max() < 0.005
        assert difference.std(0, ddof=1)[2] < 0.002


@pytest.mark.full
def test_the_published_way_with_a_wrong_mount_gives_the_documents_errors(tmp_path):
    write_campaign(tmp_path, seed=5, stops=26, mount_error=(0.09, 0.05, 0.0))
    _use_references(tmp_path, ["6"])
    outcome = solved(tmp_path, as_published=True)
    difference = _errors(tmp_path, outcome.published.stops, outcome.published.poses)
    spread = difference.std(0, ddof=1)[:2]
    # printed: 0.078 and 0.066 (genetic), 0.090 and 0.074 (scan match)
    assert (spread > 0.04).all()
    assert (spread < 0.11).all()
    # they are a circle in the heading: a mount error turned by the robot
    heading = from_csv(tmp_path / "truth" / "poses.csv").select(outcome.published.stops).poses[:, 2]
    cosine, sine, one, zero = np.cos(heading), np.sin(heading), np.ones(26), np.zeros(26)
    design = np.vstack(
        [
            np.column_stack([cosine, -sine, one, zero]),
            np.column_stack([sine, cosine, zero, one]),
        ]
    )
    observed = difference[:, :2].T.ravel()
    left = observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0]
    assert left.std() < 0.2 * observed.std()
    assert not outcome.mount_check.agrees
    assert np.abs(outcome.mount_check.difference[:2] - [0.09, 0.05]).max() < 0.003


def test_glass_and_moved_bins_leave_few_matches_for_the_eye_and_none_wrong(tmp_path):
    from data_samples.rooms.campaign_files import write_campaign as write_files
    from data_samples.rooms.laser_campaign import laser_files, with_faults
    from data_samples.rooms.rooms import RoomSettings, make_room
    from data_samples.rooms.simulate import SimulationSettings, simulate_survey

    rng = np.random.default_rng(41)
    room = make_room(RoomSettings(stops=12), rng)
    survey = simulate_survey(room, SimulationSettings(systems=()), rng)
    write_files(tmp_path, survey, 41, laser_files(room, with_faults(["boxes", "glass"]), rng))
    outcome = solved(tmp_path)
    matching = outcome.matchings["scanmatch"]
    assert len(matching.accepted) > 0.8 * len(matching.matches)
    truth = dict(zip(room.stop_names, room.stops, strict=True))
    for one in matching.accepted:
        ends = [compose(truth[stop], outcome.inputs.mount) for stop in (one.reference, one.moving)]
        off = one.pose - between(*ends)
        # 20 mm and 10 mrad, as for any accepted match
        assert np.hypot(*off[:2]) < 0.02
        assert abs(wrap(off[2])) < 0.01
