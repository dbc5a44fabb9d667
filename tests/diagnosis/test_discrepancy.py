"""The unlisted force and its place: basis, linear evidence, a planted force, missing work and bands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, few_dense_base, recorded
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal, norm

from skred.arrays import FloatArray
from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import ComparisonUnderErrors
from skred.diagnosis.compare.location import Location, locate
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.detect.score_test import log_factor_of_process
from skred.diagnosis.discrepancy.climb import climb, expanded_at
from skred.diagnosis.discrepancy.explored import (
    Expansion,
    ExploredPriors,
    laplace,
    prior_penalty,
)
from skred.diagnosis.discrepancy.fit import as_profile, fit_profile
from skred.diagnosis.discrepancy.profile import (
    KINDS,
    Kind,
    Prior,
    Profile,
    alike,
    combined,
    knots,
    log_evidence_of,
    priors_of,
    spline_basis,
)
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import event_nodes
from skred.diagnosis.evidence.expected_score import expected_score
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.refit import refit
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape


@pytest.fixture(scope="module")
def base() -> Base:
    return few_dense_base()


SHAPE_M, SHAPE = np.array([-100.0, -50.0, 50.0, 100.0]), np.array([0.0, 1.0, 1.0, 0.0])
"""What is planted, from its place on."""


def planted(base: Base, kind: int, centre: float, size: float) -> Base:
    """The same avalanches with a force on 200 m."""
    return recorded(base, combined(base.setting, KINDS[kind], centre + SHAPE_M, size * SHAPE))


def test_hats_sum_to_one_inside(base: Base) -> None:
    terrain, at = base.setting.terrain, knots(base.setting)
    middle = 0.5 * (terrain.edge_s_m[1:] + terrain.edge_s_m[:-1])
    basis = spline_basis(terrain, at)
    inside = (middle >= at[0]) & (middle <= at[-1])
    assert basis.shape == (len(at), terrain.n_cells) and inside.any() and not inside.all()
    assert_allclose(basis.sum(axis=0)[inside], 1.0)
    assert np.all(basis[:, ~inside] == 0.0) and np.all(basis >= 0.0)
    values = np.random.default_rng(0).standard_normal(len(at))
    assert_allclose((values @ basis)[inside], np.interp(middle[inside], at, values))
    direction = combined(base.setting, KINDS[0], at, values)
    assert direction.columns == (Column.CONSTANT,)
    assert_allclose(direction.profiles[0], values @ basis)


@pytest.mark.parametrize("n_groups", [1, 3])
def test_linear_evidence_of_a_profile(n_groups: int) -> None:
    """Score and information against the normal density of the readings, with the profile and without."""
    rng = np.random.default_rng(n_groups)
    n, n_data = 4, 9
    factor = rng.standard_normal((n, n))
    cover = 0.3 * factor @ factor.T + 0.05 * np.eye(n)
    scores, informations, expected = [], [], []
    for _ in range(n_groups):
        design, sd = rng.standard_normal((n_data, n)), rng.uniform(0.5, 2.0, n_data)
        data = design @ rng.multivariate_normal(np.zeros(n), cover) + sd * rng.standard_normal(n_data)
        scores.append(design.T @ (data / sd**2))
        informations.append(design.T @ (design / sd[:, None] ** 2))
        there = multivariate_normal(np.zeros(n_data), np.diag(sd**2) + design @ cover @ design.T)
        expected.append(there.logpdf(data) - norm.logpdf(data, scale=sd).sum())
    assert_allclose(
        log_factor_of_process(np.array(scores), np.array(informations), cover), expected, rtol=1e-9
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("kind", [0, 1, 2])
def test_a_planted_force_is_found(base: Base, kind: int, sign: float) -> None:
    """Where it is, which way it acts, and how much work it does; the clean campaign shows none."""
    centre = 800.0
    size = sign * {0: 1.6, 1: 2.5e-3, 2: 1e-2}[kind]
    changed = planted(base, kind, centre, size)
    found = fit_profile(changed, KINDS[kind])
    assert found.log_bayes_factor > 5.0 and found.gain > found.log_bayes_factor
    z = found.mean / np.sqrt(np.diag(found.covariance))
    top = int(np.argmax(np.abs(z)))
    assert abs(found.knots_m[top] - centre) < 120.0 and np.sign(found.mean[top]) == sign
    first, last = location_of(changed, found).stretch_m
    assert first < centre < last
    at = np.linspace(found.knots_m[0], found.knots_m[-1], 2001)
    near = np.abs(at - centre) < 200.0
    unit = [np.trapezoid(np.interp(at, found.knots_m, row) * near, at) for row in np.eye(len(found.knots_m))]
    sd = np.sqrt(unit @ found.covariance @ unit)
    # The typical speed is that of the law fitted to the changed readings: opposed to something else, then.
    within = 3.0 * sd if kind < 2 else 0.75 * abs(size) * 150.0
    assert found.mean @ unit == pytest.approx(size * 150.0, abs=within) and sd < 0.4 * abs(size) * 150.0
    # What was planted is no better explanation than what was found.
    as_planted = np.interp(found.knots_m, centre + SHAPE_M, size * SHAPE, 0.0, 0.0)
    there = expanded_at(changed, KINDS[kind], as_planted, found.fit.start)
    none = around_nothing(changed, KINDS[kind])
    assert found.gain > there.fit.found.log_evidence - none.fit.found.log_evidence - 1.0
    assert fit_profile(base, KINDS[kind]).log_bayes_factor < 2.0


def test_a_step_to_what_no_front_can_do_is_too_long(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorter ones are tried; a diagnosis of hours is not lost."""
    changed, kind = planted(base, 0, 800.0, 1.6), KINDS[0]
    cover = next(iter(priors_of(kind, knots(base.setting)))).cover(knots(base.setting))
    start, tried = around_nothing(changed, kind), list[int]()

    def first_fails(*given: Any, **more: Any) -> Any:
        tried.append(1)
        if len(tried) == 1:
            raise np.linalg.LinAlgError("a drag far below nil")
        return refit(*given, **more)

    monkeypatch.setattr("skred.diagnosis.discrepancy.climb.refit", first_fails)
    found = climb(changed, kind, start, cover)
    assert len(tried) > 1
    assert found.fit.found.log_evidence > start.fit.found.log_evidence + 5.0


