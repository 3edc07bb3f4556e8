"""Places of satellites against propagations that share no formula with ours."""

from datetime import date

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from skies import DAY, almanac, both_systems, times

from data_samples.sky.constellation import gps_rows
from data_samples.sky.texts import navigation_text, two_line_text
from rtk_gt.planning.almanacs.almanac import gps_seconds
from rtk_gt.planning.almanacs.orbits import Elements, eccentric_anomaly, positions
from rtk_gt.planning.almanacs.reading import midnight, read_almanac
from rtk_gt.planning.almanacs.two_line import sidereal_time

EARTH, WEEK = 7.2921151467e-5, 604800.0
LIMIT = np.radians(0.1)


def angle(a, b):
    """Angles between directions from the Earth's centre."""
    a, b = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (a, b))
    return 2 * np.arcsin(np.linalg.norm(a - b, axis=-1) / 2)


@given(st.floats(-np.pi, np.pi), st.floats(0, 0.5))
def test_the_eccentric_anomaly_solves_keplers_equation(mean, eccentricity):
    E = eccentric_anomaly(np.array(mean), np.array(eccentricity))
    assert E - eccentricity * np.sin(E) == pytest.approx(mean, abs=1e-11)


def random_rows(rng, count):
    return {
        f"G{k + 1:02d}": {
            "reference": 2446 * WEEK + rng.uniform(0, WEEK),
            "root_a": rng.uniform(5100, 5500),
            "eccentricity": rng.uniform(0, 0.2),
            "inclination": rng.uniform(0.8, 1.2),
            "node": rng.uniform(-np.pi, np.pi),
            "node_rate": rng.uniform(-9e-9, -7e-9),
            "perigee": rng.uniform(-np.pi, np.pi),
            "anomaly": rng.uniform(-np.pi, np.pi),
            "gravity": 3.986005e14,
        }
        for k in range(count)
    }


def integrated(row, passed):
    """Two bodies in an orbital plane, integrated; the plane turned by matrices."""
    mu, e, a = row["gravity"], row["eccentricity"], row["root_a"] ** 2
    E = brentq(lambda x: x - e * np.sin(x) - row["anomaly"], -4, 4, xtol=1e-14)
    rate = np.sqrt(mu / a**3) / (1 - e * np.cos(E))
    b = a * np.sqrt(1 - e**2)
    start = [a * (np.cos(E) - e), b * np.sin(E), -a * np.sin(E) * rate, b * np.cos(E) * rate]

    def fall(_, y):
        pull = -mu / np.hypot(y[0], y[1]) ** 3
        return [y[2], y[3], pull * y[0], pull * y[1]]

    found = solve_ivp(fall, (0, passed[-1]), start, "DOP853", passed, rtol=1e-11, atol=1e-4)
    plane = np.column_stack([found.y[:2].T, np.zeros(len(passed))])
    # Seen from the Earth, which has turned by the rate since the start of the week.
    turned = row["node"] + row["node_rate"] * passed - EARTH * (row["reference"] % WEEK + passed)
    tilt = Rotation.from_euler("ZX", [row["perigee"], 0.0])
    out = [Rotation.from_euler("ZX", [node, row["inclination"]]) * tilt for node in turned]
    return np.array([one.apply(point) for one, point in zip(out, plane, strict=True)])


def test_places_are_those_of_integrated_orbits():
    rows = random_rows(np.random.default_rng(1), 6)
    elements = Elements.of_rows(list(rows.values()))
    passed = np.linspace(0, 86400, 97)
    found = positions(elements.take(np.s_[:, None]), elements.reference[:, None] + passed)
    expected = np.array([integrated(row, passed) for row in rows.values()])
    # The integration's tolerance of 1e-11 leaves centimetres after two revolutions.
    assert angle(found, expected).max() < 1e-8 < LIMIT


