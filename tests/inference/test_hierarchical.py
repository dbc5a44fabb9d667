"""Hierarchical problems: order of events, threads, finer integration, and the PyMC model around them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pymc as pm
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import beta, halfnorm, lognorm

from skred.campaign import Campaign, Status, find_campaign, read_campaign
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.hierarchical.surface import Surfaces
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Mechanism

CAMPAIGN = read_campaign(find_campaign("ryggfonn"))
POPULATION = {
    "coulomb": {"dry_friction": [0.51, 0.54], "dry_friction_spread": [0.06, 0.12]},
    "pcm": {
        "dry_friction": [0.30, 0.33],
        "turbulent_drag": [0.0026, 0.0020],
        "dry_friction_spread": [0.2, 0.25],
        "turbulent_drag_spread": [0.5, 0.6],
        "dry_friction_turbulent_drag_correlation": [-0.3, 0.4],
    },
}
"""Two populations of each law, plausible on Ryggfonn."""


def pick(rows: Sequence[int], releases: Sequence[tuple[float, float | None]] | None = None) -> Campaign:
    """Some avalanches of Ryggfonn, with releases (place, standard deviation) in m."""
    releases = [(0.0, None)] * len(rows) if releases is None else releases
    return replace(
        CAMPAIGN,
        events=tuple(
            replace(CAMPAIGN.events[row], id=f"{k}", release_s_m=place, release_sd_m=sd)
            for k, (row, (place, sd)) in enumerate(zip(rows, releases, strict=True))
        ),
        values=CAMPAIGN.values[rows],
        status=CAMPAIGN.status[rows],
        stated_sd=CAMPAIGN.stated_sd[rows],
    )


def densities(problem: HierarchicalProblem, law_id: str) -> np.ndarray:
    """(2, n_events)."""
    return problem.log_likelihood(load_law(law_id), POPULATION[law_id])


@pytest.fixture(scope="module")
def ryggfonn() -> HierarchicalProblem:
    return hierarchical_problem(CAMPAIGN)


MIXED = [(0.0, None) if k % 3 else (20.0 + 5.0 * k, 4.0 + k) for k in range(40)]
"""Releases of 40 avalanches, every third uncertain: three groups at a time, of two kinds."""


def test_events_keep_their_order_whether_their_releases_are_known_or_not() -> None:
    """Against the same events alone; each event has its own release, so none is like another."""
    rows = [k % 22 for k in range(40)]
    mixed = densities(hierarchical_problem(pick(rows, MIXED)), "coulomb")
    assert mixed.shape == (2, 40)
    alone = np.empty((2, 40))
    for k in range(40):
        problem = hierarchical_problem(pick([rows[k]], [MIXED[k]]))
        alone[:, k] = densities(problem, "coulomb")[:, 0]
    assert_allclose(mixed, alone, atol=0.06)
    spread = np.abs(mixed[0][:, None] - mixed[0])[~np.eye(40, dtype=bool)]
    assert np.median(spread) > 0.5  # an event in another's place would show


def test_an_uncertain_release_of_no_width_is_a_known_one() -> None:
    rows = [0, 2, 14]
    known = densities(hierarchical_problem(pick(rows, [(30.0, None)] * 3)), "coulomb")
    nearly = densities(hierarchical_problem(pick(rows, [(30.0, 0.01)] * 3)), "coulomb")
    zero = densities(hierarchical_problem(pick(rows, [(30.0, 0.0)] * 3)), "coulomb")
    assert_allclose(nearly, known, atol=0.03)
    assert_array_equal(zero, known)


def same(one: Surfaces, other: Surfaces) -> bool:
    fields = ("first", "log_weights", "mean", "covariance")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in fields)


def test_two_calls_are_identical() -> None:
    """Whatever thread is done first: 40 events of two kinds are four parts."""
    campaign = pick([k % 22 for k in range(40)], MIXED)
    mechanisms = load_law("coulomb").mechanisms
    surfaces = [hierarchical_problem(campaign).surfaces(mechanisms) for _ in range(3)]
    assert same(surfaces[0], surfaces[1]) and same(surfaces[0], surfaces[2])
    assert surfaces[0].n_runs == surfaces[1].n_runs > 0


def test_surfaces_are_made_once_for_each_law(ryggfonn: HierarchicalProblem) -> None:
    coulomb, pcm, voellmy = (load_law(name).mechanisms for name in ("coulomb", "pcm", "voellmy"))
    assert ryggfonn.surfaces(coulomb) is ryggfonn.surfaces(coulomb)
    assert not same(ryggfonn.surfaces(pcm), ryggfonn.surfaces(voellmy))  # with curvature, and without


@pytest.mark.parametrize("law_id", ["coulomb", "pcm"])
def test_finer_integration_finds_little(ryggfonn: HierarchicalProblem, law_id: str) -> None:
    errors = ryggfonn.integration_errors(load_law(law_id), POPULATION[law_id])
    assert errors.shape == (2, 22)
    assert 0.0 < np.abs(errors).max() < 0.03


def test_finer_integration_of_some_events_of_many() -> None:
    """At most 24, and of each the error is its own: against the densities of finer surfaces of all."""
    problem = hierarchical_problem(pick([k % 22 for k in range(40)], MIXED))
    errors = problem.integration_errors(load_law("coulomb"), POPULATION["coulomb"], seed=2)
    assert errors.shape == (2, 24) and np.abs(errors).max() < 0.1


class OneMoved(HierarchicalProblem):
    """With one event's patches moved by a tenth."""

    def surfaces(self, mechanisms: Sequence[Mechanism]) -> Surfaces:
        surfaces = super().surfaces(mechanisms)
        mean = surfaces.mean.copy()
        mean[surfaces.first[4] : surfaces.first[5], 0] += 0.1
        return replace(surfaces, mean=mean)


