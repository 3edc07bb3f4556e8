"""Poses in space and positions: frame, mount, scale and time, as far as they go."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from validation.cli import main
from validation.explain.space.chain import PARAMETERS, State, begin, look, space_pairs
from validation.explain.space.explanation import explain_in_space
from validation.explain.telling.in_space import space_findings
from validation.poses.pose_table import PLANAR, SPATIAL, PoseTable, to_csv

FRAME = {"turn": [0.02, -0.01, 0.05], "shift": [0.1, 0.2, -0.05]}
MOUNT = {"mount": [0.02, 0.03, -0.05], "arm": [0.1, 0.05, 0.03]}
STILL = (0.0, 0.0, 0.0)


def table(name, places, turned, components=SPATIAL):
    poses = np.column_stack([places, turned.as_euler("ZYX")])[:, : len(components)]
    return PoseTable(name, tuple(map(str, range(len(places)))), poses, components=components)


def room(n, seed, *, turn=STILL, shift=STILL, mount=STILL, arm=STILL, scale=0.0, level=False):
    """A survey, and a system whose errors are frame . scale . given . mount^-1 and noise."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-4, 4, (n, 3)) * [1, 1, 0 if level else 0.2]
    tilts = rng.normal(size=(n, 2)) * (0.0 if level else 0.3)
    turned = Rotation.from_euler("ZYX", np.column_stack([rng.uniform(-3.1, 3.1, n), tilts]))
    frame, on_robot = Rotation.from_rotvec(turn), Rotation.from_rotvec(mount)
    given = frame.inv().apply(places + turned.apply(arm) - shift) / (1 + scale)
    own = frame.inv() * turned * on_robot
    given = given + rng.normal(size=(n, 3)) * 0.005
    own = Rotation.from_rotvec(rng.normal(size=(n, 3)) * 0.003) * own
    return table("survey", places, turned), table("rig", given, own)


def test_slopes_are_those_of_small_steps():
    pairs = space_pairs(*room(6, 1, **FRAME, **MOUNT), {str(i): float(i) for i in range(6)})
    rng = np.random.default_rng(2)
    state = State.none().moved(rng.normal(size=14) * 0.1)
    # Residuals near zero, where a turn vector is its own derivative.
    exact, _ = look(pairs, state)
    assert exact.shape == (6, 6)
    step = 1e-6
    for column, name in enumerate(PARAMETERS):
        by = np.zeros(14)
        by[column] = step
        ends = [look(pairs, state.moved(sign * by))[0][:, :3] for sign in (1, -1)]
        slope = (ends[1] - ends[0]) / (2 * step)
        assert slope == pytest.approx(look(pairs, state)[1][:, :3, column], abs=1e-5), name


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("none", {}),
        ("frame", FRAME),
        ("frame", {"turn": [0.2, -0.1, 2.5], "shift": [10, 0.2, -0.05]}),
        ("mount", MOUNT),
        ("frame_mount", FRAME | MOUNT),
        ("scale", {"scale": 0.01}),
    ],
)
def test_what_is_wrong_is_named(name, wrong, level):
    right = [explain_in_space(*room(20, seed, **wrong, level=level)).name for seed in range(12)]
    # At most 2 % are stated to claim more; 3 of 12 come once in 1000 times.
    assert right.count(name) >= 10


def test_intervals_hold_the_truth():
    held = []
    for seed in range(40):
        one = explain_in_space(*room(24, seed, **(FRAME | MOUNT)))
        values = {p.name: (p.low, p.high) for p in one.parameters}
        truth = {"mount_x": 0.1, "mount_y": 0.05, "frame_x": 0.1, "frame_z": -0.05}
        held += [low <= truth[k] <= high for k, (low, high) in values.items() if k in truth]
    # 160 intervals of 95 %, of which four share a table.
    assert 0.90 <= np.mean(held) <= 1


def test_heights_of_frame_and_mount_are_one_on_a_level_floor():
    one = explain_in_space(*room(20, 1, **(FRAME | MOUNT), level=True))
    assert one.not_told == ("mount_z",)
    values = {p.name: p.value for p in one.parameters}
    assert values["frame_z"] == pytest.approx(-0.08, abs=0.01)
    assert "not_observable" in [finding.code for finding in space_findings(one)]


def test_positions_show_a_lever_arm_where_the_survey_knows_headings():
    survey, rig = room(30, 3, arm=[0.1, 0.05, 0.03])
    one = explain_in_space(survey, rig.only(SPATIAL[:3]))
    assert one.name == "mount"
    assert [p.name for p in one.parameters] == ["mount_x", "mount_y", "mount_z"]
    assert [p.value for p in one.parameters] == pytest.approx([0.1, 0.05, 0.03], abs=0.005)
    other = explain_in_space(survey.only(SPATIAL[:3]), rig)
    assert [p.value for p in other.parameters] == pytest.approx([0.1, 0.05, 0.03], abs=0.005)


