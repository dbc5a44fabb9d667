"""Strengths that differ between avalanches: against dense grids, another law's evidence, a made campaign."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import cloudpickle
import numpy as np
import pytest
from diagnosis_cases import base_of, made_way
from numpy.testing import assert_allclose
from scipy.special import logsumexp
from scipy.stats import beta, halfnorm, lognorm, norm

from skred.campaign import Campaign, Status, find_campaign, read_campaign
from skred.diagnosis.augment.added_strength import added_strengths, components_of, new_rows
from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.augment.coefficient import multiples_of_events
from skred.diagnosis.compare.between import finer, may_differ, searched, with_ways
from skred.diagnosis.compare.candidate import BESIDE, Candidate, all_but_place, with_or_without
from skred.diagnosis.compare.comparison import with_errors
from skred.diagnosis.compare.recomputed import computed_again
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.compare.ways import Looked, gains_of, gains_over, over_ways
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_near
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.extension import extended, setting_of
from skred.diagnosis.evidence.marginal import Evidence
from skred.diagnosis.evidence.population_target import log_prior
from skred.diagnosis.tabulated.between_evidence import (
    BetweenTarget,
    Way,
    between_evidence,
    searched_evidence,
)
from skred.diagnosis.tabulated.coefficient_grid import from_nothing
from skred.diagnosis.tabulated.tables import build_tables
from skred.inference.between_events import (
    PRIOR,
    SPREAD_LOG_SD,
    SPREAD_MEDIAN,
    BetweenEvents,
    components,
    from_unbounded,
    own_multiples,
    variable,
)
from skred.inference.calibrate import calibrate_surely
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD as TAU_LOG_SD
from skred.inference.hierarchical.rough_population import SPREAD_MEDIAN as TAU_MEDIAN
from skred.inference.reading_density import log_likelihoods
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of, placed, shapes_of
from skred.physics.mechanisms.strength_prior import log_prior_density

COMMON, SPREAD, SOME = BetweenEvents
RYGGFONN = read_campaign(find_campaign("ryggfonn"))
STRETCH = 1400.0, 1700.0


def stretch_curve(
    base: Base, mechanism_id: str = "segment_friction", stretch: tuple[float, float] = STRETCH
) -> Curve:
    mechanism = mechanisms()[mechanism_id]
    assert mechanism.added is not None
    first = next(one for one in mechanism.added.shapes(base.setting) if one.s_from_m is not None)
    shape = replace(first, s_from_m=stretch[0], s_to_m=stretch[1])
    return curve_near(base, curve(base, placed(mechanism, base.setting, shape)), shape)


def made_campaign(law_id: str, mean: list[float], sd: list[float], own: np.ndarray, seed: int) -> Campaign:
    """Avalanches of Ryggfonn's releases and sensors, each with its own friction on a stretch."""
    n = len(own)
    blank = replace(
        RYGGFONN,
        events=RYGGFONN.events[:n],
        values=RYGGFONN.values[:n],
        status=np.full_like(RYGGFONN.status[:n], Status.OBSERVED),
        stated_sd=RYGGFONN.stated_sd[:n],
    )
    problem, law = hierarchical_problem(blank), load_law(law_id)
    setting, mechanism = setting_of(problem, law), mechanisms()["segment_friction"]
    assert mechanism.added is not None
    first = next(one for one in mechanism.added.shapes(setting) if one.s_from_m is not None)
    shape = replace(first, s_from_m=STRETCH[0], s_to_m=STRETCH[1])
    extension = extended(problem, law, (direction_of(mechanism, setting, shape),))
    rng = np.random.default_rng(seed)
    logs = np.log(mean) + np.array(sd) * rng.standard_normal((n, len(mean)))
    fronts = extension.predict(np.arange(n), np.column_stack([logs, np.zeros(n)]), own[:, None])[:, :-1]
    noise = problem.readings.sd(np.arange(n), fronts) * rng.standard_normal(fronts.shape)
    is_runout = np.array([sensor.is_runout for sensor in blank.sensors])
    stopped = ~is_runout & (fronts <= 3.0)
    status = np.where(stopped, Status.NOT_REACHED, Status.OBSERVED)
    values = np.where(stopped, np.nan, np.maximum(fronts + noise, 0.5))
    stated = np.where(stopped, np.nan, problem.readings.sd(np.arange(n), fronts))
    return replace(blank, values=values, status=status, stated_sd=stated)