def second_formulation(row, t):
    """Table 20-IV for one satellite and time, by rotations and with another solution of Kepler."""
    A = row["root_a"] ** 2
    M = row["anomaly"] + (np.sqrt(row["gravity"]) / A**1.5 + row["motion"]) * t
    e = row["eccentricity"]
    E = brentq(lambda x: x - e * np.sin(x) - M, M - 1, M + 1, xtol=1e-14)
    nu = 2 * np.arctan(np.sqrt((1 + e) / (1 - e)) * np.tan(E / 2))
    phi = nu + row["perigee"]
    waves = np.array([np.cos(2 * phi), np.sin(2 * phi)])
    u = phi + waves @ [row["cuc"], row["cus"]]
    r = A * (1 - e * np.cos(E)) + waves @ [row["crc"], row["crs"]]
    i = row["inclination"] + waves @ [row["cic"], row["cis"]] + row["inclination_rate"] * t
    node = row["node"] + row["node_rate"] * t - EARTH * (t + row["reference"] % WEEK)
    return Rotation.from_euler("ZXZ", [node, i, u]).apply([r, 0, 0])


def broadcast_rows(rng, count):
    """Elements with harmonics of the sizes that GPS broadcasts."""
    rows = random_rows(rng, count)
    for row in rows.values():
        row |= {name: rng.normal(0, 5e-6) for name in ("cuc", "cus", "cic", "cis")}
        row |= {name: rng.normal(0, 200.0) for name in ("crc", "crs")}
        row |= {"motion": rng.normal(5e-9, 5e-10), "inclination_rate": rng.normal(0, 4e-10)}
    return rows


def test_broadcast_elements_give_what_rotations_give():
    rows = broadcast_rows(np.random.default_rng(2), 8)
    elements = Elements.of_rows(list(rows.values()))
    passed = np.array([-7200.0, -60.0, 0.0, 900.0, 7200.0])
    found = positions(elements.take(np.s_[:, None]), elements.reference[:, None] + passed)
    expected = [[second_formulation(row, t) for t in passed] for row in rows.values()]
    assert np.abs(found - expected).max() < 1e-4


def test_the_record_nearest_in_time_is_used(tmp_path):
    """A day of records each two hours: each time has the one at most an hour away."""
    first = gps_rows(DAY)["G01"]
    step = 7200.0
    # Each record has its own anomaly, wrong by its number: that tells which one was taken.
    rows = [
        ("G01", {**first, "reference": first["reference"] + k * step, "anomaly": 0.01 * k})
        for k in range(12)
    ]
    path = tmp_path / "day.rnx"
    path.write_text(navigation_text(rows, 3))
    found = read_almanac(path, DAY)
    at = times(600.0)[:-13] + 1.0  # nowhere half way between two records
    assert np.abs(found.ages(at)).max() <= step / 2
    which = np.rint((gps_seconds(at) - first["reference"]) / step).astype(int)
    one = Elements.of_rows([row for _, row in rows]).take(which)
    assert np.allclose(found.ecef(at)[0], positions(one, gps_seconds(at)), atol=1e-3)


@pytest.mark.parametrize("form", ["yuma", "sem", "rinex2", "rinex3"])
def test_every_kind_of_file_gives_the_orbit_that_was_written(tmp_path, form):
    rows = gps_rows(DAY, 27)
    at = times(1800.0)
    known = Elements.of_rows(list(rows.values()))
    expected = positions(known.take(np.s_[:, None]), np.tile(gps_seconds(at), (27, 1)))
    found = almanac(tmp_path, form).ecef(at)
    # The digits of a YUMA almanac: 1e-10 rad and 1e-6 m^(1/2), which is 1e-9 of the motion.
    assert np.linalg.norm(found - expected, axis=-1).max() < 3.0


def earth_rotation_angle(time):
    """Of IAU 2000, and sidereal time of 2006 from it: another formula than that of 1982."""
    days = time / 86400 + 2440587.5 - 2451545.0
    T = days / 36525
    seconds = 0.014506 + 4612.156534 * T + 1.3915817 * T**2  # arc seconds
    turns = 0.7790572732640 + 1.00273781191135448 * days
    return np.mod(2 * np.pi * turns + np.radians(seconds / 3600), 2 * np.pi)


