"""Points of total stations: GSI-8, GSI-16, LandXML."""

import numpy as np
import pytest

from validation.errors import InputError
from validation.trajectories.formats import is_trajectory, read_trajectory
from validation.trajectories.formats.reading import format_of

POINTS = [(12.345, -6.789, 1.5), (12.446, -6.689, 1.501), (12.546, -6.589, 1.502)]
START = 1_700_000_000  # 2023-11-14 22:13:20


def gsi(*, wide=False, unit="0", times=True):
    lines = []
    for k, point in enumerate(POINTS):
        scale = {"0": 1e3, "6": 1e4, "8": 1e5}[unit]
        size = 16 if wide else 8
        words = [f"11{k + 1:04d}+{k + 1:0{size}d}"]
        if times:
            fine, coarse = f"0023{20 + k}5{k}0"[-8:], "11142213"
            fine = f"23{20 + k:02d}5{k}00"
            words += [f"18....+{fine:0>{size}}", f"19....+{coarse:0>{size}}"]
        for key, value in zip(("81", "82", "83"), point, strict=True):
            sign = "-" if value < 0 else "+"
            words.append(f"{key}..1{unit}{sign}{round(abs(value) * scale):0{size}d}")
        lines.append(("*" if wide else "") + " ".join(words) + " ")
    return "\r\n".join(lines) + "\r\n"


@pytest.mark.parametrize("wide", [True, False])
@pytest.mark.parametrize("unit", ["0", "6", "8"])
def test_points_of_gsi_with_times(written, wide, unit):
    path = written("a.gsi", gsi(wide=wide, unit=unit))
    assert is_trajectory(path)
    assert format_of(path) == "gsi"
    found = read_trajectory(path)
    assert found.kind == "points_space"
    np.testing.assert_allclose(found.positions, POINTS, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.times_since(START), [0.5, 1.51, 2.52], rtol=0, atol=1e-9)


def landxml(*, unit="meter", times=True):
    rows = []
    for k, (east, north, height) in enumerate(POINTS):
        stamp = f' timeStamp="2023-11-14T22:13:{20 + k}.5"' if times else ""
        rows.append(f'<CgPoint name="{k}"{stamp}>{north} {east} {height}</CgPoint>')
    return (
        '<?xml version="1.0"?>\n<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2">'
        f'<Units><Metric linearUnit="{unit}"/></Units><CgPoints>{"".join(rows)}</CgPoints>'
        "</LandXML>"
    )


@pytest.mark.parametrize(("unit", "scale"), [("meter", 1), ("millimeter", 1e-3)])
def test_points_of_landxml_with_times(written, unit, scale):
    path = written("a.xml", landxml(unit=unit))
    assert is_trajectory(path)
    found = read_trajectory(path)
    np.testing.assert_allclose(found.positions, np.multiply(POINTS, scale), rtol=1e-12)
    np.testing.assert_allclose(found.times_since(START), [0.5, 1.5, 2.5], rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", [gsi(times=False), landxml(times=False)])
def test_points_without_times_need_some(written, text):
    path = written("a", text)
    with pytest.raises(InputError, match=r"points without times.*--times"):
        read_trajectory(path)
    times = written("times.txt", "0.1\n0.2\n0.3\n")
    found = read_trajectory(path, times=times)
    np.testing.assert_allclose(found.times, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(found.positions, POINTS)
    with pytest.raises(InputError, match=r"3 points, but .* has 2 times"):
        read_trajectory(path, times=written("times.txt", "0.1\n0.2\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (gsi().replace("+00012345", "+0001234x"), "not a coordinate"),
        (gsi() + "garbage here\n", "line 4: 'garbage' — not a word of GSI"),
        (gsi().replace("81..", "31..").replace("82..", "32.."), "no point with coordinates"),
        (landxml(unit="ell"), "'ell' — not a length"),
        (landxml().replace("</LandXML>", ""), "not XML"),
        (landxml().replace("-6.789", "north"), "expected north, east and height"),
        (landxml().replace(' timeStamp="2023-11-14T22:13:21.5"', ""), "this point has no time"),
        (landxml().replace("?>", '?><!DOCTYPE x [<!ENTITY a "b">]>'), "a document type"),
    ],
)
def test_damaged_files_are_refused(written, text, said):
    with pytest.raises(InputError) as caught:
        read_trajectory(written("a", text))
    assert said in str(caught.value)