@pytest.fixture(scope="module")
def few() -> tuple[Base, Curve]:
    """Six avalanches of one coefficient each: three have an effect."""
    own = np.array([3.0, 0.0, 3.0, 0.0, 3.0, 0.0])
    base = base_of(made_campaign("coulomb", [0.36], [0.06], own, seed=4), "coulomb")
    return base, stretch_curve(base)


def dense_log_evidence(base: Base, found: Curve, way: BetweenEvents) -> float:
    """Sums over dense grids of everything: each event's friction and strength, populations, the effect."""
    extension = extended(base.problem, base.law, (found.direction,))
    logs = np.linspace(np.log(0.15), np.log(0.8), 400)
    strengths = np.linspace(0.0, 5.4, 73)
    n_events, n = len(base.rows.event), len(logs)
    events = np.repeat(np.arange(n_events), n)
    points = np.column_stack([np.tile(logs, n_events), np.zeros(n_events * n)])
    rows, readings = base.rows, base.rows.readings
    likelihood = np.array([
        log_likelihoods(events, extension.predict(events, points, np.array([x])), readings, rows.errors)
        for x in strengths
    ]).reshape(len(strengths), n_events, n)  # fmt: skip
    means, spreads = np.linspace(np.log(0.25), np.log(0.5), 31), np.geomspace(0.02, 0.6, 17)
    # (mean, spread, strength, event): the event's own friction summed over.
    step = logs[1] - logs[0]
    table = np.empty((len(means), len(spreads), len(strengths), n_events))
    for i, mean in enumerate(means):
        for j, spread in enumerate(spreads):
            own = norm.logpdf(logs, mean, spread) + np.log(step)
            table[i, j] = logsumexp(likelihood + own, axis=2)
    scale, width = np.exp(base.log_scale[0]), np.diff(means)[0]
    prior = halfnorm.logpdf(np.exp(means), scale=scale) + means + np.log(width)
    of_spread = lognorm.logpdf(spreads, TAU_LOG_SD, scale=TAU_MEDIAN) + np.log(np.gradient(spreads))
    population = prior[:, None] + of_spread
    density = log_prior_density(strengths, found.scale, either_sign=found.added.either_sign)
    width = np.full(len(strengths), strengths[1])
    width[[0, -1]] *= 0.5
    of_strength = density + np.log(width)
    if way is COMMON:
        each = table.sum(axis=3)
        return float(logsumexp(each + population[:, :, None] + of_strength))
    totals = []
    parameters = np.linspace(0.01, 0.99, 25) if way is SOME else np.geomspace(0.05, 2.0, 16)
    prior_of = beta(1, 1) if way is SOME else lognorm(SPREAD_LOG_SD, scale=SPREAD_MEDIAN)
    for parameter, d in zip(parameters, np.gradient(parameters), strict=True):
        if way is SOME:
            mixed = np.logaddexp(np.log(parameter) + table, np.log1p(-parameter) + table[:, :, :1])
        else:
            mixed = np.full_like(table, -np.inf)
            for k, median in enumerate(strengths[1:], start=1):
                shares = norm.logpdf(np.log(strengths[1:] / median), 0.0, parameter) - np.log(strengths[1:])
                shares -= logsumexp(shares)  # a grid is coarse where nearly all have the same
                mixed[:, :, k] = logsumexp(table[:, :, 1:] + shares[:, None], axis=2)
        total = logsumexp(mixed.sum(axis=3) + population[:, :, None] + of_strength)
        totals.append(total + prior_of.logpdf(parameter) + np.log(d))
    return float(logsumexp(totals))


@pytest.mark.slow
def test_gains_are_those_of_dense_grids(few: tuple[Base, Curve]) -> None:
    base, found = few
    ways, (fine, _) = finer(base, found, searched(base, found)), computed_again(base, found)
    gains = gains_of(ways, fine.log_factor_of(found.sign))
    dense = {way: dense_log_evidence(base, found, way) for way in BetweenEvents}
    exact = {way: value - dense[COMMON] for way, value in dense.items()}
    assert abs(gains[SPREAD] - exact[SPREAD]) < 0.35 and abs(gains[SOME] - exact[SOME]) < 0.35, exact


