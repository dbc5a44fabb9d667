"""Two error models in the comparison: one that cannot count with the effect in stays as it was screened."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, ryggfonn_base
from rolling_cases import rolling

import skred.diagnosis.compare.comparison as comparing
from skred.diagnosis.compare.comparison import ERROR_SHARES, Comparison, ComparisonUnderErrors, compare
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.inference.error_model import ERROR_MODELS
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape


def under_errors(name: str, height: float, forces: list[float]) -> ComparisonUnderErrors:
    candidate = SimpleNamespace(log_bayes_factor=height, error=None)
    profiles = [
        SimpleNamespace(log_bayes_factor=one, kind=kind, error=0.1)
        for one, kind in zip(forces, KINDS, strict=False)
    ]
    return ComparisonUnderErrors(name, SimpleNamespace(), {"obstacle": candidate}, profiles)


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


@pytest.mark.parametrize(("ahead", "taken"), [(0.5, ["robust"]), (1.5, ["student", "robust"])])
def test_one_that_is_hardly_better_than_the_robust_one_decides_nothing(
    ahead: float, taken: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robust one takes part in any case."""
    base, looked = base_of(rolling(2.4e-4, n_events=6), "coulomb"), list[str]()
    ahead += math.log(ERROR_SHARES["robust"] / ERROR_SHARES["student"])
    heights = {"robust": 0.0, "student": ahead, "correlated": -50.0, "scaled": -50.0}

    def under(base: Base, name: str) -> Base:
        found = base.fit.found._replace(log_evidence=heights[name])
        problem = replace(base.problem, error_model=ERROR_MODELS[name])
        return replace(base, problem=problem, fit=base.fit._replace(found=found))

    def screening(base: Base, *given: Any) -> list[Curve]:
        looked.append(base.problem.error_model.id)
        return [found]

    found = curve(base, placed(mechanisms()["turbulent_drag"], base.setting, Shape()))
    monkeypatch.setattr(comparing, "with_errors", under)
    monkeypatch.setattr(comparing, "screened", screening)
    assert [one.error_model for one in compare(base).under_each] == looked == taken


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
