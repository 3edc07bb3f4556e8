"""Whether one system errs less, printed statistics, and conclusions."""

import numpy as np
import pytest
from pydantic import ValidationError

from validation.campaign.folder import Claim
from validation.poses.pose_table import PoseTable
from validation.results import Finding
from validation.statistics.claims import judge_claims
from validation.statistics.evaluation import evaluate
from validation.statistics.paired import POSITION, paired_errors
from validation.statistics.printed import PrintedNumbers, cells_that_give, load_printed, verdict


def evaluations(rng, sigmas, n=25, shared=0.0):
    """Systems of some noise, whose validation poses have an error that all of them see."""
    true = np.column_stack([rng.uniform(-3, 3, (n, 2)), rng.uniform(-3, 3, n)])
    names = tuple(str(i) for i in range(n))
    validation = PoseTable("survey", names, true + rng.normal(0, shared, true.shape))
    return [
        evaluate(validation, PoseTable(name, names, true + rng.normal(0, sigma, true.shape)))
        for name, sigma in sigmas.items()
    ]


def claimed(rng, sigmas, trials, **more):
    """Share of campaigns in which any difference is claimed, and the share of wrong ones."""
    any_claim = wrong = 0
    best = min(sigmas, key=sigmas.get)
    for _ in range(trials):
        better = {one.better for one in paired_errors(evaluations(rng, sigmas, **more))} - {""}
        any_claim += bool(better)
        wrong += bool(better - {best})
    return any_claim / trials, wrong / trials


@pytest.mark.parametrize("shared", [0.0, 0.02])
def test_no_difference_is_claimed_among_equals_but_in_one_campaign_of_twenty(shared):
    rate, _ = claimed(np.random.default_rng(1), {"a": 0.01, "b": 0.01}, trials=400, shared=shared)
    # Binomial, 400 trials at 5 %: 99.9 % below 0.09. The share is of all statements together;
    # x, y and the position are correlated, so it may be lower.
    assert 0.005 < rate < 0.09


@pytest.mark.full
@pytest.mark.parametrize("n", [8, 20, 60])
def test_the_rate_of_false_claims_holds_for_three_systems_and_many_sizes(n):
    sigmas = {"a": 0.01, "b": 0.01, "c": 0.01}
    rate, _ = claimed(np.random.default_rng(n), sigmas, trials=2000, n=n)
    assert 0.01 < rate < 0.065


def test_a_system_of_a_third_of_the_noise_is_told_and_never_the_other():
    rate, wrong = claimed(np.random.default_rng(2), {"a": 0.03, "b": 0.01}, trials=100)
    assert rate > 0.98
    assert wrong == 0


def test_the_interval_of_the_difference_holds_the_truth_as_often_as_stated():
    """For normal errors the mean size is sigma sqrt(2 / pi)."""
    rng, inside = np.random.default_rng(3), 0
    truth = (0.02 - 0.01) * np.sqrt(2 / np.pi)
    for _ in range(400):
        row = next(
            one
            for one in paired_errors(evaluations(rng, {"a": 0.02, "b": 0.01}))
            if one.component == "x"
        )
        inside += row.low < truth < row.high
    assert 0.915 < inside / 400 < 0.98


def test_a_pose_taken_over_is_told_apart():
    rng = np.random.default_rng(4)
    a, b = evaluations(rng, {"a": 0.01, "b": 0.01}, n=12)
    own = a.comparison.gt
    poses = own.poses.copy()
    poses[3] = a.comparison.validation.poses[3]
    taken = evaluate(a.comparison.validation, PoseTable("a", own.ids, poses))
    rows = paired_errors([taken, b])
    assert [one.without for one in rows] == [()] * 4 + [("3",)] * 4
    assert rows[4].n == 11
    assert rows[3].component == POSITION


def test_the_published_way_is_no_system_of_its_own():
    rows = paired_errors(evaluations(np.random.default_rng(5), {"a": 0.01, "a_as_published": 0.1}))
    assert rows == []


@pytest.mark.parametrize(
    ("printed", "value", "said"),
    [
        ("0.0804", 0.08037, "equal"),
        ("-0.0006", -0.00065, "equal"),
        ("-0.0006", -0.00068, "cut"),
        ("0.0804", 0.08046, "cut"),
        ("0.0804", 0.0806, "differs"),
        ("-0.000", -0.000083, "equal"),
        ("0.0804", -0.0804, "differs"),
    ],
)
def test_a_printed_number_is_equal_cut_or_different(printed, value, said):
    assert verdict(printed, value) == said


def numbers(*texts):
    kinds = ("mean", "std", "max_abs", "ci95_low", "ci95_high")
    return PrintedNumbers("s", "x", dict(zip(kinds, texts, strict=True)))


def test_an_interval_tells_how_many_errors_it_was_printed_for():
    assert numbers("0.0804", "0.03657", "0.1481", "0.0651", "0.0957").interval_n == 22
    assert numbers("0.0804", "0.03657", "0.1481", "", "").interval_n is None


def test_the_cells_of_a_printed_statistic_are_found():
    rng = np.random.default_rng(6)
    cells = rng.normal(0, 0.02, 18)
    chosen = cells[[2, 7, 15]]
    texts = [f"{chosen.mean():.4f}", f"{chosen.std(ddof=1):.4f}", f"{np.abs(chosen).max():.4f}"]
    assert (2, 7, 15) in cells_that_give(cells, numbers(*texts, "", ""))
    assert cells_that_give(cells, numbers("9.0", "0.1", "9.0", "", "")) == []


def test_printed_digits_are_kept(tmp_path):
    path = tmp_path / "statistics.csv"
    path.write_text("system,component,mean,std\na,x,-0.000,0.0420\n")
    (row,) = load_printed(path)
    assert (row.texts["mean"], row.texts["std"], row.texts["max_abs"]) == ("-0.000", "0.0420", "")


def test_claims_get_the_verdict_of_their_pairs_and_findings():
    pairs = paired_errors(evaluations(np.random.default_rng(7), {"a": 0.03, "b": 0.01}))
    findings = [
        Finding("good", "Fine.", "s", "one"),
        Finding("warning", "Wrong.", "t", "one"),
        Finding("note", "Who knows.", "s", "two"),
    ]
    claims = [
        Claim(says="b is better", less="b", than="a"),
        Claim(says="a is better", less="a", than="b"),
        Claim(says="c is better", less="c", than="b"),
        Claim(says="all is fine", finding="one"),
        Claim(says="s is fine", finding="one", subject="s"),
        Claim(says="two", finding="two"),
        Claim(says="three", finding="three", note="Nothing of that."),
        Claim(says="four"),
    ]
    assert [one.verdict for one in judge_claims(claims, pairs, findings)] == [
        "supported",
        "contradicted",
        "not tested",
        "contradicted",
        "supported",
        "open",
        "not tested",
        "not tested",
    ]


def test_a_claim_names_both_systems():
    with pytest.raises(ValidationError, match="belong together"):
        Claim(says="better", less="a")
