"""Scores of hand-made trials whose scores are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import expit
from scorecard_cases import CRASH, QUIET, answer, drawn, effect, named, pair, truth

from skred.prove.scoring.alarms import detection, false_alarms, logistic_coefficients
from skred.prove.scoring.answers import pairs_of
from skred.prove.scoring.confusion import confusion
from skred.prove.scoring.criteria import MET, NOT_MET, TOO_FEW, Criterion, acceptance_criteria, judge
from skred.prove.scoring.gain import failures, gains, held_out, times
from skred.prove.scoring.intervals import median, share, upper_limit
from skred.prove.scoring.naming import naming, selectivity, unlisted
from skred.prove.scoring.paired import compare, roc_area, score_of, threshold
from skred.prove.scoring.places import places, strengths
from skred.prove.scoring.probability import (
    bin_of,
    brier,
    ece_if_calibrated,
    ece_of,
    log_score,
    per_trial_sums,
    probabilities,
)
from skred.prove.scoring.standards import NAMED_CEILING, RIGHT_NAME_CEILING, STRENGTHS, ceiling, class_of

NULL = truth("nothing")


def test_share_has_its_exact_interval() -> None:
    found = share([True] * 9 + [False])
    assert (found["n"], found["hits"], found["share"]) == (10, 9, 0.9)
    # Beta quantiles 0.025 of (9, 2) and 0.975 of (10, 1).
    assert found["low"] == pytest.approx(0.5549839, abs=1e-6)
    assert found["high"] == pytest.approx(0.9974714, abs=1e-6)


def test_upper_limit_is_one_sided() -> None:
    assert upper_limit([False] * 59) == pytest.approx(1.0 - 0.05 ** (1 / 59))
    assert (
        (upper_limit([True] + [False] * 119) or 1.0) < 0.05 < (upper_limit([True] * 2 + [False] * 118) or 0.0)
    )


def test_nothing_measured_is_null() -> None:
    assert share([])["share"] is None and share([])["n"] == 0
    assert median([])["value"] is None and upper_limit([]) is None
    assert median([3.0]) == {"n": 1, "value": 3.0, "low": None, "high": None}


def test_median_interval_holds_the_median_and_repeats() -> None:
    values = np.random.default_rng(1).normal(size=101)
    found = median(list(values))
    assert found["low"] < found["value"] < found["high"]
    assert found == median(list(values))
    assert found["high"] - found["low"] == pytest.approx(2 * 1.96 * 1.2533 / math.sqrt(101), rel=0.4)


def test_false_alarms_by_kind_of_null() -> None:
    odd, heavy = truth("nasty", nasty="odd_event"), truth("nasty", nasty="heavy_tails")
    pairs = [pair(NULL, QUIET), pair(NULL, answer("unexplained")), pair(NULL, CRASH), pair(heavy, QUIET)]
    pairs += [pair(odd, named("obstacle")), pair(truth("listed", effect("obstacle")), named("obstacle"))]
    found = false_alarms(pairs)
    assert (found["plain"]["hits"], found["plain"]["n"], found["plain"]["failures"]) == (1, 3, 1)
    assert found["plain"]["with_failures"]["hits"] == 2
    assert (found["nasty"]["hits"], found["all"]["n"]) == (1, 5)
    assert {name: one["hits"] for name, one in found["by_nastiness"].items()} == {
        "heavy_tails": 0,
        "odd_event": 1,
    }


def test_logistic_fit_finds_the_line_the_trials_came_from() -> None:
    rng = np.random.default_rng(3)
    snr = rng.uniform(2, 12, 4000)
    y = (rng.random(4000) < expit(0.8 + 2.4 * (snr - 6.0) / 2.0)).astype(float)
    (fit,) = logistic_coefficients(snr, y, np.ones((1, 4000)))
    assert fit == pytest.approx([0.8, 2.4], abs=0.2)


def test_logistic_fit_stays_finite_where_all_are_found() -> None:
    pairs = [pair(truth("listed", effect("obstacle"), snr=s), named("obstacle")) for s in (3.0, 6.0, 11.0)]
    found = detection(pairs)
    assert 0.5 < found["fit"]["at"]["7"]["value"] < 1.0
    assert [row["n"] for row in found["by_snr"]] == [1, 0, 1, 0, 1]
    assert found["by_hidden"]["listed"]["hits"] == 3


def test_ceilings_are_interpolated() -> None:
    assert ceiling(RIGHT_NAME_CEILING, "sparse", 6.0) == pytest.approx(0.745)
    assert ceiling(NAMED_CEILING, "dense", 12.0) == 0.91
    assert ceiling(NAMED_CEILING, "dense", 3.9) is None


def test_names_right_in_first_place_in_class_and_in_set() -> None:
    drag = truth("listed", effect("viscous_drag"))
    pairs = [pair(drag, named("viscous_drag")), pair(drag, named("turbulent_drag")),
             pair(drag, named("obstacle", "viscous_drag")), pair(drag, QUIET), pair(drag, CRASH)]  # fmt: skip
    found = naming(pairs)["around_7"]
    hits = {
        key: found[key]["hits"] for key in ("right_first_name", "right_class", "right_set", "named_alone")
    }
    assert hits == {"right_first_name": 1, "right_class": 2, "right_set": 2, "named_alone": 2}
    assert found["right_first_name"]["n"] == 5
    assert found["ceiling_right_first_name"] == pytest.approx(0.80)


def test_a_set_of_four_is_too_large() -> None:
    drag = truth("listed", effect("viscous_drag"))
    found = naming([pair(drag, named("obstacle", "entrainment", "sensor_bias", "viscous_drag"))])["all"]
    assert found["right_set"]["hits"] == 1 and found["right_set_of_3"]["hits"] == 0


@pytest.mark.parametrize(
    ("hidden", "name", "place", "kind", "same"),
    [
        ("segment_drag", "entrainment", (1100.0, 1300.0), "dense", True),
        ("segment_drag", "entrainment", (1300.0, 1500.0), "dense", False),
        ("segment_drag", "entrainment", None, "dense", False),
        ("obstacle", "segment_drag", (1000.0, 1090.0), "dense", True),
        ("obstacle", "segment_drag", (1000.0, 1200.0), "dense", False),
        ("obstacle", "sensor_bias", None, "dense", True),
        ("segment_drag", "obstacle", (1000.0, 1050.0), "dense", False),
        ("release_offset", "centrifugal", None, "sparse", True),
        ("release_offset", "centrifugal", None, "dense", False),
        ("viscous_drag", "constant_retardation", None, "sparse", False),
    ],
)
def test_permanent_ties_hold_under_their_conditions(
    hidden: str, name: str, place: tuple[float, float] | None, kind: str, same: bool
) -> None:
    location = None if place is None else {"s_from_m": place[0], "s_to_m": place[1]}
    one = pair(truth("listed", effect(hidden), kind=kind), named(name, location=location))
    assert one.right_class is same and not one.right_name


def test_each_id_has_one_class() -> None:
    classes = {name: class_of(name) for name in STRENGTHS}
    assert (
        classes["entrainment"] == classes["segment_drag"] == "segment_drag / segment_friction / entrainment"
    )
    assert classes["obstacle"] == classes["sensor_bias"] != classes["segment_drag"]
    assert classes["constant_retardation"] == "constant_retardation"


def test_of_two_mechanisms_one_is_right_and_both_are_told() -> None:
    both = truth("two", effect("obstacle"), effect("viscous_drag"))
    steps = [{"id": "viscous_drag", "tied_with": []}, {"id": "segment_drag", "tied_with": ["obstacle"]}]
    found = naming([pair(both, named("viscous_drag", mechanisms=steps)), pair(both, named("entrainment"))])[
        "two"
    ]
    assert found["right_first_name"]["hits"] == 1
    assert (found["both_found"]["hits"], found["both_in_sets"]["hits"]) == (0, 1)


def test_honesty_counts_names_where_nothing_listed_is_hidden() -> None:
    drag = truth("listed", effect("viscous_drag"))
    pairs = [pair(drag, named("viscous_drag")), pair(NULL, named("obstacle")),
             pair(truth("unlisted", effect("wave")), named("obstacle", "entrainment")),
             pair(drag, named("obstacle", "viscous_drag"))]  # fmt: skip
    found = selectivity(pairs)
    assert (found["right_where_named"]["hits"], found["right_where_named"]["n"]) == (1, 2)
    assert (found["set_holds_truth_where_tied"]["hits"], found["set_holds_truth_where_tied"]["n"]) == (1, 2)
    assert found["named_over_ceiling"]["value"] == pytest.approx(1.0 / (2 * 0.49))


def test_a_tie_with_a_force_in_no_list_holds_such_a_force() -> None:
    other = truth("unlisted", effect("wave"))
    tied = named("obstacle", "unlisted")
    assert pair(other, tied).right_set and not pair(other, tied).right_name
    assert not pair(other, named("obstacle", "segment_drag")).right_set
    assert not pair(truth("listed", effect("viscous_drag")), tied).right_set


def test_unlisted_effects_get_no_right_name() -> None:
    cubic = truth("unlisted", effect("cubic_drag", nearest="segment_drag"), snr=10.0)
    near = {"s_from_m": 1150.0, "s_to_m": 1230.0}
    pairs = [pair(cubic, named("segment_drag", location={"s_from_m": 400.0, "s_to_m": 500.0})),
             pair(cubic, answer("unexplained", location=near)), pair(cubic, CRASH)]  # fmt: skip
    found = unlisted(pairs)
    high = found["around_10"]
    assert (high["wrong_name"]["hits"], high["wrong_name_or_failed"]["hits"], high["n"]) == (1, 2, 3)
    assert high["unexplained"]["hits"] == 1 and high["wrong_name_is_nearest_listed"]["hits"] == 1
    assert (high["place_right"]["hits"], high["place_right"]["n"]) == (1, 3)
    assert found["by_id"]["cubic_drag"]["n"] == 3


def test_place_errors_and_right_stretches() -> None:
    drag = truth("listed", effect("segment_drag"))
    there, off = {"s_from_m": 1040.0, "s_to_m": 1240.0}, {"s_from_m": 1150.0, "s_to_m": 1350.0}
    stated = [named("segment_drag", location=there), named("obstacle", location=off), QUIET]
    found = places([pair(drag, one) for one in stated])
    assert found["error"]["median_m"]["value"] == pytest.approx((40.0 + 150.0) / 2)
    assert found["error_where_set_is_right"]["median_m"]["value"] == 40.0
    assert (found["right_stretch"]["hits"], found["right_stretch"]["n"]) == (1, 3)
    assert found["right_stretch_where_stated"]["n"] == 2


def test_strength_intervals_and_what_cannot_be_compared() -> None:
    drag = truth("listed", effect("viscous_drag"))

    def stated(mean: float, unit: str = "s-1") -> dict[str, object]:
        return {"parameter": "viscous_drag", "unit": unit, "mean": mean, "sd": 0.001}

    pairs = [
        pair(drag, named("viscous_drag", strength=one))
        for one in (stated(0.0216), stated(0.0217), stated(0.02, "1"))
    ]
    found = strengths(pairs)
    assert (found["coverage_90"]["hits"], found["coverage_90"]["n"], found["n_not_comparable"]) == (1, 2, 1)


def test_log_score_and_brier() -> None:
    drag = truth("listed", effect("viscous_drag"))
    stated = {"nothing": 0.2, "viscous_drag": 0.5, "obstacle": 0.3}
    one = pair(drag, named("viscous_drag", probability=stated))
    assert log_score(one) == pytest.approx(math.log(0.5))
    assert brier(one) == pytest.approx(0.25 + 0.04 + 0.09)
    both = pair(
        truth("two", effect("viscous_drag"), effect("obstacle")), named("obstacle", probability=stated)
    )
    assert log_score(both) == pytest.approx(math.log(0.8))
    assert log_score(
        pair(truth("nasty", nasty="odd_event"), named("obstacle", probability=stated))
    ) == math.log(0.2)
    assert log_score(pair(drag, CRASH)) == math.log(1e-3)
    assert log_score(pair(truth("unlisted", effect("wave")), QUIET)) == pytest.approx(math.log(0.1))


def test_ece_of_two_bins_by_hand() -> None:
    cases = [(np.array([0.85]), np.array([True]))] * 3 + [(np.array([0.25]), np.array([True]))]
    n, excess = per_trial_sums(cases)
    assert ece_of(n, excess) == pytest.approx((3 * 0.15 + 0.75) / 4)
    assert list(bin_of(np.array([0.0, 0.1, 0.999, 1.0]))) == [0, 1, 9, 9]


def test_expected_ece_is_what_calibrated_statements_show() -> None:
    # One bin, n statements of p: E|n p - k| / n from the binomial distribution.
    from scipy.stats import binom

    n, p = 25, 0.65
    exact = sum(abs(n * p - k) * binom.pmf(k, n, p) for k in range(n + 1)) / n
    cases = [(np.array([p]), np.array([True]))] * n
    assert ece_if_calibrated(cases).mean() == pytest.approx(exact, rel=0.05)


def test_expected_ece_of_many_ids_draws_one_truth_each() -> None:
    rng = np.random.default_rng(5)
    stated = rng.dirichlet(np.full(6, 0.6), size=120)
    real = []
    for _ in range(200):
        true = [np.eye(6, dtype=bool)[rng.choice(6, p=one)] for one in stated]
        real.append(float(ece_of(*per_trial_sums(list(zip(stated, true, strict=True))))))
    cases = [(one, np.eye(6, dtype=bool)[0]) for one in stated]
    assert ece_if_calibrated(cases).mean() == pytest.approx(np.mean(real), rel=0.06)


def test_overconfidence_shows() -> None:
    drag = truth("listed", effect("viscous_drag"))
    sure = {"viscous_drag": 0.95, "nothing": 0.05}
    pairs = [pair(drag, named("viscous_drag", probability=sure))] * 60
    pairs += [pair(truth("listed", effect("obstacle")), named("viscous_drag", probability=sure))] * 60
    found = probabilities(pairs)
    assert found is not None
    assert found["top_id"]["ece"] == pytest.approx(0.45)
    assert found["top_id"]["ece_less_expected"]["low"] > 0.2
    assert found["top_id"]["bins"][9]["share"] == 0.5
    assert probabilities([pair(drag, CRASH)]) is None


def test_gain_ratio_and_slope() -> None:
    drag = truth("listed", effect("viscous_drag"))
    pairs = [
        pair(drag, named("viscous_drag", gain={"promised": p, "realised": r}))
        for p, r in ((1.0, 0.5), (3.0, 3.0))
    ]
    found = gains([*pairs, pair(drag, QUIET)])
    assert found["realised_over_promised"]["value"] == pytest.approx(3.5 / 4.0)
    assert found["slope_through_origin"]["value"] == pytest.approx(9.5 / 10.0)
    assert found["n"] == 2


def test_held_out_times_and_failures() -> None:
    drag = truth("listed", effect("viscous_drag"))
    pairs = [pair(drag, named("viscous_drag", evidence={"elpd_diff": 3.0}, wall_seconds=70.0)),
             pair(drag, named("viscous_drag", evidence={"elpd_diff": None})), pair(drag, CRASH),
             pair(drag, {"verdict": "timeout", "wall_seconds": 50.0})]  # fmt: skip
    assert held_out(pairs)["better_where_named"]["n"] == 1 and held_out(pairs)["n_without_difference"] == 1
    found = times(pairs)
    assert found["wall"]["max_seconds"] == 70.0
    assert (found["wall"]["within_limit"]["hits"], found["wall"]["within_limit"]["n"]) == (1, 3)
    assert failures(pairs)["crash"]["hits"] == failures(pairs)["timeout"]["hits"] == 1


def test_confusion_counts_every_trial_once() -> None:
    trials, answers = drawn(60)
    pairs = pairs_of(trials, answers)
    for table in confusion(pairs).values():
        assert sum(map(sum, table["counts"])) == 60
    small = confusion(
        [pair(truth("listed", effect("viscous_drag")), named("turbulent_drag")), pair(NULL, {"verdict": "?"})]
    )
    assert small["mechanisms"]["columns"][0] == "turbulent_drag"
    (line, null) = small["classes"]["counts"]
    assert line[0] == 1 and null[-1] == 1


def test_a_trial_without_an_answer_is_a_crash() -> None:
    (one,) = pairs_of([{"trial": "trial-0001", "truth": NULL}], {})
    assert one.failed and not one.alarm


def test_threshold_leaves_no_more_alarms_than_asked() -> None:
    scores = np.array([0.1, 0.9, 0.5, 0.5, 0.7])
    assert int((scores > threshold(scores, 2)).sum()) == 2
    assert int((scores > threshold(scores, 3)).sum()) <= 3
    assert int((scores > threshold(scores, 0)).sum()) == 0
    assert roc_area(np.array([1.0, 0.5]), np.array([0.5, 0.0])) == pytest.approx(3.5 / 4)


def test_a_method_equals_itself() -> None:
    trials, answers = drawn(80, seed=2)
    pairs = pairs_of(trials, answers)
    found = compare(pairs, pairs)
    for key in ("right_first_name", "right_set"):
        assert found[key]["difference"] == found[key]["low"] == found[key]["high"] == 0.0
    assert found["log_score_difference_nats"]["value"] == 0.0
    assert found["roc_area"]["ours"] == found["roc_area"]["theirs"]


def test_a_loose_method_is_held_to_as_many_false_alarms() -> None:
    """A baseline that always names the truth but cannot tell it from nothing has no advantage."""
    drag = truth("listed", effect("viscous_drag"))
    ours = [pair(NULL, QUIET)] * 20
    ours += [pair(drag, named("viscous_drag", probability={"nothing": 0.01, "viscous_drag": 0.99}))] * 10
    rng = np.random.default_rng(4)
    loose = [pair(one.truth, named("viscous_drag", score=float(rng.random()))) for one in ours]
    found = compare(ours, loose)["right_first_name"]
    assert found["ours"] == 1.0 and found["theirs"] < 0.4 and found["low"] > 0.0
    assert score_of(CRASH) == -math.inf and score_of(QUIET) == pytest.approx(0.1)


def test_bars_are_called_only_with_enough_trials() -> None:
    criterion = Criterion("goal", "what", at_least=0.8)
    assert judge(criterion, 0.9, 0.85, 0.95, 19) == (TOO_FEW, False)
    assert judge(criterion, 0.9, 0.85, 0.95, 20) == (MET, True)
    assert judge(criterion, 0.9, 0.75, 0.95, 20) == (MET, False)
    assert judge(criterion, 0.7, 0.6, 0.85, 20) == (NOT_MET, False)
    assert judge(criterion, 0.1, 0.0, 0.3, 5) == (NOT_MET, True)
    assert judge(criterion, None, None, None, 0) == (TOO_FEW, False)
    assert judge(Criterion("goal", "what", at_least=0.0), 0.0, 0.0, 0.0, 50)[0] == NOT_MET


@pytest.mark.parametrize(
    ("alarms", "n", "status"),
    [(0, 40, TOO_FEW), (0, 60, MET), (1, 120, MET), (2, 120, NOT_MET), (9, 20, NOT_MET)],
)
def test_false_alarm_bar_is_on_the_upper_limit(alarms: int, n: int, status: str) -> None:
    from skred.prove.scoring.scores import scores_by_kind

    pairs = [pair(NULL, named("obstacle"))] * alarms + [pair(NULL, QUIET)] * (n - alarms)
    rows = acceptance_criteria(scores_by_kind(pairs)["open"], {})
    assert next(row for row in rows if row["what"].startswith("plain nulls"))["status"] == status


def test_crashes_count_as_false_alarms_in_the_bar() -> None:
    from skred.prove.scoring.scores import scores_by_kind

    rows = acceptance_criteria(scores_by_kind([pair(NULL, CRASH)] * 120)["open"], {})
    row = next(row for row in rows if row["what"].startswith("plain nulls"))
    assert row["status"] == NOT_MET and row["measured"] > 0.95
