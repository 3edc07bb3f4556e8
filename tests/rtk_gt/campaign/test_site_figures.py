"""The site: areas, an aerial image under the paths, odometry over the positions, and pictures."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from data_samples.drives.drive import DriveSettings, simulate_drive
from data_samples.drives.files import write_drive
from rtk_gt.campaign.figures import pose_over_time
from rtk_gt.campaign.result_files import rtk_files
from rtk_gt.campaign.sections import areas_table, rtk_sections
from rtk_gt.campaign.site_figures import aerial_image, residual_histograms
from rtk_gt.campaign.solve import solve_campaign
from rtk_gt.positions.result import positions_result
from rtk_gt.positions.solve import solve_positions
from rtk_gt.sensors.figures import cloud_picture
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import InputError
from validation.report.svg import drawn_svg
from validation.results import Figure
from validation.text_files.writing import pieces_of


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    write_drive(folder, simulate_drive(6, DriveSettings(loops=2)))
    cv2.imwrite(str(folder / "aerial.png"), np.full((30, 40, 3), 120, np.uint8))
    toml = (folder / "campaign.toml").read_text()
    toml += '[rtk.aerial]\nfile = "aerial.png"\nnorth_west = [36.716, -4.482]\n'
    toml += "south_east = [36.713, -4.476]\n"
    toml += '[[rtk.areas]]\nname = "west"\ncorners = [[-99, -99], [0, -99], [0, 99], [-99, 99]]\n'
    (folder / "campaign.toml").write_text(toml)
    return solve_campaign(load_campaign(folder))


def drawn(sections):
    return {
        block.name: block.draw()
        for section in sections
        for block in section.blocks
        if isinstance(block, Figure)
    }


def test_areas_tell_the_quality_of_each_receiver_and_of_the_poses(solved):
    table = areas_table(solved)
    assert [row[:2] for row in table.rows] == [
        ["west", name] for name in ("rear", "front_left", "front_right")
    ]
    inside = solved.path.poses[:, 0] < 0
    assert {row[5] for row in table.rows} == {int(inside.sum())}
    # The front receivers write five times as often, and their bases are 145 m away.
    assert table.rows[1][2] > 3 * table.rows[0][2] > 0


def test_the_map_has_the_image_and_the_areas(solved):
    figures = drawn(rtk_sections(solved))
    (axes,) = figures["rtk_map"].axes
    assert len(axes.images) == 1
    west, east, south, north = axes.images[0].get_extent()
    # Six thousandths of a degree of longitude at 36.7 degrees, and three of latitude.
    assert east - west == pytest.approx(536, abs=2)
    assert north - south == pytest.approx(333, abs=2)
    assert [text.get_text() for text in axes.texts] == ["west"]
    low, high = axes.get_xlim()
    assert high - low < 300
    assert len(figures["rtk_stated_over_time"].axes) == 2


def test_squares_of_distances_have_the_density_of_their_noise(solved):
    """The spread of d^2 is 2 d times that of d: the histogram below is as wide as its curve."""
    figure = residual_histograms(solved.offsets, solved.noise, solved.antennas)
    assert len(figure.axes) == 6
    good = solved.offsets.residuals[solved.offsets.weights > 0]
    for axes, d, residual in zip(figure.axes[3:], solved.offsets.distances, good.T, strict=True):
        curve = axes.lines[0].get_xydata()
        sigma = 1 / np.sqrt(2 * np.pi) / curve[:, 1].max()
        squares = (residual + d) ** 2 - d**2
        # 119 steps tell a standard deviation to 7 %.
        assert squares.std() == pytest.approx(sigma, rel=0.25)


def test_an_image_that_is_none_is_named(tmp_path):
    (tmp_path / "aerial.png").write_text("no image")
    with pytest.raises(InputError, match=r"aerial\.png.*no image that can be read"):
        aerial_image(tmp_path / "aerial.png")
    large = np.zeros((10, 4000, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "large.png"), large)
    assert aerial_image(tmp_path / "large.png").shape == (4, 1600, 3)


def test_odometry_is_laid_over_the_positions_of_one_receiver(tmp_path):
    """It has a frame of its own, and a scale 1 % too large."""
    n = 900
    times = 1.7e9 + 0.2 * np.arange(n)
    speed = 3 + 2 * np.sin(0.2 * (times - times[0]))
    heading = np.cumsum(0.2 * 0.3 * np.sin(0.11 * (times - times[0])))
    steps = 0.2 * speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    way = np.cumsum(steps, axis=0)
    rows = ["time,x,y,z,fix"]
    noisy = way + 0.005 * np.random.default_rng(2).standard_normal(way.shape)
    rows += [f"{t:.3f},{x:.4f},{y:.4f},0,fixed" for t, (x, y) in zip(times, noisy, strict=True)]
    (tmp_path / "roof.csv").write_text("\n".join(rows) + "\n")
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    other = 1.01 * way @ turn.T + [50.0, -20.0]
    rows = ["time,x,y,theta"]
    rows += [
        f"{t + 0.4:.3f},{x:.4f},{y:.4f},{a + np.pi / 2:.5f}"
        for t, (x, y), a in zip(times, other, heading, strict=True)
    ]
    (tmp_path / "odometry.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "campaign.toml").write_text(
        'name = "Court"\n[rtk]\norigin = { latitude = 45.5, longitude = 9.2, height = 160.0 }\n'
        'odometry = "odometry.csv"\n[[rtk.receivers]]\nname = "roof"\nfile = "roof.csv"\n'
        'coordinates = "local"\n'
    )
    outcome = solve_positions(load_campaign(tmp_path))
    found = outcome.overlay
    assert found is not None, outcome.without_overlay
    assert found.clock.verdict == "determined", found.clock.reason
    assert found.clock.delay_s == pytest.approx(-0.4, abs=0.02)
    assert found.lengths[1] / found.lengths[0] == pytest.approx(1.01, abs=0.001)
    # A scale of 1 % is at most 1 % of the drive's reach from its middle.
    reach = np.linalg.norm(way - way.mean(0), axis=1)
    assert found.rms == pytest.approx(0.01 * np.sqrt(np.mean(reach**2)), rel=0.1)
    result = positions_result(outcome)
    assert {"odometry_overlay", "clock_over"} <= {one.code for one in result.findings}
    assert drawn(result.sections)["rtk_odometry"].axes
    rows = [f"{1.6e9 + k:.3f},{k},{(k % 5) / 9:.3f}" for k in range(40)]
    (tmp_path / "odometry.csv").write_text("time,x,y\n" + "\n".join(rows))
    late = solve_positions(load_campaign(tmp_path))
    assert "within its time" in late.without_overlay
    assert "odometry_not_laid" in {one.code for one in positions_result(late).findings}


def test_a_cloud_is_drawn_by_height_or_in_its_colours():
    points = np.random.default_rng(0).uniform(-5, 5, (300, 3))
    assert len(cloud_picture(points).axes) == 3  # with a scale of heights
    colours = np.zeros((300, 3), np.uint8)
    assert len(cloud_picture(points, colours).axes) == 2


def test_the_corners_of_an_aerial_image_must_be_in_order(tmp_path):
    (tmp_path / "campaign.toml").write_text(
        'name = "x"\n[rtk.aerial]\nfile = "a.png"\nnorth_west = [1, 2]\nsouth_east = [3, 4]\n'
    )
    done = CliRunner().invoke(main, ["rtk", "coverage", str(tmp_path)])
    assert done.exit_code == 2
    assert "farther north and farther west" in done.output


def test_an_hour_in_fifty_parts_is_a_figure_of_a_page(solved):
    """A road beside tall buildings breaks the path: each part is no figure by itself."""
    rng, n = np.random.default_rng(1), 72_000
    path = solved.path.select(np.arange(n) % len(solved.path))
    times = np.arange(n) * 0.05 + 12.0 * (np.arange(n) // (n // 50))
    poses = path.poses + rng.normal(0, 0.005, path.poses.shape)
    path = replace(path, times=times, poses=poses)
    figure = Figure("poses", "c", "a", lambda: pose_over_time(path, 2.0))
    # Four panels of a line and a band each: as images some 20 kB apiece.
    assert len(drawn_svg(figure)) < 300_000


def test_the_path_of_a_sensor_in_pieces_is_the_whole_one(solved, monkeypatch):
    def texts():
        files = rtk_files(solved)
        names = [name for name in files if name.startswith("sensor_path_")]
        return {name: b"".join(pieces_of(files[name])) for name in names}

    whole = texts()
    assert len(whole) == 6
    monkeypatch.setattr("rtk_gt.campaign.pose_tables.ROWS", 40)
    assert len(solved.path) > 80
    assert texts() == whole
