"""The fixtures that pytest has once gtval is installed."""

import math
import re
import subprocess
import sys
import time

import numpy as np
import pytest

import gtval
import gtval.testing as samples

pytest_plugins = ["pytester"]
NAMES = (
    "gtval_drive", "gtval_fixes", "gtval_images", "gtval_motion", "gtval_room", "gtval_scans",
    "gtval_survey",
)  # fmt: skip


def test_pytest_lists_them_with_what_they_are(tmp_path):
    command = [sys.executable, "-m", "pytest", "--fixtures", "-p", "no:cacheprovider", tmp_path]
    told = subprocess.run(command, check=False, capture_output=True, text=True).stdout
    for name in NAMES:
        assert f"\n{name}" in told
    assert "Campaign folder of a synthetic room with its survey; the truth beside it." in told


def joint_nees(truth, poses):
    """Squared distance of all poses from the true ones, by their joint covariance."""
    off = gtval.compare(truth, poses).comparison.errors.ravel()
    return off @ np.linalg.solve(poses.joint, off)


def test_a_room_can_be_run_and_its_truth_is_beside_it(gtval_room):
    done = gtval.run_campaign(gtval_room.folder)
    # 36 numbers: 99.9 % of honest surveys are below 68.
    assert joint_nees(gtval_room.truth, done.validation) < 68
    assert gtval_room.walls.shape[1:] == (2, 2)
    assert len(gtval_room.world_points) == 16


@pytest.mark.parametrize("gtval_room", [{"stops": 5, "laser": True}], indirect=True)
def test_a_test_chooses_its_options(gtval_room):
    assert len(gtval_room.truth) == 5
    assert (gtval_room.folder / "laser" / "scans.csv").exists()


def test_readings_give_the_true_poses(gtval_survey):
    solution = gtval.solve_survey(**gtval_survey.survey)
    assert joint_nees(gtval_survey.truth, solution.pose_table()) < 68
    assert set(gtval_survey.world_points) == set(gtval_survey.survey["world_points"])


def test_scans_lie_where_the_truth_says(gtval_scans):
    for row, (first, second) in enumerate(
        zip(gtval_scans.scans[:-1], gtval_scans.scans[1:], strict=True)
    ):
        found = gtval.match_scans(first, second, gtval_scans.guesses[row])
        off = found.pose - gtval_scans.truth[row]
        if found.verdict == "accepted":
            # chi-squared with 3 degrees of freedom: beyond 21.1 once in 10,000 right matches.
            assert off @ np.linalg.solve(found.covariance, off) < 21.1


def test_markers_are_where_the_truth_says(gtval_images):
    sample = gtval_images
    found = gtval.locate_markers(sample.images[0], sample.camera, sample.sides, sample.family)
    assert len(found) >= 2
    for one in found:
        seen, true = one.T_camera_marker[0].translation, sample.truth[0][one.number].translation
        # Where the axis meets the image, in pixels: four corners of 0.5 pixels at worst.
        focal = sample.camera.parameters[0]
        assert np.abs(focal * (seen[:2] / seen[2] - true[:2] / true[2])).max() < 3 * 0.25


def test_a_drive_is_a_campaign_and_records(gtval_drive):
    assert (gtval_drive.folder / "campaign.toml").exists()
    assert gtval_drive.records[0].receiver == "rear"
    assert len(gtval_drive.truth.components) == 6


@pytest.mark.full
def test_another_seed_gives_another_room(pytester):
    pytester.makepyfile(
        """
        def test_it(gtval_survey):
            print("distance", gtval_survey.survey["distance"][6])
        """
    )
    told = [
        pytester.runpytest_subprocess("-s", "-p", "no:cacheprovider", f"--gtval-seed={seed}")
        for seed in (1, 1, 2)
    ]
    lines = [next(x for x in one.outlines if "distance" in x) for one in told]
    assert lines[0] == lines[1] != lines[2]


@pytest.mark.parametrize("gtval_motion", [{"minutes": 1.0, "level": 2}], indirect=True)
def test_a_motion_is_trajectories_and_their_true_clocks(gtval_motion):
    assert set(gtval_motion.clocks) == set(gtval_motion.cameras)
    assert gtval_motion.level.length == 0.008
    assert gtval_motion.truth.frame == gtval_motion.reference.frame