@pytest.mark.slow
def test_a_base_law_with_the_term_has_the_same_evidence() -> None:
    """PCM is Coulomb with a drag that is log-normal between avalanches, but for their priors.

    These differ by 3.6 nats where both have most evidence; the way knows no correlation, another nat.
    """
    coulomb, pcm = base_of(RYGGFONN, "coulomb"), base_of(RYGGFONN, "pcm")
    drag = mechanisms()["turbulent_drag"]
    assert drag.added is not None
    shape = drag.added.shapes(coulomb.setting)[0]
    found = curve_near(coulomb, curve(coulomb, placed(drag, coulomb.setting, shape)), shape)
    ways = finer(coulomb, found, searched(coulomb, found))
    differ = ways[SPREAD].log_factor
    assert differ - found.log_bayes_factor > 20.0
    psi, scale = pcm.fit.found.psi, pcm.log_scale
    of_drag = log_prior(psi, 2, scale) - log_prior(psi[[0, 2]], 1, scale[:1])
    [size] = log_prior_density(np.exp(psi[1:2]), drag.added.scale, either_sign=False) + psi[1]
    [spread] = from_unbounded(SPREAD, psi[3:4])[1]
    more = pcm.fit.found.log_evidence - coulomb.fit.found.log_evidence
    assert abs(differ - (more + size + spread - of_drag)) < 2.0
    common = computed_again(coulomb, found)[0].log_bayes_factor
    assert abs(common - found.log_bayes_factor) < 0.5


@pytest.mark.slow
def test_who_has_it_is_found() -> None:
    """Nine of 22 avalanches have friction on a stretch: the share, the strength, and which."""
    own = np.where(np.arange(22) < 9, 5.0, 0.0)
    campaign = made_campaign("pcm", [0.30, 1.2e-3], [0.10, 0.25], own, seed=5)
    base = base_of(campaign, "pcm")
    found = stretch_curve(base)
    calibration = calibrate_surely(
        augmented_problem(base, [found], SOME), base.law, SamplerSettings(draws=1500, tune=700, seed=1)
    )
    assert calibration.gate.numerics
    posterior = calibration.tree["posterior"]
    share, strength = posterior["segment_friction_share"].values, posterior["segment_friction"].values
    assert abs(share.mean() - 9.0 / 22.0) < 2.0 * share.std()
    assert abs(strength.mean() - 5.0) < 2.5 * strength.std()
    multiples = multiples_of_events(calibration)
    assert multiples is not None
    assert (multiples[own > 0.0, 0] > 0.8).all() and (multiples[own == 0.0, 0] < 0.6).all()
    fronts = calibration.tree["event_posterior"]["front"].values
    readings = base.rows.readings
    inside = np.abs(np.median(fronts, axis=(0, 1)) - readings.values)[readings.observed]
    assert np.median(inside / readings.sd(np.arange(22), readings.values)[readings.observed]) < 1.5


def test_components_are_shares_of_avalanches() -> None:
    strength, parameter = np.array([2.0, 3.0]), np.array([0.25, 0.5])
    for way in BetweenEvents:
        own, log_shares = components(way, strength, parameter)
        assert own.shape == log_shares.shape
        assert_allclose(np.exp(log_shares).sum(axis=1), 1.0)
    own, log_shares = components(SOME, strength, parameter)
    assert_allclose(np.sum(own * np.exp(log_shares), axis=1), strength * parameter)
    own, log_shares = components(SPREAD, strength, parameter)
    mean = np.sum(np.log(own) * np.exp(log_shares), axis=1)
    assert_allclose(mean, np.log(strength))
    sd = np.sqrt(np.sum((np.log(own) - mean[:, None]) ** 2 * np.exp(log_shares), axis=1))
    assert_allclose(sd, parameter, rtol=0.02)


@pytest.mark.parametrize("way", [SPREAD, SOME])
def test_the_coordinate_without_bounds_has_the_prior(way: BetweenEvents) -> None:
    """Its density is that of PyMC's variable with the change of variable, and integrates to one."""
    import pymc as pm

    coordinate = np.linspace(-30.0, 30.0, 60001)
    values, log_density = from_unbounded(way, coordinate)
    assert np.trapezoid(np.exp(log_density), coordinate) == pytest.approx(1.0, abs=1e-3)
    with pm.Model():
        logp = pm.logp(variable(way, "x"), values[29000:31000:100]).eval()
    slope = np.gradient(values, coordinate)[29000:31000:100]
    assert_allclose(log_density[29000:31000:100], logp + np.log(slope), atol=1e-4)


