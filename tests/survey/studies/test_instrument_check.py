import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import binom

from survey.readings.instrument import corrected, reading_sigma, tolerance_at
from survey.studies.instrument_check import check_instrument
from survey.studies.instrument_verdict import settings_snippet, verdict
from validation.campaign.folder import Instrument
from validation.cli import main

BOSCH = Instrument(tolerance=0.0015, tolerance_up_to=30.0, tolerance_per_metre=0.000175)
STATED = ["--tolerance", "0.0015"]
FINE = Instrument(resolution=0.0)  # no rounding, so that the noise is normal
LENGTHS = np.linspace(1.0, 12.0, 12)
PATTERN = 0.0004 * np.tile([1, -1, -1, 1], 3)  # no offset, no slope, some noise


def codes(check):
    return {finding.code for finding in verdict(check)}


def rate_limits(rate, trials):
    """Numbers of hits outside of which a true rate would be seen once in 10000."""
    return binom.ppf([5e-5, 1 - 5e-5], trials, rate)


def test_the_specification_is_the_printed_one():
    # AD2.3: +-1.5 mm to 30 m, +-5 mm at 50 m.
    assert tolerance_at(BOSCH, [1.0, 30.0, 50.0]) == pytest.approx([0.0015, 0.0015, 0.005])


def test_errors_without_noise_are_found_exactly_and_the_correction_undoes_them():
    reading = LENGTHS + 0.002 + 0.0003 * LENGTHS
    check = check_instrument(LENGTHS, reading, BOSCH)
    assert check.offset == pytest.approx(0.002, abs=1e-12)
    assert check.scale_error == pytest.approx(0.0003, abs=1e-12)
    assert check.noise == pytest.approx(0, abs=1e-12)
    entered = BOSCH.model_copy(
        update={"offset": check.correction.offset, "scale": check.correction.scale}
    )
    assert corrected(entered, reading) == pytest.approx(LENGTHS, abs=1e-12)


def test_false_alarms_and_intervals_have_the_stated_rates():
    rng = np.random.default_rng(5)
    trials = 600
    sigma = reading_sigma(FINE, LENGTHS)
    hits = dict.fromkeys(("offset", "scale", "joint", "noise", "interval", "correct"), 0)
    for _ in range(trials):
        reading = LENGTHS + 0.001 + 2e-4 * LENGTHS + rng.normal(0, sigma)
        check = check_instrument(LENGTHS, reading, FINE)
        hits["interval"] += check.noise_interval[0] <= sigma[0] <= check.noise_interval[1]
        off = np.array([check.offset - 0.001, check.scale_error - 2e-4])
        # F test of the truth, 5 % point of F(2, 10)
        hits["correct"] += off @ np.linalg.solve(check.covariance, off) / 2 > 4.1028
        clean = check_instrument(LENGTHS, LENGTHS + rng.normal(0, sigma), FINE)
        hits["offset"] += clean.p_offset < 0.05
        hits["scale"] += clean.p_scale < 0.05
        hits["joint"] += clean.p_joint < 0.05
        hits["noise"] += clean.p_noise < 0.05
    for name, count in hits.items():
        low, high = rate_limits(0.95 if name == "interval" else 0.05, trials)
        assert low <= count <= high, name


def test_a_good_instrument_with_enough_readings_is_within():
    check = check_instrument(LENGTHS, LENGTHS + PATTERN, BOSCH)
    assert codes(check) == {"within"}
    assert check.correction.offset == 0
    assert check.correction.scale == 1


@pytest.mark.parametrize(
    ("length", "error"),
    [
        ([2.0], [0.0]),
        ([2.0], [0.001]),
        ([2.0, 7.0], [0.0, 0.0]),
        ([2.0, 5.0, 9.0], [0.0, 0.0, 0.0]),
        ([4.0] * 30, [0.0, 0.0003, -0.0003] * 10),
        ([4.0, 4.0 + 1e-9, 4.0], [0.0, 0.0, 0.0]),
    ],
)
def test_too_few_readings_are_never_called_within(length, error):
    length = np.array(length)
    check = check_instrument(length, length + error, BOSCH)
    assert codes(check) == {"too_few"}
    assert "Too few" in settings_snippet(check, BOSCH)


def test_one_length_shows_no_scale_and_says_so():
    length = np.full(12, 4.0)
    check = check_instrument(length, length + 0.004 + PATTERN, BOSCH)
    assert np.isnan(check.scale_error)
    assert check.offset == pytest.approx(0.004)
    text = " ".join(finding.text for finding in verdict(check))
    assert "cannot tell an offset from a scale error" in text
    assert "a scale error cannot be seen" in text


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (0.003 + 0 * LENGTHS, {"offset"}),
        (0.001 * (LENGTHS - 0), {"scale"}),
        (0.004 + 0.001 * LENGTHS, {"offset", "scale"}),
        (10 * PATTERN, {"noise"}),
    ],
)
def test_what_is_wrong_is_named(error, expected):
    check = check_instrument(LENGTHS, LENGTHS + error + PATTERN, BOSCH)
    found = codes(check)
    assert expected <= found
    assert "within" not in found


