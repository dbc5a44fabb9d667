"""One number for one thing: verdict, table, sentences, page and draws say the same of what was added."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_report_cases import GATE, diagnosis, document_of, with_finding
from test_report_html import Page

from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.detect.detectability import Identifiability
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.outcome import NotDiagnosed
from skred.diagnosis.predict.draws import Draws
from skred.diagnosis.verdict.document import verdict
from skred.diagnosis.verdict.draws import FORCE, augmented_draws, profile_draws
from skred.diagnosis.verdict.figure_data import figure_data
from skred.diagnosis.verdict.improvement import improvement
from skred.inference.added_terms import added_terms
from skred.inference.results import FORMAT, save
from skred.output import write_json
from skred.prediction.predict import Simulation, prediction_of
from skred.prediction.source import source_of
from skred.prediction.track import prediction_track
from skred.report.diagnosis.report import render_diagnosis


def uncertain_place():
    """Drag on one of several stretches, weaker on those that begin further down; the first leads."""
    found = diagnosis("tie")
    step = found.steps[0]
    curves = sorted(
        (one for one in step.candidate.curves if one.shape.place_m is not None),
        key=lambda one: one.shape.s_from_m,
    )
    tops = [one.log_evidence.max() for one in curves]
    curves = [
        replace(
            one,
            strengths=(1.0 - 0.1 * k) * one.strengths,
            log_evidence=one.log_evidence + (one.strengths > 0.0) * (30.0 - 0.1 * k - top),
        )
        for k, (one, top) in enumerate(zip(curves, tops, strict=True))
    ]
    weights = np.full(len(curves), -np.log(len(curves)))
    candidate = replace(step.candidate, curves=tuple(curves), log_weights=weights, log_between=0.0)
    under = replace(
        step.comparison.under_each[0],
        candidates=step.comparison.under_each[0].candidates | {candidate.mechanism.id: candidate},
    )
    comparison = replace(step.comparison, under_each=(under,))
    found = replace(found, comparison=comparison)
    return with_finding(found, steps=(replace(step, candidate=candidate, comparison=comparison),))


def test_one_place_and_one_interval():
    found = uncertain_place()
    best = found.steps[0].candidate.best.shape
    document = verdict(found)
    place, strength = document["location"], document["strength"]
    assert (place["s_from_m"], place["s_to_m"]) != (best.s_from_m, best.s_to_m)
    low, high = place["s_from_interval_m"]
    assert low <= place["s_from_m"] <= high and low < high
    (row,) = [one for one in document["candidates"] if one["id"] == document["mechanism"]]
    for one in (document["mechanisms"][0], row):
        assert one["location"] == place
        assert {key: one["strength"][key] for key in ("mean", "sd")} == {
            key: strength[key] for key in ("mean", "sd")
        }
    ends = f"{place['s_from_m']:.0f} and {place['s_to_m']:.0f}"
    assert f"between s = {ends} m" in document["statement"]
    text = Page(render_diagnosis(document_of(found), figure_data(found), {})).text
    assert re.findall(r"where the stretch begins and ends, here (\d+ and \d+)", text) == [ends]


def test_draws_hold_the_interval_of_the_verdict():
    """Beside those of the chains, which hold the place at the best one and are narrower."""
    found = uncertain_place()
    document, tree = verdict(found), augmented_draws(found)
    group, strength, place = tree["added"], document["strength"], document["location"]
    assert float(group["strength_mean"][0]) == strength["mean"]
    assert float(group["strength_sd"][0]) == strength["sd"]
    low, middle, high = group["s_from"].values[0]
    assert [low, high] == place["s_from_interval_m"] and middle == place["s_from_m"]
    draws = tree["posterior"][strength["parameter"]]
    assert float(draws.std()) < strength["sd"]
    assert np.isnan(augmented_draws(diagnosis("sensor"))["added"]["s_from"].values).all()


def test_draws_of_a_force_in_no_list_can_be_predicted_with(tmp_path):
    """Written beside an `unexplained` verdict, and read again without the diagnosis."""
    found = diagnosis("unexplained")
    law = found.finding
    n, n_knots = 30, len(law.profile.knots_m)
    rng = np.random.default_rng(2)
    draws = Draws(
        np.log(0.45) + 0.05 * rng.standard_normal((n, 1)),
        np.full((n, 1, 1), 0.2),
        np.tile(law.profile.mean, (n, 1)),
    )
    setting = setting_of(found.problem, found.law)
    base = SimpleNamespace(base=SimpleNamespace(setting=setting))
    stub = replace(found, comparison=SimpleNamespace(leading=lambda name: base))
    tree = profile_draws(stub, replace(law, draws_after=draws))
    tree.attrs |= {
        "format": FORMAT,
        "law": found.law.id,
        "campaign": "ryggfonn",
        "campaign_fingerprint": "",
        "smoothing_m": found.problem.terrain.smoothing_m,
        "settings": "{}",
        "seed": 1,
        "versions": "{}",
        "gate": json.dumps(GATE.as_dict()),
    }
    assert tree["population"]["added_strengths"].shape == (n, n_knots)
    terms = added_terms(tree)
    assert len(terms) == n_knots and not any(term.transfers for term in terms)
    # At the knots the force is what was drawn there.
    profile = sum(s * term.direction.profiles[0] for s, term in zip(law.profile.mean, terms, strict=True))
    edge = found.problem.terrain.edge_s_m
    at = np.interp(law.profile.knots_m[5:15], 0.5 * (edge[1:] + edge[:-1]), profile)
    np.testing.assert_allclose(at, law.profile.mean[5:15], atol=0.03)
    save(tree, tmp_path / "profile.nc")
    write_json(tmp_path / "verdict.json", {"format": 1, "verdict": "unexplained"})
    source = source_of(tmp_path)
    assert source.file == "profile.nc" and FORCE in source.told
    stored = source.stored
    track, size = prediction_track(stored.problem), Simulation(20, 64)
    ends = [
        prediction_of(stored.problem, found.law, stored.calibration.tree, track, size, added=added)
        for added in ((), stored.added)
    ]
    assert float(ends[1]["runout_quantile"][0]) < float(ends[0]["runout_quantile"][0])  # it brakes


def test_refits_that_did_not_converge_are_told_first():
    found = diagnosis("tie")
    assert verdict(found)["converged"] is True and verdict(found)["refits_not_converged"] == []
    one, two, *_ = found.problem.campaign.event_ids
    before = replace(found.before, not_converged=(two,))
    document = verdict(replace(found, before=before))
    assert document["converged"] is False and document["refits_not_converged"] == [two]
    assert document["statement"].startswith(
        f"Take this with care: the refit without avalanche {two} did not converge"
    )
    after = replace(found.after, not_converged=(one,))
    document = verdict(replace(found, before=before, after=after))
    assert document["refits_not_converged"] == [one, two]
    first = document["statement"].partition(". ")[0]
    assert f"the refits without avalanches {one} and {two} did not converge" in first


def test_what_ended_a_diagnosis_is_no_lack_of_convergence_unless_it_is():
    problem, law = diagnosis("nothing").problem, diagnosis("nothing").law
    assert verdict(NotDiagnosed(problem, law, "too few", converged=True))["converged"] is True
    assert verdict(diagnosis("gate"))["converged"] is False


@pytest.mark.parametrize("kind", ["nothing", "silent", "sensor", "tie", "unexplained"])
def test_the_next_sensor_is_the_one_that_the_page_names(kind):
    found = diagnosis(kind)
    document = verdict(found)
    sensor = document["detection_sensor"]
    assert sensor["s_from_m"] == found.table.sensor_m and sensor["power_with"] == found.table.power_with
    assert document["next_sensor"] == sensor or document["next_sensor"]["splits"]
    text = Page(render_diagnosis(document_of(found), figure_data(found), {})).text
    assert f"A speed read at s = {sensor['s_from_m']:.0f} m helps most" in text


@pytest.mark.parametrize("power", [0.3, 0.304])
def test_a_sensor_that_raises_nothing_is_not_named(power):
    table = Identifiability(diagnosis("silent").table.rows, 1750.0, 0.3, power)
    found = replace(diagnosis("silent"), table=table)
    document = verdict(found)
    assert document["next_sensor"] is None and document["detection_sensor"] is None
    text = Page(render_diagnosis(document_of(found), figure_data(found), {})).text
    assert "One more sensor" not in text and "One more speed" not in document["statement"]


@pytest.mark.parametrize(
    ("log_odds", "n", "by"),
    [(30.0, 9, "evidence"), (4.0, 99, "check"), (-2.0, 9, None)],
)
def test_what_raised_the_alarm(log_odds, n, by):
    """The odds alone where they are high, or clean campaigns that do not reach them."""
    found = diagnosis("tie")
    check = BootstrapTest(log_odds, np.linspace(-1.0, 2.0, n))
    assert replace(found, check=check).alarm_by == by


def test_the_verdict_says_what_raised_the_alarm():
    assert verdict(diagnosis("tie"))["alarm_by"] == "check"
    assert verdict(diagnosis("silent"))["alarm_by"] is None


def held(**values):
    keys = ("rmse_velocity_before", "rmse_velocity_after", "rmse_runout_before", "rmse_runout_after")
    return dict.fromkeys(keys) | values


RISES = "For avalanches left out the log score rises by 51.0 (twice its standard error: 16.0)"
FALLS = "the log score falls by 20.0 (twice its standard error: 16.0)"
STAYS = "the log score changes by +9.0 (twice its standard error: 16.0), not beyond its error"
FASTER = "the error of speeds falls from 5.6 to 4.3 m/s"
FARTHER = "But the error of runouts grows from 205 to 212 m."


@pytest.mark.parametrize(
    ("difference", "after", "said"),
    [
        (51.0, 212.3, f"{RISES}; {FASTER}. {FARTHER}"),
        (51.0, 180.0, f"{RISES}; {FASTER}; the error of runouts falls from 205 to 180 m."),
        (
            -20.0,
            204.8,
            f"For avalanches left out {FASTER}; the error of runouts stays at 205 m. But {FALLS}.",
        ),
        (9.0, 212.3, f"For avalanches left out {STAYS}; {FASTER}. {FARTHER}"),
    ],
)
def test_what_got_worse_is_told_as_worse(difference, after, said):
    errors = held(
        rmse_velocity_before=5.56, rmse_velocity_after=4.31, rmse_runout_before=204.6, rmse_runout_after=after
    )
    assert improvement({"evidence": {"elpd_diff": difference, "elpd_se": 8.0}, "held_out": errors}) == said


def test_where_all_is_worse_nothing_is_called_better():
    errors = held(rmse_velocity_before=4.0, rmse_velocity_after=5.0)
    told = improvement({"evidence": {"elpd_diff": -20.0, "elpd_se": 8.0}, "held_out": errors})
    assert told == (
        f"Avalanches left out are predicted worse: {FALLS}; the error of speeds grows from 4.0 to 5.0 m/s."
    )


@pytest.mark.parametrize("kind", ["nothing", "silent", "sensor", "tie", "two", "unexplained"])
def test_numbers_in_sentences_are_written_one_way(kind):
    statement = verdict(diagnosis(kind))["statement"]
    assert "+-" not in statement and not re.search(
        r"\bm s-\d|\bm-1\b|\b1 times\b|\b1 avalanches\b", statement
    )
    if kind in ("sensor", "tie", "two"):
        assert re.search(r"is \d[\d.e-]* ± \d", statement)
