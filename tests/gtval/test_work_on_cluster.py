"""Images and scans worked on by a cluster: the same to the last digit."""

import cv2
import numpy as np
import pytest
from drives import drive_inputs_of

from data_samples.motion.laser import laser_drive
from laser_gt.driving.drive import solve_log
from validation.pieces.cluster import on_cluster
from validation.text_files.json_text import json_text
from vision_gt.images.jobs import MarkerJob, detect_all
from vision_gt.patterns.dictionaries import Family

pytestmark = [pytest.mark.full, pytest.mark.filterwarnings("ignore")]  # Dask's own warnings


def test_markers_in_images_are_the_same(cluster, tmp_path):
    rng = np.random.default_rng(1)
    family = Family("4X4_50")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    jobs = []
    for number in range(14):
        picture = np.full((240, 320), 200.0)
        picture[60:160, 90:190] = cv2.aruco.generateImageMarker(dictionary, number % 5, 100)
        picture = cv2.GaussianBlur(picture, (0, 0), 1.0) + rng.normal(0, 2, picture.shape)
        path = tmp_path / f"{number}.png"
        cv2.imwrite(str(path), picture.clip(0, 255).astype(np.uint8))
        jobs.append(MarkerJob(path, family, tuple(range(5))))
    here = detect_all(jobs, 1)
    assert all(len(one.markers.views) == 1 for one in here)
    with on_cluster(cluster.scheduler_address):
        there = detect_all(jobs, 1)
    assert json_text(there) == json_text(here)


def test_a_drive_is_the_same(cluster):
    inputs = drive_inputs_of(laser_drive(0, minutes=0.25))
    here = solve_log(inputs, 1, lambda _what, _share: None)
    with on_cluster(cluster.scheduler_address):
        there = solve_log(inputs, 1, lambda _what, _share: None)
    np.testing.assert_array_equal(there.trajectory.poses, here.trajectory.poses)
    np.testing.assert_array_equal(there.trajectory.covariances, here.trajectory.covariances)
