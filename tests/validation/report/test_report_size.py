"""Figures of many points and photographs are small; what is drawn stays lines and text."""

import base64
import io
import re

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from PIL import Image

from validation.report.svg import drawn_svg, inline_svg
from validation.results import Figure

MOST = 5_000_000
"""Bytes of the report of a whole room with scans and images."""


def figure_of(draw):
    def drawn():
        drawing = Drawing(figsize=(7, 7))
        draw(drawing.subplots())
        return drawing

    return Figure("one", "A caption.", "An alternative.", drawn)


def images_in(svg):
    found = re.findall(r"data:image/(\w+);base64,([A-Za-z0-9+/=\s]+)", svg)
    return [(kind, Image.open(io.BytesIO(base64.b64decode(data)))) for kind, data in found]


def cloud(count):
    rng = np.random.default_rng(1)
    return rng.normal(size=(2, count))


@pytest.mark.parametrize("form", ["plot", "scatter"])
def test_a_cloud_of_20_000_points_is_an_image_and_its_words_are_text(form):
    def draw(axes):
        if form == "plot":
            axes.plot(*cloud(20_000), ".", markersize=1.6)
        else:
            axes.scatter(*cloud(20_000), s=2)
        axes.set_xlabel("length of the way")

    svg = drawn_svg(figure_of(draw))
    assert len(svg) < 200_000  # 2 MB as dots
    ((kind, image),) = images_in(svg)
    assert kind == "webp"
    assert 500 < image.width < 7 * 160
    assert "length of the way" in svg
    assert svg.count("<text") > 10


@pytest.mark.parametrize("form", ["plot", "fill_between", "broken_barh"])
def test_an_hour_at_20_hertz_is_an_image(form):
    def draw(axes):
        times, rough = np.arange(72_000) / 20, cloud(36_000).ravel()
        if form == "plot":
            axes.plot(times, rough)
        elif form == "fill_between":
            axes.fill_between(times, rough, rough + 1)
        else:
            axes.broken_barh([(time, 0.03) for time in times[::8]], (0, 1))

    svg = drawn_svg(figure_of(draw))
    assert len(images_in(svg)) == 1
    assert len(svg) < 300_000  # 1 to 2 MB as lines


def test_few_points_and_long_lines_stay_as_they_are():
    def draw(axes):
        axes.plot(*cloud(250), "o")
        axes.plot(np.linspace(0, 1, 5000), np.sin(np.linspace(0, 50, 5000)))

    svg = drawn_svg(figure_of(draw))
    assert images_in(svg) == []
    assert svg.count("<use") >= 250


def test_the_image_of_a_cloud_has_its_dots_where_they_are():
    """One dot far from the others: the image's extent is that of the dots, to a pixel."""

    def draw(axes):
        axes.plot([*np.zeros(400), 10.0], [*np.zeros(400), 10.0], ".", color="black")
        axes.set(xlim=(-5, 15), ylim=(-5, 15))
        axes.set_axis_off()

    svg = drawn_svg(figure_of(draw))
    ((_, image),) = images_in(svg)
    # 0 to 10 of 20 across axes that take 77.5 % of 7 inches, and half a dot on either side
    wanted = 0.5 * 0.775 * 7 * 160
    ink = image.convert("RGBA").getchannel("A").getbbox()
    assert ink[2] - ink[0] == pytest.approx(wanted, abs=16)


def test_a_photograph_is_compressed():
    rng = np.random.default_rng(1)
    rough = rng.integers(0, 255, (24, 32), dtype=np.uint8)
    photo = np.array(Image.fromarray(rough).resize((640, 480), Image.Resampling.BICUBIC))
    noisy = np.clip(photo + rng.normal(0, 2, photo.shape), 0, 255).astype(np.uint8)

    def draw(axes):
        axes.imshow(noisy, cmap="gray", vmin=0, vmax=255)

    svg = drawn_svg(figure_of(draw))
    ((kind, image),) = images_in(svg)
    assert kind == "webp"
    png = io.BytesIO()
    image.save(png, "PNG")
    assert len(svg) < png.tell()


def test_the_same_figure_gives_the_same_bytes():
    one, two = (drawn_svg(figure_of(lambda axes: axes.plot(*cloud(2000), "."))) for _ in range(2))
    assert one == two


def test_numbers_in_words_keep_their_decimals():
    def draw(axes):
        axes.plot([0, 1], [0, 1 / 3])
        axes.set_title("0.123456789 m")

    svg = drawn_svg(figure_of(draw))
    assert "0.123456789 m" in svg
    assert not re.search(r'\sd="[^"]*\.\d{3}', svg)


def test_on_a_phone_a_figure_is_no_smaller_than_its_text_can_be_read():
    svg = inline_svg(figure_of(lambda axes: axes.plot([0, 1])), "a")
    # 7 inches are 504 points; 390 pixels less the margins are 358.
    assert 'style="--least: 353px"' in svg


@pytest.mark.full
def test_the_report_of_a_room_with_scans_and_images_is_below_5_mb(tmp_path):
    import subprocess
    import sys

    gtval = [sys.executable, "-m", "gtval"]
    room = tmp_path / "room"
    subprocess.run([*gtval, "simulate", room, "--laser", "--vision"], check=True)
    subprocess.run([*gtval, "run", room], check=True)
    report = room / "report" / "report.html"
    assert 500_000 < report.stat().st_size < MOST