def made_profile(base: Base, kind: int) -> Profile:
    at = knots(base.setting)
    rng = np.random.default_rng(7)
    factor = 0.3 * rng.standard_normal((len(at), len(at)))
    mean = np.sin(at / 90.0)
    cover = factor @ factor.T + 0.02 * np.eye(len(at))
    prior = Prior(KINDS[kind].amplitude, 80.0)
    return Profile(KINDS[kind], prior, at, mean, cover, 0.0, 0.0, base.fit, ())


def location_of(base: Base, profile: Profile) -> Location:
    """Where, by this profile alone."""
    return locate(ComparisonUnderErrors("robust", base, {}, [profile]))


def test_work_is_the_integral_of_the_force(base: Base) -> None:
    """Between neighbouring sensors, and from the last to the last knot; its standard deviation by draws."""
    profile, edge = made_profile(base, 0), base.setting.terrain.edge_s_m
    work = location_of(base, profile).work
    ends = sorted(float(s.s_from_m) for s in base.problem.campaign.sensors if not s.is_runout)
    if profile.knots_m[-1] > ends[-1] + 1.0:
        ends = [*ends, profile.knots_m[-1]]
    assert_allclose(work[:, 0], ends[:-1])
    assert_allclose(work[:, 1], ends[1:])
    draws = np.random.default_rng(0).multivariate_normal(profile.mean, profile.covariance, 4000)
    for first, last, mean, sd in work:
        at = np.linspace(first, last, 2001)
        exact = np.trapezoid(np.interp(at, profile.knots_m, profile.mean), at)
        assert mean == pytest.approx(exact, abs=1.2 * np.diff(edge).max())  # a cell at each end
        unit = np.trapezoid(
            [np.interp(at, profile.knots_m, row) for row in np.eye(len(profile.knots_m))], at, axis=1
        )
        assert sd == pytest.approx((draws @ unit).std(), rel=0.12, abs=0.6)
    whole = np.interp(edge, profile.knots_m, profile.mean, 0.0, 0.0)
    inside = (edge >= ends[0]) & (edge <= ends[-1])
    assert work[:, 2].sum() == pytest.approx(np.trapezoid(whole[inside], edge[inside]), abs=8.0)


def test_band_holds_the_whole_profile(base: Base) -> None:
    """Nine draws in ten, everywhere at once; wider than pointwise, narrower than Bonferroni's."""
    profile = made_profile(base, 0)
    basis = spline_basis(base.setting.terrain, profile.knots_m)
    basis = basis[:, basis.sum(axis=0) > 0.0]
    found = location_of(base, profile)
    mean, sd = profile.mean @ basis, np.sqrt(np.einsum("kc,kl,lc->c", basis, profile.covariance, basis))
    assert_allclose(found.mean, mean)
    factor = ((found.high - mean) / sd).mean()
    assert_allclose([mean - factor * sd, mean + factor * sd], [found.low, found.high])
    assert norm.ppf(0.95) < factor < norm.ppf(1.0 - 0.05 / basis.shape[1])
    draws = np.random.default_rng(9).multivariate_normal(profile.mean, profile.covariance, 4000) @ basis
    held = np.all(np.abs(draws - mean) <= factor * sd, axis=1).mean()
    assert held == pytest.approx(0.9, abs=0.03)