def test_multiples_of_avalanches_to_come() -> None:
    rng = np.random.default_rng(0)
    assert (own_multiples(COMMON, np.zeros(3), (3, 4), rng) == 1.0).all()
    some = own_multiples(SOME, np.array([0.2, 0.7]), (2, 20000), rng)
    assert set(np.unique(some)) == {0.0, 1.0}
    assert_allclose(some.mean(axis=1), [0.2, 0.7], atol=0.015)
    spread = np.log(own_multiples(SPREAD, 0.5, (20000,), rng))
    assert abs(spread.mean()) < 0.015 and abs(spread.std() - 0.5) < 0.01


@pytest.mark.slow
def test_gains_do_not_hang_on_quadrature_points() -> None:
    """Friction on a stretch at Ryggfonn, around two populations: gains differed by 1.5 and 1.7 nats while a
    strength in common was by the same tables, between which it lay."""
    base = with_errors(base_of(RYGGFONN, "pcm"), "scaled")
    fit, gains = base.fit, list[dict[BetweenEvents, float]]()
    for wider in (0.0, 0.3):  # of both spreads' logarithms
        psi = fit.found.psi + wider * np.array([0.0, 0.0, 1.0, 1.0, 0.0])
        other = replace(base, fit=fit._replace(found=fit.found._replace(psi=psi)))
        found = stretch_curve(other, stretch=(980.75, 1820.75))
        in_common = computed_again(other, found)[0].log_factor_of(found.sign)
        gains.append(gains_of(finer(other, found, searched(other, found)), in_common))
    for way in (SPREAD, SOME):
        assert gains[0][way] == pytest.approx(gains[1][way], abs=0.4)


def looked(found: Curve, log_share: float, in_common: float, spread: float, some: float) -> Looked:
    """A shape with the log Bayes factors of both ways."""
    ways = {SPREAD: made_way(spread), SOME: made_way(some)}
    return Looked(found, log_share, in_common, ways)


def slower(found: Curve) -> Curve:
    """Another kind of shape of the same mechanism."""
    return replace(found, shape=replace(found.shape, constants=(("another", 1.0),)))


def test_shapes_are_mixed_by_what_they_have(few: tuple[Base, Curve]) -> None:
    """Of two kinds the less probable one with a strength in common may lead where avalanches differ."""
    found, other = few[1], slower(few[1])
    shapes = looked(found, np.log(0.8), 10.0, 9.0, 8.0), looked(other, np.log(0.2), 8.6, 14.0, 8.0)
    candidate = Candidate(found.mechanism, (found, other), np.log([0.8, 0.2]), looked=shapes)
    assert candidate.best is other and candidate.ways is shapes[1].ways
    gains = gains_over(shapes)
    assert gains[COMMON] == pytest.approx(0.0)
    assert gains[SPREAD] == pytest.approx(np.log(0.8 * np.exp(-1.0) + 0.2 * np.exp(5.4)))
    heights = np.log([0.8, 0.2]) + [over_ways(one.gains) for one in shapes]
    assert_allclose(candidate.shape_weights, np.exp(heights - np.logaddexp.reduce(heights)))
    assert [one for one, _ in candidate.best_of_each(all_but_place)] == [found, other]
    # Both that lead are looked at closer: with a strength in common, and where avalanches differ.
    assert candidate.to_look_closer == list(shapes)
    closer = {one: replace(one, error=0.1) for one in shapes}
    closer[shapes[0]] = replace(closer[shapes[0]], log_share=shapes[0].log_share + 0.5)
    again = candidate.looked_closer(closer)
    assert again.correction == pytest.approx(np.log(0.8 * np.exp(0.5) + 0.2))
    # By more points a kind may have more: its shapes have more of the weight then.
    heights = [heights[0] + 0.5, heights[1]]
    assert_allclose(again.shape_weights, np.exp(heights - np.logaddexp.reduce(heights)))
    assert again.error == 0.1 and again.to_look_closer == []