def test_offset_and_scale_that_cannot_be_separated_are_reported_together():
    # Far from 0 and close together: the sum is sharp, the parts are not.
    length = 40 + np.linspace(0.0, 0.3, 12)
    check = check_instrument(length, length + 0.006 + PATTERN, BOSCH)
    assert "offset_or_scale" in codes(check)


def test_rounded_readings_without_scatter_do_not_make_certainty():
    check = check_instrument(LENGTHS, LENGTHS + 0.0002, BOSCH)
    # What rounding hides, 1 mm / sqrt(12), is the least noise that the tests assume.
    assert check.covariance[0, 0] > (0.001 / np.sqrt(12)) ** 2 / len(LENGTHS)
    assert 0.05 < check.p_joint < 1


@pytest.mark.parametrize("bad", [[np.nan], [np.inf], []])
def test_numbers_that_are_none_are_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        check_instrument(np.array(bad), np.array(bad), BOSCH)


def lengths_file(folder, rows, header="true,reading"):
    path = folder / "lengths.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_the_command_prints_a_verdict_and_settings_that_a_campaign_takes(tmp_path):
    path = lengths_file(tmp_path, [f"{x:.3f},{x + 0.003:.3f}" for x in LENGTHS])
    figure = tmp_path / "check.svg"
    done = CliRunner().invoke(
        main, ["instrument-check", str(path), *STATED, "--figure", str(figure)]
    )
    assert done.exit_code == 0, done.output
    assert "too long" in done.output
    assert figure.read_bytes().startswith(b"<?xml")
    snippet = done.output.split("For campaign.toml:")[1]
    (tmp_path / "campaign.toml").write_text(f'name = "x"\n{snippet}tolerance = 0.0015\n')
    again = CliRunner().invoke(
        main, ["instrument-check", str(path), "--campaign", str(tmp_path), "--json"]
    )
    result = json.loads(again.output)
    assert result["check"]["offset"] == pytest.approx(0.003, abs=1e-9)
    assert {f["code"] for f in result["findings"]} >= {"offset"}


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["2.0,abc"], ["line 2", "'reading'", "'abc'", "not a number"]),
        (["2.0,2.0", "-1,2.0"], ["line 3", "'true'", "'-1'"]),
        (["2.0,3.0"], ["line 2", "'reading'", "more than 1 %"]),
        ([], ["no reading"]),
        (["2.0,nan"], ["line 2", "'nan'"]),
    ],
)
def test_bad_files_end_in_plain_words(tmp_path, rows, said):
    path = lengths_file(tmp_path, rows)
    figure = tmp_path / "check.png"
    done = CliRunner().invoke(
        main, ["instrument-check", str(path), *STATED, "--figure", str(figure)]
    )
    assert done.exit_code == 2
    assert "Traceback" not in done.output
    for words in [str(path), *said]:
        assert words in done.output
    assert not figure.exists()


def test_a_figure_of_another_kind_is_refused(tmp_path):
    path = lengths_file(tmp_path, ["2.0,2.001", "5.0,5.0"])
    done = CliRunner().invoke(
        main, ["instrument-check", str(path), *STATED, "--figure", str(tmp_path / "a.doc")]
    )
    assert done.exit_code == 2
    assert ".png or .svg" in done.output


@pytest.mark.parametrize("value", ["nan", "0", "-1", "inf"])
def test_a_tolerance_that_is_none_is_refused(tmp_path, value):
    path = lengths_file(tmp_path, ["2.0,2.001"])
    done = CliRunner().invoke(main, ["instrument-check", str(path), "--tolerance", value])
    assert done.exit_code == 2
    assert "Traceback" not in done.output


@pytest.mark.parametrize("command", ["instrument-check", "walls-check"])
def test_what_the_maker_states_is_asked_for(tmp_path, command):
    path = lengths_file(tmp_path, ["2.0,2.001"])
    done = CliRunner().invoke(main, [command, str(path)])
    assert done.exit_code == 2
    assert "--tolerance 0.0015" in done.output
    (tmp_path / "campaign.toml").write_text('name = "x"\n[instrument]\nresolution = 0.01\n')
    done = CliRunner().invoke(main, [command, str(path), "--campaign", str(tmp_path)])
    assert done.exit_code == 2
    assert "instrument.tolerance" in done.output