def test_wrong_surfaces_are_found_out(ryggfonn: HierarchicalProblem) -> None:
    """By the same comparison."""
    moved = OneMoved(ryggfonn.campaign, ryggfonn.terrain, ryggfonn.error_model)
    errors = np.abs(moved.integration_errors(load_law("pcm"), POPULATION["pcm"]))
    assert errors[:, 4].max() > 0.1 > np.delete(errors, 4, axis=1).max()


def test_density_of_an_event_does_not_depend_on_the_others(ryggfonn: HierarchicalProblem) -> None:
    """Only where surfaces are resolved does, and that by little."""
    whole = densities(ryggfonn, "pcm")
    for rows in ([0, 3, 9, 11], [13, 17, 18]):
        part = densities(hierarchical_problem(pick(rows)), "pcm")
        assert_allclose(part, whole[:, rows], atol=0.1)


def test_an_event_without_any_reading_says_nothing() -> None:
    """Its density is 1 for any population, and the others' are what they are without it: it is left out."""
    campaign = pick([0, 2, 14])
    status, values = np.array(campaign.status), np.array(campaign.values)
    status[1], values[1] = Status.MISSING, np.nan
    silent = replace(campaign, status=status, values=values, stated_sd=np.full(values.shape, np.nan))
    with_silent = densities(replace(hierarchical_problem(campaign), campaign=silent), "coulomb")
    assert_allclose(with_silent[:, 1], 0.0, atol=0.02)
    left_out = hierarchical_problem(silent)
    assert left_out.campaign.event_ids == (campaign.event_ids[0], campaign.event_ids[2])
    assert_allclose(densities(left_out, "coulomb"), with_silent[:, [0, 2]], atol=0.02)


def test_no_reading_at_all_is_refused() -> None:
    campaign = pick([0, 1])
    nothing = replace(
        campaign,
        status=np.full(campaign.status.shape, Status.MISSING),
        values=np.full(campaign.values.shape, np.nan),
    )
    with pytest.raises(ValueError, match="no reading is observed"):
        hierarchical_problem(nothing)


# The PyMC model


@pytest.fixture(scope="module")
def pcm_model(ryggfonn: HierarchicalProblem) -> pm.Model:
    return load_law("pcm").build(ryggfonn)


def test_parameters_are_the_models_variables(ryggfonn: HierarchicalProblem, pcm_model: pm.Model) -> None:
    names = [parameter.name for parameter in ryggfonn.parameters(load_law("pcm"))]
    assert [variable.name for variable in pcm_model.free_RVs] == names == list(POPULATION["pcm"])
    assert [variable.name for variable in pcm_model.observed_RVs] == ["recordings"]
    assert pcm_model.named_vars_to_dims["recordings"] == ("event",)


def transformed(sample: dict[str, float]) -> dict[str, np.ndarray]:
    """A point of the model, on the scales that it samples."""
    point = {}
    for name, value in sample.items():
        if name.endswith("correlation"):
            point[f"{name}_interval__"] = np.asarray(np.log((1 + value) / (1 - value)))
        else:
            point[f"{name}_log__"] = np.asarray(np.log(value))
    return point


