"""The comparison: screening of every place, refinement where one leads, and what is computed again."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, ryggfonn_base, sparse_base, trial
from numpy.testing import assert_allclose
from scipy.stats import halfnorm, qmc

import skred.diagnosis.evidence.refit as refits
from skred.diagnosis.compare.candidate import FORM, Candidate
from skred.diagnosis.compare.comparison import with_errors, worth_comparing
from skred.diagnosis.compare.over_places import Area
from skred.diagnosis.compare.recomputed import recomputed
from skred.diagnosis.compare.refinement import Kind, Part, candidates_of, kinds_of, leading, refine
from skred.diagnosis.compare.screening import curve, screened
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at, curve_near
from skred.diagnosis.evidence.event_quadrature import FINE, FIRST, SCREENING, USUAL
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import COUNTS, DECIDES_NOTHING, STANDARD_ERROR
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Direction, Shape
from skred.physics.mechanisms.strength_prior import SCALES


@pytest.fixture(scope="module")
def base() -> Base:
    """A drag is left out, at a signal-to-noise of 7."""
    return base_of(trial(1013, "sparse", "turbulent_drag", "coulomb", 7.0).campaign, "coulomb")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["turbulent_drag", "viscous_drag", "sensor_bias"])
def test_second_look_against_many_nodes_on_a_dense_grid(base: Base, name: str) -> None:
    job = next(one for one in placed_mechanisms(base.setting) if one.mechanism.id == name)
    found = curve_near(base, curve(base, job), job.shape)
    reach = job.added.scale * np.linspace(0.0, 3.5, 24)
    grid = np.concatenate([-reach[:0:-1], reach]) if job.added.either_sign else reach
    exact = curve_at(base, job, grid, FINE)
    assert found.log_bayes_factor == pytest.approx(exact.log_bayes_factor, abs=0.4)
    mean, sd = exact.moments
    assert abs(found.moments[0] - mean) < 0.25 * sd


def test_screening_finds_what_is_missing(base: Base) -> None:
    for name in ("turbulent_drag", "viscous_drag"):
        jobs = [job for job in placed_mechanisms(base.setting) if job.mechanism.id == name]
        assert max(curve(base, job).log_bayes_factor for job in jobs) > 5.0


@pytest.mark.slow
def test_screening_promises_nothing_in_a_clean_campaign() -> None:
    """Along tangents friction on many a stretch would have five nats here, where fronts stop."""
    base = base_of(trial(990001, "sparse", "nothing", "pcm").campaign, "pcm")
    friction = [one for one in placed_mechanisms(base.setting) if one.mechanism.id == "segment_friction"]
    found = [curve(base, one) for one in friction]
    assert len(found) > 15
    assert max(one.log_evidence.max() for one in found) < 2.0
    assert all(one.log_evidence[one.strengths == 0.0][0] == 0.0 for one in found)


def test_a_curve_goes_on_where_its_posterior_would_be_cut(base: Base) -> None:
    """Begun at strengths far too small, it comes to what it is from all strengths."""
    job = next(one for one in placed_mechanisms(base.setting) if one.mechanism.id == "viscous_drag")
    whole = curve_at(base, job, job.scale * np.linspace(0.05, 4.5, 60), USUAL)
    start = curve_at(base, job, job.scale * np.array([0.01, 0.02, 0.03]), USUAL)
    assert len(start.open_ends) and not len(whole.open_ends)
    near = curve_near(base, start, job.shape)
    assert not len(near.open_ends)
    assert near.log_bayes_factor == pytest.approx(whole.log_bayes_factor, abs=0.2)
    assert near.moments == pytest.approx(whole.moments, rel=0.15)


def test_only_what_leads_is_computed_again(base: Base) -> None:
    job = next(one for one in placed_mechanisms(base.setting) if one.mechanism.id == "turbulent_drag")
    one = curve_near(base, curve(base, job), job.shape)
    drag = {"turbulent_drag": Candidate(job.mechanism, (one,), np.zeros(1))}
    with ThreadPoolExecutor(1) as pool:
        looked, behind = (
            recomputed(base, drag, [], pool, best)[0]["turbulent_drag"]
            for best in (0.0, one.log_bayes_factor + 7.0)
        )
    assert behind.correction == 0.0 and behind.error is None
    assert looked.error is not None and 0.0 < looked.error < 0.15
    assert 0.0 < abs(looked.correction) < 0.5


def test_screening_finds_what_ends_outliers() -> None:
    """At Ryggfonn without drag a third of the readings are outliers; no tangent leads to what ends that."""
    base = ryggfonn_base("coulomb")
    drag = mechanisms()["velocity_weakening"]
    assert drag.added is not None
    found = [curve(base, placed(drag, base.setting, shape)) for shape in drag.added.shapes(base.setting)]
    assert max(one.log_bayes_factor for one in found) > 30.0


def made(name: str, place: float, height: float) -> Curve:
    """A curve with a certain Bayes factor, nearly."""
    mechanism = mechanisms()[name]
    assert mechanism.added is not None
    strengths = mechanism.added.scale * np.array([0.0, 0.5, 1.0, 2.0, 3.5])
    shape = Shape(place, place + 50.0)
    return Curve(mechanism, shape, Direction(), strengths, height + 0.0 * strengths, ())


SETTING: Any = SimpleNamespace(recorded_m=(50.0, 450.0))
"""Where stretches end; nothing else is asked for."""


def places_of(*curves: Curve) -> list[Kind]:
    """Curves as they were screened."""
    return kinds_of(SETTING, curves)


def candidate_of(*curves: Curve) -> Candidate:
    """The only mechanism of curves."""
    (candidate,) = candidates_of(places_of(*curves)).values()
    return candidate


def test_what_holds_much_of_its_mechanisms_evidence_is_parted() -> None:
    heights = [9.0, 8.5, 3.0, 9.2, 1.0]
    (kind,) = places_of(*(made("segment_drag", 100.0 * k, height) for k, height in enumerate(heights)))
    assert leading([kind]) == [(0, 0), (0, 1), (0, 3)]
    # Once the first is parted and falls behind, what was small beside it holds much.
    fell = kind.parted({0: [made("segment_drag", 0.0, 2.0), made("segment_drag", 10.0, 2.0)]})
    assert [one.level for one in fell.parts] == [1, 1, 1, 0, 0, 0, 0]
    assert leading([fell]) == [(0, 3), (0, 5)]


def test_a_place_has_what_it_adds_to_the_mean_and_not_the_wide_part_around_it() -> None:
    """A peak among places close to each other, beside a lonely one that stands for most of the track."""
    near = [made("segment_drag", 100.0 + 10.0 * k, 10.0 - 0.5 * k**2) for k in range(-4, 5)]
    kinds = places_of(*near, made("segment_drag", 400.0, 8.0))
    (candidate,) = candidates_of(kinds).values()
    assert_allclose(candidate.log_factors, kinds[0].log_factors)
    by_weight = candidate.log_weights + np.array([one.log_bayes_factor for one in candidate.curves])
    assert np.logaddexp.reduce(by_weight) == pytest.approx(candidate.alone)
    assert by_weight.argmax() != candidate.log_factors.argmax() == 4


def test_only_mechanisms_that_may_come_up_to_the_best_are_parted() -> None:
    """Parts may have twice as much; what has less evidence than nothing has none to part."""
    strong = [made("viscous_drag", 0.0, 91.0), made("segment_drag", 0.0, 71.0), made("obstacle", 0.0, 30.0)]
    assert leading(places_of(*strong)) == [(0, 0), (1, 0)]
    assert leading(places_of(made("segment_drag", 0.0, -1.0))) == []
    assert leading(places_of(made("segment_drag", 0.0, 4.0), made("obstacle", 0.0, -1.0))) == [(0, 0)]
    # Nor what cannot come up to the best under another error model.
    assert leading(places_of(*strong), best=150.0) == [(0, 0)]
    # Smaller steps gain less: with 71 of 91 nats it is not parted any more.
    for level, expected in ((1, [(0, 0), (1, 0)]), (2, [(0, 0)])):
        parted = [replace(one, parts=(Part(one.parts[0].curve, level),)) for one in places_of(*strong)]
        assert leading(parted) == expected


def test_parting_ends(base: Base) -> None:
    """However much a single place holds; what has no parts is left as it is."""
    looked: list[str] = []

    def near(known: Curve, shape: Shape) -> Curve:
        looked.append(known.mechanism.id)
        return replace(made(known.mechanism.id, 0.0, 30.0), shape=shape)

    bias = replace(made("sensor_bias", 0.0, 28.0), shape=Shape(sensor=base.setting.sensors[0]))
    with ThreadPoolExecutor(1) as pool:
        found = refine(base.setting, [made("segment_drag", 500.0, 30.0), bias], near, pool)
    assert looked.count("sensor_bias") == 0 and len(found["sensor_bias"].curves) == 1
    assert looked.count("segment_drag") + 1 == len(found["segment_drag"].curves) > 2
    # All places looked at have the same evidence: so has the mean over all that lie between.
    for name, height in (("segment_drag", 30.0), ("sensor_bias", 28.0)):
        assert found[name].alone == pytest.approx(made(name, 0.0, height).log_bayes_factor, abs=0.05)


def test_mechanisms_that_an_error_model_far_behind_cannot_bring_back() -> None:
    """Twice what they have under the other one and `COUNTS` more, less what it is behind, are too few."""
    curves = [made("segment_drag", 0.0, 12.0), made("obstacle", 0.0, 4.0), made("sensor_bias", 0.0, -1.0)]
    curves.append(made("obstacle", 100.0, -3.0))
    best, low, none, worst = (one.log_bayes_factor for one in curves)
    assert worth_comparing(curves, 0.0) == [curves[0], curves[1], curves[3]]
    assert 2.0 * low + COUNTS > best and none + COUNTS < best
    assert worth_comparing(curves, 2.0 * low + COUNTS - best + 0.01) == [curves[0]]
    assert worth_comparing(curves, best + COUNTS + 0.01) == []
    # With nothing that leads they have to keep up with nothing.
    assert worth_comparing(curves[2:3], none + COUNTS - 0.01) == curves[2:3]
    assert worth_comparing(curves[2:3], none + COUNTS + 0.01) == []


def test_under_another_error_model_each_mechanism_is_looked_at_until_the_rest_is_far_behind(
    base: Base,
) -> None:
    """A place that was far behind is looked at once the leading one falls; one that stays behind is not."""
    friction = [one for one in placed_mechanisms(base.setting) if one.mechanism.id == "segment_friction"]
    bias = [one for one in placed_mechanisms(base.setting) if one.mechanism.id == "sensor_bias"]
    places = [*friction[:3], bias[0]]

    def before(*heights: float) -> list[Curve]:
        return [
            replace(made(one.mechanism.id, 0.0, height), shape=one.shape, direction=one.direction)
            for one, height in zip(places, heights, strict=True)
        ]

    with ThreadPoolExecutor(1) as pool:
        now = screened(base, pool, before=before(0.0, 0.0, 0.0, 0.0))
        heights = [one.log_bayes_factor for one in now]
        most = max(heights[:2])
        known = before(most + 90.0, most + 45.0, most - 12.0, -50.0)
        told: list[tuple[int, int]] = []
        found = screened(base, pool, lambda *of: told.append(of), known)
    assert [one.log_bayes_factor for one in found[:2]] == heights[:2]
    assert found[2] is known[2]
    assert found[3].log_bayes_factor == heights[3]  # the best of its own mechanism
    assert told == [(3, 4), (4, 4), (4, 4)]


def test_strengths_of_other_sensors_are_other_strengths() -> None:
    one, other = made("sensor_bias", 0.0, 1.0), made("sensor_bias", 100.0, 1.0)
    slope = 4.0 * np.arange(len(other.strengths))
    other = replace(other, log_evidence=0.9 + slope - slope.max(), shape=Shape(sensor="b"))
    candidate = candidate_of(replace(one, shape=Shape(sensor="a")), other)
    best = candidate.best.moments
    assert candidate.strength() == pytest.approx(best)


PEAK_M = (431.0, 587.0)
"""The best stretch in the next test."""


def peaked(shape: Shape, width_m: float) -> float:
    """40 nats on the best stretch, less with the squares of how far off the ends are."""
    assert shape.s_from_m is not None and shape.s_to_m is not None
    apart = np.array([shape.s_from_m, shape.s_to_m]) - PEAK_M
    return float(40.0 - 0.5 * np.sum((apart / width_m) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width_m", "most_looks", "off", "error"),
    [(10.0, 160, 12.0, 0.5), (30.0, 150, 20.0, 0.5), (1e3, 21, 200.0, 0.1)],
)
def test_a_place_is_parted_where_one_part_holds_most(
    base: Base, width_m: float, most_looks: int, off: float, error: float
) -> None:
    """The peak is found, and the mean over all stretches is that of very many of them."""
    setting = replace(base.setting, recorded_m=(100.0, 900.0))
    looked: list[Shape] = []

    def as_high(shape: Shape) -> Curve:
        return replace(made("segment_friction", 0.0, peaked(shape, width_m)), shape=shape)

    def near(known: Curve, shape: Shape) -> Curve:
        looked.append(shape)
        return as_high(shape)

    added = mechanisms()["segment_friction"].added
    assert added is not None
    shapes = added.shapes(setting)
    with ThreadPoolExecutor(1) as pool:
        found = refine(setting, [as_high(one) for one in shapes], near, pool)
    candidate = found["segment_friction"]
    assert len(looked) <= most_looks and len(set(looked)) == len(looked)
    assert max(abs(a - b) for a, b in zip(candidate.ends(0.5) or (), PEAK_M, strict=True)) < off
    area = Area.around(list(shapes), setting)
    heights = [peaked(area.shape(at), width_m) for at in qmc.Sobol(2, rng=0).random(1 << 14)]
    exact = np.logaddexp.reduce(heights) - np.log(len(heights)) + as_high_as_nothing()
    assert exact - error < candidate.log_bayes_factor < exact + 0.1
    assert candidate.shape_weights.max() < 1.5 * STANDARD_ERROR


def as_high_as_nothing() -> float:
    """Log Bayes factor of a curve that has no more evidence than nothing."""
    return made("segment_friction", 0.0, 0.0).log_bayes_factor


def test_a_strength_is_over_all_places() -> None:
    """A mixture: within shapes, and between their means; and for the form of the term."""
    flat, steep = made("segment_drag", 0.0, 1.0), made("segment_drag", 100.0, 1.0)
    slope = 4.0 * np.arange(len(steep.strengths))
    steep = replace(steep, log_evidence=1.0 + slope - slope.max())
    candidate = candidate_of(flat, steep)
    weights = candidate.shape_weights
    means = np.array([one.moments[0] for one in candidate.curves])
    mean, sd = candidate.strength()
    assert mean == pytest.approx(weights @ means) and abs(mean - candidate.best.moments[0]) > 1e-5
    within, between = candidate.best.moments[1] ** 2, weights @ (means - mean) ** 2
    assert sd**2 == pytest.approx(within + between + (FORM * mean) ** 2)
    alone = candidate_of(flat).strength()
    assert alone.mean == flat.moments[0]
    assert alone.sd == pytest.approx(np.hypot(flat.moments[1], FORM * flat.moments[0]))


def test_a_place_is_quantiles_over_the_places() -> None:
    """Of equally probable ones: medians in the middle, and the ends of an interval at the outer ones."""
    curves = [made("segment_drag", 100.0 * k, 1.0) for k in range(5)]
    candidate = candidate_of(*curves)
    first = [one.shape.s_from_m for one in candidate.curves]
    assert candidate.ends(0.5) == (curves[2].shape.s_from_m, curves[2].shape.s_to_m)
    (low, _), (high, _) = candidate.ends(0.05), candidate.ends(0.95)
    assert (low, high) == (min(first), max(first))


def test_other_error_models_start_from_any() -> None:
    """The evidence of an error model does not depend on the one that it was reached from."""
    base = sparse_base()
    student = with_errors(base, "student")
    there, again = with_errors(base, "robust"), with_errors(student, "robust")
    assert student.problem.error_model.id == "student"
    assert again.fit.found.log_evidence == pytest.approx(there.fit.found.log_evidence, abs=0.1)
    assert replace(again, fit=there.fit).problem.error_model.id == "robust"
    # Two routes: nodes around modes, and the law's likelihood surfaces.
    assert there.fit.found.log_evidence == pytest.approx(base.fit.found.log_evidence, abs=0.3)


def test_errors_in_common_are_integrated_as_closely_as_others() -> None:
    """Of a clean campaign with such errors, 42 readings a front: more nodes change nothing.

    Modes that are looked for as if they were independent are somewhere else: 40 nats and more were lost.
    """
    clean = trial(2300015, "dense", "nasty", "constant").campaign
    base = with_errors(base_of(clean, "constant"), "correlated")
    found = [base.with_nothing(budget).found.log_evidence for budget in (SCREENING, USUAL, FINE)]
    assert max(found) - min(found) < 1.0


@pytest.mark.slow
def test_screening_has_what_a_grid_over_the_prior_has() -> None:
    """Where climbs begin, and about where they lead, tells what strengths to 3.5 scales of the prior do.

    It is for looking closer within 6 nats: between few strengths a curve may be off by some tenths.
    """
    base, off = sparse_base(), list[float]()
    local = [
        one for one in placed_mechanisms(base.setting) if one.mechanism.id in ("segment_friction", "obstacle")
    ]
    for job in local[::9]:
        grid = job.scale * np.array([0.1, 0.2, 0.4, 0.6, 0.9, 1.2, 1.7, 2.2, 3.5])
        grid = np.append(-grid[::-1], grid) if job.added.either_sign else grid
        whole = curve_at(base, job, grid, SCREENING)
        found = curve(base, job)
        off.append(abs(found.log_bayes_factor - whole.log_bayes_factor))
    assert max(off) < 0.5 * DECIDES_NOTHING and np.median(off) < 0.1


def test_nothing_is_the_same_whatever_is_not_added() -> None:
    """At strength 0 of a mechanism, refitted with those of its other strengths or by itself."""
    base = sparse_base()
    for job in (placed_mechanisms(base.setting)[k] for k in (0, 20, -1)):
        extension = extended(base.problem, base.law, (*base.directions, job.direction))
        start = (base.population, base.fit.points)
        (zero,) = refit(extension, base.rows, np.zeros((1, 1)), start, Rounds(SCREENING, FIRST))
        found = base.with_nothing(SCREENING)
        assert found.found.log_evidence == pytest.approx(zero.found.log_evidence, abs=1e-6)
        assert base.with_nothing(SCREENING) is found
    # Another base, under another error model say, has its own.
    assert replace(base).with_nothing(SCREENING) is not base.with_nothing(SCREENING)


def test_refits_of_few_points_at_a_time_are_the_same(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups one by one, as of campaigns of a thousand avalanches."""
    job = next(one for one in placed_mechanisms(base.setting) if one.mechanism.id == "turbulent_drag")
    strengths = job.added.scale * np.array([0.3, 0.6, 1.2])
    whole = curve_at(base, job, strengths, USUAL)
    monkeypatch.setattr(refits, "MOST_NODES", 1)
    parts = curve_at(base, job, strengths, USUAL)
    assert parts.log_evidence == pytest.approx(whole.log_evidence, abs=1e-8)