def test_sidereal_time_is_that_of_the_rotation_of_the_earth():
    at = midnight(date(2000, 1, 1)) + np.arange(0, 30 * 365.25 * 86400, 7e6)
    off = np.angle(np.exp(1j * (sidereal_time(at) - earth_rotation_angle(at))))
    # The two theories differ by some hundredths of an arc second; a tenth is 3e-5 degrees.
    assert np.abs(off).max() < np.radians(0.1 / 3600)


def test_two_line_elements_move_as_their_means_under_the_flattened_earth(tmp_path):
    """Kepler with the secular J2 rates: what SGP4 adds for satellites so high is small."""
    rows = both_systems()
    at = times(1800.0)
    found = almanac(tmp_path, "tle", rows).ecef(at)
    J2, R, mu = 1.082616e-3, 6378.135e3, 3.986008e14
    expected = []
    for row in rows.values():
        n = np.sqrt(row["gravity"]) / row["root_a"] ** 3
        a, i = (mu / n**2) ** (1 / 3), row["inclination"]
        size = 1.5 * n * J2 * (R / a) ** 2
        node_rate, perigee_rate = -size * np.cos(i), size * (2 - 2.5 * np.sin(i) ** 2)
        passed = at - at[0]
        start = row["node"] - EARTH * (row["reference"] % WEEK) + earth_rotation_angle(at[0])
        # SGP4's mean motion (Kozai) holds the anomaly's own rate already.
        u = row["anomaly"] + (n + perigee_rate) * passed
        node = start + node_rate * passed - earth_rotation_angle(at)
        c, s = np.cos(u), np.sin(u)
        expected.append(
            a * np.column_stack([
                c * np.cos(node) - s * np.cos(i) * np.sin(node),
                c * np.sin(node) + s * np.cos(i) * np.cos(node),
                s * np.sin(i),
            ])
        )  # fmt: skip
    assert angle(found, np.array(expected)).max() < LIMIT


def test_an_epoch_in_gps_time_and_one_in_utc_are_the_same_moment(tmp_path):
    """YUMA counts in GPS time, two-line elements in UTC: 18 s apart."""
    at = times()[0] + np.array([0.0, 1.0])
    now, later = np.moveaxis(almanac(tmp_path, "yuma").ecef(at), 1, 0)
    speed = later - now
    ahead = almanac(tmp_path, "tle").ecef(at)[:, 0] - now
    seconds = (ahead * speed).sum(-1) / (speed**2).sum(-1)
    # Waves that SGP4 adds are up to 0.08 degrees, 10 s, each; of 27 satellites little is left.
    assert abs(seconds.mean()) < 2.0


def test_two_line_elements_of_other_satellites_are_refused(tmp_path):
    rows = gps_rows(DAY)
    rows["G01"] |= {"root_a": np.sqrt(6.8e6)}
    path = tmp_path / "low.tle"
    path.write_text(two_line_text(rows))
    found = read_almanac(path, DAY)
    with pytest.raises(Exception, match="orbit of G01 cannot be propagated"):
        found.ecef(times())


def test_errors_of_old_elements_grow_with_the_square_of_time(tmp_path):
    """900 m at first (IS-GPS-200, 20.3.3.5.2.1); test_almanac_ageing has the growth."""
    found = almanac(tmp_path)
    off = [2.02e7 * found.direction_error(86400.0 * days) for days in (0, 14, -28, 180)]
    assert off[0] == pytest.approx(900.0)
    assert off[1] - off[0] == pytest.approx((off[2] - off[0]) / 4, rel=1e-3)
    # A range has a sixth to an eighth of an error along the orbit: what IS-GPS-200 states at the
    # ends of short-term operation (14 days) and of long-term operation (180 days).
    assert 3600 < off[1] < 8 * 3600
    assert 300e3 < off[3] < 8 * 300e3