def test_positions_alone_show_frame_and_scale_and_say_what_they_cannot():
    survey, rig = (one.only(SPATIAL[:3]) for one in room(30, 4, **FRAME, scale=0.02))
    one = explain_in_space(survey, rig)
    assert one.name == "frame_scale"
    assert one.unasked == ("time", "mount")
    [said] = [finding.text for finding in space_findings(one) if finding.code == "positions_only"]
    assert "lever arm cannot" in said


def test_in_the_plane_positions_have_a_frame_of_three_numbers():
    rng = np.random.default_rng(5)
    poses = np.column_stack([rng.uniform(-4, 4, (25, 2)), rng.uniform(-3, 3, 25)])
    survey = PoseTable("survey", tuple(map(str, range(25))), poses)
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    given = poses[:, :2] @ turn.T + [1, 2] + rng.normal(size=(25, 2)) * 0.003
    one = explain_in_space(survey, PoseTable("ts", survey.ids, given, components=PLANAR[:2]))
    assert one.name == "frame"
    values = {p.name: p.value for p in one.parameters}
    assert set(values) == {"frame_x", "frame_y", "frame_rz"}
    assert values["frame_rz"] == pytest.approx(-0.1, abs=0.002)


def test_gross_errors_do_not_move_the_frame_and_are_named():
    survey, rig = room(24, 6, **FRAME)
    poses = rig.poses.copy()
    poses[[3, 9, 15], 0] += [0.5, -0.8, 1.0]
    one = explain_in_space(survey, PoseTable("rig", rig.ids, poses, components=SPATIAL))
    assert one.name == "frame"
    assert [n for n, good in zip(one.pairs.ids, one.cells, strict=True) if not good[0]] == [
        *("3", "9", "15")
    ]


def test_a_time_offset_of_a_moving_robot_shows():
    n, rng = 60, np.random.default_rng(7)
    times = np.arange(n) * 0.5

    def at(t):
        places = np.column_stack([3 * np.cos(0.4 * t), 2 * np.sin(0.6 * t), 0.3 * np.sin(t)])
        return places, Rotation.from_euler("ZYX", np.column_stack([0.5 * np.sin(t), 0 * t, 0 * t]))

    survey = table("survey", *at(times))
    places, turned = at(times - 0.02)
    turned = Rotation.from_rotvec(rng.normal(size=(n, 3)) * 0.003) * turned
    rig = table("rig", places + rng.normal(size=(n, 3)) * 0.003, turned)
    one = explain_in_space(survey, rig, dict(zip(survey.ids, times, strict=True)))
    assert one.name == "time"
    assert one.parameters[0].value == pytest.approx(0.02, abs=0.002)


def test_what_is_left_must_be_credible():
    survey, rig = room(24, 8, **FRAME)
    stated = np.tile(np.diag([1e-8] * 6), (24, 1, 1))
    tight = [PoseTable(t.system, t.ids, t.poses, stated, SPATIAL) for t in (survey, rig)]
    one = explain_in_space(*tight)
    assert not one.credible
    assert space_findings(one)[0].code == "not_explained"


def test_closed_formulas_begin_near_the_truth():
    pairs = space_pairs(*room(20, 9, turn=[0.5, -1, 2], shift=[3, 4, 5]))
    found = begin(pairs).turn * Rotation.from_rotvec([0.5, -1, 2]).inv()
    # Heights of 0.2 m and less in noise of 5 mm.
    assert found.magnitude() < 0.05


def test_the_command_takes_poses_in_space_and_positions(tmp_path):
    survey, rig = room(20, 1, **FRAME)
    prism = PoseTable("prism", rig.ids, rig.poses[:, :3], components=SPATIAL[:3])
    paths = []
    for one in (survey, rig, prism):
        paths.append(str(tmp_path / f"{one.system}.csv"))
        (tmp_path / f"{one.system}.csv").write_text(to_csv(one))
    done = CliRunner().invoke(main, ["explain", *paths, "--json"])
    told = json.loads(done.stdout)
    assert [told["systems"][name]["explanation"] for name in ("rig", "prism")] == ["frame"] * 2
    shown = CliRunner().invoke(main, ["explain", *paths])
    assert "A wrong frame" in shown.stdout
    refused = CliRunner().invoke(main, ["explain", *paths, "--reference", "rig=1"])
    assert refused.exit_code == 2
