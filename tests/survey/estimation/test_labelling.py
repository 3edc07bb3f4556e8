from dataclasses import replace

import numpy as np
import pytest
from surveys import ad23, case, simulated

from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from survey.estimation.evidence import Evidence
from survey.estimation.labelling import _symmetries
from survey.estimation.solve import solve_survey
from survey.readings.readings import Readings
from validation.campaign.folder import Vframe
from validation.errors import GtvalError

SWAP = {"X": "Y", "Y": "X"}


def relabelled(readings, meaning):
    return replace(
        readings,
        start=tuple(meaning.get(n, n) for n in readings.start),
        end=tuple(meaning.get(n, n) for n in readings.end),
    )


def without_robot(readings):
    keep = ["/" not in a + b for a, b in zip(readings.start, readings.end, strict=True)]
    return readings.select(np.array(keep))


def solve(readings, evidence=None, solved=None):
    solved = solved or case(0)
    rig = solved.simulated.robot_frame
    return solve_survey(solved.room.vframe, rig, readings, solved.room.world_names, evidence)


def test_readings_to_the_vframe_alone_cannot_tell_a_mirror_image():
    readings = without_robot(case(0).simulated.readings)
    costs = []
    for labels in ({}, SWAP):
        verdict = solve(relabelled(readings, labels)).labelling
        assert verdict.status == "unconfirmed"
        assert dict(SWAP) in [dict(other.meaning) for other in verdict.open_mirrors]
        costs.append(verdict.given.cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)


def test_handedness_of_the_rig_confirms_right_labels_and_refuses_wrong_ones():
    readings = case(0).simulated.readings
    verdict = solve(readings).labelling
    assert verdict.status == "confirmed"
    assert verdict.decided_by == ("robot-frame readings",)
    with pytest.raises(GtvalError, match=r'exchanged.*mirror image.*robot-frame.*X = "Y"'):
        solve(relabelled(readings, SWAP))


@pytest.mark.parametrize("kind", ["published", "hand"])
def test_one_point_known_from_elsewhere_is_enough(kind):
    solved = case(0)
    readings = without_robot(solved.simulated.readings)
    # A point far from the mirror line x = y.
    points = solved.room.world_points
    i = int(np.abs(points[:, 0] - points[:, 1]).argmax())
    rough = {solved.room.world_names[i]: points[i] + [0.15, -0.1] * np.array(kind == "hand")}
    evidence = Evidence(**{kind: rough})
    assert solve(readings, evidence).labelling.status == "confirmed"
    with pytest.raises(GtvalError, match="mirror image"):
        solve(relabelled(readings, SWAP), evidence)


def test_labels_turned_by_a_quarter_are_refused_where_a_point_is_known():
    solved = case(0)
    turn = {"O": "X", "X": "XY", "XY": "Y", "Y": "O"}
    evidence = Evidence(hand={solved.room.world_names[0]: solved.room.world_points[0]})
    with pytest.raises(GtvalError, match="turned about the frame"):
        solve(relabelled(solved.simulated.readings, turn), evidence)


def test_rough_poses_are_evidence_against_turned_labels():
    solved = case(0)
    turn = {"O": "X", "X": "XY", "XY": "Y", "Y": "O"}
    truth = solved.simulated.truth.poses
    guesses = dict(zip(truth.ids, truth.poses + np.array([0.2, -0.2, 0.3]), strict=True))
    with pytest.raises(GtvalError, match="hand-measured poses"):
        solve(relabelled(solved.simulated.readings, turn), Evidence(guesses=guesses))


def test_two_exchanged_labels_that_are_no_symmetry_are_found():
    readings = case(0).simulated.readings
    swap = {"O": "X", "X": "O"}
    with pytest.raises(GtvalError, match=r'O = "X", X = "O"'):
        solve(relabelled(readings, swap))


def test_an_unsymmetric_frame_is_unambiguous():
    solved = case(0)
    vframe = solved.room.vframe.model_copy(
        update={"points": {"A": (0.0, 0.0), "B": (3.0, 0.0), "C": (0.5, 2.0)}}
    )
    places = np.array(list(vframe.points.values()))
    world = solved.room.world_points
    start = [name for name in solved.room.world_names for _ in places]
    distance = np.linalg.norm(world[:, None] - places[None], axis=2).ravel()
    readings = Readings(tuple(start), tuple(vframe.points) * len(world), distance, 0.002)
    rig = solved.simulated.robot_frame
    verdict = solve_survey(vframe, rig, readings, solved.room.world_names).labelling
    assert verdict.status == "unambiguous"


@pytest.mark.parametrize("seed", range(40))
def test_right_labels_of_small_rooms_are_never_refused(seed):
    room, survey = simulated(seed, 3, missing=0.3)
    solve_survey(room.vframe, survey.robot_frame, survey.readings, room.world_names)


def test_ad23_labels_as_printed_are_refused_because_coordinates_were_printed():
    outcome = ad23()
    settings = outcome.campaign.settings
    readings = relabelled(outcome.inputs.file.used, SWAP)
    arguments = (
        settings.vframe,
        settings.robot_frame,
        readings,
        outcome.inputs.settings.world_points,
    )
    with pytest.raises(GtvalError, match=r'published coordinates.*X = "Y", Y = "X"'):
        solve_survey(*arguments, outcome.inputs.evidence)
    no_print = replace(outcome.inputs.evidence, published={})
    assert solve_survey(*arguments, no_print).labelling.status == "unconfirmed"
    assert outcome.solution.labelling.decided_by == ("published coordinates",)


@pytest.mark.parametrize(
    ("points", "turns", "mirrors"),
    [
        ([[0, 0], [2.5, 0], [0, 2.5], [2.5, 2.5]], 4, 4),
        ([[0, 0], [3, 0], [0, 2], [3, 2]], 2, 2),
        ([[0, 0], [3, 0], [0, 2]], 1, 0),
        ([[0, 0], [3, 0], [1.5, 2]], 1, 1),
        ([[np.cos(a), np.sin(a)] for a in np.arange(6) * np.pi / 3], 6, 6),
        ([[np.cos(a), np.sin(a)] for a in np.arange(9) * 2 * np.pi / 9], 9, 9),
    ],
    ids=["square", "rectangle", "triangle", "isosceles", "hexagon", "nonagon"],
)
def test_all_symmetries_of_a_frame_are_found(points, turns, mirrors):
    points = np.array(points, dtype=float)
    found = _symmetries(points)
    assert found[0][0] == tuple(range(len(points)))
    assert sum(not motion.is_mirror for _, motion in found) == turns
    assert sum(motion.is_mirror for _, motion in found) == mirrors
    for order, motion in found:
        moved = points @ motion.matrix.T + motion.shift
        assert np.allclose(moved, points[list(order)], atol=1e-9)


def test_a_symmetric_frame_of_six_points_with_exchanged_labels_is_refused():
    names = ["A", "B", "C", "D", "E", "F"]
    corners = 1.5 * np.exp(1j * np.arange(6) * np.pi / 3)
    places = [(c.real, c.imag) for c in corners]
    vframe = Vframe(points=dict(zip(names, places, strict=True)))
    rng = np.random.default_rng(8)
    room = make_room(RoomSettings(stops=3), rng, vframe)
    survey = simulate_survey(room, SimulationSettings(), rng)
    mirrored = dict(zip(names, ["A", "F", "E", "D", "C", "B"], strict=True))
    readings = relabelled(survey.readings, mirrored)
    with pytest.raises(GtvalError, match="labels of the Vframe points are exchanged"):
        solve_survey(vframe, survey.robot_frame, readings, room.world_names)
