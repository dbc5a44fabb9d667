"""The force profile let in: tried on avalanches it was not fitted to, by exact refits too."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, first_events, trial, with_sensors
from numpy.testing import assert_array_equal

from skred.diagnosis.compare.comparison import Comparison, ComparisonUnderErrors
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, combined, knots
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.extension import extended, setting_of
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.predict.held_out import held_out, largest_k
from skred.diagnosis.predict.predictor_document import as_dict, from_dict
from skred.diagnosis.predict.profile_law import ProfileLaw, parts_left_out, profile_law
from skred.diagnosis.predict.unseen import ProfileTerm, log_scores
from skred.diagnosis.verdict.predictors import predictors_of, promised_gain
from skred.errors import InputError
from skred.inference.calibrate import calibrate
from skred.inference.sampling import SamplerSettings


def law_of(base: Base) -> ProfileLaw:
    profiles = [fit_profile(base, KINDS[0])]
    return profile_law(ComparisonUnderErrors("robust", base, {}, profiles), seed=0)


def thinned(hidden: str, snr: float | None) -> Base:
    """Ten avalanches past every other gate, constant retardation."""
    campaign = first_events(trial(1003, "dense", hidden, "constant", snr).campaign, 10)
    gates = [*range(0, campaign.n_sensors - 1, 2), campaign.n_sensors - 1]
    return base_of(with_sensors(campaign, gates), "constant")


@pytest.fixture(scope="module")
def hidden() -> Base:
    return thinned("push_pull", 14.0)


@pytest.fixture(scope="module")
def added(hidden: Base) -> ProfileLaw:
    return law_of(hidden)


def test_few_avalanches_are_left_out_one_by_one_and_many_in_parts() -> None:
    assert [part.tolist() for part in parts_left_out(22, 0)] == [[event] for event in range(22)]
    parts = parts_left_out(200, 0)
    assert len(parts) == 24 and {len(part) for part in parts} == {8, 9}
    assert sorted(np.concatenate(parts)) == list(range(200))
    assert parts[0].tolist() != list(range(9))  # avalanches stand in the order of their dates


@pytest.mark.slow
def test_a_force_that_is_there_predicts_avalanches_left_out(added: ProfileLaw) -> None:
    difference = added.after.pointwise - added.before.pointwise
    assert difference.sum() > 10.0
    assert difference.sum() < added.profile.gain + 5.0
    assert added.check.p_value > 0.01


@pytest.mark.slow
def test_a_force_that_is_not_there_does_not() -> None:
    clean = law_of(thinned("nothing", None))
    assert (clean.after.pointwise - clean.before.pointwise).sum() < 1.0


def diagnosed(hidden: Base, added: ProfileLaw) -> Diagnosis:
    under_errors = ComparisonUnderErrors("robust", hidden, {}, [added.profile])
    comparison = Comparison((under_errors,), {}, {"robust": 0.0})
    nothing: Any = None
    return Diagnosis(
        hidden.problem, hidden.law, nothing, nothing, nothing, comparison, nothing, nothing,
        added, added.before, added.after,
    )  # fmt: skip


@pytest.mark.slow
def test_fresh_avalanches_are_scored_with_the_profile(hidden: Base, added: ProfileLaw) -> None:
    """As plain data and back; what they gain is about what those left out promise."""
    found = diagnosed(hidden, added)
    document = json.loads(json.dumps([as_dict(one) for one in predictors_of(found) if one is not None]))
    before, after = (from_dict(one) for one in document)
    assert before.profile is None and after.profile is not None
    fresh = trial(1003, "dense", "push_pull", "constant", 14.0).fresh
    fresh = with_sensors(fresh, [*range(0, fresh.n_sensors - 1, 2), fresh.n_sensors - 1])
    realised = (log_scores(after, fresh) - log_scores(before, fresh)).mean()
    promised = promised_gain(found)
    assert promised is not None and promised > 1.0
    assert 0.4 * promised < realised < 2.0 * promised


@pytest.mark.parametrize("kind", range(len(KINDS)))
def test_a_predictor_s_profile_is_that_which_was_fitted(hidden: Base, kind: int) -> None:
    """Readings with any values at the knots, also where the force refers to the typical speed."""
    setting, own = hidden.setting, KINDS[kind]
    at = knots(setting)
    values = own.amplitude * np.sin(np.arange(len(at)))
    fitted = extended(hidden.problem, hidden.law, [combined(setting, own, at, values)])
    profile = replace(fit_profile(hidden, KINDS[0]), kind=own)
    directions = ProfileTerm.of(profile, setting).directions(setting_of(hidden.problem, hidden.law))
    told = extended(hidden.problem, hidden.law, directions)
    events, points = hidden.rows.event, hidden.fit.points
    expected = fitted.predict(events, points, np.array([1.0]))
    np.testing.assert_allclose(told.predict(events, points, values), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("kind", "-f", "kind: found '-f'"),
        ("knots_m", [10.0, 5.0], "knots_m: expected two or more increasing"),
        ("knots_m", [1.0] * 1000, "at most"),
        ("front_speed", [-1.0, 2.0], "front_speed: expected one for each edge_m, 0 or more"),
        ("front_speed", "fast", "front_speed: found 'fast': expected finite numbers"),
        ("front_speed", [1.0], "front_speed: expected one for each edge_m"),
    ],
)
def test_a_profile_that_cannot_be_is_refused(key: str, value: Any, words: str) -> None:
    places, speeds = [10.0, 50.0], [0.0, 0.0]
    term = {"kind": KINDS[0].equation, "knots_m": places, "edge_m": places, "front_speed": speeds}
    document = {
        "format": 1,
        "law": "constant",
        "error_model": "robust",
        "place_sd_m": 8.0,
        "smoothing_m": 10.0,
    }
    document |= {"means": [[0.5]], "factors": [[[0.1]]], "terms": [], "strengths": [[0.1, 0.2]]}
    assert from_dict(document | {"profile": term}).profile is not None
    with pytest.raises(InputError, match=words):
        from_dict(document | {"profile": term | {key: value}})


@pytest.mark.slow
def test_an_avalanche_has_no_say_in_what_is_predicted_of_it(hidden: Base, added: ProfileLaw) -> None:
    """Other readings of one avalanche change its scores, and what is predicted of the others alone."""
    event, readings = 3, hidden.rows.readings
    values = readings.values.copy()
    values[event] *= 1.3
    changed = replace(hidden, rows=hidden.rows._replace(readings=readings._replace(values=values)))
    other = profile_law(ComparisonUnderErrors("robust", changed, {}, [added.profile]), seed=0)
    for one, again in ((added.before, other.before), (added.after, other.after)):
        assert_array_equal(one.predicted.mean[event], again.predicted.mean[event])
        assert abs(one.pointwise[event] - again.pointwise[event]) > 1.0
        moved = np.nanmax(np.abs(one.predicted.mean - again.predicted.mean), axis=1)
        assert np.all(np.delete(moved, event) > 0.0)


@pytest.mark.slow
def test_before_is_what_sampling_and_refits_say(hidden: Base, added: ProfileLaw) -> None:
    """Populations by importance sampling against Metropolis, avalanche by avalanche."""
    calibration = calibrate(hidden.problem, hidden.law, SamplerSettings("metropolis", 800, 1500, 4, 0))
    sampled = held_out(calibration, 0, exact=True)
    np.testing.assert_allclose(added.before.pointwise, sampled.pointwise, atol=0.5)
    assert largest_k([added.before]) is None and added.before.n_unreliable == 0
    assert largest_k([added.before, sampled]) == sampled.pareto_k.max()
    assert added.before.pointwise.sum() == pytest.approx(sampled.pointwise.sum(), abs=1.0)
    # Sampling weights its draws for this, few of which count for an avalanche that is unlike the others.
    seen = hidden.problem.observed
    ratio = added.before.predicted.mean[seen] / sampled.predicted.mean[seen]
    assert abs(np.median(ratio) - 1.0) < 0.02
    assert np.abs(ratio - 1.0).max() < 0.2
