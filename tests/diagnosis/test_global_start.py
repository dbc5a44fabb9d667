"""Global starts: a strong effect that the base law has absorbed is found, from wherever the climb begins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of
from rolling_cases import rolling

from skred.diagnosis.compare.screening import curve
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Population,
    deviations,
    look_around,
)
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.global_start import global_starts
from skred.diagnosis.evidence.linear_mixed_model import joint_step, mean_prior
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of, placed
from skred.physics.mechanisms.spec import Shape

DRAG = 2.4e-4


def with_term(base: Base, name: str, shape: Shape | None = None) -> Any:
    direction = direction_of(mechanisms()[name], base.setting, shape or Shape())
    return extended(base.problem, base.law, (direction,))


@pytest.fixture(scope="module")
def base() -> Base:
    return base_of(rolling(DRAG), "coulomb")


def test_a_drag_that_friction_has_absorbed_is_found(base: Base) -> None:
    """Friction has to fall to a third for it: no derivative at nil, no refit at a fixed drag gets there."""
    found = curve(base, placed(mechanisms()["turbulent_drag"], base.setting, Shape()))
    mean, sd = found.moments
    assert found.log_bayes_factor > 30.0
    assert abs(mean - DRAG) < 4.0 * sd and sd < 0.2 * DRAG


def test_all_starts_lead_to_one_maximum(base: Base) -> None:
    begin = base.population, base.fit.points
    found = global_starts(with_term(base, "turbulent_drag"), base.rows, np.empty(0), begin, 1.5e-3, False)
    assert len(found) == 1 and abs(found[0].strength - DRAG) < 4.0 * found[0].sd
    fitted = np.exp(found[0].fit.points[:, 0])
    assert np.median(fitted) < 0.7 * np.median(np.exp(base.fit.points[:, 0]))


def test_nothing_is_found_where_nothing_is() -> None:
    base = base_of(rolling(1e-8, friction=0.02, n_events=12), "coulomb")
    found = curve(base, placed(mechanisms()["turbulent_drag"], base.setting, Shape()))
    assert found.log_bayes_factor < 1.0


def test_a_joint_step_solves_the_linear_model(base: Base) -> None:
    """Means, coefficient and all points of one normal equation, solved at once."""
    strengths, prior = np.array([1e-4]), mean_prior(base.law)
    likelihood = EventLikelihood(with_term(base, "turbulent_drag"), base.rows, strengths)
    around = look_around(likelihood, base.fit.points)
    population = Population(base.population.mean, base.population.covariance)
    step = joint_step(around, base.rows, population, prior, strengths, 1.5e-3**-2.0)
    n_events, n, size = len(base.rows.event), base.population.mean.shape[1], base.fit.points.shape[1]
    of_points, away = population.precision[0], deviations(base.fit.points, base.rows, population)
    hessian = np.zeros((n + 1 + n_events * size,) * 2)
    gradient = np.zeros(len(hessian))
    weighted = around.weighed(around.by_strengths)
    for event in range(n_events):
        own = slice(n + 1 + event * size, n + 1 + (event + 1) * size)
        hessian[own, own] = around.information[event] + of_points
        hessian[:n, :n] += of_points[:n, :n]
        hessian[:n, own] = -of_points[:n]
        hessian[n, n] += float(around.by_strengths[event, :, 0] @ weighted[event, :, 0])
        hessian[n, own] = around.by_points[event].T @ weighted[event, :, 0]
        gradient[own] = around.by_points[event].T @ around.slope[event] - of_points @ away[event]
        gradient[:n] += (of_points @ away[event])[:n]
        gradient[n] += float(around.by_strengths[event, :, 0] @ around.slope[event])
    hessian = np.triu(hessian) + np.triu(hessian, 1).T
    hessian[:n, :n] += np.diag(prior.sd**-2.0)
    hessian[n, n] += 1.5e-3**-2.0
    gradient[:n] += (prior.mean - population.mean[0]) / prior.sd**2
    gradient[n] -= strengths[0] * 1.5e-3**-2.0
    whole = np.linalg.solve(hessian, gradient)
    assert step.mean[0] == pytest.approx(whole[:n], rel=1e-6)
    assert step.strength[0] == pytest.approx(whole[n], rel=1e-6)
    assert step.sd[0] == pytest.approx(np.sqrt(np.linalg.inv(hessian)[n, n]), rel=1e-6)
    moved = step.of_points(1.0, base.rows).ravel()
    small = np.abs(whole[n + 1 :]).reshape(n_events, size).max(axis=1) < 1.0
    assert moved.reshape(n_events, size)[small] == pytest.approx(
        whole[n + 1 :].reshape(n_events, size)[small], rel=1e-5, abs=1e-9
    )
    assert small.any()