def test_screening_sees_strengths_far_below_the_grid() -> None:
    """Many recordings tell a drag of a tenth of its prior's scale; the grid begins at a fifth."""
    base = base_of(trial(1031, "dense", "turbulent_drag", "constant", 9.5).campaign, "constant")
    job = next(one for one in placed_mechanisms(base.setting) if one.mechanism.id == "turbulent_drag")
    rough = curve(base, job)
    settled = curve_near(base, rough, job.shape)
    assert 0.0 < settled.moments[0] < 0.2 * job.added.scale
    assert settled.log_bayes_factor > 20.0
    assert rough.log_bayes_factor == pytest.approx(settled.log_bayes_factor, abs=5.0)


def test_moments_of_a_curve_on_uneven_strengths(base: Base) -> None:
    """A normal likelihood, narrow beside the grid, under half-normal priors."""
    drag = mechanisms()["turbulent_drag"]
    assert drag.added is not None
    scale, mean, sd = drag.added.scale, 0.1 * drag.added.scale, 0.01 * drag.added.scale
    near = mean + sd * np.linspace(-4.0, 4.0, 9)
    strengths = np.concatenate([[0.0], near, scale * np.array([0.2, 0.6, 1.2, 3.5])])
    strengths.sort()
    heights = 0.5 * ((mean / sd) ** 2 - ((strengths - mean) / sd) ** 2)
    direction = drag.added.direction(base.setting, Shape())
    one = Curve(drag, Shape(), direction, strengths, heights, (base.fit,) * len(strengths))
    assert one.moments[0] == pytest.approx(mean, rel=0.01) and one.moments[1] == pytest.approx(sd, rel=0.05)
    density = np.mean([halfnorm.pdf(0.1, scale=part) for part in SCALES])
    exact = 50.0 + np.log(np.sqrt(2.0 * np.pi) * sd / scale * density)
    assert one.log_bayes_factor == pytest.approx(exact, abs=0.1)