def test_a_way_that_could_not_be_computed_gains_nothing(few: tuple[Base, Curve]) -> None:
    found, other = few[1], slower(few[1])
    failed = Looked(found, np.log(0.997), 20.0, {})
    shapes = failed, looked(other, np.log(0.003), 14.0, 24.0, 14.0)
    gains = gains_over(shapes)
    assert gains[SPREAD] == pytest.approx(np.log(0.003) + 10.0)
    one = Candidate(found.mechanism, (found,), np.zeros(1), looked=(failed,))
    assert one.gains is None and one.between == {COMMON: 1.0, SPREAD: 0.0, SOME: 0.0}


class Copying(ThreadPoolExecutor):
    """Returns copies, as other processes do."""

    def map(self, compute: Any, *jobs: Any, **options: Any) -> Any:
        return [cloudpickle.loads(cloudpickle.dumps(one)) for one in super().map(compute, *jobs, **options)]


def test_shapes_from_other_processes_are_those_of_the_candidate(few: tuple[Base, Curve]) -> None:
    base, found = few
    candidate = Candidate(found.mechanism, (found,), np.zeros(1), correction=3.0)
    with Copying(1) as pool:
        [again] = with_ways(base, {found.mechanism.id: candidate}, pool).values()
    assert again.looked and again.error is not None and again.best is found
    assert 2.5 < again.correction < 3.5


def test_tables_reach_what_single_avalanches_have(few: tuple[Base, Curve]) -> None:
    """One of sixty may have what all have next to nothing of in common; close to nil they lie closer."""
    base, found = few
    mean, sd = found.moments
    strengths = from_nothing(found, base.fit.found).grid.points[:, 0]
    assert strengths[0] == 0.0 and strengths[1] < 0.2 * (mean + sd) and strengths[-1] > 60.0 * (mean + sd)
    far = strengths[1:] > 4.0 * (mean + sd)
    assert np.all(np.diff(strengths)[far] < 0.08 * strengths[1:][far])


def to_four_times(base: Base, found: Curve, way: BetweenEvents) -> Way:
    """By tables that reach four times what all may have in common."""
    mean, sd = found.moments
    near = found.nearest(mean).found
    located = from_nothing(found, near, 2.0 * (mean + sd))
    tables = build_tables(base, base.extended(found.direction), located, USUAL)
    return searched_evidence(BetweenTarget(base, found, tables, way), near)


def test_places_on_a_grid_whose_steps_grow(few: tuple[Base, Curve]) -> None:
    base, found = few
    located = from_nothing(found, base.fit.found)
    places = np.linspace(0.0, located.grid.size[0] - 1.0, 50)[:, None]
    assert_allclose(located.grid.places(located.grid.strengths(places)), places, atol=1e-9)
    assert_allclose(located.finer.grid.points[::2], located.grid.points, rtol=1e-12, atol=1e-12)


def test_tables_reach_farther_where_few_avalanches_have_it() -> None:
    """Three of 22 have ten times what all could have in common."""
    own = np.where(np.isin(np.arange(22), (9, 15, 21)), 9.6, 0.0)
    base = base_of(made_campaign("coulomb", [0.36], [0.2], own, seed=44), "coulomb")
    found = stretch_curve(base)
    assert 0.0 < found.moments[0] < 1.2
    ways = searched(base, found)
    assert ways[SOME].strength[0] == pytest.approx(9.6, rel=0.2)
    assert ways[SOME].log_factor > to_four_times(base, found, SOME).log_factor + 4.0


@pytest.mark.slow
def test_tables_reach_what_the_strongest_avalanche_has() -> None:
    """One of Ryggfonn has many times the median; tables that ended before took ten nats."""
    base, mechanism = base_of(RYGGFONN, "pcm", "scaled"), mechanisms()["viscous_drag"]
    shape = next(one for one in shapes_of(mechanism, base.setting) if one.begins_m is not None)
    found = curve_near(base, curve(base, placed(mechanism, base.setting, shape)), shape)
    near = found.nearest(found.moments[0]).found
    twice = from_nothing(found, near).finer
    closer = build_tables(base, base.extended(found.direction), twice, USUAL)
    looked = searched(base, found)
    way = finer(base, found, looked)[SPREAD]
    assert way.log_factor > 38.0 and way.log_factor > to_four_times(base, found, SPREAD).log_factor + 10.0
    assert looked[SPREAD].log_factor > 38.0
    half = between_evidence(BetweenTarget(base, found, closer, SPREAD), way.proposal)
    assert way.log_factor == pytest.approx(half.log_factor, abs=0.5)


