"""The force profile let in: tried on avalanches it was not fitted to, by exact refits too."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, first_events, trial, with_sensors
from numpy.testing import assert_array_equal

from skred.diagnosis.curves import Base
from skred.diagnosis.diagnose import Effort, _before
from skred.diagnosis.profile_law import ProfileLaw, _left_out, profile_law
from skred.diagnosis.race import Heat
from skred.diagnosis.unlisted import KINDS, fit_profile
from skred.inference.sampling import SamplerSettings
from skred.work.calibrate import calibrate


def law_of(base: Base) -> ProfileLaw:
    profiles = [fit_profile(base, KINDS[0])]
    return profile_law(Heat("robust", base, {}, profiles, []), most=40, seed=0)


def thinned(hidden: str, snr: float | None) -> Base:
    """Ten avalanches past every other gate, constant retardation."""
    campaign = first_events(trial(1003, "dense", hidden, "constant", snr).campaign, 10)
    gates = [*range(0, campaign.n_sensors - 1, 2), campaign.n_sensors - 1]
    return base_of(with_sensors(campaign, gates), "constant")


@pytest.fixture(scope="module")
def hidden() -> Base:
    return thinned("push_pull", 14.0)


@pytest.fixture(scope="module")
def let_in(hidden: Base) -> ProfileLaw:
    return law_of(hidden)


def test_a_force_that_is_there_predicts_avalanches_left_out(let_in: ProfileLaw) -> None:
    difference = let_in.after.pointwise - let_in.before.pointwise
    assert difference.sum() > 10.0
    assert difference.sum() < let_in.profile.gain + 5.0
    assert let_in.check.p_value > 0.01


def test_a_force_that_is_not_there_does_not() -> None:
    clean = law_of(thinned("nothing", None))
    assert (clean.after.pointwise - clean.before.pointwise).sum() < 1.0


def test_an_avalanche_has_no_say_in_what_is_predicted_of_it(hidden: Base, let_in: ProfileLaw) -> None:
    """Other readings of one avalanche change its scores and nothing that is predicted."""
    event, readings = 3, hidden.rows.readings
    values = readings.values.copy()
    values[event] *= 1.3
    changed = hidden.rows._replace(readings=readings._replace(values=values))
    one = _left_out(hidden, let_in.profile, event, 0)
    other = _left_out(replace(hidden, rows=changed), let_in.profile, event, 0)
    for a, b in zip(one, other, strict=True):
        assert_array_equal(a.predicted.mean, b.predicted.mean)
        assert abs(a.log_score - b.log_score) > 1.0


def test_before_is_what_sampling_and_refits_say(hidden: Base, let_in: ProfileLaw) -> None:
    """Populations by importance sampling against Metropolis, avalanche by avalanche."""
    calibration: Any = calibrate(hidden.problem, hidden.law, SamplerSettings("metropolis", 800, 1500, 4, 0))
    sampled = _before(calibration, 0, Effort(exact_loo=True))
    np.testing.assert_allclose(let_in.before.pointwise, sampled.pointwise, atol=0.5)
    assert let_in.before.elpd == pytest.approx(sampled.elpd, abs=1.0)
    # Sampling weights its draws for this, few of which count for an avalanche that is unlike the others.
    seen = hidden.problem.observed
    ratio = let_in.before.predicted.mean[seen] / sampled.predicted.mean[seen]
    assert abs(np.median(ratio) - 1.0) < 0.02 and np.all(np.abs(ratio - 1.0) < 0.12)
