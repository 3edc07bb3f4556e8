"""Rows of numbers without names: TUM, KITTI, EuRoC, RAWSEEDS; evo reads the same."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError, InputError
from validation.poses.trajectory import Trajectory
from validation.trajectories.formats import read_trajectory, trajectory_text, write_trajectory
from validation.trajectories.formats.covariances import checked_covariances
from validation.trajectories.formats.reading import format_of
from validation.trajectories.formats.records import Records
from validation.trajectories.formats.source import Source

REAL = Path(os.environ.get("GTVAL_REAL_DATA", Path(__file__).parents[5] / "shared" / "real"))
BICOCCA = REAL / "trajectories" / "bicocca_25a"
real = pytest.mark.skipif(
    not BICOCCA.is_dir(), reason=f"no real trajectories at {BICOCCA}; set GTVAL_REAL_DATA"
)


@pytest.mark.parametrize("form", ["tum", "euroc", "kitti"])
def test_evo_reads_what_is_written_and_writes_what_is_read(tmp_path, drive, same, form):
    evo = pytest.importorskip("evo.tools.file_interface")
    before = drive("space", covariance=False)
    path = tmp_path / f"a.{form}"
    files = write_trajectory(before, path, form)
    if form == "kitti":
        theirs = evo.read_kitti_poses_file(str(path))
        times = np.loadtxt(files[1])
    else:
        read = {"tum": evo.read_tum_trajectory_file, "euroc": evo.read_euroc_csv_trajectory}[form]
        theirs = read(str(path))
        times = theirs.timestamps
    np.testing.assert_allclose(times - before.epoch, before.times, rtol=0, atol=2.5e-7)
    np.testing.assert_array_equal(theirs.positions_xyz, before.positions)
    quaternions = np.roll(theirs.orientations_quat_wxyz, -1, axis=1)
    turned = Rotation.from_quat(quaternions).inv() * before.rotations
    np.testing.assert_allclose(turned.magnitude(), 0, atol=1e-12)
    if form == "tum":
        evo.write_tum_trajectory_file(str(tmp_path / "theirs.txt"), theirs)
    if form == "kitti":
        evo.write_kitti_poses_file(str(tmp_path / "theirs.txt"), theirs)
    if form != "euroc":
        after = read_trajectory(tmp_path / "theirs.txt", times=files[-1] if files[1:] else None)
        same(after, before, atol=1e-12, seconds=2.5e-7)


@pytest.mark.parametrize("form", ["tum", "tum_covariance", "euroc", "kitti"])
@pytest.mark.parametrize("kind", ["space", "plane"])
@pytest.mark.parametrize("ending", ["", ".gz"])
def test_round_trips(tmp_path, drive, same, form, kind, ending):
    before = drive(kind)
    files = write_trajectory(before, tmp_path / f"a.txt{ending}", form)
    assert format_of(files[0]) == form
    after = read_trajectory(files[0], times=files[-1] if form == "kitti" else None)
    same(after, before, atol=1e-15 if form != "kitti" else 1e-12)
    if form == "tum_covariance":
        wanted = before.covariances.copy()
        if kind == "space":
            wanted[:, :3, 3:] = wanted[:, 3:, :3] = 0
        else:
            wanted[:, :2, 2] = wanted[:, 2, :2] = 0
        np.testing.assert_allclose(after.covariances, wanted, rtol=1e-9, atol=1e-15)


def test_tum_keeps_every_bit(tmp_path, drive):
    before = drive("space", covariance=False)
    (tmp_path / "a.txt").write_text(trajectory_text(before, "tum"))
    after = read_trajectory(tmp_path / "a.txt")
    np.testing.assert_array_equal(after.poses, before.poses)
    assert after.times_since(before.epoch).tolist() == before.times.tolist()


def test_tum_files_with_stamps_in_nanoseconds(written):
    text = "1403636579763555527 1 2 3 0 0 0 1\n1403636579813555456 1 2 4 0 0 0 1\n"
    found = read_trajectory(written("a.txt", text))
    assert found.times.tolist() == [0.763555527, 0.813555456]
    assert "stamps are in ns" in found.provenance["notes"][0]


def test_the_covariance_of_openvins_is_of_a_turn_in_the_moving_frame(written):
    """A robot that looks along Y and may be rolled by 0.1 rad is uncertain about Y in the room."""
    row = "{} 1 2 3 0 0 0.70710678 0.70710678 1e-2 0 0 1e-4 0 1e-4 1e-6 0 0 4e-6 0 9e-6\n"
    found = read_trajectory(written("a.txt", row.format(1e9) + row.format(1e9 + 0.1)))
    assert found.provenance["format"] == "tum_covariance"
    wanted = [1e-6, 4e-6, 9e-6, 1e-4, 1e-2, 1e-4]
    np.testing.assert_allclose(np.diagonal(found.covariances[0]), wanted, rtol=1e-6)


def test_kitti_needs_its_times(tmp_path, drive):
    before = drive("space")
    poses, times = write_trajectory(before, tmp_path / "00.kitti")
    with pytest.raises(InputError, match="--times"):
        read_trajectory(poses)
    times.write_text("".join(times.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(InputError, match=r"60 poses, but .* has 59 times"):
        read_trajectory(poses, times=times)


def test_a_matrix_that_mirrors_is_no_pose(written):
    times = written("times.txt", "0.0\n0.1\n")
    rows = "1 0 0 1 0 1 0 2 0 0 1 3\n1 0 0 1 0 1 0 2 0 0 -1 3\n"
    with pytest.raises(InputError, match=r"line 2, field 'rotation': not a rotation matrix"):
        read_trajectory(written("a.txt", rows), times=times)


def test_the_files_of_euroc(written):
    header = (
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
        "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1],"
        " b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
        "b_a_RS_S_z [m s^-2]\n"
    )
    row = "1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152"
    rows = "".join(f"{row.replace('838', str(k))},0,0,0,0,0,0,0,0,0\r\n" for k in (838, 843))
    for text in (header + rows, rows):
        found = read_trajectory(written("data.csv", text))
        assert found.provenance["format"] == "euroc"
        assert (found.epoch, found.times[0]) == (1403636580, 0.838555648)
        turned = Rotation.from_quat([-0.153029, -0.827383, -0.082152, 0.534108])
        assert (found.rotations[0].inv() * turned).magnitude() < 1e-6
    leica = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]\n"
    leica += "1403636579763555527,1,2,3\n1403636579813555456,1,2,4\n"
    found = read_trajectory(written("leica.csv", leica))
    assert found.kind == "points_space"
    assert found.times[0] == 0.763555527


def test_eight_columns_with_commas_may_be_two_formats(written):
    rows = "1403636579763555527,1,2,3,0,0,0,1\n1403636579813555456,1,2,4,0,0,0,1\n"
    with pytest.raises(InputError, match="--from tum or --from euroc"):
        read_trajectory(written("a.csv", rows))
    upright = read_trajectory(written("a.csv", rows), format="tum")
    turned = read_trajectory(written("a.csv", rows), format="euroc")
    assert upright.rotations[0].magnitude() == 0
    assert turned.rotations[0].magnitude() == pytest.approx(np.pi)
    assert read_trajectory(written("a.tum", rows)).rotations[0].magnitude() == 0


def test_points_have_no_place_in_formats_of_poses(drive):
    for form in ("tum", "tum_covariance", "kitti"):
        with pytest.raises(GtvalError, match="without orientation"):
            trajectory_text(drive("points_space"), form)
    with pytest.raises(GtvalError, match="is no format of text"):
        trajectory_text(drive(), "word")


def test_poses_flat_on_the_floor_are_poses_in_the_plane(tmp_path, drive, same):
    flat, climbing = drive("plane"), drive("space")
    (tmp_path / "a.txt").write_text(trajectory_text(flat, "tum"))
    found = read_trajectory(tmp_path / "a.txt")
    same(found, flat, atol=1e-12)
    assert "in the plane" in found.provenance["notes"][0]
    (tmp_path / "a.txt").write_text(trajectory_text(climbing, "tum"))
    assert read_trajectory(tmp_path / "a.txt").kind == "space"


@real
def test_the_ground_truth_of_rawseeds():
    found = read_trajectory(BICOCCA / "GROUNDTRUTH.csv.gz")
    assert (found.system, found.kind, len(found)) == ("GROUNDTRUTH", "plane", 4207)
    assert (found.epoch, found.times[0]) == (1235561680, 0.680798)
    np.testing.assert_array_equal(found.poses[0], [-0.349688, -6.364827, 1.396411])
    wanted = [[12e-6, 0, 3e-6], [0, 9e-6, 0], [3e-6, 0, 16e-6]]
    np.testing.assert_allclose(found.covariances[0], wanted, rtol=1e-12)
    assert np.isfinite(found.covariances).all()
    assert np.linalg.eigvalsh(found.covariances).min() > 0
    by_hand = read_trajectory(BICOCCA / "GT-extended.csv.gz")
    assert (by_hand.kind, len(by_hand)) == ("plane", 1762)
    assert not by_hand.has_covariance.any()


@real
@pytest.mark.parametrize("name", ["GROUNDTRUTH.csv.gz", "GT-extended.csv.gz"])
def test_real_files_go_through_gtvals_own_exactly(tmp_path, name):
    before = read_trajectory(BICOCCA / name)
    write_trajectory(before, tmp_path / "a.csv")
    after = read_trajectory(tmp_path / "a.csv")
    for field in ("times", "poses", "covariances"):
        np.testing.assert_array_equal(getattr(after, field), getattr(before, field))


def rawseeds(*covariances):
    rows = [
        f"{1e9 + k / 10:.6f},0,{k},0,{','.join(f'{one:.6f}' for one in np.ravel(matrix))}\n"
        for k, matrix in enumerate(covariances)
    ]
    return "".join(rows)


def test_a_variance_printed_as_zero_stands_for_half_of_the_last_digit(written):
    small = np.diag([4e-6, 1e-7, 9e-6])
    found = read_trajectory(written("a.csv", rawseeds(small, small)))
    np.testing.assert_allclose(np.diagonal(found.covariances[0]), [4e-6, 5e-7, 9e-6], rtol=1e-12)
    assert "half of the last digit" in " ".join(found.provenance["notes"])


def test_covariances_of_zeros_state_nothing(written):
    found = read_trajectory(written("a.csv", rawseeds(np.zeros((3, 3)), np.diag([1e-4] * 3))))
    assert found.has_covariance.tolist() == [False, True]


def test_rounding_is_repaired_upwards_and_nothing_else():
    """Of many true covariances, printed with six decimals, none is refused or mended too little."""
    rng = np.random.default_rng(5)
    roots = rng.normal(0, 1e-3, (3000, 3, 3)) * [1, 0.3, 0.02] * rng.uniform(0.2, 2, (3000, 3, 1))
    true = roots @ roots.transpose(0, 2, 1)
    printed = np.round(true, 6)
    source = Source(Path("a.csv"), b"")
    records = Records(source, "rawseeds", range(1, 3001), [], np.empty(0), digit=1e-6)
    found = checked_covariances(printed.copy(), records)
    stated = np.isfinite(found).all((1, 2))
    assert stated.sum() > 2000
    assert np.linalg.eigvalsh(found[stated]).min() > 0
    # Half of the last digit stands for variances printed as zero.
    diagonal = np.arange(3)
    raised = printed[stated].copy()
    raised[:, diagonal, diagonal] += 5e-7 * (raised[:, diagonal, diagonal] == 0)
    broken = np.linalg.eigvalsh(raised).min(1) <= 0
    assert broken.sum() > 100
    # What was added is at least what the printing may have hidden.
    excess = np.linalg.eigvalsh(found[stated][broken] - true[stated][broken])
    assert excess.min() > -1e-12


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (np.array([[1e-4, 5e-4, 0], [5e-4, 1e-4, 0], [0, 0, 1e-4]]), "not positive definite"),
        (np.diag([1e-4, -1e-4, 1e-4]), "not positive definite"),
        (np.array([[1e-4, 5e-5, 0], [1e-5, 1e-4, 0], [0, 0, 1e-4]]), "not symmetric"),
    ],
)
def test_what_no_rounding_explains_is_refused(written, matrix, said):
    path = written("a.csv", rawseeds(np.diag([1e-4] * 3), matrix))
    with pytest.raises(InputError, match=f"line 2, field 'covariance': the covariance is {said}"):
        read_trajectory(path)


def test_a_fourth_column_that_is_no_heading_is_told(written):
    path = written("a.csv", "1000000000.0,1,2,0.1\n1000000000.1,1,2,9.3\n")
    with pytest.raises(InputError, match=r"line 2, field 'theta': '9\.3' — not a heading"):
        read_trajectory(path)


def test_a_trajectory_keeps_quaternions_of_length_one_as_they_are():
    poses = np.tile([0, 0, 0, 0.1, 0.2, 0.3, np.sqrt(1 - 0.14)], (2, 1))
    once = Trajectory("a", [0, 1], poses, "space").poses
    np.testing.assert_array_equal(Trajectory("a", [0, 1], once, "space").poses, once)
    twice = Trajectory("a", [0, 1], np.column_stack([poses[:, :3], 2 * poses[:, 3:]]), "space")
    np.testing.assert_allclose(twice.poses, once, rtol=1e-15)
