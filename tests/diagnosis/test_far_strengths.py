"""Strengths far from what the base law's fit is near: refits, curves and tables get there."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import base_of, ryggfonn_base

from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.compare.screening import curve, whole_curve
from skred.diagnosis.evidence.coefficient import curve_at, curve_near
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.inference.hierarchical.population import population_samples
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed, shapes_of
from skred.physics.mechanisms.spec import Shape
from skred.simulator.draw import draw_trial


@pytest.mark.slow
def test_refits_far_from_the_base_law_end_where_small_steps_do() -> None:
    """A narrow population lets no event go: 22 000 nats were lost at strengths that readings ask for."""
    base = base_of(draw_trial(1374178000, kind="sparse", hidden="listed").campaign, "constant")
    candidate = placed(mechanisms()["coulomb_friction"], base.setting, Shape())
    steps = np.linspace(0.01, 0.33, 17)
    at_once = curve_at(base, candidate, steps).log_evidence[1:]
    extension, fit, one_by_one = base.extended(candidate.direction), base.fit, list[float]()
    for strength in steps:
        given = base.given(np.array([[strength]]))
        (fit,) = refit(extension, base.rows, given, base.fit.start, Rounds(), [fit])
        one_by_one.append(fit.found.log_evidence)
    nothing = base.with_nothing(USUAL).found.log_evidence
    np.testing.assert_allclose(at_once, np.array(one_by_one) - nothing, atol=0.4)
    assert at_once[-1] > 8.0


def test_a_curve_goes_on_to_a_maximum_far_away() -> None:
    """Steps of its own standard deviation, which is small on a slope, ended nats below the maximum."""
    base = ryggfonn_base("coulomb")
    shape = Shape(s_from_m=1599.0, s_to_m=1674.0)
    found = curve_near(base, curve(base, placed(mechanisms()["segment_drag"], base.setting, shape)), shape)
    assert not len(found.open_ends) and 0 < np.argmax(found.log_evidence) < len(found.strengths) - 1


@pytest.mark.parametrize("law", ["coulomb", "constant"])
def test_screening_goes_on_where_evidence_rises_to_the_last_strength(law: str) -> None:
    """A climb that ends on the way up left a place tens of nats too low, and it was not looked at again."""
    base, shape = ryggfonn_base(law), Shape(s_from_m=1599.0, s_to_m=1674.0)
    screened = curve(base, placed(mechanisms()["segment_drag"], base.setting, shape))
    closer = curve_near(base, screened, shape)
    assert not len(screened.open_ends) and closer.log_bayes_factor > 80.0
    assert screened.log_bayes_factor == pytest.approx(closer.log_bayes_factor, abs=COUNTS)


@pytest.mark.parametrize(
    ("law", "mechanism_id", "stretch", "least"),
    [
        # Its maximum below nil is the lower one, and above nil evidence still rose at the last strength.
        ("voellmy", "segment_friction", (1599.0, 1674.0), 34.0),
        # Flat at first; it rises from four scales on.
        ("pcm", "entrainment", (1599.0, 1674.0), 8.0),
        # The maximum lies between two of the strengths that are looked at first.
        ("pcm", "segment_drag", (1278.75, 1778.75), 12.0),
    ],
)
def test_no_place_is_lost(law: str, mechanism_id: str, stretch: tuple[float, float], least: float) -> None:
    """Fifteen nats were, at Ryggfonn."""
    base, (first, last) = ryggfonn_base(law), stretch
    shape = next(
        one
        for one in shapes_of(mechanisms()[mechanism_id], base.setting)
        if one.s_from_m == pytest.approx(first, abs=0.5) and one.s_to_m == pytest.approx(last, abs=0.5)
    )
    assert whole_curve(base, placed(mechanisms()[mechanism_id], base.setting, shape)).log_bayes_factor > least


@pytest.mark.slow
def test_tables_follow_the_population() -> None:
    """The population is spreads away from that of the next table; at one for all, events are nats off."""
    base = base_of(draw_trial(1374178000, kind="sparse", hidden="listed").campaign, "constant")
    candidate = placed(mechanisms()["coulomb_friction"], base.setting, Shape())
    problem = augmented_problem(base, [curve_near(base, curve(base, candidate), Shape())])
    located, law = problem.tables.located, base.law
    psi = np.array([fit.found.psi for fit in located.fits])
    moved = np.abs(np.diff(psi[:, 0])) / np.exp(psi[1:, 1])
    for k in range(1, 7):
        between, strength = psi[k : k + 2].mean(axis=0), located.grid.points[k : k + 2].mean(axis=0)
        draw = law.parameter_rows(np.exp(between[None, :1])) | population_samples(law, between[None, 1:])
        errors = problem.integration_errors(law, {**draw, "dry_friction": strength})
        assert moved[k] > 2.0 and np.abs(errors).max() < 0.045
