import numpy as np
import pytest
from scipy.stats import norm

from survey.estimation.vframe import estimate_vframe
from survey.readings.readings import Readings
from validation.campaign.folder import Vframe


def readings(**lengths):
    pairs = [name.split("_") for name in lengths]
    return Readings(
        tuple(a for a, _ in pairs), tuple(b for _, b in pairs), list(lengths.values()), 0.00075
    )


def test_the_documents_diagonal_confirms_a_right_angle():
    checks = estimate_vframe(Vframe(), readings(X_Y=3.536)).checks
    length = next(c for c in checks if c.name.startswith("length"))
    assert length.expected == pytest.approx(3.535534, abs=5e-7)
    assert length.p_value > 0.8
    angle = next(c for c in checks if "right angle at O" in c.name)
    # c^2 = 2 a^2 (1 - cos): 0.466 mm over 2.5 m * sin 45 degrees.
    assert angle.measured - np.pi / 2 == pytest.approx(0.000466 / (2.5 * np.sqrt(0.5)), rel=1e-3)
    assert angle.p_value > 0.8


def test_a_diagonal_that_is_two_centimetres_long_is_called_out():
    checks = estimate_vframe(Vframe(), readings(X_Y=3.556)).checks
    assert all(check.p_value < 1e-3 for check in checks)


def test_unequal_diagonals_are_tested_against_each_other():
    checks = estimate_vframe(Vframe(), readings(O_XY=3.545, X_Y=3.526)).checks
    equal = next(c for c in checks if c.name.startswith("equal"))
    sigma = np.sqrt(2 * 0.00075**2 + 4 * 0.002**2)
    assert equal.sigma == pytest.approx(sigma)
    assert equal.p_value == pytest.approx(2 * norm.sf(0.019 / sigma))


def test_p_values_of_a_frame_marked_as_stated_are_uniform():
    rng = np.random.default_rng(5)
    nominal = np.array(list(Vframe().points.values()))
    names = list(Vframe().points)
    low = {}
    n = 500
    for _ in range(n):
        at = dict(zip(names, nominal + 0.002 * rng.standard_normal((4, 2)), strict=True))
        lengths = {
            f"{a}_{b}": np.linalg.norm(at[a] - at[b]) + 0.00075 * rng.standard_normal()
            for a, b in (("O", "X"), ("O", "Y"), ("X", "Y"), ("O", "XY"), ("X", "XY"), ("Y", "XY"))
        }
        for check in estimate_vframe(Vframe(), readings(**lengths)).checks:
            low[check.name] = low.get(check.name, 0) + (check.p_value < 0.05)
    # Binomial, 99.9 % per name: 0.05 +- 3.29 sqrt(0.05 * 0.95 / n).
    reach = 3.29 * np.sqrt(0.05 * 0.95 / n)
    assert len(low) == 11
    for name, count in low.items():
        assert abs(count / n - 0.05) < reach, name
