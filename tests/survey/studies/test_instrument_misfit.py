"""Errors that are no offset, scale and noise: told apart, and no lines for campaign.toml given."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binom

from survey.studies.instrument_check import check_instrument
from survey.studies.instrument_misfit import FALSE_ALARM
from survey.studies.instrument_verdict import settings_snippet, verdict
from validation.campaign.folder import Instrument
from validation.cli import main

METER = Instrument(tolerance=0.0015, resolution=0.001)
FINE = Instrument(tolerance=0.0015, resolution=0.0)
LENGTHS = np.tile([0.8, 2.2, 4.5, 7.0, 11.0, 15.0], 2)
SIGMA = 0.00075


def readings(rng, length=LENGTHS, noise=SIGMA, step=0.001):
    """What a meter with a small offset and scale shows."""
    exact = length + 0.0004 + 5e-5 * length + rng.normal(0, noise, len(length))
    return np.round(exact / step) * step if step else exact


def of(length, reading, instrument=METER):
    return check_instrument(length, reading, instrument)


def test_an_edge_changed_half_way_is_a_step_at_its_row():
    right = 0
    for seed in range(100):
        rng = np.random.default_rng([21, seed])
        row, size = int(rng.integers(2, 11)), float(rng.choice([-0.1, 0.1, 0.025, -0.012]))
        reading = readings(rng)
        reading[row:] += size
        misfit = of(LENGTHS, reading).misfit
        if misfit.step_row == row:
            right += 1
            assert abs(misfit.step - size) < 6 * misfit.step_sigma
    assert right >= binom.ppf(1e-3, 100, 0.97)


def test_bad_rows_are_named_and_the_numbers_are_those_of_the_others():
    right = 0
    for seed in range(100):
        rng = np.random.default_rng([22, seed])
        bad = np.sort(rng.choice(len(LENGTHS), int(rng.integers(1, 4)), replace=False))
        reading = readings(rng)
        reading[bad] += rng.choice([-1, 1], len(bad)) * rng.uniform(0.01, 0.1, len(bad))
        check = of(LENGTHS, reading)
        if check.misfit.bad_rows == tuple(bad):
            right += 1
            assert abs(check.offset - 0.0004) < 0.003
        assert settings_snippet(check, METER) == ""
    assert right >= binom.ppf(1e-3, 100, 0.95)


def test_errors_that_come_and_go_with_the_length_are_neither_offset_nor_scale():
    rng = np.random.default_rng(23)
    length = np.repeat(LENGTHS[:6], 4)
    rng.shuffle(length)
    wave = 0.004 * np.sin(2 * np.pi * length / 3.1)
    check = of(length, readings(rng, length) + wave)
    (found,) = verdict(check)
    assert found.code == "instrument-lengths"
    assert settings_snippet(check, METER) == ""


@pytest.mark.parametrize("instrument", [METER, FINE])
def test_a_good_meter_is_seldom_accused(instrument):
    trials, wrong = 400, 0
    for seed in range(trials):
        rng = np.random.default_rng([24, seed])
        wrong += of(LENGTHS, readings(rng, step=instrument.resolution), instrument).misfit.is_found
    # Two tests at 1 % each that look at noise, and one that also needs more than is stated.
    assert wrong <= binom.ppf(0.999, trials, 3 * FALSE_ALARM)


def test_a_meter_of_more_noise_than_stated_is_no_misfit_and_gets_its_lines():
    kept = 0
    for seed in range(200):
        rng = np.random.default_rng([25, seed])
        check = of(LENGTHS, readings(rng, noise=0.004))
        kept += bool(settings_snippet(check, METER))
    assert kept >= binom.ppf(1e-3, 200, 1 - 3 * FALSE_ALARM)


def test_rounding_that_all_readings_of_a_length_share_is_counted_once():
    """A display that never flickers hides up to half its last digit, however often it is read."""
    off, sigma = [], []
    for seed in range(300):
        rng = np.random.default_rng([26, seed])
        length = np.full(12, rng.uniform(3, 9))
        reading = np.round((length + 0.0007 + rng.normal(0, 1e-5, 12)) / 0.001) * 0.001
        check = of(length, reading)
        flickers = len(set(reading)) > 1  # as where the true value is between two digits
        assert flickers or check.shared_rounding == pytest.approx(0.001 / np.sqrt(12), rel=0.02)
        off.append(check.offset - 0.0007)
        sigma.append(np.sqrt(check.covariance[0, 0]))
    # The error is uniform over one step: never more than half of it, 0.29 mm in the mean square.
    assert np.max(np.abs(off)) < 0.00053
    assert 0.9 < np.sqrt(np.mean(np.square(off))) / np.mean(sigma) < 1.1


def test_rounding_of_readings_that_scatter_averages_out():
    rng = np.random.default_rng(27)
    check = of(LENGTHS, readings(rng, noise=0.002))
    assert check.shared_rounding < 1e-5


@pytest.mark.parametrize(
    ("rows", "code", "said"),
    [
        (["1,1.000", "2,2.001", "4,4", "8,8.060", "12,12.001", "3,3"], "instrument-rows", "line 5"),
        (
            [f"{x},{x:.3f}" for x in (1, 2, 4, 8)] + [f"{x},{x + 0.1:.3f}" for x in (1, 2, 4, 8)],
            "instrument-step",
            "From line 6 on the readings are longer by 100.00 mm",
        ),
    ],
)
def test_the_command_gives_no_lines_where_nothing_fits(tmp_path, rows, code, said):
    path = tmp_path / "lengths.csv"
    path.write_text("\n".join(["true,reading", *rows]) + "\n")
    command = ["instrument-check", str(path), "--tolerance", "0.0015"]
    done = CliRunner().invoke(main, command)
    assert said in done.output
    assert "[instrument]" not in done.output
    result = json.loads(CliRunner().invoke(main, [*command, "--json"]).output)
    assert result["settings"] is None
    assert [finding["code"] for finding in result["findings"]] == [code]