def test_gains_share_the_prior() -> None:
    assert sum(PRIOR.values()) == 1.0
    assert over_ways(dict.fromkeys(BetweenEvents, 0.0)) == pytest.approx(0.0)
    gains = {COMMON: 0.0, SPREAD: 3.0, SOME: -2.0}
    own = np.log(0.5 + 0.25 * np.exp(3.0) + 0.25 * np.exp(-2.0))
    assert over_ways(gains) == pytest.approx(own)
    assert with_or_without(own, 5.0) == pytest.approx(
        np.log((1.0 - BESIDE) * np.exp(own) + BESIDE * np.exp(5.0))
    )


def test_only_physics_of_track_and_stretch_may_differ() -> None:
    differ = {name for name, one in mechanisms().items() if one.added is not None and may_differ(one)}
    assert {"segment_drag", "segment_friction", "obstacle", "turbulent_drag"} <= differ
    assert not differ & {"sensor_bias", "release_offset", "covariate_friction"}


def test_what_avalanches_to_come_have_is_drawn_for_each(few: tuple[Base, Curve]) -> None:
    added = added_strengths([few[1]], SOME)
    samples = {"segment_friction": np.full(500, 2.0), "segment_friction_share": np.full(500, 0.3)}
    rows = new_rows(added, samples, np.random.default_rng(1), 8)
    assert rows.shape == (500, 8, 1) and set(np.unique(rows)) == {0.0, 2.0}
    assert abs((rows > 0.0).mean() - 0.3) < 0.03


def test_avalanches_differ_in_none_of_two(few: tuple[Base, Curve]) -> None:
    base, found = few
    added = added_strengths([found, found], COMMON)
    samples = {"segment_friction": np.full(5, 2.0), "segment_friction_2": np.full(5, 1.0)}
    own, log_shares = components_of(added, samples)
    assert_allclose(own, np.tile([2.0, 1.0], (5, 1, 1)))
    assert_allclose(log_shares, np.zeros((5, 1)))
    with pytest.raises(ValueError, match="differ in none"):
        augmented_problem(base, [found, found], SOME)


class TwoModes:
    """A way whose density has two modes of as much each, the wider one lower; the integral is 1."""

    kind, end = SPREAD, 100.0
    tables = SimpleNamespace(budget=None)

    def __init__(self, moments: tuple[float, float]) -> None:
        nothing = SimpleNamespace(found=SimpleNamespace(log_evidence=0.0))
        self.curve = SimpleNamespace(moments=moments)
        self.base = SimpleNamespace(with_nothing=lambda budget, sampled: nothing)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        each = [norm.logpdf(x[:, 2], -3.0, 0.3), norm.logpdf(x[:, 2], 2.0, 0.6)]
        rest = norm.logpdf(x[:, 0]) + norm.logpdf(x[:, 1], 0.0, 0.2)
        return np.logaddexp(*each) - np.log(2.0) + rest

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, None, None]:
        return x[:, :1], np.exp(x[:, 1]), None, None

    def farthest(self, x: np.ndarray, shares: np.ndarray) -> float:
        return 1.0


@pytest.mark.parametrize("moments", [(1.0, 0.1), (0.0, 1.0)])
def test_a_second_mode_of_a_way_counts(moments: tuple[float, float]) -> None:
    """Drawn around the highest alone it was lost, -0.7 nats; and nil in the mean had no logarithm."""
    found = searched_evidence(cast(BetweenTarget, TwoModes(moments)), Evidence(0.0, np.zeros(1), np.eye(1)))
    assert found.log_factor == pytest.approx(0.0, abs=0.25)


def test_avalanches_that_know_their_own_are_not_missed_between_places() -> None:
    """To a tenth, where they differ by a factor of e: places a quarter of a spread apart were off by nats."""
    own, log_shares = components(SPREAD, np.ones(1), np.ones(1))
    at = np.linspace(-1.5, 1.5, 40)
    found = np.logaddexp.reduce(log_shares[0] + norm.logpdf(at[:, None], np.log(own[0]), 0.1), axis=1)
    assert found == pytest.approx(norm.logpdf(at, 0.0, np.hypot(1.0, 0.1)), abs=0.02)