def test_a_room_and_its_scans_cost_next_to_nothing():
    # Processor time, the best of five: less than 50 ms a room and 1 s for the scans of 26 stops.
    def least(make):
        times = []
        for _ in range(5):
            start = time.process_time()
            make()
            times.append(time.process_time() - start)
        return min(times)

    assert least(lambda: samples.make_survey(stops=26)) < 0.05
    assert least(lambda: samples.make_scans(stops=26)) < 1


def test_samples_in_memory_leave_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    samples.make_survey(blunders=1)
    samples.make_scans(faults=["boxes"])
    samples.make_fixes(loops=1, missing=0.1)
    samples.make_motion(minutes=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("gtval_survey", [{"blunders": 2, "typos": 1}], indirect=True)
def test_the_wrong_readings_are_those_that_the_solver_suspects(gtval_survey):
    solution = gtval.solve_survey(**gtval_survey.survey)
    suspects = {row for one in solution.suspicions for row in one.candidates.tolist()}
    assert len(gtval_survey.wrong_readings) == 3
    # A typing error may be smaller than the noise; two of 0.1 m are not.
    assert len(suspects & set(gtval_survey.wrong_readings)) >= 2


def test_the_folder_and_the_memory_are_the_same_room(tmp_path):
    options = {"seed": 4, "stops": 5, "bias": (0.1, 0.0, 0.0)}
    folder, memory = samples.make_room(tmp_path, **options), samples.make_survey(**options)
    assert np.array_equal(folder.truth.poses, memory.truth.poses)
    assert np.array_equal(folder.survey["distance"], memory.survey["distance"])
    assert np.array_equal(folder.example.poses, memory.example.poses)


def test_faults_of_scans_are_in_them_and_nothing_else_changes():
    clean, boxes = samples.make_scans(seed=3), samples.make_scans(seed=3, faults=["boxes"])
    assert np.array_equal(clean.poses, boxes.poses)
    # A range is nearer by more than ten of its standard deviations of 10 mm only at a box.
    nearer = [(two.ranges < one.ranges - 0.1).mean()
              for one, two in zip(clean.scans, boxes.scans, strict=True)]  # fmt: skip
    assert 0.005 < np.mean(nearer) < 0.3
    lost = samples.make_scans(seed=3, faults=["lost"])
    assert 0.02 < np.mean([~np.isfinite(one.ranges) for one in lost.scans]) < 0.08
    assert np.isfinite([one.ranges for one in clean.scans]).all()
    with pytest.raises(ValueError, match="no such fault: fog"):
        samples.make_scans(faults=["fog"])


def test_odometry_starts_at_the_truth_and_drifts():
    made = samples.make_scans(seed=2, stops=12)
    assert np.array_equal(made.odometry[0], made.poses[0])
    drift = np.hypot(*(made.odometry - made.poses)[:, :2].T)
    assert drift[-1] > drift[1]
    assert drift.max() < 12 * (0.05 + 0.04 * 3)


@pytest.mark.parametrize("gtval_fixes", [{"loops": 1, "missing": 0.3}], indirect=True)
def test_fixes_are_a_drive_in_memory(gtval_fixes):
    whole = samples.make_fixes(seed=1, loops=1)
    for one, other in zip(gtval_fixes.records, whole.records, strict=True):
        wanted = 0.7 * len(other.times)
        # binomial: five standard deviations
        assert abs(len(one.times) - wanted) < 5 * np.sqrt(0.3 * wanted)
    assert len(gtval_fixes.truth.components) == 6


@pytest.mark.parametrize(
    ("make", "options", "said"),
    [
        (samples.make_survey, {"typos": -1}, "typos = -1: expected 0 or more"),
        (samples.make_survey, {"missing": 2.0}, "missing = 2.0: expected from 0 to 1"),
        (samples.make_survey, {"missing": math.nan}, "missing = nan: expected from 0 to 1"),
        (samples.make_survey, {"world_points": 1}, "world_points = 1: expected 2 or more"),
        (samples.make_scans, {"stops": 99}, "stops = 99: expected from 1 to 26"),
        (samples.make_scans, {"stops": 0}, "stops = 0: expected from 1 to 26"),
        (samples.make_images, {"images": 0}, "images = 0: expected 1 or more"),
        (samples.make_fixes, {"missing": -0.1}, "missing = -0.1: expected from 0 to 1"),
        (samples.make_motion, {"level": 5}, "level = 5: expected from 1 to 4"),
    ],
)
def test_a_sample_that_cannot_be_is_refused_with_the_range(make, options, said):
    with pytest.raises(gtval.GtvalError, match=re.escape(said)):
        make(**options)
