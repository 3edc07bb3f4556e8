"""The marker layout from images around the robot."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform
from scipy.stats import chi2
from vision_scenes import camera, seen_robot

from data_samples.rooms.cameras import DIMA_MARKER, T_DIMA_MARKER, looking, robot_layout
from validation.errors import GtvalError
from vision_gt.optics.transforms import change_between
from vision_gt.robot.layout import Frame, UnlinkedMarkersError, fit_layout

DIMA_SIGMAS = np.array([0.0005] * 3 + [0.001] * 3)


def movie(seed: int, count: int = 16, noise: float = 0.05) -> list[Frame]:
    rng = np.random.default_rng(seed)
    frames = []
    for k in range(count):
        around = 2 * np.pi * k / count
        eye = [-0.35 + 1.2 * np.cos(around), 1.2 * np.sin(around), rng.uniform(0.9, 1.5)]
        T = looking(np.array(eye), np.array([-0.35, 0.0, 0.3]))
        views = seen_robot(T, RigidTransform.identity(), noise, rng).views
        frames.append(Frame(f"{k}", views))
    return frames


def fitted(frames, sigmas=DIMA_SIGMAS):
    layout = robot_layout()
    sides = dict(zip(layout.numbers, layout.sides.tolist(), strict=True))
    return fit_layout(frames, camera(), sides, (DIMA_MARKER, T_DIMA_MARKER, np.diag(sigmas**2)))


def test_the_layout_is_found_and_its_covariance_holds():
    total = 0.0
    for seed in range(2):
        layout = fitted(movie(seed), np.full(6, 1e-7)).layout
        for i, number in enumerate(layout.numbers):
            if number == DIMA_MARKER:
                continue
            off = change_between(layout.T_robot_marker[i], robot_layout().T_robot_marker[i])
            assert np.linalg.norm(off[:3]) < 0.003
            P = layout.covariance[6 * i : 6 * i + 6, 6 * i : 6 * i + 6]
            total += float(off @ np.linalg.solve(P, off))
    # Markers of one movie err together through the dima-marker: the bounds of one movie, twice.
    low, high = chi2.ppf([1e-5, 1 - 1e-5], 30)
    assert 2 * low < total < 2 * high


def test_the_refinement_is_better_than_the_chains():
    fit = fitted(movie(7, noise=0.2))
    true = robot_layout().T_robot_marker
    refined = change_between(fit.layout.T_robot_marker, true)[:, :3]
    chained = change_between(fit.chained, true)[:, :3]
    assert np.linalg.norm(refined) < np.linalg.norm(chained)


def test_chains_take_the_pairs_seen_most_and_start_at_the_dima_marker():
    fit = fitted(movie(1))
    assert fit.chains[DIMA_MARKER] == (DIMA_MARKER,)
    counts = {frozenset((p.first, p.second)): p.images for p in fit.pairs}
    best = max(n for pair, n in counts.items() if DIMA_MARKER in pair)
    linked = [c for c in fit.chains.values() if len(c) == 2]
    assert max(counts[frozenset(c)] for c in linked) == best


def test_the_dima_markers_error_is_in_every_marker():
    exact = fitted(movie(2), np.full(6, 1e-7)).layout.sigmas()
    loose = fitted(movie(2)).layout.sigmas()
    gained = np.sqrt(loose[:, 3:] ** 2 - exact[:, 3:] ** 2)
    np.testing.assert_allclose(gained, 0.001, rtol=0.05)


def test_markers_never_seen_together_are_named():
    frames = movie(3)
    apart = [
        Frame(f.name, tuple(v for v in f.views if v.number != 200))
        if any(v.number != 200 for v in f.views)
        else f
        for f in frames
    ]
    alone = [Frame(f.name, tuple(v for v in f.views if v.number == 200)) for f in frames]
    with pytest.raises(UnlinkedMarkersError, match="marker 200 to the dima-marker 14"):
        fitted([*apart, *alone])


def test_images_that_say_nothing_and_markers_without_a_side_are_named():
    frames = movie(5)
    alone = Frame("alone", frames[0].views[:1])
    assert fitted([*frames, alone]).left_out == ("alone",)
    stranger = replace(frames[0].views[0], number=777)
    with pytest.raises(GtvalError, match="no side is given for 777"):
        fitted([*frames, Frame("strange", (stranger,))])


def test_single_markers_say_nothing():
    frames = [replace(f, views=f.views[:1]) for f in movie(4)]
    with pytest.raises(UnlinkedMarkersError, match="never seen together"):
        fitted(frames)