def test_the_most_probable_kind_is_shown_or_the_one_asked_for(base: Base) -> None:
    """An opposed kind has the smaller share; what is missing of a fast front is then meant."""
    plain = replace(made_profile(base, 0), log_bayes_factor=10.0)
    opposed = replace(made_profile(base, 2), log_bayes_factor=10.1)
    under_errors = ComparisonUnderErrors("robust", base, {}, [plain, opposed])
    assert locate(under_errors).log_bayes_factor == 10.0 and not locate(under_errors).opposed
    found = locate(under_errors, opposed=True)
    assert found.log_bayes_factor == 10.1 and found.opposed
    speeds = extended(base.problem, base.law).speeds(base.fit.points, base.strengths)
    edge = base.setting.terrain.edge_s_m
    squares = 0.5 * (speeds[:, 1:] ** 2 + speeds[:, :-1] ** 2)
    middle = int(np.abs(0.5 * (edge[1:] + edge[:-1]) - found.s_m[len(found.s_m) // 2]).argmin())
    here = squares[squares[:, middle] > 0.0, middle]
    expected = np.interp(found.s_m[len(found.s_m) // 2], opposed.knots_m, opposed.mean) * here.std()
    assert found.mean[len(found.s_m) // 2] == pytest.approx(expected, rel=1e-6)
    assert here.mean() == pytest.approx(base.setting.front_square[middle], rel=0.1)


def test_resolution(base: Base) -> None:
    """What is told of nothing is smeared over everything; of everything, over the knots' distance."""
    profile = made_profile(base, 0)
    at = profile.knots_m
    prior = profile.prior.cover(at)
    length = at[-1] - at[0]
    nothing, everything = (replace(profile, covariance=share * prior) for share in (1.0, 1e-9))
    assert location_of(base, nothing).resolution_m == pytest.approx(length)
    assert location_of(base, everything).resolution_m == pytest.approx(length / len(at))


def test_evidence_of_all_kinds_is_their_mean(base: Base) -> None:
    profile = made_profile(base, 0)
    some = [replace(profile, log_bayes_factor=value) for value in (2.0, -1.0, 0.5, 900.0)]
    assert log_evidence_of(some) == pytest.approx(900.0 - np.log(4.0))
    assert log_evidence_of(some[:3]) == pytest.approx(np.log(np.exp([2.0, -1.0, 0.5]).mean()))
    assert sum(kind.share for kind in KINDS) == pytest.approx(1.0)
    one_of_each = [replace(profile, kind=kind) for kind, profile in zip(KINDS[1:], some, strict=False)]
    shares = np.array([kind.share for kind in KINDS[1:]])
    assert log_evidence_of(one_of_each) == pytest.approx(np.log(shares @ np.exp([2.0, -1.0]) / shares.sum()))


@pytest.mark.parametrize("errors", ["robust", "scaled"])
@pytest.mark.parametrize("id_", ["segment_drag", "segment_friction"])
def test_a_smooth_profile_does_what_a_force_on_a_stretch_does(errors: str, id_: str) -> None:
    """With some loss at its edges, from no force and from the listed one.

    At Ryggfonn without drag most readings are outliers, and fronts may have stopped or gone on: no mode of an
    event says where to go from no force.
    """
    base = base_of(read_campaign(find_campaign("ryggfonn")), "coulomb", errors)
    listed = curve(base, placed(mechanisms()[id_], base.setting, Shape(1600.0, 1700.0)))
    kind = next(kind for kind in KINDS if alike(kind, listed))
    assert listed.log_bayes_factor > 50.0
    for near in (None, as_profile(base, kind, listed)):
        assert fit_profile(base, kind, near).log_bayes_factor > 0.8 * listed.log_bayes_factor


def around_nothing(base: Base, kind: Kind) -> Expansion:
    """The log likelihood of a profile around no force."""
    at = knots(base.setting)
    return expanded_at(base, kind, np.zeros(len(at)), (base.population, base.fit.points))


def score_of_nothing(base: Base, kind: Kind) -> FloatArray:
    """Score of the evidence by the values at the knots, where there is no such force."""
    nothing = EventLikelihood(base.extended(), base.rows, base.strengths)
    by_knots = by_knots_of(base, kind, np.zeros(len(knots(base.setting))))
    return expected_score(nothing, by_knots, base.population, base.fit.points)[len(base.strengths) :]


def by_knots_of(base: Base, kind: Kind, values: FloatArray) -> EventLikelihood:
    """Likelihoods with the value at each knot as a strength, beside what the base has."""
    strengths = np.append(base.strengths, values)
    return EventLikelihood(base.extended(*kind.each(base.setting)), base.rows, strengths)


def test_the_score_of_no_force_is_that_of_the_evidence() -> None:
    """At Ryggfonn without drag: against what a small force everywhere gains.

    Where an event has several modes, as where its front may have stopped or gone on, a force moves the weight
    from one to another, and each mode's own score says nothing of that: it is below nil here.
    """
    base, kind = base_of(read_campaign(find_campaign("ryggfonn")), "coulomb", "robust"), KINDS[0]
    none, step, at = around_nothing(base, kind), 0.02 * KINDS[0].amplitude, knots(base.setting)
    heights = [
        expanded_at(base, kind, np.full(len(at), sign * step), none.fit.start).fit.found.log_evidence
        for sign in (-1.0, 1.0)
    ]
    score = score_of_nothing(replace(base, fit=none.fit), kind)
    assert score.sum() == pytest.approx((heights[1] - heights[0]) / (2.0 * step), rel=0.3)


@pytest.mark.parametrize("kind", KINDS)
def test_the_score_is_the_derivative_of_the_quadrature(
    base: Base, kind: Kind, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Knot by knot, beside a mechanism that is held; in parts as at once.

    What is left out far behind the best point of an event is a hundredth or so.
    """
    drag = placed(mechanisms()["segment_drag"], base.setting, Shape(700.0, 900.0)).direction
    held = replace(base, directions=(drag,), strengths=np.array([5e-4]))
    score = score_of_nothing(held, kind)
    likelihood = EventLikelihood(held.extended(), held.rows, held.strengths)
    modes = event_modes(likelihood, held.fit.points, held.population, n_steps=6)
    spread = event_nodes(likelihood, held.population, modes)
    shares, n = spread.log_shares(held.population, held.rows), len(knots(held.setting))
    assert_allclose(np.logaddexp.reduce(shares, axis=1), 0.0, atol=1e-9)

    def log_likelihoods(values: FloatArray) -> FloatArray:
        rows = np.repeat(np.arange(len(shares)), shares.shape[1])
        points = spread.points.reshape(len(rows), -1)
        return by_knots_of(held, kind, values).take(rows).at(points).reshape(shares.shape)

    steps, nothing = 1e-3 * kind.amplitude * np.eye(n), log_likelihoods(np.zeros(n))
    ahead, behind = (
        [np.logaddexp.reduce(shares + log_likelihoods(sign * one) - nothing, axis=1).sum() for one in steps]
        for sign in (1.0, -1.0)
    )
    expected = (np.array(ahead) - behind) / (2e-3 * kind.amplitude)
    assert_allclose(score, expected, atol=0.03 * np.abs(expected).max())
    monkeypatch.setattr("skred.diagnosis.evidence.expected_score.MOST_NODES", 1)
    assert_allclose(score_of_nothing(held, kind), score, rtol=1e-9, atol=1e-9 * np.abs(score).max())


def test_a_climb_begins_anywhere_and_goes_on_by_the_score_of_the_evidence() -> None:
    """Under a prior that is local, at the maximum under one that acts everywhere: far outside its window."""
    base, kind = base_of(read_campaign(find_campaign("ryggfonn")), "coulomb", "robust"), KINDS[0]
    at, none = knots(base.setting), around_nothing(base, kind)
    everywhere, local = (Prior(3.0 * kind.amplitude, *rest).cover(at) for rest in ((40.0,), (40.0, at[5])))

    def height(one: Expansion, cover: FloatArray) -> float:
        return one.fit.found.log_evidence - prior_penalty(one.values, np.linalg.inv(cover))

    first = climb(base, kind, none, everywhere)
    further = climb(base, kind, first, everywhere, by_modes=False)
    assert height(further, everywhere) > height(first, everywhere) + 10.0
    there = climb(base, kind, further, local)
    outside = np.abs(at - at[5]) > 480.0
    assert np.all(np.abs(further.values[outside]).max() > 100.0 * np.abs(there.values[outside]))


def test_evidence_under_a_prior_from_the_peak_under_another(base: Base) -> None:
    """The likelihood's slope and curvature say what climbing under the other prior finds."""
    changed, kind = planted(base, 0, 800.0, 1.0), KINDS[0]
    at = knots(changed.setting)
    flat = around_nothing(changed, kind)
    height = flat.fit.found.log_evidence
    usual, other = Prior(0.8, 120.0), Prior(1.6, 120.0, 800.0)
    peak, own = (climb(changed, kind, flat, one.cover(at)) for one in (usual, other))
    found, exact = (laplace(one, height, other.cover(at)).log_factor() for one in (peak, own))
    assert exact > 20.0
    assert found == pytest.approx(exact, abs=0.5)
    precision = np.linalg.inv(other.cover(at))
    assert_allclose(own.score, precision @ own.values, atol=0.05 * np.abs(own.score).max())


def test_priors_are_probabilities_everywhere_or_local() -> None:
    at = np.linspace(300.0, 1500.0, 30)
    priors = priors_of(KINDS[1], at)
    assert sum(np.exp(share) for share in priors.values()) == pytest.approx(1.0)
    local = {one: share for one, share in priors.items() if one.centre_m is not None}
    assert sum(np.exp(share) for share in local.values()) == pytest.approx(0.5)
    assert {one.centre_m for one in local} == {360.0 + 120.0 * k for k in range(10)}
    for one in priors:
        sd = np.sqrt(np.diag(one.cover(at)))
        assert sd.max() == pytest.approx(one.amplitude, rel=0.02)
        if one.centre_m is not None:
            assert np.all(sd[np.abs(at - one.centre_m) > 480.0] < 2e-3 * one.amplitude)
    middle = [np.median([one.amplitude for one in priors]), np.median([one.length_m for one in priors])]
    assert middle[0] == pytest.approx(KINDS[1].amplitude) and 40.0 <= middle[1] <= 120.0


def test_push_and_pull_beside_each_other_are_of_no_listed_shape(base: Base) -> None:
    """A short force that changes its sign is worth more as a local profile than as friction on a stretch."""
    problem_at = [knots(base.setting)[0], knots(base.setting)[-1]]
    centre = 0.5 * sum(problem_at)
    at = centre + np.array([-130.0, -120.0, -10.0, 10.0, 120.0, 130.0])
    values = 1.2 * np.array([0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    changed = recorded(base, combined(base.setting, KINDS[0], at, values))
    profile = fit_profile(changed, KINDS[0])
    assert profile.prior.length_m < 200.0
    friction = mechanisms()["segment_friction"]
    places = [(centre - 120.0, centre), (centre, centre + 120.0)]
    listed = [curve(changed, placed(friction, changed.setting, Shape(*place))) for place in places]
    best = max(one.log_bayes_factor for one in listed)
    assert profile.log_bayes_factor > best + 2.0


@pytest.mark.parametrize(
    ("kind", "size"), [(0, 1.0), pytest.param(1, 2.0e-3, marks=pytest.mark.slow), (0, 0.0)]
)
def test_evidence_over_priors_against_climbing_under_each(base: Base, kind: int, size: float) -> None:
    """The few priors that are climbed under stand for all."""
    changed = planted(base, kind, 800.0, size) if size else base
    own, at = KINDS[kind], knots(changed.setting)
    flat = around_nothing(changed, own)
    height = flat.fit.found.log_evidence
    factors = [
        laplace(climb(changed, own, flat, cover), height, cover).log_factor() + share
        for prior, share in priors_of(own, at).items()
        for cover in [prior.cover(at)]
    ]
    found = fit_profile(changed, own).log_bayes_factor
    assert (found > 5.0) == bool(size)
    assert found == pytest.approx(float(np.logaddexp.reduce(factors)), abs=1.0)


def test_what_is_only_promised_counts_no_more_than_what_was_computed(base: Base) -> None:
    """A slope at a kink promises hundreds of nats elsewhere: enough to climb there, not to claim them."""
    own, at = KINDS[0], knots(base.setting)
    flat, priors = around_nothing(base, own), priors_of(own, at)
    covers = {prior: prior.cover(at) for prior in priors}
    seen = ExploredPriors(flat.fit.found.log_evidence, priors, covers)
    climbed = next(one for one in priors if one.centre_m is not None)
    # Settled under its own prior, which holds its rough values down: to others that is a steep slope.
    values = 0.05 * own.amplitude * np.sin(2.0 * np.arange(len(at)))
    score = np.linalg.solve(climbed.cover(at), values)
    seen.add(climbed, replace(flat, values=values, score=score))
    assert seen.open and seen.factor(seen.open[0]) > 50.0
    assert seen.factor(climbed) < 0.0 and seen.log_factor < 0.0
