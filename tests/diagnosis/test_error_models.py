"""Two error models in the comparison: one that cannot count with the effect in stays as it was screened."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import ryggfonn_base

import skred.diagnosis.compare.comparison as comparing
from skred.diagnosis.compare.comparison import ERROR_SHARES, Comparison, ComparisonUnderErrors, compare
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED


def under_errors(name: str, height: float, forces: list[float]) -> ComparisonUnderErrors:
    candidate = SimpleNamespace(log_bayes_factor=height, in_common=height, error=None)
    profiles = [
        SimpleNamespace(log_bayes_factor=one, kind=kind, error=0.1)
        for one, kind in zip(forces, KINDS, strict=False)
    ]
    return ComparisonUnderErrors(name, SimpleNamespace(), {"obstacle": candidate}, profiles, [])


def test_a_force_that_was_fitted_under_one_error_model_alone() -> None:
    """It has nothing under the other; a mechanism and nothing have what they have under both."""
    both = under_errors("student", 2.0, []), under_errors("robust", 40.0, [30.0] * len(KINDS))
    odds = {NOTHING: 0.5, UNLISTED: 0.1, "obstacle": 0.4}
    found = Comparison(both, odds, {"student": -100.0, "robust": -120.0})
    heights = {name: math.log(ERROR_SHARES[name]) for name in ("student", "robust")}
    student, robust = heights["student"] - 100.0, heights["robust"] - 120.0
    nothing = np.logaddexp(student, robust)
    obstacle = np.logaddexp(student + 2.0, robust + 40.0)
    assert found.log_factors["obstacle"] == pytest.approx(obstacle - nothing)
    assert found.log_factors[UNLISTED] == pytest.approx(robust + 30.0 - nothing)
    assert found.leading(UNLISTED).error_model == found.leading("obstacle").error_model == "robust"
    assert UNLISTED not in both[0].errors and both[1].errors[UNLISTED] == 0.1
    assert sum(found.probability.values()) == pytest.approx(1.0)


@pytest.mark.slow
def test_what_an_error_model_far_behind_would_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """At Ryggfonn under Coulomb's law wide errors stand for the drag that is not in, and lose by it then."""
    base = ryggfonn_base("coulomb")
    found = compare(base)
    assert [bool(one.profiles) for one in found.under_each] == [True, False]
    left, chosen = found.under_each[1], found.under_each[0]
    assert chosen.error_model != left.error_model == "robust"
    monkeypatch.setattr(comparing, "COUNTS", 200.0)  # nothing is far behind
    whole = compare(base)
    assert all(one.profiles for one in whole.under_each)
    for name, share in whole.probability.items():
        assert found.probability[name] == pytest.approx(share, abs=0.03), name
    best = max(whole.log_factors, key=lambda name: whole.log_factors[name])
    assert found.log_factors[best] == pytest.approx(whole.log_factors[best], abs=0.5)