def of_events(model: pm.Model) -> Callable[..., list[np.ndarray]]:
    """Log density of each event at a point."""
    return model.compile_logp(vars=model["recordings"], sum=False, mode="FAST_COMPILE")


@pytest.mark.parametrize("draw", [0, 1])
def test_log_density_of_the_model(ryggfonn: HierarchicalProblem, pcm_model: pm.Model, draw: int) -> None:
    """Prior and likelihood by hand: numpy's sum over the nodes of the surfaces."""
    sample = {name: values[draw] for name, values in POPULATION["pcm"].items()}
    mu, drag, mu_spread, drag_spread, r = sample.values()
    prior = halfnorm.logpdf(mu, scale=0.5) + halfnorm.logpdf(drag, scale=0.01)
    prior += lognorm.logpdf([mu_spread, drag_spread], 0.6, scale=0.13).sum()
    prior += beta.logpdf((1 + r) / 2, 2, 2) - np.log(2)
    found = pcm_model.compile_logp(jacobian=False, mode="FAST_COMPILE")(transformed(sample))
    terms = pcm_model.compile_logp(vars=pcm_model["recordings"], sum=False, mode="FAST_COMPILE")(
        transformed(sample)
    )[0]
    first, points, log_weights, _ = ryggfonn.surfaces(load_law("pcm").mechanisms).nodes
    covariance = np.array([[mu_spread**2, r * mu_spread * drag_spread], [0.0, drag_spread**2]])
    covariance[1, 0] = covariance[0, 1]
    deviation = points.T - np.log([mu, drag])
    square = np.sum(deviation @ np.linalg.inv(covariance) * deviation, axis=1)
    weighted = log_weights - 0.5 * square - 0.5 * np.log(np.linalg.det(2 * np.pi * covariance))
    expected = np.logaddexp.reduceat(weighted, first[:-1])
    assert_allclose(terms, expected, rtol=1e-5)
    assert_allclose(densities(ryggfonn, "pcm")[draw], expected, rtol=1e-5)
    assert_allclose(found, prior + expected.sum(), rtol=1e-5)


def test_gradient_of_the_model(pcm_model: pm.Model) -> None:
    """Against differences of its own density."""
    sample = {name: values[0] for name, values in POPULATION["pcm"].items()}
    point = transformed(sample)
    gradient = pcm_model.compile_dlogp(mode="FAST_COMPILE")(point)
    density = pcm_model.compile_logp(mode="FAST_COMPILE")
    for k, name in enumerate(point):
        ends = [float(density({**point, name: point[name] + step})) for step in (-2e-4, 2e-4)]
        assert_allclose(gradient[k], (ends[1] - ends[0]) / 4e-4, rtol=1e-4, atol=1e-3)


def test_one_model_serves_other_surfaces(pcm_model: pm.Model) -> None:
    """They are data: set anew, the density is that of the other campaign."""
    other = hierarchical_problem(CAMPAIGN, error_model="student")
    mechanisms = load_law("pcm").mechanisms
    sample = {name: values[0] for name, values in POPULATION["pcm"].items()}
    logp = of_events(pcm_model)
    before = logp(transformed(sample))[0]
    nodes = {
        f"surface_{name}": pcm_model[f"surface_{name}"].get_value()
        for name in ("first", "points", "log_weights", "log_widths")
    }
    try:
        values = other.surfaces(mechanisms).nodes._asdict()
        pm.set_data({f"surface_{name}": value for name, value in values.items()}, model=pcm_model)
        after = logp(transformed(sample))[0]
    finally:
        pm.set_data(nodes, model=pcm_model)
    assert_allclose(after, densities(other, "pcm")[0], rtol=1e-9)
    assert np.abs(after - before).max() > 0.1


def test_means_may_differ_between_events(ryggfonn: HierarchicalProblem) -> None:
    """The Op takes one mean an event, as covariates will need."""
    nodes = ryggfonn.surfaces(load_law("coulomb").mechanisms).nodes
    means, factor = np.linspace(-0.8, -0.5, 22)[:, None], np.array([[0.1]])
    together = integrated_log_density(means, factor, *nodes)
    each = [integrated_log_density(np.tile(mean, (22, 1)), factor, *nodes)[k] for k, mean in enumerate(means)]
    assert_allclose(together, each, rtol=1e-12)
